"""From a seed and the names of what to hide to a measured session and its truth."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from . import catalogue, noise
from .laboratories import LABORATORIES, Laboratory
from .person import Trials
from .plant import END_S, FINE_HZ, START_S, Motion, Plant, simulate
from .rig.bearing import fit_bearing
from .rig.trials import RigTrials, bearing_of, rig_trials
from .scenario import Hidden, Scenario, base_scenario
from .streams import stream


@dataclass
class Session:
    """Raw signals, trials x samples, on one time axis with the onset at 0; each trial begins at its `first` sample."""

    seed: int
    scenario: Scenario
    hidden: list[Hidden]
    motion: Motion
    t_s: np.ndarray
    first: np.ndarray
    theta_m_rad: np.ndarray
    torque_l_nm: np.ndarray
    emg_fcr_mvc: np.ndarray
    emg_ecr_mvc: np.ndarray
    rig: RigTrials | None = None

    @property
    def trials(self) -> Trials:
        return self.scenario.trials

    def x_t_s(self) -> np.ndarray:
        """When the true joint angle passes the true elastic limit (NaN where it never does)."""
        passed = self.motion.theta_j >= self.trials.x_e[:, None]
        return np.where(passed.any(axis=1), self.motion.t_s[passed.argmax(axis=1)], np.nan)


def generate(seed: int, effect: str = "none", size: float = 1.0, repetitions: int | None = None,
             laboratory: Laboratory = LABORATORIES["paper"], with_rig_trials: bool = False, trap: str | None = None) -> Session:
    """Measured in `laboratory`, with other `repetitions` than its own where they are given.

    `with_rig_trials` adds those of the laboratory, and gives the lever a bearing as it is in them. `trap` is one of rig.traps.
    """
    names = catalogue.parse(effect, laboratory)
    if repetitions is not None:
        laboratory = replace(laboratory, repetitions=repetitions)
    scenario = base_scenario(seed, laboratory)
    step = FINE_HZ // laboratory.sample_hz
    if with_rig_trials:
        fit_bearing(scenario, *bearing_of(seed))
    hidden = [catalogue.hide(scenario, name, size) for name in names]
    motion = simulate(plant_of(scenario))

    fine = np.arange(round(-laboratory.longest_hold_s * FINE_HZ), round(END_S * FINE_HZ) + 1) / FINE_HZ
    moving = slice(round((laboratory.longest_hold_s + START_S) * FINE_HZ), None)
    torque, gauge = noise.voluntary_torque(seed, scenario.person, scenario.trials.torque_nm, fine, laboratory)
    torque[:, moving] += motion.torque_l
    for link in scenario.torque_chain:
        torque = link(fine, torque, scenario, motion)
    t = fine[::step]
    torque = torque[:, ::step] + gauge
    for link in scenario.digital_chain:
        torque = link(t, torque, scenario)

    angle = np.zeros_like(torque)
    angle[:, round((laboratory.longest_hold_s + START_S) * laboratory.sample_hz):] = recorded_angle(scenario, motion)[:, ::step]
    rng = stream(seed, "holds")
    start = scenario.person.start_angle_rad + rng.normal(0, 2e-4, (len(torque), 1))
    first = rng.integers(0, round(laboratory.hold_spread_s * laboratory.sample_hz), len(torque))
    burst = scenario.person.late_reflex["latency_s"] - 0.012  # EMG leads the torque
    fcr, ecr = noise.emg(seed, scenario.person, scenario.trials, t, burst, laboratory.sample_hz)
    rig = rig_trials(seed, names, size, laboratory, hidden, trap) if with_rig_trials else None
    return Session(seed, scenario, hidden, motion, t, first, noise.encoder(start + angle, laboratory.encoder_counts), torque, fcr, ecr, rig)


def plant_of(s: Scenario) -> Plant:
    return Plant(s.trials, s.lever, s.followed or s.ramp.angle, s.servo, s.elastic, s.interface, s.forces)


def recorded_angle(s: Scenario, motion: Motion) -> np.ndarray:
    if s.record_command:
        angle = np.stack([s.ramp.angle(t) for t in motion.t_s], axis=1)
    else:
        angle = motion.theta_m
    for link in s.angle_chain:
        angle = link(motion.t_s, angle, s)
    return s.angle_factor * angle


def base_model_response(s: Scenario, motion: Motion) -> Motion:
    """What Eq. 1-7 with the trials' true parameters and the session's lever say to the recorded angle."""
    spline = CubicSpline(motion.t_s, recorded_angle(s, motion), axis=1)
    speed = spline.derivative()
    plant = Plant(s.trials, s.laboratory.own_lever(), s.ramp.angle, s.servo, motor=lambda t: (spline(t), speed(t)))
    return simulate(plant, motion.t_s[-1])
