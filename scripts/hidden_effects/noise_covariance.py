"""The covariance of a trial's torque within the analysis window, from what the generator knows of its noise.

Every torque counts from the mean of the last 20 ms of the hold. The gate's selection of quiet holds is left out.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import toeplitz
from scipy.signal import cont2discrete, dlsim

from . import noise
from .plant import FINE_HZ
from .scenario import Scenario

BASELINE_S = 0.02


def torque_covariance(s: Scenario, torque_nm: float, samples: int) -> np.ndarray:
    """Wander, tremor and gauge noise at one target torque, samples x samples."""
    hz = s.laboratory.sample_hz
    before = round(BASELINE_S * hz)
    lag_s = np.arange(before + samples) / hz
    covariance = toeplitz(torque_nm**2 * _unsteadiness(s, lag_s) + s.person.gauge_noise_nm**2 * _gauge(s, len(lag_s)))
    change = np.hstack([np.full((samples, before), -1 / before), np.eye(samples)])
    return change @ covariance @ change.T


def _unsteadiness(s, lag_s):
    low, high = noise.WANDER_HZ
    wander = (high * np.sinc(2 * high * lag_s) - low * np.sinc(2 * low * lag_s)) / (high - low)
    spread = np.exp(-0.5 * (2 * np.pi * noise.TREMOR_SPREAD_HZ * lag_s) ** 2)
    tremor = np.cos(2 * np.pi * s.person.tremor_hz * lag_s) * spread
    return s.person.wander**2 * wander + s.person.tremor**2 * tremor


def _gauge(s, n):
    """Autocorrelation of the gauge's noise: that of an impulse sent through its spectrum."""
    length = s.laboratory.sample_hz  # 1 s, about the longest trial
    impulse = np.zeros((1, length))
    impulse[0, 0] = 1.0
    shaped = noise.SPECTRA[s.laboratory.gauge_spectrum](impulse, s.laboratory.sample_hz)
    return np.fft.irfft(np.abs(np.fft.rfft(shaped[0])) ** 2, length)[:n]


def encoder_covariance(s: Scenario, samples: int) -> np.ndarray:
    """What the encoder's steps, from the onset on, are worth in the torque predicted from the recorded angle.

    Steps count as white and uniform; the angle of the hold, from which all angles count, is off by part of a step too. The response is
    that of the unyielding wrist of the session's mean parameters.
    """
    step_rad = 2 * np.pi / s.laboratory.encoder_counts
    response, centre = _torque_of_one_sample(s, samples)
    late = np.arange(samples)[:, None] - np.arange(samples)[None, :]  # sample of the torque less that of the angle
    spread = np.where(late > -centre, response[np.clip(late + centre, 0, len(response) - 1)], 0.0)
    of_hold = spread.sum(axis=1)
    return step_rad**2 / 12 * (spread @ spread.T + np.outer(of_hold, of_hold))


def _torque_of_one_sample(s, samples):
    """Torque, at the laboratory's rate, of a spline through angles that are 1 at the sample `centre` and 0 elsewhere."""
    fine, centre = FINE_HZ // s.laboratory.sample_hz, 12
    count = samples + 2 * centre
    angle = CubicSpline(np.arange(count), np.eye(count)[centre])
    at = np.arange((count - 1) * fine + 1) / fine
    motor = np.column_stack([angle(at), angle(at, 1) * s.laboratory.sample_hz])
    system = cont2discrete([np.array(m) for m in _linear_wrist(s)], 1 / FINE_HZ, method="foh")
    return dlsim(system, motor)[1][::fine, 0], centre


def _linear_wrist(s):
    """Eq. 3-7 below the elastic limit as a state space from the motor's angle and speed to the measured torque."""
    i_j, b, k, k_srs = (np.mean(getattr(s.trials, name)) for name in ("i_j", "b_h", "k_h", "k_srs"))
    if s.laboratory.lever is None:
        return ([[0, 1], [-(k + k_srs) / i_j, -b / i_j]], [[0, 0], [k / i_j, b / i_j]], [[-k, -b]], [[k, b]])
    own = s.laboratory.own_lever()
    i_l, b_l, k_l = own["inertia_kg_m2"], own["damping_nm_s_per_rad"], own["stiffness_nm_per_rad"]
    return ([[0, 1, 0, 0], [-(k_l + k) / i_l, -(b_l + b) / i_l, k / i_l, b / i_l],
             [0, 0, 0, 1], [k / i_j, b / i_j, -(k + k_srs) / i_j, -b / i_j]],
            [[0, 0], [k_l / i_l, b_l / i_l], [0, 0], [0, 0]], [[-k_l, -b_l, 0, 0]], [[k_l, b_l]])
