"""Mechanisms of the wrist joint and its muscles."""

import numpy as np
from scipy.special import erf

from ..plant import Force, gamma_reflex
from ..scenario import SIZES
from .law import drifting, law


def _on_joint(s, torque):
    """Adds `torque(theta, speed)` to the joint."""
    s.forces.append(Force(lambda t, theta, speed, z, past: (torque(theta, speed), None)))


@law("joint_damping", "linear", "T_j += b v", "Eq. 7")
def linear_damping(s, size, rng):
    b = size * SIZES["joint_damping"]["damping_nm_s_per_rad"]
    _on_joint(s, lambda theta, speed: b * speed)
    return {"b_j_nm_s_per_rad": b}, [], "linear, as Eq. 7 has it"


@law("joint_damping", "shear_thinning", "T_j += b v / (1 + |v| / v_0)", "Cross 1965, as synovial fluid thins; v_0 assumed")
def thinning_damping(s, size, rng):
    d = SIZES["joint_damping@shear_thinning"]
    b, thin = size * d["damping_nm_s_per_rad"], d["thinning_speed_rad_s"]
    _on_joint(s, lambda theta, speed: b * speed / (1 + np.abs(speed) / thin))
    return {"b_j_nm_s_per_rad": b}, ["b_j_nm_s_per_rad"], "the value is the slope at rest"


@law("joint_damping", "quadratic", "T_j += c v |v|", "assumed: fluid pressed through tissue")
def quadratic_damping(s, size, rng):
    c = size * SIZES["joint_damping@quadratic"]["coefficient_nm_s2_per_rad2"]
    _on_joint(s, lambda theta, speed: c * speed * np.abs(speed))
    return {"b_j_nm_s_per_rad": 2 * c}, ["b_j_nm_s_per_rad"], "the value is the secant at 2 rad/s"


@law("joint_friction", "lugre", "T_j += z, dz/dt = (F v - F |v| z / g(v)) / x_0, g = F (1 + 0.15 exp(-(v/0.3)^2))",
     "Canudas de Wit et al. 1995")
def bristles(s, size, rng):
    level = size * SIZES["joint_friction"]["level_nm"]
    presliding_rad = SIZES["joint_friction"]["presliding_rad"]

    def lugre(t, theta, speed, z, past):
        # Bristles of stiffness level / presliding that slip the easier the faster, down to the level (Stribeck).
        slips_at = level * (1 + 0.15 * np.exp(-((speed / 0.3) ** 2)))
        return z[0], (level / presliding_rad * (speed - np.abs(speed) * z[0] / slips_at))[None]

    s.forces.append(Force(lugre, states=1))
    return {"level_nm": level, "presliding_rad": presliding_rad}, ["presliding_rad"], "LuGre friction with a Stribeck drop"


@law("joint_friction", "speed", "T_j += F tanh(v / v_0) (1 + 0.2 exp(-(v/0.5)^2))", "Stribeck 1902; v_0 assumed")
def friction_of_speed(s, size, rng):
    d = SIZES["joint_friction@speed"]
    level, smooth = size * d["level_nm"], d["smoothing_rad_s"]
    _on_joint(s, lambda theta, speed: level * np.tanh(speed / smooth) * (1 + 0.2 * np.exp(-((speed / 0.5) ** 2))))
    return {"level_nm": level}, [], "smoothed Coulomb friction with a Stribeck drop"


@law("joint_friction", "dahl", "T_j += z, dz/dt = F / x_0 v (1 - z sign(v) / F)^2", "Dahl 1968, exponent 2")
def friction_of_travel(s, size, rng):
    d = SIZES["joint_friction@dahl"]
    level, presliding_rad = size * d["level_nm"], d["presliding_rad"]

    def dahl(t, theta, speed, z, past):
        part = np.clip(1 - z[0] * np.sign(speed) / level, 0.0, 2.0)
        return z[0], (level / presliding_rad * speed * part**2)[None]

    s.forces.append(Force(dahl, states=1))
    return {"level_nm": level, "presliding_rad": presliding_rad}, ["presliding_rad"], "builds up over travel, whatever the speed"


