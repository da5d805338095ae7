"""The rig's and the sensors' mechanisms of the catalogue, and the unsteady hand."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import cont2discrete, lfilter

from .plant import FINE_HZ, Force
from .scenario import SIZES


def lever_inertia(s, size, rng):
    return _wrong_lever(s, size, "lever_inertia", "inertia_kg_m2")


def lever_stiffness(s, size, rng):
    return _wrong_lever(s, size, "lever_stiffness", "stiffness_nm_per_rad")


def lever_damping(s, size, rng):
    return _wrong_lever(s, size, "lever_damping", "damping_nm_s_per_rad")


def _wrong_lever(s, size, mechanism, constant):
    """The lever is another one than session.json says; the value is the true constant."""
    s.lever[constant] *= SIZES[mechanism]["factor"] ** size
    return {constant: s.lever[constant]}, [], f"{SIZES[mechanism]['factor'] ** size:.3g} times what session.json says"


def servo_following(s, size, rng):
    s.servo.bandwidth_hz = SIZES["servo_following"]["bandwidth_hz"] / size
    s.servo.stiffness_nm_per_rad = np.inf
    s.record_command = True
    return {"bandwidth_hz": s.servo.delay_matched_natural_hz()}, ["bandwidth_hz"], \
        "poles a factor 10 apart; the value is the natural frequency of a critically damped servo of the same delay; " \
        "no droop under load"


def channel_skew(s, size, rng):
    delay = size * SIZES["channel_skew"]["delay_s"] * rng.choice([-1, 1])
    s.torque_chain.append(lambda t, torque, *_: CubicSpline(t, torque, axis=1)(np.clip(t - delay, t[0], t[-1])))
    return {"delay_s": float(delay)}, [], "positive: torque late"


def torque_lag(s, size, rng):
    cutoff = SIZES["torque_lag"]["cutoff_hz"] / size
    poles = 2 * np.pi * cutoff * np.array([1.1, 11.0])
    num, den, _ = cont2discrete((np.prod(poles), np.poly(-poles)), 1 / FINE_HZ, method="foh")

    def lag(t, torque, *_):
        return torque[:, :1] + lfilter(num.ravel(), den, torque - torque[:, :1], axis=1)

    s.torque_chain.append(lag)
    return {"cutoff_hz": cutoff}, ["cutoff_hz"], "poles a factor 10 apart; the value is the single pole of the same delay"


def torque_gain(s, size, rng):
    """The person follows the display, so the true torque is the target over the gain."""
    g = SIZES["torque_gain"]["factor"] ** size
    t = s.trials
    for name, law in (("k_srs", lambda x: s.person.k_srs(x)), ("k_dec", lambda x: s.person.k_dec(t.velocity_rad_s, x)),
                      ("x_e", lambda x: s.person.x_e(t.velocity_rad_s, x))):
        setattr(t, name, getattr(t, name) * law(t.torque_nm / g) / law(t.torque_nm))

    def amplify(time, torque, scenario, motion):
        """The hold is already what the display shows; only what the ramp adds is not."""
        out = torque.copy()
        out[:, -motion.torque_l.shape[1]:] += (g - 1) * motion.torque_l
        return out

    s.torque_chain.append(amplify)
    return {"factor": g}, [], "recorded over true"


def angle_gain(s, size, rng):
    """The encoder is also the servo's, so the record follows the command and the true movement is the smaller."""
    g = SIZES["angle_gain"]["factor"] ** size
    t = s.trials
    t.x_e = t.x_e * s.person.x_e(t.velocity_rad_s / g, t.torque_nm) / s.person.x_e(t.velocity_rad_s, t.torque_nm)
    s.ramp.velocity_rad_s = s.ramp.velocity_rad_s / g
    s.ramp.amplitude_rad = s.ramp.amplitude_rad / g
    s.angle_factor = g
    return {"factor": g}, [], "recorded over true"


def torque_saturation(s, size, rng):
    """Clips a part of the largest change that the window would have shown, with a knee of a few per cent."""
    part = 1 - size * (1 - SIZES["torque_saturation"]["part_of_peak"])
    sharpness = 60
    truth = {"level_nm": None}

    def clip(t, torque, *_):
        window = (t >= 0) & (t <= 0.04)
        level = part * np.max(torque[:, window])
        truth["level_nm"] = float(level)
        return torque / (1 + np.abs(torque / level) ** sharpness) ** (1 / sharpness)

    s.torque_chain.append(clip)
    return truth, [], "absolute torque; an algebraic knee"


def mains_hum(s, size, rng):
    d = SIZES["mains_hum"]
    a, hz = size * d["amplitude_nm"], float(rng.choice([50.0, 60.0]))
    phase = rng.uniform(0, 2 * np.pi, (len(s.trials), 1))
    a_trial = a * (1 + 0.05 * np.clip(rng.standard_normal(phase.shape), -2, 2))
    grid = hz * (1 + rng.uniform(-0.0005, 0.0005))

    def hum(t, torque, *_):
        w = 2 * np.pi * grid * t + phase
        return torque + a_trial * (np.sin(w) + 0.12 * np.sin(3 * w + 1.0))

    s.torque_chain.append(hum)
    return {"amplitude_nm": a, "frequency_hz": hz}, [], "with an eighth of third harmonic, another phase in each trial"


def torque_drift(s, size, rng):
    d = SIZES["torque_drift"]
    slope = size * d["slope_nm_per_s"] * rng.choice([-1, 1])
    start = d["start_s"] + rng.uniform(-0.004, 0.004)
    rise, over = 0.012, 0.12
    each = slope * (1 + 0.1 * np.clip(rng.standard_normal(len(s.trials)), -2, 2))

    def drift(t, *_):
        u = np.clip(t - (start - rise / 2), 0, rise)
        eased = 0.5 * (u - rise / np.pi * np.sin(np.pi * u / rise)) + np.clip(t - start - rise / 2, 0, over)
        return each * eased, None

    s.forces.append(Force(drift))
    return {"slope_nm_per_s": float(slope), "start_s": float(start)}, ["start_s"], \
        "in the muscle; the slope sets in as a half cosine of 12 ms about the start, 10 % spread between trials"


RIG = [lever_inertia, lever_stiffness, lever_damping, servo_following]
SENSOR = [channel_skew, torque_lag, torque_gain, angle_gain, torque_saturation, mains_hum]
HAND = [torque_drift]
