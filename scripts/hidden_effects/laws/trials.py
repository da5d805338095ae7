"""Mechanisms that leave a trial alone and differ from trial to trial."""

import numpy as np
from scipy.optimize import least_squares

from ..scenario import SIZES
from .law import law


@law("fatigue", "exponential", "k_srs (1 - f (1 - exp(-1.2 order)) / (1 - exp(-1.2)))", "assumed")
def exponential_fatigue(s, size, rng):
    done = -np.expm1(-1.2 * s.trials.order()) / -np.expm1(-1.2)
    return _tire(s, size * SIZES["fatigue"]["fraction"], done, "k_srs falls exponentially with order, by this fraction at the last trial")


@law("fatigue", "linear", "k_srs (1 - f order)", "assumed")
def linear_fatigue(s, size, rng):
    return _tire(s, size * SIZES["fatigue@linear"]["fraction"], s.trials.order(), "k_srs falls linearly with order")


@law("fatigue", "recovering", "k_srs (1 - f F / F_last), F grows with each trial's torque and fades over the rests",
     "compartments of motor units, Xia and Frey Law 2008, reduced to one; the rate is assumed")
def recovering_fatigue(s, size, rng):
    t, level, tired = s.trials, [], 0.0
    for torque, rest in zip(t.torque_nm, t.rest_s):
        tired *= np.exp(-rest / 120.0)
        level.append(tired)
        tired += torque
    done = np.array(level) / max(max(level), 1e-9)
    return _tire(s, size * SIZES["fatigue@recovering"]["fraction"], done, "recovers in the rests, by this fraction at the most tired trial",
                 ["fraction"])


def _tire(s, fraction, done, note, nominal=()):
    s.trials.k_srs *= 1 - fraction * done
    return {"fraction": fraction}, list(nominal), note


@law("thixotropy", "hyperbolic", "k_srs ~ 1 + 1.55 a r / (r + tau), r the rest", "assumed")
def hyperbolic_thixotropy(s, size, rng):
    d = SIZES["thixotropy"]
    amount, tau = size * d["amount"], d["time_constant_s"] * rng.uniform(0.9, 1.1)
    return _rested(s, lambda r: 1 + 1.55 * amount * r / (r + tau), amount, tau,
                   "hyperbolic in the rest; the values are the closest k_srs ~ 1 - amount exp(-rest/time_constant) over 3-12 s")


@law("thixotropy", "exponential", "k_srs ~ 1 - a exp(-r / tau)", "Lakie et al. 1984")
def exponential_thixotropy(s, size, rng):
    d = SIZES["thixotropy@exponential"]
    amount, tau = size * d["amount"], d["time_constant_s"] * rng.uniform(0.9, 1.1)
    s.trials.k_srs *= _recovery(amount, tau, s.trials.rest_s)
    return {"amount": amount, "time_constant_s": tau}, [], "exponential in the rest"


@law("thixotropy", "power", "k_srs ~ r^p", "assumed: recovery over a wide range of rests")
def power_thixotropy(s, size, rng):
    power = size * SIZES["thixotropy@power"]["power"]
    return _rested(s, lambda r: r**power, 0.4, 5.0, "a power of the rest; the values are the closest exponential over 3-12 s")


@law("thixotropy", "previous_size", "k_srs ~ 1 - a (v / v_mean)_previous exp(-r / tau)", "Campbell and Lakie 1998: a larger movement softens more; assumed form")
def previous_thixotropy(s, size, rng):
    d = SIZES["thixotropy@previous_size"]
    amount, tau = size * d["amount"], d["time_constant_s"] * rng.uniform(0.9, 1.1)
    v = s.trials.velocity_rad_s
    previous = np.concatenate([[v.mean()], v[:-1]]) / v.mean()
    s.trials.k_srs *= (1 - amount * previous * np.exp(-s.trials.rest_s / tau)) / (1 - amount * np.exp(-6.0 / tau))
    return {"amount": amount, "time_constant_s": tau}, ["amount", "time_constant_s"], \
        "depends on the rest and on the velocity of the trial before"


def _recovery(amount, tau, rest_s):
    """Relative to a rest of 6 s."""
    return (1 - amount * np.exp(-rest_s / tau)) / (1 - amount * np.exp(-6.0 / tau))


def _rested(s, stiffness, amount, tau, note):
    s.trials.k_srs *= stiffness(s.trials.rest_s) / stiffness(6.0)
    r = np.linspace(3, 12, 40)
    fit = least_squares(lambda q: _recovery(*q, r) - stiffness(r) / stiffness(6.0), [amount, tau]).x
    return {"amount": float(fit[0]), "time_constant_s": float(fit[1])}, ["amount", "time_constant_s"], note