@law("stretch_reflex", "gamma", "T_j += gain (h * max(0, v))(t - latency), h a gamma density of order 2", "assumed")
def two_lags(s, size, rng):
    gain, latency, tau = _reflex(SIZES["stretch_reflex"], size, rng)
    s.forces.append(gamma_reflex(gain, latency, tau))
    return _reflex_truth(gain, latency, tau, "gain_nm_s_per_rad", "latency_s", "time_constant_s") + (
        "gamma kernel of order 2 whose mean delay is the time constant; it rises later than a first-order lag",)


@law("stretch_reflex", "lag", "T_j += r, dr/dt = (gain max(0, v(t - latency)) - r) / tau", "first-order lag of activation; the numbers are assumed")
def one_lag(s, size, rng):
    gain, latency, tau = _reflex(SIZES["stretch_reflex@lag"], size, rng)

    def reflex(t, theta, speed, z, past):
        return gain * z[0], ((np.maximum(past(t - latency), 0.0) - z[0]) / tau)[None]

    s.forces.append(Force(reflex, states=1))
    return _reflex_truth(gain, latency, tau) + ("first-order lag",)


@law("stretch_reflex", "burst", "T_j += gain v_c sin^2(pi (t - latency) / D) for 0 < t - latency < D",
     "assumed: a synchronous volley, scaled by the velocity v_c of the condition")
def burst(s, size, rng):
    d = SIZES["stretch_reflex@burst"]
    gain, latency, duration = _reflex(d, size, rng)
    latency += s.ramp.rise_s / 2  # the spindles fire when the stretch is under way

    def volley(t, theta, speed, z, past):
        u = np.clip((t - latency) / duration, 0.0, 1.0)
        return gain * s.trials.velocity_rad_s * np.sin(np.pi * u) ** 2, None

    s.forces.append(Force(volley))
    return _reflex_truth(gain, latency, duration, "gain_nm_s_per_rad", "latency_s", "time_constant_s") + (
        "one twitch; the time constant is its whole duration",)


def _reflex(d, size, rng):
    return size * d["gain_nm_s_per_rad"], d["latency_s"] + rng.uniform(-0.001, 0.001), d["time_constant_s"] * rng.uniform(0.9, 1.1)


def _reflex_truth(gain, latency, tau, *nominal):
    return {"gain_nm_s_per_rad": gain, "latency_s": latency, "time_constant_s": tau}, list(nominal)


@law("stress_relaxation", "two_branches", "T_j += m_1 + m_2, dm_i/dt = k v / 2 - m_i / tau_i, tau_i = tau 1.5^(-1, +1)", "assumed")
def two_branches(s, size, rng):
    d = SIZES["stress_relaxation"]
    k, tau = size * d["stiffness_nm_per_rad"], d["time_constant_s"] * rng.uniform(0.85, 1.15)
    _maxwell(s, [k / 2, k / 2], [tau / 1.5, tau * 1.5])
    return {"stiffness_nm_per_rad": k, "time_constant_s": tau}, ["time_constant_s"], \
        "two Maxwell branches with time constants a factor 2.25 apart about the one given"


@law("stress_relaxation", "maxwell", "T_j += m, dm/dt = k v - m / tau", "Maxwell 1867")
def one_branch(s, size, rng):
    d = SIZES["stress_relaxation@maxwell"]
    k, tau = size * d["stiffness_nm_per_rad"], d["time_constant_s"] * rng.uniform(0.85, 1.15)
    _maxwell(s, [k], [tau])
    return {"stiffness_nm_per_rad": k, "time_constant_s": tau}, [], "one Maxwell branch"


@law("stress_relaxation", "power_law", "T_j += k (G * v), G(t) about (1 + t / tau)^-0.5, by five branches",
     "power laws are usual in soft tissue; the exponent is assumed")
def power_law(s, size, rng):
    d = SIZES["stress_relaxation@power_law"]
    k, tau = size * d["stiffness_nm_per_rad"], d["time_constant_s"] * rng.uniform(0.85, 1.15)
    times = tau * 3.0 ** np.arange(-1, 4)
    weights = times**-0.5 * np.exp(-tau / times)
    _maxwell(s, k * weights / weights.sum(), times)
    return {"stiffness_nm_per_rad": k, "time_constant_s": tau}, ["stiffness_nm_per_rad", "time_constant_s"], \
        "five Maxwell branches whose time constants are a factor 3 apart, weighted as a power law"


