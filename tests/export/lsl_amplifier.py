"""An EMG amplifier on Lab Streaming Layer: run by test_lsl_inlet.py. It publishes a stream, and a common signal in its third channel.

The value of each sample follows from its number alone, so that a reader can tell whether one is missing. The third channel is the time on the
clock of this computer at which the sample is due: wherever a sample lands, that says when it was taken."""

import argparse
import time

import pylsl
from lsl_amplifier_values import sample


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--name", default="Amplifier 7")
    parser.add_argument("--source", default="amplifier-7")
    parser.add_argument("--rate", type=float, default=2000)
    parser.add_argument("--nominal", type=float, default=2000)
    parser.add_argument("--parcel", type=int, default=1, help="samples that are sent at once, all but the last with no stamp")
    parser.add_argument("--format", default="double64")
    parser.add_argument("--unit", default="microvolts")
    parser.add_argument("--channels", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--silent", type=float, nargs=2, help="from when to when nothing is sent, s")
    parser.add_argument("--frozen", type=float, nargs=2, help="from when to when the EMG keeps its last value, s")
    parser.add_argument("--ahead", type=float, default=0, help="how far the stream's stamps are ahead of the clock, s")
    parser.add_argument("--jump", type=float, nargs=3, default=[0, 0, 0], help="from when to when the stamps are ahead, and by how much, s")
    given = parser.parse_args()
    info = pylsl.StreamInfo(given.name, "EMG", given.channels, given.nominal, given.format, given.source)
    channels = info.desc().append_child("channels")
    for label, unit in [("FCR", given.unit), ("ECR", given.unit), ("clock", "s"), *[("more", "V")] * 9][: given.channels]:
        channels.append_child("channel").append_child_value("label", label).append_child_value("unit", unit)
    outlet = pylsl.StreamOutlet(info)
    print("ready", flush=True)
    start = pylsl.local_clock()
    number = 0
    live = range(1)
    while (now := pylsl.local_clock() - start) < given.seconds:
        # Sample k is taken at k / rate, and a parcel is complete with its last one.
        due = (int(now * given.rate) + 1) // given.parcel * given.parcel
        while number < due:
            numbers = range(number, number + given.parcel)
            number += given.parcel
            times = [start + one / given.rate for one in numbers]
            if given.silent and given.silent[0] <= times[0] - start < given.silent[1]:
                continue
            if given.format == "string":
                outlet.push_sample(["0"] * given.channels)
                continue
            if not (given.frozen and given.frozen[0] <= times[0] - start < given.frozen[1]):
                live = numbers
            held = [one if live is numbers else live[-1] for one in numbers]
            values = [[*sample(own), at, *[0.0] * 9][: given.channels] for own, at in zip(held, times)]
            # Parcels are stamped when they are sent, as amplifiers do: late, never early.
            stamp = pylsl.local_clock() if given.parcel > 1 else times[-1]
            jump = given.jump[2] if given.jump[0] <= times[0] - start < given.jump[1] else 0
            outlet.push_chunk(values, stamp + given.ahead + jump)
        time.sleep(0.002)


main()
