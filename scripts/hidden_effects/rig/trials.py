"""The rig trials of a session: its rig with its faults, without its person."""

from dataclasses import dataclass, field, replace

import numpy as np

from .. import catalogue, noise
from ..laboratories import Laboratory
from ..person import Trials
from ..plant import FINE_HZ
from ..scenario import Hidden, Scenario, base_scenario
from ..streams import stream
from .bearing import FRICTION, NOMINAL_FRICTION, fit_bearing
from .loads import BLOCKS, RigTrial, expanded, with_true_values
from .mechanics import RigMotion, simulate
from .motion import REST_AFTER_S, REST_BEFORE_S, Commands, commanded, duration_s
from .traps import TRAPS, another_day, wrong_load

# What is hidden in the rig is there without a person too. Of the aliens: those of the handle, the channels and the motor.
RIG_CAUSES = frozenset({*catalogue.CLASSES["rig"], *catalogue.CLASSES["sensor"]})
RIG_ALIENS = frozenset({"torque_burst", "cable_pull", "rough_bearing", "bent_amplifier", "ringing_amplifier", "eccentric_encoder",
                        "loose_mass", "gauge_hysteresis", "speed_dependent_gain", "jittered_clock", "frozen_torque",
                        "coarse_converter", "motor_crosstalk", "baseline_jumps", "echo"})

OFFSET_SPREAD_NM = 0.05
SMALLEST_LEVEL_NM, LARGEST_LEVEL_NM = 0.002, 0.008  # of a ball bearing's friction: below what a person's trials show


@dataclass
class RigRecording:
    """Raw signals of one rig trial."""

    trial: RigTrial
    t_s: np.ndarray
    target_rad: np.ndarray
    theta_m_rad: np.ndarray
    torque_l_nm: np.ndarray


@dataclass
class RigTrials:
    """All of a session, and the truth about them."""

    recordings: list[RigRecording]
    hidden: list[Hidden]  # those of the session's hidden effects that were there
    trap: str | None
    quantities: dict  # name of rig-calibration.json to its value when the rig trials were made; None where the rig has no such thing
    nominal: list  # names whose true law has no exact counterpart
    wrong_loads: list = field(default_factory=list)
    then_over_now: dict = field(default_factory=dict)

    def as_json(self):
        loads = [{"load": block.load, "stated_over_true": 1 / factor} for block, factor in
                 dict.fromkeys((r.trial.block, r.trial.true_over_stated) for r in self.recordings)]
        return {"trap": self.trap, "hidden": [h.as_json() for h in self.hidden], "quantities": self.quantities, "nominal": self.nominal,
                "loads": loads, "wrong_loads": self.wrong_loads, "then_over_now": self.then_over_now}


class BeforeThePerson(Trials):
    """Rig trials come before the first of the person's: what drifts over the session has its first value in all of them."""

    def order(self):
        return np.zeros(len(self))


def bearing_of(seed: int) -> tuple[str, float, float]:
    """Law and level of the bearing's friction, and the growth of the lever's damping, the same in rig trials and person trials."""
    rng = stream(seed, "bearing")
    return str(rng.choice(list(FRICTION))), float(rng.uniform(SMALLEST_LEVEL_NM, LARGEST_LEVEL_NM)), float(rng.uniform(0.0, 0.1))


def is_of_the_rig(name: str) -> bool:
    """Whether a hidden effect is there without a person."""
    return catalogue.mechanism_of(name) in RIG_CAUSES or name.removeprefix("alien:") in RIG_ALIENS


def rig_trials(seed: int, names: list[str], size: float, laboratory: Laboratory, in_person: list[Hidden], trap: str | None = None) -> RigTrials:
    """Those of `laboratory`. `names` are hidden in the session, `in_person` is what became of them there."""
    if trap is not None and trap not in TRAPS:
        raise ValueError(f"unknown trap {trap!r}; known: {', '.join(TRAPS)}")
    if trap == "person_only" and not any(map(is_of_the_rig, names)):
        raise ValueError("person_only needs a hidden fault of the rig")
    blocks, rng = BLOCKS[laboratory.rig_trials], stream(seed, "rig trials")
    wrong = wrong_load(blocks, stream(seed, "wrong load")) if trap == "wrong_load" else {}
    trials = with_true_values(expanded(blocks, laboratory.velocities_rad_s), rng, wrong)
    base = base_scenario(seed, laboratory)
    law, level_nm, growth = bearing_of(seed)
    s = rig_scenario(base, trials)
    fit_bearing(s, law, level_nm, growth)
    present = [] if trap == "person_only" else [n for n in names if is_of_the_rig(n)]
    hidden = [catalogue.hide(s, name, size) for name in present]
    _share_levels(hidden, in_person)
    then = another_day(s, stream(seed, "another day")) if trap == "another_day" else {}
    offset = OFFSET_SPREAD_NM * float(rng.standard_normal())
    recordings = record(s, trials, offset, seed)
    quantities, nominal = true_quantities(s, hidden, law, level_nm, offset, then)
    return RigTrials(recordings, hidden, trap, quantities, nominal, [
        {"load": b.load, "stated_over_true": f} for b, f in wrong.items()], then)


