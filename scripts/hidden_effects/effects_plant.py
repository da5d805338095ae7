"""The plant's mechanisms of the catalogue, each in a form that is not the obvious one.

Every function changes the scenario and returns its parameters, the names of those that are only nominal, and a note.
`size` multiplies the default of sizes.json; `rng` varies what a person would vary.
"""

import numpy as np
from scipy.optimize import least_squares
from scipy.special import erf

from .plant import Force, gamma_reflex
from .scenario import SIZES


def joint_damping(s, size, rng):
    b = size * SIZES["joint_damping"]["damping_nm_s_per_rad"]
    s.forces.append(Force(lambda t, theta, speed, z, past: (b * speed, None)))
    return {"b_j_nm_s_per_rad": b}, [], "linear, as Eq. 7 has it"


def joint_friction(s, size, rng):
    level = size * SIZES["joint_friction"]["level_nm"]
    presliding_rad = SIZES["joint_friction"]["presliding_rad"]

    def lugre(t, theta, speed, z, past):
        # Bristles of stiffness level / presliding that slip the easier the faster, down to the level (Stribeck).
        slips_at = level * (1 + 0.15 * np.exp(-((speed / 0.3) ** 2)))
        return z[0], (level / presliding_rad * (speed - np.abs(speed) * z[0] / slips_at))[None]

    s.forces.append(Force(lugre, states=1))
    return {"level_nm": level, "presliding_rad": presliding_rad}, ["presliding_rad"], "LuGre friction with a Stribeck drop"


def interface_hardening(s, size, rng):
    strength = size * SIZES["interface_hardening"]["strength_per_rad2"]
    alpha = np.sqrt(6 * strength)
    s.interface = lambda d, p: p.k_h * np.sinh(alpha * d) / alpha
    return {"strength_per_rad2": strength}, ["strength_per_rad2"], \
        "k_h sinh(alpha d)/alpha; strength is that of its cubic term, T = k_h d (1 + strength d^2)"


def interface_slack(s, size, rng):
    w = size * SIZES["interface_slack"]["half_width_rad"]
    soft = w / 4
    s.interface = lambda d, p: p.k_h * (d + 0.5 * (np.hypot(d - w, soft) - np.hypot(d + w, soft)))
    return {"half_width_rad": w}, [], "hyperbolic corners of a quarter of the half-width; the interface's damper stays"


def stretch_reflex(s, size, rng):
    d = SIZES["stretch_reflex"]
    gain = size * d["gain_nm_s_per_rad"]
    latency = d["latency_s"] + rng.uniform(-0.001, 0.001)
    tau = d["time_constant_s"] * rng.uniform(0.9, 1.1)
    s.forces.append(gamma_reflex(gain, latency, tau))
    return {"gain_nm_s_per_rad": gain, "latency_s": latency, "time_constant_s": tau}, \
        ["gain_nm_s_per_rad", "latency_s", "time_constant_s"], \
        "gamma kernel of order 2 whose mean delay is the time constant; it rises later than a first-order lag"


def stress_relaxation(s, size, rng):
    d = SIZES["stress_relaxation"]
    k, tau, split = size * d["stiffness_nm_per_rad"], d["time_constant_s"] * rng.uniform(0.85, 1.15), 1.5

    def two_branches(t, theta, speed, z, past):
        return z[0] + z[1], np.stack([k / 2 * speed - z[0] / (tau / split), k / 2 * speed - z[1] / (tau * split)])

    s.forces.append(Force(two_branches, states=2))
    return {"stiffness_nm_per_rad": k, "time_constant_s": tau}, ["time_constant_s"], \
        "two Maxwell branches with time constants a factor 2.25 apart about the one given"


def post_yield_viscosity(s, size, rng):
    c = size * SIZES["post_yield_viscosity"]["coefficient_nm_s_per_rad"]
    width = 0.0015

    def law(t, theta, speed, z, past):
        return c * speed * 0.5 * (1 + erf((theta - s.trials.x_e) / (np.sqrt(2) * width))), None

    s.forces.append(Force(law))
    return {"coefficient_nm_s_per_rad": c}, [], "sets in over an error function of 1.5 mrad about x_e"


def gradual_yield(s, size, rng):
    """Eq. 2 with a kink smeared by a normal distribution of yield torques instead of a logistic one."""
    a = SIZES["gradual_yield"]["smoothness_per_nm"] / size
    sd = np.pi / np.sqrt(3) / a

    def smeared(u):
        return u * 0.5 * (1 + erf(u / (np.sqrt(2) * sd))) + sd / np.sqrt(2 * np.pi) * np.exp(-0.5 * (u / sd) ** 2)

    s.elastic = lambda theta, p: (p.k_srs * theta - smeared(p.k_dec * (theta - p.x_e)) + smeared(-p.k_dec * p.x_e))
    return {"smoothness_per_nm": a}, ["smoothness_per_nm"], "smoothness of the logistic with the same variance"