def _maxwell(s, stiffnesses, times):
    def branches(t, theta, speed, z, past):
        return sum(z), np.stack([k * speed - m / tau for k, m, tau in zip(stiffnesses, z, times)])

    s.forces.append(Force(branches, states=len(times)))


@law("post_yield_viscosity", "linear", "T_j += c v Phi((theta - x_e) / 1.5 mrad)", "assumed")
def linear_viscosity(s, size, rng):
    c = size * SIZES["post_yield_viscosity"]["coefficient_nm_s_per_rad"]
    width = 0.0015

    def viscous(t, theta, speed, z, past):
        return c * speed * 0.5 * (1 + erf((theta - s.trials.x_e) / (np.sqrt(2) * width))), None

    s.forces.append(Force(viscous))
    return {"coefficient_nm_s_per_rad": c}, [], "sets in over an error function of 1.5 mrad about x_e"


@law("post_yield_viscosity", "hill", "T_j += c v / (1 + |v| / v_0) beyond x_e", "Hill 1938: force levels off with speed; v_0 assumed")
def levelling_viscosity(s, size, rng):
    d = SIZES["post_yield_viscosity@hill"]
    c, thin = size * d["coefficient_nm_s_per_rad"], d["levelling_speed_rad_s"]
    _on_joint(s, lambda theta, speed: c * speed / (1 + np.abs(speed) / thin) * _beyond(theta - s.trials.x_e))
    return {"coefficient_nm_s_per_rad": c}, ["coefficient_nm_s_per_rad"], "the value is the slope at rest"


@law("post_yield_viscosity", "growing", "T_j += c v (1 - exp(-(theta - x_e) / 10 mrad)) beyond x_e",
     "assumed: cross-bridges that slip one after the other")
def growing_viscosity(s, size, rng):
    c = size * SIZES["post_yield_viscosity@growing"]["coefficient_nm_s_per_rad"]
    _on_joint(s, lambda theta, speed: c * speed * -np.expm1(-np.maximum(theta - s.trials.x_e, 0.0) / 0.010))
    return {"coefficient_nm_s_per_rad": c}, ["coefficient_nm_s_per_rad"], "the value is the viscosity far beyond the limit"


def _beyond(excess_rad):
    return 0.5 * (1 + np.tanh(excess_rad / 0.0015))


@law("gradual_yield", "normal", "Eq. 2 with normally distributed yield torques", "assumed")
def normal_yield(s, size, rng):
    """Eq. 2 with a kink smeared by a normal distribution of yield torques instead of a logistic one."""
    a = SIZES["gradual_yield"]["smoothness_per_nm"] / size
    sd = np.pi / np.sqrt(3) / a
    _smear(s, lambda u: u * 0.5 * (1 + erf(u / (np.sqrt(2) * sd))) + sd / np.sqrt(2 * np.pi) * np.exp(-0.5 * (u / sd) ** 2))
    return {"smoothness_per_nm": a}, ["smoothness_per_nm"], "smoothness of the logistic with the same variance"


@law("gradual_yield", "hyperbolic", "Eq. 2 with (u + sqrt(u^2 + w^2)) / 2 for the kink", "assumed")
def hyperbolic_yield(s, size, rng):
    a = SIZES["gradual_yield@hyperbolic"]["smoothness_per_nm"] / size
    _smear(s, lambda u: 0.5 * (u + np.hypot(u, 2 * np.log(2) / a)))
    return {"smoothness_per_nm": a}, ["smoothness_per_nm"], "smoothness of the logistic that is as far from the kink at the limit"


@law("gradual_yield", "uniform", "Eq. 2 with uniformly distributed yield torques", "assumed: sarcomeres of equal number at each limit")
def uniform_yield(s, size, rng):
    a = SIZES["gradual_yield@uniform"]["smoothness_per_nm"] / size
    half = np.pi / a  # the logistic's standard deviation, pi / sqrt(3) / a, is that of a uniform of this half-width
    _smear(s, lambda u: np.where(np.abs(u) < half, (u + half) ** 2 / (4 * half), np.maximum(u, 0.0)))
    return {"smoothness_per_nm": a}, ["smoothness_per_nm"], "smoothness of the logistic with the same variance"


