"""Causes that are no function of one argument at one place: they remember, differ from trial to trial, or depend on two things."""

import numpy as np
from scipy.interpolate import CubicSpline

from ..plant import Force
from ..scenario import SIZES
from .alien import alien


def _swinging_mass(place, s, size, rng, name, damping_ratio):
    """At `place`, a mass on a spring of its own."""
    d = SIZES[name]
    inertia, hz = size * d["inertia_kg_m2"], rng.uniform(*d["resonance_hz"])
    w = 2 * np.pi * hz

    def law(t, theta, speed, z, past):
        torque = inertia * (w**2 * (theta - z[0]) + 2 * damping_ratio * w * (speed - z[1]))
        return torque, np.stack([z[1], torque / inertia])

    s.forces.append(Force(law, states=2, on=place))
    return {"inertia_kg_m2": inertia, "resonance_hz": hz}


@alien()
def loose_mass(s, size, rng):
    """A part of the handle swings on a spring of its own."""
    return _swinging_mass("lever", s, size, rng, "alien:loose_mass", 0.06), [], "on the lever, in parallel with the hand"


@alien()
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


@alien()
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


@alien()
def oscillating_stiffness(s, size, rng):
    """The joint's stiffness swings in time."""
    d = SIZES["alien:oscillating_stiffness"]
    part, hz, phase = size * d["part"], rng.uniform(*d["frequency_hz"]), rng.uniform(0, 2 * np.pi)
    s.forces.append(Force(lambda t, theta, speed, z, past: (
        part * s.trials.k_srs * theta * np.sin(2 * np.pi * hz * t + phase), None)))
    return {"part": part, "frequency_hz": hz}, [], "the joint's stiffness swings in time"


@alien()
def yield_catch(s, size, rng):
    """Stretched past the limit the muscle catches again: the torque jumps up, then fades."""
    d = SIZES["alien:yield_catch"]
    a, at, width = size * d["step_nm"], d["part_of_limit"], 0.0012

    def law(t, theta, speed, z, past):
        gate = 0.5 * (1 + np.tanh((theta - at * s.trials.x_e) / width))
        return a * z[0], np.stack([(gate - z[0]) / 0.0015 - z[1] / 0.0015, (gate - z[1]) / 0.007])

    s.forces.append(Force(law, states=2))
    return {"step_nm": a}, [], "a pulse of torque that begins near the elastic limit"


@alien()
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


@alien()
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


@alien()
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


@alien()
def coarse_converter(s, size, rng):
    """The torque's converter has lost its low bits."""
    step = size * SIZES["alien:coarse_converter"]["step_nm"]
    s.digital_chain.append(lambda t, torque, scenario: np.round(torque / step) * step)
    return {"step_nm": step}, [], "rounded after the noise"


@alien()
def tendon_whip(s, size, rng):
    """A mass in the arm swings behind the joint on a spring of its own."""
    return _swinging_mass("joint", s, size, rng, "alien:tendon_whip", 0.1), [], "on the joint, in parallel with the muscle"


@alien()
def motor_crosstalk(s, size, rng):
    """The motor's current leaks into the torque channel, with the motor's acceleration."""
    c = size * SIZES["alien:motor_crosstalk"]["nm_s2_per_rad"]

    def leak(t, torque, scenario, motion):
        out = torque.copy()
        acceleration = np.gradient(motion.speed_m, motion.t_s, axis=1)
        out[:, -acceleration.shape[1]:] += c * acceleration * (1 + 0.5 * np.tanh(motion.speed_m))
        return out

    s.torque_chain.append(leak)
    return {"nm_s2_per_rad": c}, [], "more at speed"


@alien()
def baseline_jumps(s, size, rng):
    """The torque's baseline jumps at another time and by another step in each trial."""
    d = SIZES["alien:baseline_jumps"]
    step = size * d["step_nm"] * rng.choice([-1, 1], (len(s.trials), 1)) * rng.uniform(0.7, 1.3, (len(s.trials), 1))
    at = rng.uniform(0.008, 0.030, (len(s.trials), 1))
    s.torque_chain.append(lambda t, torque, *_: torque + step / (1 + np.exp(-np.clip((t - at) / 0.0003, -40, 40))))
    return {"step_nm": size * d["step_nm"]}, [], "a loose contact"


@alien()
def slipping_strap(s, size, rng):
    """The strap slips under load and holds again: what has slipped stays."""
    d = SIZES["alien:slipping_strap"]
    most, at, tau = size * d["slip_rad"], d["deflection_rad"], 0.002

    def slip(t, deflection, speed, z, past):
        pulled = 1 / (1 + np.exp(-np.clip((deflection - at) / (at / 10), -40, 40)))
        return -s.trials.k_h * z[0], ((most - z[0]) * pulled / tau)[None]

    s.forces.append(Force(slip, states=1, on="interface"))
    return {"slip_rad": most, "deflection_rad": at}, [], "an offset of the deflection that builds up within 2 ms"


@alien()
def echo(s, size, rng):
    """The torque channel repeats a part of what it showed some milliseconds before."""
    d = SIZES["alien:echo"]
    part, late = size * d["part"], rng.uniform(*d["delay_s"])

    def repeat(t, torque, *_):
        before = np.stack([np.interp(t - late, t, row) for row in torque])
        return torque + part * (before - torque[:, :1])

    s.torque_chain.append(repeat)
    return {"part": part, "delay_s": late}, [], "an echo on a long cable of a network"


@alien()
def wandering_axis(s, size, rng):
    """The wrist's axis moves off the motor's: joint torque with the product of angle and speed."""
    c = size * SIZES["alien:wandering_axis"]["nm_s_per_rad2"]
    s.forces.append(Force(lambda t, theta, speed, z, past: (c * theta * speed * np.exp(-((theta / 0.05) ** 2)), None)))
    return {"nm_s_per_rad2": c}, [], "fades beyond 50 mrad"
