"""Reads the two streams of a running session until they end, and writes them to the file that is named: run by test_lsl.py."""

import json
import sys
import time

import pylsl
from pylsl.util import LostError


def main(target):
    inlets = {}
    for name in ["ramphold signals", "ramphold markers"]:
        (info, *_) = pylsl.resolve_byprop("name", name, minimum=1, timeout=60)
        inlets[name] = pylsl.StreamInlet(info, recover=False)
        inlets[name].open_stream(timeout=10)
    info = inlets["ramphold signals"].info()
    channel = info.desc().child("channels").child("channel")
    labels = []
    while channel.name() == "channel":
        labels.append(channel.child_value("label"))
        channel = channel.next_sibling("channel")
    print("connected", flush=True)
    read = {name: ([], []) for name in inlets}
    quiet_since = time.monotonic()
    ended = set()
    while len(ended) < 2 and time.monotonic() - quiet_since < 20:
        for name, inlet in inlets.items():
            try:
                samples, times = inlet.pull_chunk(timeout=0.02, max_samples=4096)
            except LostError:
                ended.add(name)
                continue
            if times:
                quiet_since = time.monotonic()
            read[name][0].extend(samples)
            read[name][1].extend(times)
    kept = {name: {"samples": samples, "times": times} for name, (samples, times) in read.items()}
    with open(target, "w") as file:
        json.dump({"labels": labels, "rate": info.nominal_srate(), "streams": kept, "ended": sorted(ended)}, file)


main(sys.argv[1])
