"""Friction of the handle's bearing, by several laws, and a damper of the lever that is not quite linear."""

import numpy as np

from ..plant import Force
from ..scenario import Scenario


def smooth(level_nm):
    """Coulomb friction, smoothed over the speed."""
    return Force(lambda t, theta, speed, z, past: (level_nm * np.tanh(speed / 0.01), None), on="lever")


def stribeck(level_nm):
    """More at the lowest speeds."""
    return Force(lambda t, theta, speed, z, past: (level_nm * np.tanh(speed / 0.02) * (1 + 0.3 * np.exp(-((speed / 0.1) ** 2))), None),
                 on="lever")


def bristles(level_nm):
    """Canudas de Wit et al. 1995, without a drop: elastic before it slides."""
    presliding_rad = 0.0003

    def lugre(t, theta, speed, z, past):
        return level_nm * z[0], ((speed - np.abs(speed) * z[0]) / presliding_rad)[None]

    return Force(lugre, states=1, on="lever")


def grease(level_nm):
    """Thin grease beside the balls: a part grows with the root of the speed."""
    return Force(lambda t, theta, speed, z, past: (level_nm * np.tanh(speed / 0.01) * (0.8 + 0.2 * np.sqrt(np.abs(speed))), None), on="lever")


FRICTION = {"smooth": smooth, "stribeck": stribeck, "bristles": bristles, "grease": grease}
NOMINAL_FRICTION = {"stribeck", "grease"}  # whose level has no exact counterpart in a constant friction


def fit_bearing(s: Scenario, law: str, level_nm: float, damping_growth_s_per_rad: float) -> None:
    """Gives the lever of a scenario, of rig trials or of a person, a bearing and a damper as they are. No-op without a lever."""
    if s.lever is None:
        return
    s.forces.append(FRICTION[law](level_nm))
    s.lever["damping_growth_s_per_rad"] = damping_growth_s_per_rad
