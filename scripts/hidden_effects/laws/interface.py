"""Mechanisms of the soft layer between hand and handle, whose deflection is d = theta_l - theta_j."""

import numpy as np

from ..plant import Force
from ..scenario import SIZES
from .law import law


@law("interface_hardening", "sinh", "k_h sinh(a d) / a, a^2 = 6 strength", "assumed")
def sinh_spring(s, size, rng):
    strength = size * SIZES["interface_hardening"]["strength_per_rad2"]
    alpha = np.sqrt(6 * strength)
    s.interface = lambda d, p: p.k_h * np.sinh(alpha * d) / alpha
    return {"strength_per_rad2": strength}, ["strength_per_rad2"], \
        "k_h sinh(alpha d)/alpha; strength is that of its cubic term, T = k_h d (1 + strength d^2)"


@law("interface_hardening", "cubic", "k_h d (1 + strength d^2)", "Duffing 1918")
def cubic_spring(s, size, rng):
    strength = size * SIZES["interface_hardening@cubic"]["strength_per_rad2"]
    s.interface = lambda d, p: p.k_h * d * (1 + strength * d**2)
    return {"strength_per_rad2": strength}, [], "cubic spring"


@law("interface_hardening", "exponential", "k_h (exp(a d) - 1) / a for d > 0, k_h d for d < 0", "Fung 1967, as skin and foam under compression")
def exponential_spring(s, size, rng):
    alpha = size * SIZES["interface_hardening@exponential"]["growth_per_rad"]
    s.interface = lambda d, p: p.k_h * np.where(d > 0, np.expm1(alpha * np.clip(d, 0.0, 0.1)) / alpha, d)
    return {"strength_per_rad2": alpha**2 / 6}, ["strength_per_rad2"], "hardens on the loaded side only; the value is its cubic term"


@law("interface_hardening", "bottoming", "k_h (d + r max(0, d - d_0))", "assumed: the strap is taut beyond d_0")
def bottoming_spring(s, size, rng):
    d0 = SIZES["interface_hardening@bottoming"]
    part, at = size * d0["part"], d0["deflection_rad"]
    s.interface = lambda d, p: p.k_h * (d + part * 0.5 * (d - at + np.hypot(d - at, at / 8) + at - np.hypot(at, at / 8)))
    return {"strength_per_rad2": part / at**2 / 4}, ["strength_per_rad2"], "stiffer beyond one deflection; the value is a rough equivalent"


@law("interface_slack", "hyperbolic", "a dead zone with hyperbolic corners of a quarter of its half-width", "assumed")
def rounded_dead_zone(s, size, rng):
    w = size * SIZES["interface_slack"]["half_width_rad"]
    _dead_zone(s, w, w / 4)
    return {"half_width_rad": w}, [], "hyperbolic corners of a quarter of the half-width; the interface's damper stays"


@law("interface_slack", "dead_zone", "k_h (max(0, d - w) - max(0, -d - w))", "a loose strap")
def sharp_dead_zone(s, size, rng):
    w = size * SIZES["interface_slack@dead_zone"]["half_width_rad"]
    _dead_zone(s, w, w / 50)
    return {"half_width_rad": w}, [], "sharp corners"


@law("interface_slack", "backlash", "k_h p, p the play operator of half-width w on d", "Krasnosel'skii and Pokrovskii 1989")
def backlash(s, size, rng):
    w = size * SIZES["interface_slack@backlash"]["half_width_rad"]
    soft = w / 20

    def play(t, d, speed, z, past):
        ahead, behind = (1 / (1 + np.exp(-np.clip((sign * (d - z[0]) - w) / soft, -40, 40))) for sign in (1, -1))
        rate = np.maximum(speed, 0.0) * ahead + np.minimum(speed, 0.0) * behind
        return s.trials.k_h * (z[0] - d), rate[None]

    s.forces.append(Force(play, states=1, on="interface"))
    return {"half_width_rad": w}, [], "with hysteresis: what is taken up in one direction is taken up again on the way back"


def _dead_zone(s, w, soft):
    s.interface = lambda d, p: p.k_h * (d + 0.5 * (np.hypot(d - w, soft) - np.hypot(d + w, soft)))
