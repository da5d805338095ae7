"""A stream of EMG beside a session for a long time: `python lsl_soak.py SECONDS`. See scripts/lsl-soak.

The amplifier of the tests sends 2000 samples a second, each with the time at which it is due. A virtual session takes them in, in real time;
a shorter one without a stream shows how late the loop is by itself."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy
import pyxdf
from conftest import ROOT, program
from test_lsl import LIBRARY, LOOPBACK
from test_lsl_inlet import EMG, attachment, offsets_ms

TRIAL_S = 3.4  # rest, approach, gate, ramp, hold and return of one trial
ALONE = 0.1  # how long the session without a stream is, as a part of the other
LARGEST_OFFSET_MS = 1.0


def run(folder, name, seconds, streams, environment):
    """Runs a session of as many trials as fill the time."""
    protocol = json.loads((ROOT / "protocols/quick.json").read_text())
    protocol.update(velocities_rad_s=[1.3], torques_nm=[0.9], repetitions=max(2, round(seconds / TRIAL_S)))
    protocol["before"].update(mvc=None)
    (folder / "protocol.json").write_text(json.dumps(protocol))
    (folder / "rig.json").write_text(json.dumps({"kind": "virtual", "streams": streams}))
    session = folder / name
    arguments = [program(), "run", folder / "protocol.json", "--rig", folder / "rig.json", "--seed", 3, "--out", session, "--real-time"]
    library = ["--lsl-library", LIBRARY] if streams else []
    done = subprocess.run([*map(str, arguments), *library], env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"the session did not end well:\n{done.stderr}")
    return session


def lateness_us(session):
    """How late the loop was at each stamp of the journal, us."""
    entries = (json.loads(line[26:]) for line in (session / "journal.log").read_text().splitlines())
    stamps = (entry["stamp"].get("late_ns") for entry in entries if entry["record"] == "clock")
    return numpy.array([1e-3 * late_ns for late_ns in stamps if late_ns is not None])


def main(seconds):
    with tempfile.TemporaryDirectory(prefix="lsl-soak-") as place:
        folder = Path(place)
        (folder / "lsl.cfg").write_text(LOOPBACK)
        environment = dict(os.environ, LSLAPICFG=str(folder / "lsl.cfg"))
        alone = lateness_us(run(folder, "alone", ALONE * seconds, [], environment))
        command = [sys.executable, Path(__file__).with_name("lsl_amplifier.py"), "--seconds", 2 * seconds + 60]
        amplifier = subprocess.Popen(list(map(str, command)), env=environment, stdout=subprocess.PIPE, text=True)
        try:
            amplifier.stdout.readline()
            session = run(folder, "streamed", seconds, [EMG], environment)
        finally:
            amplifier.kill()
        (stream,), _ = pyxdf.load_xdf(session / "streams/Amplifier-7.run-1.xdf", dejitter_timestamps=False)
        clock = stream["time_series"][:, 2]
        numbers = numpy.rint((clock - clock[0]) * 2000).astype(int)
        lost = int(numbers[-1] + 1 - len(numpy.unique(numbers)))
        off, streamed = numpy.abs(offsets_ms(session)), lateness_us(session)
        result = {
            "seconds": round(float(clock[-1] - clock[0])), "samples": len(clock), "lost": lost, "twice": len(clock) - len(numpy.unique(numbers)),
            "trials": len(attachment(session)["trials"]), "offset_ms_mean": round(float(off.mean()), 4), "offset_ms_longest": round(float(off.max()), 4),
        }
        for name, late in (("alone", alone), ("streamed", streamed)):
            for percent in (50, 99):
                result[f"lateness_us_p{percent}_{name}"] = round(float(numpy.percentile(late, percent)), 1)
        print(json.dumps(result, indent=1))
        if lost or result["twice"] or off.max() > LARGEST_OFFSET_MS:
            sys.exit("samples were lost or taken twice, or lie more than a millisecond off")


if __name__ == "__main__":
    main(float(sys.argv[1]))
