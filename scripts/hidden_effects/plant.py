"""The wrist at the motor: Eq. 1-7 for all trials of a session at once, solved by an adaptive Dormand-Prince 8(5,3).

All angles and torques are changes from the hold. Mechanisms enter as `Force`s on the joint or the lever, as another
interface spring, or as another elastic law; with none of them this is the base model.
"""

from dataclasses import dataclass, field
from typing import Callable

import numpy as np
from scipy.integrate import solve_ivp

SMOOTHNESS_PER_NM = 100.0  # a_s of Eq. 2
JOINT_DAMPING_NM_S_PER_RAD = 1e-5  # b_j of Eq. 7
FINE_HZ = 10_000
START_S, END_S = -0.06, 0.2
SEGMENT_S = 0.01  # shorter than any reflex latency, so that what is delayed is already known


def eq2(theta, p):
    """T_j,elas of Eq. 2."""
    return p.k_srs * theta - np.logaddexp(0.0, SMOOTHNESS_PER_NM * p.k_dec * (theta - p.x_e)) / SMOOTHNESS_PER_NM


def linear_interface(deflection, p):
    return p.k_h * deflection


@dataclass
class Force:
    """A torque that resists a positive angle of the `joint` or the `lever`, or a deflection of the `interface`.

    `law(t, theta, speed, states, past)` returns the torque and the rates of its own states. `theta` is the angle of the joint
    or the lever, or the deflection; `past(t)` is the speed the joint had at an earlier time.
    """

    law: Callable
    states: int = 0
    on: str = "joint"


@dataclass
class Plant:
    trials: object
    lever: dict | None  # None: the handle follows the motor, and the torque is measured there
    command: Callable  # motor command at time t, for every trial
    servo: object
    elastic: Callable = eq2
    interface: Callable = linear_interface
    forces: list = field(default_factory=list)
    motor: Callable | None = None  # where given, (angle, speed) of the motor at t instead of the servo


@dataclass
class Motion:
    """On the fine grid from START_S to END_S; arrays are trials x times."""

    t_s: np.ndarray
    theta_m: np.ndarray
    theta_l: np.ndarray
    theta_j: np.ndarray
    speed_m: np.ndarray
    speed_j: np.ndarray
    torque_l: np.ndarray


def simulate(plant: Plant, end_s: float = END_S) -> Motion:
    p, n = plant.trials, len(plant.trials)
    size = 6 + sum(f.states for f in plant.forces)
    steps = round(SEGMENT_S * FINE_HZ)
    times = np.arange(round(START_S * FINE_HZ), round(end_s * FINE_HZ) + 1) / FINE_HZ
    kept = np.zeros((len(times), size, n))
    known = 0

    def past(t):
        at = (t - START_S) * FINE_HZ
        if at <= 0:
            return np.zeros(n)
        i = min(max(int(at), 1), known - 2)
        u = at - i
        a, b, c, d = kept[i - 1:i + 3, 5]  # Catmull-Rom: without kinks the solver keeps its long steps
        return b + 0.5 * u * (c - a + u * (2 * a - 5 * b + 4 * c - d + u * (3 * (b - c) + d - a)))

    def motor(t, y):
        return (y[0], y[1]) if plant.motor is None else plant.motor(t)

    def torques(t, y):
        """Torques on the lever, between handle and hand, in the joint and on the handle itself; rates of the forces' states."""
        theta_m, speed_m = motor(t, y)
        theta_l, speed_l, theta_j, speed_j = y[2:6] if plant.lever else (theta_m, speed_m, y[4], y[5])
        torque_h = p.b_h * (speed_l - speed_j) + plant.interface(theta_l - theta_j, p)  # Eq. 6
        torque_j = JOINT_DAMPING_NM_S_PER_RAD * speed_j + plant.elastic(theta_j, p)  # Eq. 7
        seen = {"joint": (theta_j, speed_j), "lever": (theta_l, speed_l), "interface": (theta_l - theta_j, speed_l - speed_j)}
        on_lever, used, changes = 0.0, 6, []
        for f in plant.forces:
            torque, change = f.law(t, *seen[f.on], y[used:used + f.states], past)
            changes.append(change)
            used += f.states
            if f.on == "joint":
                torque_j = torque_j + torque
            elif f.on == "interface":
                torque_h = torque_h + torque
            else:
                on_lever = on_lever + torque
        if plant.lever:
            torque_l = lever_torque(plant.lever, theta_m, speed_m, theta_l, speed_l)  # Eq. 5
        else:
            torque_l = torque_h + on_lever
        return torque_l, torque_h, torque_j, on_lever, changes

    def rates(t, flat):
        y = flat.reshape(size, n)
        out = np.empty_like(y)
        torque_l, torque_h, torque_j, on_lever, changes = torques(t, y)
        out[0] = y[1]
        out[1] = plant.servo.acceleration(plant.command(t), y[0], y[1], torque_l) if plant.motor is None else 0.0
        if plant.lever:
            out[2] = y[3]
            out[3] = (torque_l - torque_h - on_lever) / plant.lever["inertia_kg_m2"]  # Eq. 3
        else:
            out[2:4] = 0.0
        out[4] = y[5]
        out[5] = (torque_h - torque_j) / p.i_j  # Eq. 4
        used = 6
        for f, change in zip(plant.forces, changes):
            if f.states:
                out[used:used + f.states] = change
            used += f.states
        return out.ravel()

    while known < len(times) - 1:
        end = min(known + steps, len(times) - 1)
        span = times[known:end + 1]
        solved = solve_ivp(rates, (span[0], span[-1]), kept[known].ravel(), method="DOP853", t_eval=span,
                           rtol=1e-7, atol=1e-10, first_step=5e-4)
        if not solved.success:
            raise RuntimeError(f"the plant could not be integrated at {span[0]:.3f} s: {solved.message}")
        kept[known + 1:end + 1] = solved.y.T.reshape(-1, size, n)[1:]
        known = end

    y = kept.transpose(1, 2, 0)
    if plant.motor is None:
        theta_m, speed_m = y[0], y[1]
    else:
        theta_m, speed_m = (np.stack(a, axis=1) for a in zip(*(plant.motor(t) for t in times)))
    if plant.lever:
        each_trial = {name: np.reshape(value, (-1, 1)) for name, value in plant.lever.items()}
        torque = lever_torque(each_trial, theta_m, speed_m, y[2], y[3])
        return Motion(times, theta_m, y[2], y[4], speed_m, y[5], torque)
    torque = np.stack([torques(t, now)[0] for t, now in zip(times, kept)], axis=1)
    return Motion(times, theta_m, theta_m, y[4], speed_m, y[5], torque)


def lever_torque(lever, theta_m, speed_m, theta_l, speed_l):
    """Eq. 5. A constant of the lever is a number, or has an entry per trial. The damper of a rig as it is grows a little with speed."""
    growth = lever.get("damping_growth_s_per_rad")
    damping = lever["damping_nm_s_per_rad"] * (1.0 if growth is None else 1.0 + growth * np.abs(speed_m - speed_l))
    return damping * (speed_m - speed_l) + lever["stiffness_nm_per_rad"] * (theta_m - theta_l)


def gamma_reflex(gain_nm_s_per_rad, latency_s, mean_delay_s):
    """Delayed, rectified stretch speed through a gamma-shaped kernel of order 2."""
    tau = mean_delay_s / 2

    def law(t, theta, speed, z, past):
        drive = np.maximum(past(t - latency_s), 0.0)
        return gain_nm_s_per_rad * z[1], np.stack([(drive - z[0]) / tau, (z[0] - z[1]) / tau])

    return Force(law, states=2)
