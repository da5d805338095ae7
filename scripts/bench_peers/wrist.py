"""Eq. 1-7 with classical Runge-Kutta in numba, plain and with the six forward sensitivities, as one would write it by hand.

Same equations, same steps, same cubic motion between two samples, same filter as ours; fastmath lets the compiler do what
it likes with the rounding.
"""

import numpy as np
from numba import njit

COMPILED = {"fastmath": True, "error_model": "numpy", "cache": False}
STATES = 4
SLOPES = 6


@njit(inline="always")
def softplus(x):
    return x + np.log1p(np.exp(-x)) if x > 0.0 else np.log1p(np.exp(x))


@njit(inline="always")
def logistic(x):
    return 1.0 / (1.0 + np.exp(-x)) if x > 0.0 else 1.0 - 1.0 / (1.0 + np.exp(x))


@njit(inline="always")
def motor(theta, omega, sample, u, period):
    """The cubic through angle and speed at both samples."""
    rise = theta[sample + 1] - theta[sample]
    start, end = period * omega[sample], period * omega[sample + 1]
    square, cube = 3.0 * rise - 2.0 * start - end, start + end - 2.0 * rise
    angle = theta[sample] + u * (start + u * (square + u * cube))
    return angle, (start + u * (2.0 * square + 3.0 * u * cube)) / period


@njit(inline="always")
def rates(y, dy, p, at_rest, lever, fixed, theta_m, omega_m):
    """Rates of the four states; returns T_l."""
    theta_l, omega_l, theta_j, omega_j = y[0], y[1], y[2], y[3]
    smoothness = fixed[1]
    t_l = lever[1] * (omega_m - omega_l) + lever[2] * (theta_m - theta_l)
    t_h = p[1] * (omega_l - omega_j) + p[2] * (theta_l - theta_j)
    loss = (softplus(smoothness * p[4] * (theta_j - p[5])) - at_rest) / smoothness
    t_j = fixed[0] * omega_j + p[3] * theta_j - loss
    dy[0], dy[1] = omega_l, (t_l - t_h) / lever[0]
    dy[2], dy[3] = omega_j, (t_h - t_j) / p[0]
    return t_l


@njit(inline="always")
def rates_of_slopes(y, dy, p, lever, fixed, dt_l):
    """Rates of the sensitivities, by the chain rule; leaves those of T_l in `dt_l`."""
    theta_l, omega_l, theta_j, omega_j = y[0], y[1], y[2], y[3]
    smoothness, inverse = fixed[1], 1.0 / p[0]
    beyond = logistic(smoothness * p[4] * (theta_j - p[5]))
    resting = logistic(-smoothness * p[4] * p[5])
    stiffness = p[3] - beyond * p[4]
    for k in range(SLOPES):
        s = STATES + STATES * k
        dt_l[k] = -lever[1] * y[s + 1] - lever[2] * y[s]
        dt_h = p[1] * (y[s + 1] - y[s + 3]) + p[2] * (y[s] - y[s + 2])
        dt_j = fixed[0] * y[s + 3] + stiffness * y[s + 2]
        if k == 1:
            dt_h += omega_l - omega_j
        elif k == 2:
            dt_h += theta_l - theta_j
        elif k == 3:
            dt_j += theta_j
        elif k == 4:
            dt_j -= beyond * (theta_j - p[5]) + resting * p[5]
        elif k == 5:
            dt_j -= p[4] * (resting - beyond)
        dy[s], dy[s + 1] = y[s + 1], (dt_l[k] - dt_h) / lever[0]
        dy[s + 2], dy[s + 3] = y[s + 3], (dt_h - dt_j) * inverse
        if k == 0:
            dy[s + 3] -= dy[3] * inverse


@njit(inline="always")
def filtered(sections, memory, x):
    for i in range(sections.shape[0]):
        y = sections[i, 0] * x + memory[i, 0]
        memory[i, 0] = sections[i, 1] * x - sections[i, 3] * y + memory[i, 1]
        memory[i, 1] = sections[i, 2] * x - sections[i, 4] * y
        x = y
    return x


