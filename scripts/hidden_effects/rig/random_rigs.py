"""Calibration sessions of random rigs whose constants, laws and loads are known."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import cont2discrete, lfilter

from ..generator import generate
from ..laboratories import NOMINAL_LEVER, RIGID, Laboratory, lever
from ..plant import FINE_HZ
from ..ramp import ResonantServo, Servo
from ..scenario import base_scenario
from ..session_writer import write_session
from ..streams import stream
from .bearing import FRICTION, NOMINAL_FRICTION, fit_bearing
from .loads import bar, clamp, expanded, multisine, ramps, spring, weight, with_true_values
from .trials import record, rig_scenario
from .writer import write_rig_trials

QUANTITIES = ("lever_inertia_kg_m2", "lever_damping_nm_s_per_rad", "lever_stiffness_nm_per_rad", "torque_gain", "torque_offset_nm",
              "torque_nonlinearity_per_nm2", "angle_gain", "torque_delay_s", "torque_cutoff_hz", "servo_bandwidth_hz", "bearing_friction_nm")


@dataclass
class RandomRig:
    """What was drawn: each quantity's true value (None where the rig has no such thing), those that are only nominal, and a description."""

    seed: int
    quantities: dict
    nominal: set
    description: dict


def write_random_rig(seed: int, folder: Path) -> RandomRig:
    """A session with a few trials of a person, by the stated lever, and with rig trials of a rig that differs from what is stated."""
    rng = stream(seed, "random rig")
    within = lambda low, high: float(np.exp(rng.uniform(np.log(low), np.log(high))))
    about = lambda middle, spread: float(middle * np.exp(spread * np.clip(rng.standard_normal(), -2, 2)))
    rigid = rng.random() < 0.15
    true = dict(zip(NOMINAL_LEVER, (within(0.0008, 0.004), within(0.15, 0.8), within(400.0, 3000.0))))
    stated = RIGID if rigid else lever(*(about(value, 0.15) for value in true.values()))
    laboratory = Laboratory("a random rig", sample_hz=int(rng.choice([1000, 1250, 2000, 2500, 5000])),
                            encoder_bits=int(rng.choice([13, 16, 17, 18, 20])), lever=stated,
                            ramp_profile=str(rng.choice(["raised cosine", "trapezoid", "minimum jerk"])), velocities_rad_s=(1.5, 3.0),
                            torques_nm=(1.0, 2.0), repetitions=1, gauge_noise=float(rng.uniform(0.5, 1.5)),
                            gauge_spectrum=str(rng.choice(["white", "white", "1/f"])), has_emg=False)
    trials = with_true_values(expanded(_blocks(rng, rigid), laboratory.velocities_rad_s), rng)
    s = rig_scenario(base_scenario(seed, laboratory), trials)
    s.lever = None if rigid else dict(true)
    law, level_nm = str(rng.choice(list(FRICTION))), within(0.001, 0.02)
    growth = float(rng.choice([0.0, rng.uniform(0.02, 0.15)]))
    fit_bearing(s, law, level_nm, growth)
    servo = _servo(s, rng)
    gain, angle_gain, offset = about(1.0, 0.1), about(1.0, 0.05), float(0.1 * rng.standard_normal())
    cubic = float(rng.choice([0.0, rng.choice([-1, 1]) * rng.uniform(0.0005, 0.004)]))
    delay = float(rng.choice([0.0, rng.uniform(-0.001, 0.0015), rng.uniform(-0.001, 0.0015)]))
    cutoff = None if rng.random() < 0.5 else within(80.0, 400.0)
    s.angle_factor = angle_gain
    s.torque_chain = [lambda t, torque, *_: gain * (torque + cubic * torque**3), lambda t, torque, *_: _late(t, torque, delay)]
    if cutoff:
        s.torque_chain.append(lambda t, torque, *_: _first_order(torque, cutoff))
    # The trials of the person are there because a session has some: the noise of some rigs lets nobody hold a torque within the gate.
    write_session(generate(seed, laboratory=replace(laboratory, gate_fraction=1.0)), folder)
    write_rig_trials(record(s, trials, offset, seed), folder)

    there = (lambda value: None) if rigid else (lambda value: value)
    values = (*map(there, true.values()), gain, offset, cubic, angle_gain, delay, cutoff, s.servo.delay_matched_natural_hz(), there(level_nm))
    nominal = {"servo_bandwidth_hz"} if servo != "critically damped" else set()
    nominal |= {"bearing_friction_nm"} if law in NOMINAL_FRICTION else set()
    nominal |= {"lever_damping_nm_s_per_rad"} if growth else set()
    description = {"sample_rate_hz": laboratory.sample_hz, "encoder_bits": laboratory.encoder_bits, "rigid": bool(rigid), "friction": law,
                   "damping_growth_s_per_rad": growth, "servo": servo, "gauge_spectrum": laboratory.gauge_spectrum,
                   "gauge_noise_nm": s.person.gauge_noise_nm, "loads": list(dict.fromkeys(t.load for t in trials))}
    return RandomRig(seed, dict(zip(QUANTITIES, values)), nominal, description)


