"""The voluntary torque is not steady at the onset."""

import numpy as np

from ..plant import Force
from ..scenario import SIZES
from .law import law


@law("torque_drift", "line", "T_j += slope (t - start) from the start on, eased in over 12 ms", "assumed")
def line(s, size, rng):
    slope, start, each = _drawn(s, SIZES["torque_drift"], size, rng)
    rise, over = 0.012, 0.12

    def drift(t, *_):
        u = np.clip(t - (start - rise / 2), 0, rise)
        eased = 0.5 * (u - rise / np.pi * np.sin(np.pi * u / rise)) + np.clip(t - start - rise / 2, 0, over)
        return each * eased, None

    s.forces.append(Force(drift))
    return {"slope_nm_per_s": float(slope), "start_s": float(start)}, ["start_s"], \
        "in the muscle; the slope sets in as a half cosine of 12 ms about the start, 10 % spread between trials"


@law("torque_drift", "exponential", "T_j += slope tau (1 - exp(-(t - start) / tau)) from the start on", "assumed: the subject lets go")
def exponential(s, size, rng):
    d = SIZES["torque_drift@exponential"]
    slope, start, each = _drawn(s, d, size, rng)
    tau = d["time_constant_s"]
    s.forces.append(Force(lambda t, *_: (each * tau * -np.expm1(-max(t - start, 0.0) / tau), None)))
    return {"slope_nm_per_s": float(slope), "start_s": float(start)}, ["slope_nm_per_s", "start_s"], "the value is the slope at the start"


@law("torque_drift", "swing", "T_j += slope / (2 pi f) sin(2 pi f (t - start)) from the start on", "assumed: a slow sway of the arm, f = 4 Hz")
def swing(s, size, rng):
    d = SIZES["torque_drift@swing"]
    slope, start, each = _drawn(s, d, size, rng)
    w = 2 * np.pi * d["frequency_hz"]
    s.forces.append(Force(lambda t, *_: (each / w * np.sin(w * max(t - start, 0.0)), None)))
    return {"slope_nm_per_s": float(slope), "start_s": float(start)}, ["slope_nm_per_s", "start_s"], "the value is the slope at the start"


def _drawn(s, d, size, rng):
    slope = size * d["slope_nm_per_s"] * rng.choice([-1, 1])
    start = d["start_s"] + rng.uniform(-0.004, 0.004)
    return slope, start, slope * (1 + 0.1 * np.clip(rng.standard_normal(len(s.trials)), -2, 2))