def stiffening(s, size, rng):
    c, levelling = size * SIZES["stiffening"]["coefficient_per_rad"], SIZES["stiffening"]["levelling_rad"]
    reach = 0.08  # rad, about what the joint turns in the window
    base = s.elastic
    extra = lambda theta: c * levelling**2 * (theta / levelling - np.log1p(np.maximum(theta, -0.1) / levelling))
    s.elastic = lambda theta, p: base(theta, p) + p.k_srs * extra(theta)
    x = np.linspace(0.0, reach, 40)
    closest = float(np.sum(extra(x) * x**2 / 2) / np.sum((x**2 / 2) ** 2))
    return {"coefficient_per_rad": closest}, ["coefficient_per_rad"], \
        f"dT/dtheta = k_srs (1 + c theta / (1 + theta / {levelling})), c = {c:.3g}; the value is the closest " \
        f"k_srs (1 + c theta) up to {reach} rad"


def timed_yield(s, size, rng):
    """x_e = v x_t exactly, whatever the torque; everybody else has x_0 away from zero and a dependence on torque."""
    x_t = s.person.x_e_middle_rad / 2.275
    base = s.person.x_e(s.trials.velocity_rad_s, s.trials.torque_nm)
    s.trials.x_e = s.trials.velocity_rad_s * x_t * (s.trials.x_e / base)
    return {"x_t_s": x_t, "x_0_rad": 0.0}, [], "a law across trials; x_e keeps its spread from trial to trial"


def fatigue(s, size, rng):
    f = size * SIZES["fatigue"]["fraction"]
    done = -np.expm1(-1.2 * s.trials.order()) / -np.expm1(-1.2)
    s.trials.k_srs *= 1 - f * done
    return {"fraction": f}, [], "k_srs falls exponentially with order, by this fraction at the last trial"


def thixotropy(s, size, rng):
    d = SIZES["thixotropy"]
    amount, tau = size * d["amount"], d["time_constant_s"] * rng.uniform(0.9, 1.1)
    rest = s.trials.rest_s
    hyperbolic = lambda r: 1 + 1.55 * amount * r / (r + tau)
    s.trials.k_srs *= hyperbolic(rest) / hyperbolic(6.0)
    r = np.linspace(3, 12, 40)
    shape = lambda a, b: (1 - a * np.exp(-r / b)) / (1 - a * np.exp(-6.0 / b))
    fit = least_squares(lambda q: shape(*q) - hyperbolic(r) / hyperbolic(6.0), [amount, tau]).x
    return {"amount": float(fit[0]), "time_constant_s": float(fit[1])}, ["amount", "time_constant_s"], \
        "hyperbolic in the rest; the values are the closest k_srs ~ 1 - amount exp(-rest/time_constant) over 3-12 s"


def cocontraction(s, size, rng):
    c = size * SIZES["cocontraction"]["stiffness_nm_per_rad_per_mvc"]
    full = 0.6  # MVC at which the antagonist's stiffness is half used up
    mean = np.mean(s.trials.emg_ecr_mvc)
    stiffness = lambda e: c * (1 + mean / full) ** 2 * e / (1 + e / full)
    s.trials.k_srs += stiffness(s.trials.emg_ecr_mvc) - stiffness(mean)
    return {"stiffness_nm_per_rad_per_mvc": c}, [], "saturating in ECR EMG; the value is the slope at its mean"


def outlier_trial(s, size, rng):
    n = len(s.trials)
    odd = np.sort(rng.choice(np.arange(2, n), SIZES["outlier_trial"]["count"], replace=False))
    part = size * SIZES["outlier_trial"]["fraction"]
    s.trials.k_srs[odd] *= 1 + part * rng.choice([-1, 1], len(odd))
    s.trials.x_e[odd] *= 1 + 0.6 * part * rng.choice([-1, 1], len(odd))
    return {"trials": [int(i) + 1 for i in odd]}, [], \
        "another k_srs and x_e, as after squeezing or letting go of the handle"


def activation_scaling(s, size, rng):
    t, e = s.trials, s.person.emg
    expected = e["fcr_rest"] + e["fcr_per_nm"] * t.torque_nm
    middle = e["fcr_rest"] + e["fcr_per_nm"] * 1.5
    ends = e["fcr_rest"] + e["fcr_per_nm"] * np.array([0.9, 2.1])
    k_ends = s.person.k_srs(np.array([0.9, 2.1]))
    power = size * np.log(k_ends[1] / k_ends[0]) / np.log(ends[1] / ends[0])
    t.k_srs *= (t.emg_fcr_mvc / expected) ** power
    slope = power * s.person.k_srs(1.5) / middle
    return {"slope_nm_per_rad_per_mvc": float(slope)}, ["slope_nm_per_rad_per_mvc"], \
        f"k_srs ~ EMG^{power:.3f} within and between conditions; slope is dk_srs/dEMG at 1.5 N m, in N m/rad per MVC"


PLANT = [joint_damping, joint_friction, interface_hardening, interface_slack, stretch_reflex, stress_relaxation,
         post_yield_viscosity, gradual_yield, stiffening, timed_yield]
ACROSS_TRIALS = [fatigue, thixotropy, cocontraction, outlier_trial, activation_scaling]