def _blocks(rng, rigid):
    """A laboratory has most of these; none has always all."""
    has = lambda probability: rng.random() < probability
    blocks = [] if rigid else [ramps()]
    blocks += [multisine(duration_s=2.0)] if rigid or has(0.8) else []
    blocks += [weight(float(rng.uniform(0.5, 1.5)))] if has(0.85) else []
    blocks += [weight(float(rng.uniform(2.0, 4.0)), 0.12)] if has(0.4) else []
    blocks += [bar(float(rng.uniform(0.002, 0.006)), duration_s=2.0)] if has(0.6) else []
    blocks += [clamp(duration_s=2.0)] if not rigid and has(0.6) else []
    blocks += [spring(float(rng.uniform(15.0, 60.0)), duration_s=2.0)] if has(0.4) else []
    return blocks


def _servo(s, rng):
    """Gives the motor a servo and returns the name of its law."""
    hz, law = float(rng.uniform(70.0, 200.0)), str(rng.choice(["critically damped", "cascade", "resonant"]))
    s.servo = Servo(hz, 1000.0) if law == "cascade" else ResonantServo(hz, 1.0 if law == "critically damped" else 0.7)
    return law


def _late(t, torque, delay):
    return torque if delay == 0.0 else CubicSpline(t, torque, axis=1)(np.clip(t - delay, t[0], t[-1]))


def _first_order(torque, cutoff_hz):
    pole = 2 * np.pi * cutoff_hz
    num, den, _ = cont2discrete(([pole], [1, pole]), 1 / FINE_HZ, method="foh")
    return torque[:, :1] + lfilter(num.ravel(), den, torque - torque[:, :1], axis=1)


@dataclass
class Told:
    """What a calibration says of one quantity of one rig, beside the truth."""

    rig: RandomRig
    name: str
    value: float | None
    se: float | None
    above: float | None = None  # what a frequency without a value lies above
    has_low_pass: bool = True  # whether the calibration has one; where it has none, that is in the delay

    @property
    def true(self):
        cutoff_hz = self.rig.quantities["torque_cutoff_hz"]
        in_delay_s = 1 / (2 * np.pi * cutoff_hz) if self.name == "torque_delay_s" and cutoff_hz and not self.has_low_pass else 0.0
        own = self.rig.quantities[self.name]
        return own if own is None else own + in_delay_s

    @property
    def is_told(self):
        return self.value is not None

    @property
    def z(self):
        """Infinite where a value is told of what the rig does not have."""
        return np.inf if self.true is None else (self.value - self.true) / self.se

    @property
    def is_covered(self):
        return abs(self.z) <= 1.96

    @property
    def is_above(self):
        """What a rig does not have is above any frequency."""
        return self.true is None or self.true >= self.above


def read_calibration(path: Path, rig: RandomRig) -> list[Told]:
    """Raises ValueError where the file is not as the format says."""
    try:
        calibration = json.loads(path.read_text())
        found = {q["name"]: q for q in calibration["quantities"]}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{path.name}: {error}") from error
    if calibration.get("format") != "ramphold-rig-calibration/1" or list(found) != list(QUANTITIES):
        raise ValueError(f"{path.name}: format is {calibration.get('format')!r}, quantities are {', '.join(found)}")
    for name, q in found.items():
        if q["value"] is None and not q["reason"]:
            raise ValueError(f"{path.name}: {name} has neither a value nor a reason")
        if q["value"] is not None and not (q["se"] or 0) > 0:
            raise ValueError(f"{path.name}: {name} has a value without a standard error")
        if q.get("above") is not None and not (q["value"] is None and q["above"] > 0):
            raise ValueError(f"{path.name}: {name} is above {q['above']} and has the value {q['value']}")
    has_low_pass = found["torque_cutoff_hz"]["value"] is not None
    return [Told(rig, name, q["value"], q["se"], q.get("above"), has_low_pass) for name, q in found.items()]