def rig_scenario(base: Scenario, trials: list[RigTrial]) -> Scenario:
    """The scenario `base` with rig trials in place of the person's, for the laws of the catalogue to act on."""
    laboratory, rise = base.laboratory, base.ramp.rise_s
    longest = max(duration_s(t, laboratory, rise) for t in trials) + REST_AFTER_S
    t = np.arange(round(-REST_BEFORE_S * FINE_HZ), round(longest * FINE_HZ) + 1) / FINE_HZ
    n, middle = len(trials), float(np.mean(laboratory.velocities_rad_s))
    velocity = np.array([trial.velocity_rad_s or middle for trial in trials])
    told = np.stack([commanded(trial, laboratory, rise, t) for trial in trials])
    ones = lambda: np.ones(n)
    of_rig = BeforeThePerson(velocity, np.zeros(n), np.array([trial.repetition for trial in trials]), ones(), ones(), ones(),
                             *(ones() for _ in range(6)))
    return replace(base, trials=of_rig, ramp=Commands(t, told, velocity.copy(), laboratory.amplitude_rad), servo=replace(base.servo),
                   lever=None if base.lever is None else dict(base.lever), forces=[], torque_chain=[], digital_chain=[], angle_chain=[])


def moved(s: Scenario, trials: list[RigTrial]) -> RigMotion:
    """Motor and handle as they move. The encoder is the servo's too: what it shows follows the command."""
    told = np.stack([s.followed(t) for t in s.ramp.t_s], axis=1) if s.followed else s.ramp.told_rad
    return simulate(trials, s.lever, s.servo, told / s.angle_factor, s.ramp.t_s, s.forces)


def record(s: Scenario, trials: list[RigTrial], offset_nm: float, seed: int) -> list[RigRecording]:
    """Through the channels of the session, with the laboratory's noise, encoder and rate."""
    laboratory, motion = s.laboratory, moved(s, trials)
    torque = motion.torque_l
    for link in s.torque_chain:
        torque = link(motion.t_s, torque, s, motion)
    step = FINE_HZ // laboratory.sample_hz
    t, torque = motion.t_s[::step], torque[:, ::step] + offset_nm
    white = s.person.gauge_noise_nm * stream(seed, "rig gauge noise").standard_normal(torque.shape)
    torque = torque + noise.SPECTRA[laboratory.gauge_spectrum](white, laboratory.sample_hz)
    for link in s.digital_chain:
        torque = link(t, torque, s)
    angle = s.ramp.told_rad if s.record_command else motion.theta_m
    for link in s.angle_chain:
        angle = link(motion.t_s, angle, s)
    start = s.person.start_angle_rad
    shown = noise.encoder(start + (s.angle_factor * angle)[:, ::step], laboratory.encoder_counts)
    target = start + s.ramp.told_rad[:, ::step]
    out = []
    for i, trial in enumerate(trials):
        kept = t <= duration_s(trial, laboratory, _rise_s(s)) + REST_AFTER_S
        out.append(RigRecording(trial, (t - t[0])[kept], target[i, kept], shown[i, kept], torque[i, kept]))
    return out


def _rise_s(s):
    return s.person.ramp_rise_s * s.laboratory.ramp_rise_factor


def _share_levels(hidden, in_person):
    """A level that was set by the person's trials (of a saturation) is the rig's in its own trials too."""
    for h in hidden:
        for name in [n for n, value in h.parameters.items() if value is None]:
            h.parameters[name] = next(p for p in in_person if p.mechanism == h.mechanism).parameters[name]


# Hidden effect to the quantity that it changes, and the name of its own parameter.
QUANTITY_OF = {"torque_gain": ("torque_gain", "factor"), "angle_gain": ("angle_gain", "factor"), "channel_skew": ("torque_delay_s", "delay_s"),
               "torque_lag": ("torque_cutoff_hz", "cutoff_hz"), "servo_following": ("servo_bandwidth_hz", "bandwidth_hz")}


def true_quantities(s: Scenario, hidden: list[Hidden], friction: str, level_nm: float, offset_nm: float, then: dict) -> tuple[dict, list]:
    """The quantities of rig-calibration.json, and those that are only nominal."""
    lever = {name: None if s.lever is None else float(np.mean(s.lever[name])) for name in
             ("inertia_kg_m2", "damping_nm_s_per_rad", "stiffness_nm_per_rad")}
    quantities = {
        "lever_inertia_kg_m2": lever["inertia_kg_m2"],
        "lever_damping_nm_s_per_rad": lever["damping_nm_s_per_rad"],
        "lever_stiffness_nm_per_rad": lever["stiffness_nm_per_rad"],
        "torque_gain": then.get("torque_gain", 1.0),
        "torque_offset_nm": offset_nm,
        "torque_nonlinearity_per_nm2": 0.0,
        "angle_gain": 1.0,
        "torque_delay_s": 0.0,
        "torque_cutoff_hz": None,
        "servo_bandwidth_hz": s.servo.delay_matched_natural_hz(),
        "bearing_friction_nm": None if s.lever is None else level_nm,
    }
    nominal = ["lever_damping_nm_s_per_rad", "servo_bandwidth_hz"] + (["bearing_friction_nm"] if friction in NOMINAL_FRICTION else [])
    for h in hidden:
        if h.mechanism in QUANTITY_OF:
            quantity, parameter = QUANTITY_OF[h.mechanism]
            share = 1 - 0.1 if h.law == "drifting" else 1.0  # see BeforeThePerson
            value = h.parameters[parameter]
            if h.mechanism in ("torque_gain", "angle_gain"):
                value = (1 + (value - 1) * share) * (quantities[quantity] if h.mechanism == "torque_gain" else 1.0)
            elif h.mechanism == "channel_skew":
                value *= share
            quantities[quantity] = float(value)
            nominal += [quantity] if h.nominal else []
        if h.mechanism == "torque_saturation":
            nominal.append("torque_nonlinearity_per_nm2")
    return quantities, sorted(set(nominal))
