"""What the sensors show without noise, what the base model says to it, and how that depends on the model's parameters."""

from dataclasses import fields, replace

import numpy as np

from .generator import base_model_response, recorded_angle
from .person import Trials
from .plant import FINE_HZ, Motion
from .scenario import Scenario

FREE = ("b_h", "k_h", "k_srs", "k_dec", "x_e")  # of each trial
PARAMETERS = FREE + ("i_j",)  # i_j is shared by all trials
RELATIVE_STEP = 0.005


def measured_torque(s: Scenario, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Times and torque at the laboratory's rate, trials x samples, hold included."""
    step = FINE_HZ // s.laboratory.sample_hz
    torque = s.trials.torque_nm[:, None] + motion.torque_l
    for link in s.torque_chain:
        torque = link(motion.t_s, torque, s, motion)
    t, torque = motion.t_s[::step], torque[:, ::step]
    for link in s.digital_chain:
        torque = link(t, torque, s)
    return t, torque


def base_torque_and_jacobian(s: Scenario, motion: Motion, trials: Trials, by=PARAMETERS) -> tuple[np.ndarray, np.ndarray]:
    """The base model's torque with the parameters of `trials`, at the angle that `s` records, and its derivative by each relative
    change of a parameter (last axis, in the order of `by`). All variants are solved together, so that they share their steps."""
    variants = [trials] + [replace(trials, **{name: getattr(trials, name) * (1 + RELATIVE_STEP)}) for name in by]
    n, times = len(trials), len(variants)
    stacked = replace(s, trials=stack(variants), record_command=False, angle_factor=1.0, angle_chain=[])
    angle = np.tile(recorded_angle(s, motion), (times, 1))
    torque = base_model_response(stacked, replace(motion, theta_m=angle)).torque_l.reshape(times, n, -1)
    return torque[0], np.moveaxis(torque[1:] - torque[0], 0, -1) / RELATIVE_STEP


def stack(many: list[Trials]) -> Trials:
    return Trials(**{f.name: np.concatenate([getattr(t, f.name) for t in many]) for f in fields(Trials)})


def some(trials: Trials, chosen) -> Trials:
    return Trials(**{f.name: getattr(trials, f.name)[chosen] for f in fields(Trials)})
