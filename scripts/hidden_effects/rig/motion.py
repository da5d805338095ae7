"""What the motor is told in a rig trial, on the fine grid, and how long it takes."""

from dataclasses import dataclass

import numpy as np

from ..laboratories import Laboratory
from ..plant import FINE_HZ
from ..ramp import Ramp
from .loads import Block, RigTrial

REST_BEFORE_S, REST_AFTER_S = 0.3, 0.2
HOLD_S = 0.25  # of an empty ramp
FADE_S = 0.25  # of a multisine
LINES = 24  # frequencies of a multisine, where its duration separates as many


def duration_s(trial: RigTrial, laboratory: Laboratory, rise_s: float) -> float:
    """From the start of the motion to its end, without the rests."""
    if trial.motion == "ramp":
        return 2 * (laboratory.amplitude_rad / trial.velocity_rad_s + rise_s) + HOLD_S
    return trial.block.duration_s


def commanded(trial: RigTrial, laboratory: Laboratory, rise_s: float, t: np.ndarray) -> np.ndarray:
    """Angle from the start position at times `t`, whose zero is the start of the motion."""
    if trial.motion == "still":
        return np.zeros_like(t)
    if trial.motion == "multisine":
        return multisine(trial.block, t)
    ramp = Ramp(trial.velocity_rad_s, laboratory.amplitude_rad, rise_s, laboratory.ramp_profile)
    back = laboratory.amplitude_rad / trial.velocity_rad_s + rise_s + HOLD_S
    return ramp.angle(t) - ramp.angle(t - back)


def multisine(block: Block, t: np.ndarray) -> np.ndarray:
    """Whole numbers of periods, evenly spread in the logarithm, with the phases of Schroeder 1970; faded in and out."""
    grid = np.arange(round(block.duration_s * FINE_HZ) + 1) / FINE_HZ
    peak = np.max(np.abs(_faded_sum(block, grid)))
    return np.where((t > 0) & (t < block.duration_s), block.amplitude_rad / peak * _faded_sum(block, t), 0.0)


def _faded_sum(block, t):
    periods = np.geomspace(block.lowest_hz, block.highest_hz, LINES) * block.duration_s
    hz = np.unique(np.round(periods)) / block.duration_s
    phase = -np.pi * np.arange(len(hz)) * np.arange(1, len(hz) + 1) / len(hz)
    total = sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(hz, phase))
    ends = np.clip(np.minimum(t, block.duration_s - t) / FADE_S, 0.0, 1.0)
    return total * np.sin(np.pi / 2 * ends) ** 2


@dataclass
class Commands:
    """The commands of all rig trials on one grid. Stands in for the ramp of the person's trials, whose laws divide its velocity and
    amplitude by an angle gain; the commands themselves stay what the controller was told."""

    t_s: np.ndarray
    told_rad: np.ndarray  # trials x times
    velocity_rad_s: np.ndarray
    amplitude_rad: float

    def angle(self, t):
        return self.told_rad[:, np.clip(round((t - self.t_s[0]) * FINE_HZ), 0, len(self.t_s) - 1)]

    def times_s(self):
        return self.t_s
