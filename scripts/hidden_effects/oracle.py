"""What of a hidden effect can be found at all, by a fit that knows the true law: an upper bound for any diagnosis.

At the truth, to first order. d is what the effect does to the torque, in units of the noise, after the base model has absorbed its
part: b_h, k_h, k_srs, k_dec and x_e of each condition and an I_j of the session are free, and each trial departs from its condition
with the spread that the generator gives it. With a prior N(0, 1) of the effect's size in units of the usual one, D_1 the distance of
an effect of usual size and D = size D_1 that of the one hidden, the log Bayes factor to expect against nothing hidden is

    D^2 / 2 * D_1^2 / (1 + D_1^2) - log(1 + D_1^2) / 2.

The last term is the penalty. The effect is *findable* where this exceeds log 20, which is where

    D^2 > (1 + 1 / D_1^2) (2 log 20 + log(1 + D_1^2)).

It can be *told apart* where what the best single rival of free size leaves of d exceeds the same limit.
"""

from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_triangular

from . import catalogue
from .generator import plant_of
from .laboratories import Laboratory
from .noise_covariance import encoder_covariance, torque_covariance
from .plant import simulate
from .response import FREE, PARAMETERS, base_torque_and_jacobian, measured_torque, some
from .scenario import Scenario, base_scenario

WINDOW_S = 0.04
END_S = 0.045
BAYES_FACTOR = 20.0
TRIAL_SPREAD = {"b_h": 0.01, "k_h": 0.01, "k_srs": 0.025, "k_dec": 0.03, "x_e": 0.02}  # as person.draw_trials has it
ACROSS_TRIALS = ("fatigue", "thixotropy", "cocontraction", "activation_scaling")
# Another phase in each trial, any two trials, a law of x_e: no single pattern that could stand in for another mechanism.
NO_RIVAL = ("mains_hum", "outlier_trial", "timed_yield")
STANDARD_SUBJECT = 0
RECOMPUTED = 3  # rivals, in the session's own subject


@dataclass
class Finding:
    raw: float  # what it does to the torque before the base model absorbs any, in units of the noise
    distance: float  # D
    limit: float
    findable: bool
    nearest_rival: str | None = None
    distance_beyond_rival: float | None = None
    told_apart: bool | None = None

    def as_json(self) -> dict:
        return asdict(self)


def limit(distance: float, size: float) -> float:
    """Least distance that has a log Bayes factor of log 20, where an effect of this size lies at `distance`."""
    usual = max(distance / size, 1e-9) ** 2
    return float(np.sqrt((1 + 1 / usual) * (2 * np.log(BAYES_FACTOR) + np.log1p(usual))))


def finding(seed: int, effect: str, laboratory: Laboratory, size: float = 1.0, with_rivals: bool = True) -> Finding:
    names = catalogue.parse(effect, laboratory)
    base = base_scenario(seed, laboratory)
    absorption = _absorption(seed, laboratory, "timed_yield" in map(catalogue.mechanism_of, names))
    torque, predicted, _ = _responses(base, names, size, by=())
    raw = float(np.linalg.norm(absorption.in_units_of_noise(torque - predicted)))
    left = absorption.left_of(torque - predicted)
    distance = float(np.linalg.norm(left))
    least = limit(distance, size)
    found = Finding(raw, distance, least, distance > least)
    if with_rivals and len(names) == 1:
        found.nearest_rival, found.distance_beyond_rival = _nearest_rival(base, catalogue.mechanism_of(names[0]), left, absorption)
        found.told_apart = found.findable and found.distance_beyond_rival > least
    return found


@lru_cache(maxsize=8)
def _absorption(seed: int, laboratory: Laboratory, x_e_is_a_time: bool) -> "Absorption":
    base = base_scenario(seed, laboratory)
    return Absorption(base, _responses(base, [], 1.0)[2], x_e_is_a_time)


class Absorption:
    """Whitens a pattern (trials x samples) and takes out what the base model absorbs of it.

    The Jacobian is that of the session with nothing hidden. Where the elastic limit is a time, x_e has one free scale for all
    conditions, since that is what the mechanism says.
    """

    def __init__(self, s: Scenario, jacobian: np.ndarray, x_e_is_a_time: bool):
        self.jacobian = jacobian
        samples = jacobian.shape[1]
        steps = encoder_covariance(s, samples)
        noise = {t: torque_covariance(s, t, samples) + steps for t in set(s.trials.torque_nm)}
        self.noise_roots = [np.linalg.cholesky(noise[t]) for t in s.trials.torque_nm]
        spread = np.diag([TRIAL_SPREAD[name] ** 2 for name in FREE])
        own = jacobian[..., :len(FREE)]
        self.roots = [np.linalg.cholesky(noise[t] + j @ spread @ j.T) for t, j in zip(s.trials.torque_nm, own)]
        conditions = condition_of(s)
        columns = [np.where((conditions == c)[:, None], own[..., k], 0.0)
                   for k, name in enumerate(FREE) for c in range(conditions.max() + 1) if not (name == "x_e" and x_e_is_a_time)]
        if x_e_is_a_time:
            columns.append(own[..., FREE.index("x_e")])
        columns.append(jacobian[..., -1])
        self.basis = np.linalg.qr(np.stack([_white(self.roots, c) for c in columns], axis=1))[0]

    def in_units_of_noise(self, pattern):
        return _white(self.noise_roots, pattern)

    def left_of(self, pattern):
        white = _white(self.roots, pattern)
        return white - self.basis @ (self.basis.T @ white)