@law("cocontraction", "saturating", "k_srs += c e / (1 + e / 0.6), e the ECR EMG in MVC", "assumed")
def saturating_cocontraction(s, size, rng):
    c = size * SIZES["cocontraction"]["stiffness_nm_per_rad_per_mvc"]
    full = 0.6  # MVC at which the antagonist's stiffness is half used up
    mean = np.mean(s.trials.emg_ecr_mvc)
    return _stiffen(s, c, lambda e: c * (1 + mean / full) ** 2 * e / (1 + e / full),
                    "saturating in ECR EMG; the value is the slope at its mean")


@law("cocontraction", "linear", "k_srs += c e", "Hunter and Kearney 1982: stiffness in proportion to torque, here to EMG")
def linear_cocontraction(s, size, rng):
    c = size * SIZES["cocontraction@linear"]["stiffness_nm_per_rad_per_mvc"]
    return _stiffen(s, c, lambda e: c * e, "linear in ECR EMG")


@law("cocontraction", "quadratic", "k_srs += c e^2 / (2 e_mean)", "assumed: stiffness grows faster than EMG")
def quadratic_cocontraction(s, size, rng):
    c = size * SIZES["cocontraction@quadratic"]["stiffness_nm_per_rad_per_mvc"]
    mean = np.mean(s.trials.emg_ecr_mvc)
    return _stiffen(s, c, lambda e: c * e**2 / (2 * mean), "quadratic in ECR EMG; the value is the slope at its mean", ["stiffness_nm_per_rad_per_mvc"])


def _stiffen(s, c, stiffness, note, nominal=()):
    e = s.trials.emg_ecr_mvc
    s.trials.k_srs += stiffness(e) - stiffness(np.mean(e))
    return {"stiffness_nm_per_rad_per_mvc": c}, list(nominal), note


@law("outlier_trial", "both", "k_srs and x_e of two trials differ", "assumed: the handle squeezed or let go")
def both(s, size, rng):
    d = SIZES["outlier_trial"]
    return _outliers(s, d, size, rng, (("k_srs", 1.0), ("x_e", 0.6)), "another k_srs and x_e, as after squeezing or letting go of the handle")


@law("outlier_trial", "stiffness", "k_srs of two trials differs", "assumed")
def stiffness_only(s, size, rng):
    return _outliers(s, SIZES["outlier_trial@stiffness"], size, rng, (("k_srs", 1.0),), "another k_srs")


@law("outlier_trial", "yielding", "k_dec and x_e of two trials differ", "assumed: a twitch before the ramp")
def yielding(s, size, rng):
    return _outliers(s, SIZES["outlier_trial@yielding"], size, rng, (("k_dec", 1.0), ("x_e", 0.6)), "another k_dec and x_e")


def _outliers(s, d, size, rng, shares, note):
    n = len(s.trials)
    odd = np.sort(rng.choice(np.arange(2, n), d["count"], replace=False))
    part = size * d["fraction"]
    for name, share in shares:
        getattr(s.trials, name)[odd] *= 1 + share * part * rng.choice([-1, 1], len(odd))
    return {"trials": [int(i) + 1 for i in odd]}, [], note


@law("activation_scaling", "power", "k_srs ~ EMG^p within and between conditions", "assumed")
def power_scaling(s, size, rng):
    power, slope, expected = _activation(s, size)
    s.trials.k_srs *= (s.trials.emg_fcr_mvc / expected) ** power
    return _slope(slope, f"k_srs ~ EMG^{power:.3f} within and between conditions; slope is dk_srs/dEMG at 1.5 N m, in N m/rad per MVC")


@law("activation_scaling", "linear", "k_srs += slope (EMG - EMG expected of the torque)", "assumed")
def linear_scaling(s, size, rng):
    _, slope, expected = _activation(s, size)
    s.trials.k_srs += slope * (s.trials.emg_fcr_mvc - expected)
    return _slope(slope, "linear in FCR EMG", [])


@law("activation_scaling", "saturating", "k_srs += slope e_0 tanh((EMG - EMG expected) / e_0), e_0 = 0.05 MVC", "assumed")
def saturating_scaling(s, size, rng):
    _, slope, expected = _activation(s, size)
    s.trials.k_srs += slope * 0.05 * np.tanh((s.trials.emg_fcr_mvc - expected) / 0.05)
    return _slope(slope, "levels off at 0.05 MVC from what the torque asks")


def _activation(s, size):
    """The power that ties k_srs to the EMG as to the torque, its slope in the middle, and the EMG that each trial's torque asks."""
    e = s.person.emg
    asked = lambda torque_nm: e["fcr_rest"] + e["fcr_per_nm"] * torque_nm
    ends = asked(np.array([0.9, 2.1]))
    k_ends = s.person.k_srs(np.array([0.9, 2.1]))
    power = size * np.log(k_ends[1] / k_ends[0]) / np.log(ends[1] / ends[0])
    return power, power * s.person.k_srs(1.5) / asked(1.5), asked(s.trials.torque_nm)


def _slope(slope, note, nominal=("slope_nm_per_rad_per_mvc",)):
    return {"slope_nm_per_rad_per_mvc": float(slope)}, list(nominal), note
