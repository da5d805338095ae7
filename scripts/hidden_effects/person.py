"""Persons, their trials, and the laws that tie the wrist's parameters to velocity and torque.

Numbers and their sources: the parameter table of the design notes (paper 3.2-3.4, or assumed where it is silent).
"""

from dataclasses import dataclass, field

import numpy as np

from .laboratories import Laboratory
from .streams import stream

MIDDLE_VELOCITY_RAD_S = 2.275
MIDDLE_TORQUE_NM = 1.5


@dataclass
class Person:
    i_j_kg_m2: float
    b_h_nm_s_per_rad: float
    k_h_nm_per_rad: float
    k_h_per_velocity: float
    k_srs_scale: float
    k_dec_scale: float
    x_e_middle_rad: float
    x_0_rad: float
    x_e_per_torque: float
    wander: float
    tremor: float
    tremor_hz: float
    gauge_noise_nm: float
    late_reflex: dict
    emg: dict
    servo_bandwidth_hz: float
    ramp_rise_s: float
    start_angle_rad: float

    def k_srs(self, torque_nm):
        return self.k_srs_scale * (15.0 + 8.0 * (torque_nm - 0.9) / 1.2)

    def k_dec(self, velocity_rad_s, torque_nm):
        return self.k_dec_scale * (9.0 + 3.0 * (torque_nm - 0.9) + 1.6 * (velocity_rad_s - 1.3))

    def x_e(self, velocity_rad_s, torque_nm):
        """x_0 + v x_t, a little lower at higher torque. x_0 is never near zero: that is `timed_yield`."""
        slope = (self.x_e_middle_rad - self.x_0_rad) / MIDDLE_VELOCITY_RAD_S
        return (self.x_0_rad + slope * velocity_rad_s) * (1 - self.x_e_per_torque * (torque_nm - MIDDLE_TORQUE_NM))

    def k_h(self, velocity_rad_s):
        return self.k_h_nm_per_rad * (1 - self.k_h_per_velocity * (velocity_rad_s - MIDDLE_VELOCITY_RAD_S))


def draw_person(seed: int) -> Person:
    rng = stream(seed, "person")
    around = lambda middle, spread: middle * np.exp(spread * np.clip(rng.standard_normal(), -2, 2))
    return Person(
        i_j_kg_m2=around(0.005, 0.08),
        b_h_nm_s_per_rad=around(1.2, 0.12),
        k_h_nm_per_rad=around(300.0, 0.10),
        k_h_per_velocity=rng.uniform(0.01, 0.03),
        k_srs_scale=around(1.0, 0.08),
        k_dec_scale=around(1.0, 0.08),
        x_e_middle_rad=around(0.045, 0.03),
        x_0_rad=rng.choice([-1, 1]) * rng.uniform(0.006, 0.009),
        x_e_per_torque=rng.uniform(0.03, 0.07),
        wander=rng.uniform(0.005, 0.007),
        tremor=rng.uniform(0.002, 0.004),
        tremor_hz=rng.uniform(8.7, 10.3),
        gauge_noise_nm=rng.uniform(0.006, 0.020),
        late_reflex={
            "latency_s": rng.uniform(0.043, 0.055),
            "gain_nm_s_per_rad": around(0.2, 0.3),
            "time_constant_s": rng.uniform(0.010, 0.018),
        },
        emg={"fcr_rest": rng.uniform(0.02, 0.05), "fcr_per_nm": around(0.13, 0.15), "ecr": around(0.045, 0.2),
             "burst": around(1.5, 0.3)},
        servo_bandwidth_hz=rng.uniform(80.0, 105.0),
        ramp_rise_s=rng.uniform(0.0155, 0.0165),
        start_angle_rad=rng.uniform(-0.09, -0.05),
    )


@dataclass
class Trials:
    """One array entry per trial, in the order they were run."""

    velocity_rad_s: np.ndarray
    torque_nm: np.ndarray
    repetition: np.ndarray
    rest_s: np.ndarray
    emg_fcr_mvc: np.ndarray
    emg_ecr_mvc: np.ndarray
    i_j: np.ndarray = field(default=None)
    b_h: np.ndarray = field(default=None)
    k_h: np.ndarray = field(default=None)
    k_srs: np.ndarray = field(default=None)
    k_dec: np.ndarray = field(default=None)
    x_e: np.ndarray = field(default=None)

    def __len__(self):
        return len(self.velocity_rad_s)

    def order(self):
        """Position in the session, 0 for the first trial to 1 for the last."""
        return np.arange(len(self)) / (len(self) - 1)


def draw_trials(seed: int, person: Person, laboratory: Laboratory) -> Trials:
    """The random order and every trial's own parameters."""
    rng = stream(seed, "order")
    grid = [(v, t, r + 1) for r in range(laboratory.repetitions) for v in laboratory.velocities_rad_s
            for t in laboratory.torques_nm]
    grid = [grid[i] for i in rng.permutation(len(grid))]
    v, t, r = (np.array(c) for c in zip(*grid))
    n = len(v)

    level = stream(seed, "emg level")
    fcr = (person.emg["fcr_rest"] + person.emg["fcr_per_nm"] * t) * np.exp(0.11 * _clipped(level, n))
    ecr = person.emg["ecr"] * (0.7 + 0.2 * t) * np.exp(0.35 * _clipped(level, n))
    trials = Trials(v, t, _in_order_of_appearance(v, t), rng.uniform(3.0, 12.0, n), fcr, ecr)

    spread = stream(seed, "trial spread")
    vary = lambda fraction: 1 + fraction * _clipped(spread, n)
    trials.i_j = np.full(n, person.i_j_kg_m2)
    trials.b_h = person.b_h_nm_s_per_rad * vary(0.01)
    trials.k_h = person.k_h(v) * vary(0.01)
    trials.k_srs = person.k_srs(t) * vary(0.025)
    trials.k_dec = person.k_dec(v, t) * vary(0.03)
    trials.x_e = person.x_e(v, t) * vary(0.02)
    return trials


def _in_order_of_appearance(v, t):
    seen, out = {}, []
    for key in zip(v, t):
        seen[key] = seen.get(key, 0) + 1
        out.append(seen[key])
    return np.array(out)


def _clipped(rng, n):
    return np.clip(rng.standard_normal(n), -2.5, 2.5)