def _white(roots, pattern):
    return np.concatenate([solve_triangular(root, row, lower=True) for root, row in zip(roots, pattern)])


def condition_of(s: Scenario) -> np.ndarray:
    """The number of each trial's condition."""
    return np.unique(np.stack([s.trials.velocity_rad_s, s.trials.torque_nm]), axis=1, return_inverse=True)[1].ravel()


def _responses(base, names, size, by=PARAMETERS):
    """In the window: the torque with `names` hidden, what the base model with the parameters of `base` says, and its Jacobian."""
    hidden = replace(base, trials=replace(base.trials), ramp=replace(base.ramp), servo=replace(base.servo), forces=list(base.forces),
                     lever=base.lever and dict(base.lever), torque_chain=[], digital_chain=[], angle_chain=[])
    for field, values in vars(base.trials).items():
        setattr(hidden.trials, field, values.copy())  # mechanisms change them in place
    for name in names:
        catalogue.hide(hidden, name, size)
    motion = simulate(plant_of(hidden), END_S)
    t, torque = measured_torque(hidden, motion)
    fine, fine_jacobian = base_torque_and_jacobian(hidden, motion, base.trials, by)
    step = round((t[1] - t[0]) / (motion.t_s[1] - motion.t_s[0]))
    onset = int(np.argmin(np.abs(t)))
    window = slice(onset, onset + round(WINDOW_S * base.laboratory.sample_hz))
    before = slice(onset - round(0.02 * base.laboratory.sample_hz), onset)
    change = torque - torque[:, before].mean(axis=1, keepdims=True)
    return change[:, window], fine[:, ::step][:, window], fine_jacobian[:, ::step][:, window]


def _nearest_rival(base, own, left, absorption):
    """Of the catalogue's other mechanisms at their first law: the one of free size that leaves least of `left`, and how much.

    What acts within a trial is compared in the standard subject first, and the closest few then in the session's own.
    """
    def beyond(pattern):
        pattern = absorption.left_of(pattern)
        return float(np.linalg.norm(left - pattern * (pattern @ left) / max(pattern @ pattern, 1e-12)))

    conditions = condition_of(base)
    roughly = {rival: beyond(pattern[conditions]) for rival, pattern in _standard_patterns(replace(base.laboratory, repetitions=1)).items()
               if rival != own}
    exactly = {rival: beyond(_pattern_within_trials(base, rival)[conditions]) for rival in sorted(roughly, key=roughly.get)[:RECOMPUTED]}
    for rival in ACROSS_TRIALS:
        if rival != own and catalogue.shows(base.laboratory, rival):
            exactly[rival] = beyond(_pattern_across_trials(base, rival, absorption.jacobian))
    return min(exactly.items(), key=lambda found: found[1])


@lru_cache
def _standard_patterns(laboratory: Laboratory) -> dict:
    """The patterns of all rivals that act within a trial, in a subject who stands for all."""
    base = base_scenario(STANDARD_SUBJECT, laboratory)
    return {rival: _pattern_within_trials(base, rival) for rival in catalogue.MECHANISMS
            if rival not in NO_RIVAL + ACROSS_TRIALS and catalogue.shows(laboratory, rival)}


def _pattern_within_trials(base, rival):
    """What `rival` does to the torque of one trial of each condition."""
    first = np.unique(condition_of(base), return_index=True)[1]
    ramp = replace(base.ramp, velocity_rad_s=base.ramp.velocity_rad_s[first])
    torque, predicted, _ = _responses(replace(base, trials=some(base.trials, first), ramp=ramp), [rival], 1.0, by=())
    return torque - predicted


def _pattern_across_trials(base, rival, jacobian):
    """What `rival` does to the torque of every trial through k_srs."""
    changed = base_scenario(base.seed, base.laboratory)
    catalogue.hide(changed, rival, 1.0)
    return jacobian[..., FREE.index("k_srs")] * (changed.trials.k_srs / base.trials.k_srs - 1)[:, None]
