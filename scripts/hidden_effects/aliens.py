"""Causes that are in no catalogue. Each says what it is in the truth; the right verdict is `unexplained`."""

import numpy as np
from scipy.interpolate import CubicSpline

from .plant import Force
from .scenario import SIZES


def loose_mass(s, size, rng):
    """A part of the handle swings on a spring of its own."""
    d = SIZES["alien:loose_mass"]
    inertia, hz, ratio = size * d["inertia_kg_m2"], rng.uniform(*d["resonance_hz"]), 0.06
    w = 2 * np.pi * hz

    def law(t, theta, speed, z, past):
        torque = inertia * (w**2 * (theta - z[0]) + 2 * ratio * w * (speed - z[1]))
        return torque, np.stack([z[1], torque / inertia])

    s.forces.append(Force(law, states=2, on="lever"))
    return {"inertia_kg_m2": inertia, "resonance_hz": hz}, [], "on the lever, in parallel with the hand"


def gauge_hysteresis(s, size, rng):
    """The gauge loses part of the torque until a play of its own is used up, then gives it back (Bouc-Wen)."""
    d = SIZES["alien:gauge_hysteresis"]
    part, width = size * d["part"], d["width_nm"]

    def play(t, torque, *_):
        state, out = torque[:, 0].copy(), np.empty_like(torque)
        for i in range(torque.shape[1]):  # the play operator: the state follows within +-width
            state = np.clip(state, torque[:, i] - width, torque[:, i] + width)
            out[:, i] = torque[:, i] + part * (state - torque[:, i])
        return out

    s.torque_chain.append(play)
    return {"part": part, "width_nm": width}, [], "play operator in parallel with the gauge"


def speed_dependent_gain(s, size, rng):
    """The gauge reads more while the motor runs (a slip-ring)."""
    c = size * SIZES["alien:speed_dependent_gain"]["per_rad_s"]

    def chain(t, torque, scenario, motion):
        speed = np.zeros_like(torque)
        speed[:, -motion.speed_m.shape[1]:] = motion.speed_m
        rest = torque[:, :1]
        return rest + (torque - rest) * (1 + c * np.abs(speed) ** 1.5)

    s.torque_chain.append(chain)
    return {"per_rad_s": c}, [], "gain 1 + c |speed|^1.5"


def torque_burst(s, size, rng):
    """Interference: a burst in the torque at a fixed time in the window."""
    d = SIZES["alien:torque_burst"]
    a, at, width = size * d["amplitude_nm"], rng.uniform(*d["time_s"]), d["width_s"]
    s.torque_chain.append(lambda t, torque, *_: torque + a * np.exp(-0.5 * ((t - at) / width) ** 2))
    return {"amplitude_nm": a, "time_s": at}, [], "the same in every trial"


def oscillating_stiffness(s, size, rng):
    d = SIZES["alien:oscillating_stiffness"]
    part, hz, phase = size * d["part"], rng.uniform(*d["frequency_hz"]), rng.uniform(0, 2 * np.pi)
    s.forces.append(Force(lambda t, theta, speed, z, past: (
        part * s.trials.k_srs * theta * np.sin(2 * np.pi * hz * t + phase), None)))
    return {"part": part, "frequency_hz": hz}, [], "the joint's stiffness swings in time"


def yield_catch(s, size, rng):
    """Stretched past the limit the muscle catches again: the torque jumps up, then fades."""
    d = SIZES["alien:yield_catch"]
    a, at, width = size * d["step_nm"], d["part_of_limit"], 0.0012

    def law(t, theta, speed, z, past):
        gate = 0.5 * (1 + np.tanh((theta - at * s.trials.x_e) / width))
        return a * z[0], np.stack([(gate - z[0]) / 0.0015 - z[1] / 0.0015, (gate - z[1]) / 0.007])

    s.forces.append(Force(law, states=2))
    return {"step_nm": a}, [], "a pulse of torque that begins near the elastic limit"


def emg_crosstalk(s, size, rng):
    """The stretch burst of the EMG leaks into the torque channel."""
    d = SIZES["alien:emg_crosstalk"]
    a, start, width = size * d["amplitude_nm"], rng.uniform(*d["start_s"]), d["width_s"]
    each = a * s.trials.emg_fcr_mvc / np.mean(s.trials.emg_fcr_mvc)

    def leak(t, torque, *_):
        u = np.clip((t - start) / width, 0, 1)
        return torque + each[:, None] * np.sin(np.pi * u) ** 2 * np.where(u < 1, np.sin(2 * np.pi * u * 1.5), 0)

    s.torque_chain.append(leak)
    return {"amplitude_nm": a, "start_s": start}, [], "biphasic, scaled by the trial's FCR activity"


def jittered_clock(s, size, rng):
    """The torque's converter runs on an unsteady clock: times wander within every trial."""
    d = SIZES["alien:jittered_clock"]
    jitter, corner = size * d["jitter_s"], d["corner_s"]

    def resample(t, torque, *_):
        knots = np.arange(t[0], t[-1] + corner, corner)
        wander = CubicSpline(knots, jitter * rng.standard_normal((len(torque), len(knots))), axis=1)(t)
        return np.stack([np.interp(t + w, t, row) for w, row in zip(wander, torque)])

    s.torque_chain.append(resample)
    return {"jitter_s": jitter}, [], "another jitter in every trial"


def frozen_torque(s, size, rng):
    """The torque channel repeats its last value for some milliseconds, at another time in every trial."""
    d = SIZES["alien:frozen_torque"]
    duration = size * d["duration_s"]
    at = rng.uniform(0.008, 0.030, len(s.trials))

    def freeze(t, torque, scenario):
        out = torque.copy()
        for row, a in zip(out, at):
            stuck = (t >= a) & (t < a + duration)
            row[stuck] = row[np.argmax(stuck)]
        return out

    s.digital_chain.append(freeze)
    return {"duration_s": duration}, [], "the value at the start of the freeze is repeated"


def coarse_converter(s, size, rng):
    """The torque's converter has lost its low bits."""
    step = size * SIZES["alien:coarse_converter"]["step_nm"]
    s.digital_chain.append(lambda t, torque, scenario: np.round(torque / step) * step)
    return {"step_nm": step}, [], "rounded after the noise"


def handle_recoil(s, size, rng):
    """The foam around the hand lets go: its force drops at a set deflection and builds up again."""
    d = SIZES["alien:handle_recoil"]
    drop, at, width = size * d["drop"], d["deflection_rad"], d["width_rad"]
    base = s.interface
    s.interface = lambda x, p: base(x, p) - p.k_h * at * drop * np.exp(-0.5 * ((x - at) / width) ** 2)
    return {"drop": drop, "deflection_rad": at}, [], "a dent in the force-deflection curve of the interface"


def rebound_wall(s, size, rng):
    """A soft stop in the joint at a set angle, thrown off again: stiffness in a band of angles only."""
    d = SIZES["alien:rebound_wall"]
    a, at, width = size * d["torque_nm"], rng.uniform(*d["angle_rad"]), d["width_rad"]
    s.forces.append(Force(lambda t, theta, speed, z, past: (a * np.exp(-0.5 * ((theta - at) / width) ** 2), None)))
    return {"torque_nm": a, "angle_rad": at}, [], "a bump of torque about one joint angle"


ALIENS = [loose_mass, gauge_hysteresis, speed_dependent_gain, torque_burst, oscillating_stiffness, yield_catch,
          emg_crosstalk, jittered_clock, frozen_torque, coarse_converter, handle_recoil, rebound_wall]