def _smear(s, kink):
    s.elastic = lambda theta, p: (p.k_srs * theta - kink(p.k_dec * (theta - p.x_e)) + kink(-p.k_dec * p.x_e))


REACH_RAD = 0.08  # about what the joint turns in the window


@law("stiffening", "levelling", "dT_j/dtheta += k_srs c theta / (1 + theta / 0.15 rad)", "assumed")
def levelling_stiffening(s, size, rng):
    c, levelling = size * SIZES["stiffening"]["coefficient_per_rad"], SIZES["stiffening"]["levelling_rad"]
    closest = _stiffen(s, lambda theta: c * levelling**2 * (theta / levelling - np.log1p(np.maximum(theta, -0.1) / levelling)))
    return {"coefficient_per_rad": closest}, ["coefficient_per_rad"], \
        f"dT/dtheta = k_srs (1 + c theta / (1 + theta / {levelling})), c = {c:.3g}; the value is the closest " \
        f"k_srs (1 + c theta) up to {REACH_RAD} rad"


@law("stiffening", "linear", "dT_j/dtheta += k_srs c theta", "first order of any stiffening")
def linear_stiffening(s, size, rng):
    c = size * SIZES["stiffening@linear"]["coefficient_per_rad"]
    _stiffen(s, lambda theta: c * theta**2 / 2)
    return {"coefficient_per_rad": c}, [], "stiffness linear in angle"


@law("stiffening", "exponential", "dT_j/dtheta += k_srs (exp(theta / x_0) - 1)", "Fung 1967: exponential stiffening of soft tissue; x_0 assumed")
def exponential_stiffening(s, size, rng):
    d = SIZES["stiffening@exponential"]
    part, scale = size * d["part"], d["scale_rad"]
    closest = _stiffen(s, lambda theta: part * (scale * np.expm1(np.minimum(theta, 0.3) / scale) - theta))
    return {"coefficient_per_rad": closest}, ["coefficient_per_rad"], \
        f"the value is the closest k_srs (1 + c theta) up to {REACH_RAD} rad"


def _stiffen(s, extra):
    """Adds k_srs `extra(theta)` to the elastic torque; returns the c of the closest k_srs c theta^2 / 2."""
    base = s.elastic
    s.elastic = lambda theta, p: base(theta, p) + p.k_srs * extra(theta)
    x = np.linspace(0.0, REACH_RAD, 40)
    return float(np.sum(extra(x) * x**2 / 2) / np.sum((x**2 / 2) ** 2))


@law("timed_yield", "proportional", "x_e = v x_t", "de Vlugt et al. 2011, 3.2")
def proportional_limit(s, size, rng):
    """x_e = v x_t exactly, whatever the torque; everybody else has x_0 away from zero and a dependence on torque."""
    return _timed(s, 1.0, "a law across trials; x_e keeps its spread from trial to trial")


@law("timed_yield", "drifting", "x_e = v x_t (1 + 0.02 order), order from -1 to 1 over the session", "assumed")
def drifting_limit(s, size, rng):
    return _timed(s, 1 + 0.2 * (drifting(s) - 1), "the time grows by 4 % over the session")


@law("timed_yield", "loaded", "x_e = v x_t (1 - 0.01 (T - 1.5 N m) / 1 N m)", "assumed: a third of the usual dependence on torque")
def loaded_limit(s, size, rng):
    return _timed(s, 1 - 0.01 * (s.trials.torque_nm - 1.5), "the time falls slightly with torque")


def _timed(s, part, note):
    x_t = s.person.x_e_middle_rad / 2.275
    base = s.person.x_e(s.trials.velocity_rad_s, s.trials.torque_nm)
    s.trials.x_e = s.trials.velocity_rad_s * x_t * (s.trials.x_e / base) * part
    return {"slope_s": x_t, "x_0_rad": 0.0}, [], note
