"""Eq. 1-7 as a plain script has them: a right-hand side in Python, solve_ivp, and the filter from scipy.

Steps and tolerances are the fastest of those tried with which finite differences lead to the optimum at all. With RK45 at
rtol 1e-6 or 1e-8, or with scipy's own step of the differences, the solver's choice of steps drowns the derivatives.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import sosfilt

METHOD, RTOL, ATOL = "LSODA", 1e-9, 1e-12
DIFFERENCE = 1e-4


def log1p_exp(x):
    return x + math.log1p(math.exp(-x)) if x > 0.0 else math.log1p(math.exp(x))


def simulate(windows, theta, omega, p):
    """Filtered T_l of the window."""
    period, last = windows.period_s, len(theta) - 2
    (i_l, b_l, k_l), (b_j, smoothness) = windows.lever.tolist(), windows.fixed.tolist()
    i_j, b_h, k_h, k_srs, k_dec, x_e = p.tolist()
    theta_list, omega_list = theta.tolist(), omega.tolist()
    at_rest = log1p_exp(-smoothness * k_dec * x_e)

    def motor(t):
        sample = min(max(int(t / period), 0), last)
        u = t / period - sample
        rise = theta_list[sample + 1] - theta_list[sample]
        start, end = period * omega_list[sample], period * omega_list[sample + 1]
        square, cube = 3.0 * rise - 2.0 * start - end, start + end - 2.0 * rise
        angle = theta_list[sample] + u * (start + u * (square + u * cube))
        return angle, (start + u * (2.0 * square + 3.0 * u * cube)) / period

    def rates(t, y):
        theta_l, omega_l, theta_j, omega_j = y.tolist()
        theta_m, omega_m = motor(t)
        t_l = b_l * (omega_m - omega_l) + k_l * (theta_m - theta_l)
        t_h = b_h * (omega_l - omega_j) + k_h * (theta_l - theta_j)
        loss = (log1p_exp(smoothness * k_dec * (theta_j - x_e)) - at_rest) / smoothness
        t_j = b_j * omega_j + k_srs * theta_j - loss
        return [omega_l, (t_l - t_h) / i_l, omega_j, (t_h - t_j) / i_j]

    times = np.arange(last + 1) * period
    moved = solve_ivp(rates, (0.0, times[-1]), np.zeros(4), t_eval=times, method=METHOD, rtol=RTOL, atol=ATOL)
    t_l = b_l * (omega[:-1] - moved.y[1]) + k_l * (theta[:-1] - moved.y[0])
    sos = [[*b, 1.0, *a] for b, a in ((s[:3], s[3:]) for s in windows.sections)]
    return sosfilt(sos, t_l)[windows.lead :]
