"""Another device that saw a session, with a rate and a clock of its own."""

import shutil

import numpy
import pyxdf
from conftest import done

# The other device: its rate by its own clock, and how far that is ahead and fast.
RATE_HZ = 2000
AHEAD_S = 17.3
FAST = 80e-6


def on_clock(session_s):
    return AHEAD_S + session_s * (1 + FAST)


class Device:
    """What the other device saw of a session: a pulse at each ramp, the torque, EMG."""

    def __init__(self, session, folder):
        done("export", session, "--xdf", folder / "session.xdf")
        streams, _ = pyxdf.load_xdf(folder / "session.xdf", dejitter_timestamps=False)
        streams = {stream["info"]["name"][0]: stream for stream in streams}
        signals, markers = streams["ramphold signals"], streams["ramphold markers"]
        begin = signals["time_stamps"][0]
        self.onsets = {
            int(text.split()[1]): on_clock(time - begin)
            for (text,), time in zip(markers["time_series"], markers["time_stamps"])
            if text.startswith("onset ")
        }
        times = on_clock(signals["time_stamps"] - begin)
        device = numpy.arange(int(RATE_HZ * (times[-1] + 1))) / RATE_HZ
        torque = numpy.interp(device, times, signals["time_series"][:, 1])
        place = numpy.searchsorted(times, device).clip(1, len(times) - 1)
        torque[(times[place] - times[place - 1] > 0.01) | (device < times[0]) | (device > times[-1])] = 0
        noise = numpy.random.default_rng(1).normal(size=(2, len(device)))
        pulse = numpy.full(len(device), 0.1)
        for onset in self.onsets.values():
            pulse[(device >= onset) & (device < onset + 0.005)] = 4.9
        samples = numpy.stack([0.2 * noise[0], pulse, 3.2 * torque + 0.01 * noise[1]])
        # A frame has up to 20 samples.
        self.samples = samples[:, : len(device) // 20 * 20].astype(numpy.float32)


def with_attached_emg(session, folder):
    """A copy of a session with the EMG of another device, whose value at maximal effort is 2.5, as the attachment `lab`."""
    emg, trigger, _ = Device(session, folder).samples.astype(float)
    times = numpy.arange(len(emg)) / RATE_HZ
    rows = numpy.column_stack([times, emg, trigger])
    numpy.savetxt(folder / "emg.csv", rows, delimiter=",", header="t,EMG 1,TRIG", comments="", fmt="%.9g")
    copy = shutil.copytree(session, folder / "s", symlinks=True)
    more = ["--trigger", "TRIG", "--name", "lab", "--emg-fcr", "EMG 1", "--fcr-at-mvc", 2.5]
    done("attach", copy, folder / "emg.csv", "--time", "t", *more)
    return copy