@njit(**COMPILED)
def simulate(theta, omega, p, lever, fixed, sections, period, lead, substeps, torque):
    """Filtered T_l of the window into `torque`."""
    y, begin, sum_ = np.zeros(STATES), np.zeros(STATES), np.zeros(STATES)
    dy = np.zeros(STATES)
    memory = np.zeros((sections.shape[0], 2))
    at_rest = softplus(-fixed[1] * p[4] * p[5])
    step = period / substeps
    for sample in range(lead + torque.shape[0]):
        for substep in range(substeps):
            begin[:] = y
            sum_[:] = y
            for stage in range(4):
                u = (substep + (0.0, 0.5, 0.5, 1.0)[stage]) / substeps
                theta_m, omega_m = motor(theta, omega, sample, u, period)
                t_l = rates(y, dy, p, at_rest, lever, fixed, theta_m, omega_m)
                if substep == 0 and stage == 0:
                    t = filtered(sections, memory, t_l)
                    if sample >= lead:
                        torque[sample - lead] = t
                weight, ahead = step * (1.0, 2.0, 2.0, 1.0)[stage] / 6.0, step * (0.5, 0.5, 1.0, 0.0)[stage]
                for i in range(STATES):
                    sum_[i] += weight * dy[i]
                    y[i] = begin[i] + ahead * dy[i]
            y[:] = sum_


@njit(**COMPILED)
def simulate_with_slopes(theta, omega, p, lever, fixed, sections, period, lead, substeps, torque, slopes):
    """The same, and its derivatives by the six parameters into `slopes` (samples by six)."""
    size = STATES * (1 + SLOPES)
    y, begin, sum_, dy = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    dt_l = np.zeros(SLOPES)
    memory = np.zeros((1 + SLOPES, sections.shape[0], 2))
    at_rest = softplus(-fixed[1] * p[4] * p[5])
    step = period / substeps
    for sample in range(lead + torque.shape[0]):
        for substep in range(substeps):
            begin[:] = y
            sum_[:] = y
            for stage in range(4):
                u = (substep + (0.0, 0.5, 0.5, 1.0)[stage]) / substeps
                theta_m, omega_m = motor(theta, omega, sample, u, period)
                t_l = rates(y, dy, p, at_rest, lever, fixed, theta_m, omega_m)
                rates_of_slopes(y, dy, p, lever, fixed, dt_l)
                if substep == 0 and stage == 0:
                    t = filtered(sections, memory[SLOPES], t_l)
                    for k in range(SLOPES):
                        slope = filtered(sections, memory[k], dt_l[k])
                        if sample >= lead:
                            slopes[sample - lead, k] = slope
                    if sample >= lead:
                        torque[sample - lead] = t
                weight, ahead = step * (1.0, 2.0, 2.0, 1.0)[stage] / 6.0, step * (0.5, 0.5, 1.0, 0.0)[stage]
                for i in range(size):
                    sum_[i] += weight * dy[i]
                    y[i] = begin[i] + ahead * dy[i]
            y[:] = sum_


@njit(**COMPILED)
def simulate_all(theta, omega, p, lever, fixed, sections, period, lead, substeps, torque):
    """Every trial in one call."""
    for trial in range(torque.shape[0]):
        simulate(theta[trial], omega[trial], p[trial], lever, fixed, sections, period, lead, substeps, torque[trial])


@njit(**COMPILED)
def simulate_all_with_slopes(theta, omega, p, lever, fixed, sections, period, lead, substeps, torque, slopes):
    """Every trial with its derivatives in one call."""
    for trial in range(torque.shape[0]):
        simulate_with_slopes(
            theta[trial], omega[trial], p[trial], lever, fixed, sections, period, lead, substeps, torque[trial], slopes[trial]
        )
