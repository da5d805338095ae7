"""Motor, lever and handle with a load, without a person.

The linear part is discretised exactly, per trial, for inputs that are straight within a step (van Loan 1978); what is not linear
(friction, a damper that grows with speed, forces on the handle) enters as an input, predicted and corrected once.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from ..plant import FINE_HZ, Force
from .loads import RigTrial


@dataclass
class RigMotion:
    """On the fine grid, trials x times; angles from the start position, the torque in the lever absolute."""

    t_s: np.ndarray
    theta_m: np.ndarray
    speed_m: np.ndarray
    theta_l: np.ndarray
    torque_l: np.ndarray


# Entries of the state and of the input.
THETA_M, SPEED_M, THETA_L, SPEED_L = range(4)
COMMAND, ON_HANDLE, IN_LEVER = range(3)


def simulate(trials: list[RigTrial], lever: dict | None, servo, command: np.ndarray, t_s: np.ndarray, forces: list[Force]) -> RigMotion:
    """`command` is trials x times. A constant of the lever is a number, or has an entry per trial. Forces on the handle alone count."""
    n, count = command.shape
    systems = [linear_system(trial, _of_trial(lever, i), servo) for i, trial in enumerate(trials)]
    a, b, from_state, from_input = (np.stack(part) for part in zip(*systems))
    steps = [_discretised(a[i], b[i]) for i in range(n)]
    onward, at_start, at_end = (np.stack(part) for part in zip(*steps))
    load = np.array([t.true_torque_nm for t in trials])
    growth = np.broadcast_to(_growth(lever), n)
    damping = np.broadcast_to(0.0 if lever is None else lever["damping_nm_s_per_rad"], n)
    forces = [f for f in forces if f.on == "lever"]
    used = np.cumsum([0] + [f.states for f in forces])

    def resisting(t, x, z):
        """Torque on the handle and the part of the damper's that is not linear; rates of the forces' own states."""
        on_handle, rates = load, np.zeros_like(z)
        for f, first, last in zip(forces, used, used[1:]):
            torque, change = f.law(t, x[:, THETA_L], x[:, SPEED_L], z[first:last], None)
            on_handle = on_handle + torque
            if f.states:
                rates[first:last] = change
        speed = x[:, SPEED_M] - x[:, SPEED_L]
        return on_handle, damping * growth * np.abs(speed) * speed, rates

    def inputs(now, on_handle, in_lever):
        return np.stack([command[:, now], on_handle, in_lever], axis=1)

    u = inputs(0, load, np.zeros(n))
    x = np.stack([np.linalg.lstsq(a[i], -b[i] @ u[i], rcond=None)[0] for i in range(n)])  # the load hangs before the trial begins
    z = np.zeros((used[-1], n))
    kept, torque = np.empty((count, n, 4)), np.empty((count, n))
    apply = lambda matrix, vector: np.einsum("nij,nj->ni", matrix, vector)
    for k in range(count):
        kept[k] = x
        torque[k] = np.einsum("nj,nj->n", from_state, x) + np.einsum("nj,nj->n", from_input, u)
        if k == count - 1:
            break
        _, _, rates = resisting(t_s[k], x, z)
        begun = apply(onward, x) + apply(at_start, u)
        later_z = z + rates / FINE_HZ
        guess = begun + apply(at_end, inputs(k + 1, u[:, ON_HANDLE], u[:, IN_LEVER]))
        on_handle, in_lever, later_rates = resisting(t_s[k + 1], guess, later_z)
        z = z + 0.5 / FINE_HZ * (rates + later_rates)
        u = inputs(k + 1, on_handle, in_lever)
        x = begun + apply(at_end, u)
    kept = kept.transpose(2, 1, 0)
    return RigMotion(t_s, kept[THETA_M], kept[SPEED_M], kept[THETA_L], torque.T)


def linear_system(trial: RigTrial, lever: dict | None, servo):
    """State and input matrix, and the rows that give the lever's torque from state and input."""
    of_command, of_angle, of_speed, of_torque = (servo.acceleration(*unit) for unit in np.eye(4))
    if lever is None:
        return _rigid(trial, of_command, of_angle, of_speed, of_torque)
    k, damping, inertia = (lever[name] for name in ("stiffness_nm_per_rad", "damping_nm_s_per_rad", "inertia_kg_m2"))
    from_state, from_input = np.array([k, damping, -k, -damping]), np.array([0.0, 0.0, 1.0])  # Eq. 5
    a, b = np.zeros((4, 4)), np.zeros((4, 3))
    a[THETA_M, SPEED_M] = 1.0
    a[SPEED_M] = of_torque * from_state
    a[SPEED_M, THETA_M] += of_angle
    a[SPEED_M, SPEED_M] += of_speed
    b[SPEED_M] = of_torque * from_input
    b[SPEED_M, COMMAND] += of_command
    if trial.load != "clamped_handle":
        moved = inertia + trial.true_inertia_kg_m2
        a[THETA_L, SPEED_L] = 1.0
        a[SPEED_L] = from_state / moved  # Eq. 3 with the load in place of the hand
        a[SPEED_L, THETA_L] -= trial.true_stiffness_nm_per_rad / moved
        b[SPEED_L] = from_input / moved
        b[SPEED_L, ON_HANDLE] -= 1 / moved
    return a, b, from_state, from_input


def _rigid(trial, of_command, of_angle, of_speed, of_torque):
    """The handle follows the motor, and what is beyond the sensor is the load alone."""
    if trial.load == "clamped_handle":
        raise ValueError("a rigid handle cannot be clamped: the motor would stand still")
    inertia, stiffness = trial.true_inertia_kg_m2, trial.true_stiffness_nm_per_rad
    own = 1 - of_torque * inertia  # the load's inertia droops the motor too
    acceleration = np.array([of_angle + of_torque * stiffness, of_speed, 0.0, 0.0]) / own
    by_input = np.array([of_command, of_torque, 0.0]) / own
    a, b = np.zeros((4, 4)), np.zeros((4, 3))
    a[[THETA_M, THETA_L], SPEED_M] = 1.0
    a[[SPEED_M, SPEED_L]] = acceleration
    b[[SPEED_M, SPEED_L]] = by_input
    from_state, from_input = inertia * acceleration, inertia * by_input
    from_state[THETA_M] += stiffness
    from_input[ON_HANDLE] += 1.0
    return a, b, from_state, from_input


def _discretised(a, b):
    """x(k+1) = onward x(k) + at_start u(k) + at_end u(k+1)."""
    n, m, h = *b.shape, 1 / FINE_HZ
    block = np.zeros((n + 2 * m, n + 2 * m))
    block[:n, :n], block[:n, n:n + m] = a * h, b * h
    block[n:n + m, n + m:] = np.eye(m)
    whole = expm(block)
    steady, rising = whole[:n, n:n + m], whole[:n, n + m:]
    return whole[:n, :n], steady - rising, rising


def _of_trial(lever, i):
    if lever is None:
        return None
    return {name: float(value if np.ndim(value) == 0 else np.ravel(value)[i]) for name, value in lever.items()}


def _growth(lever):
    """Relative growth of the damper's torque with the speed of its deflection, in s/rad."""
    return 0.0 if lever is None else lever.get("damping_growth_s_per_rad", 0.0)
