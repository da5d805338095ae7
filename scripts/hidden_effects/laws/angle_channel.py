"""Mechanisms of the angle's sensor."""

import numpy as np

from ..scenario import SIZES
from .law import by_velocity, constant, drifting, law


@law("angle_gain", "constant", "angle recorded = factor times the true one", "assumed: a wrong number of counts")
def constant_gain(s, size, rng):
    return _gain(s, SIZES["angle_gain"]["factor"] ** size, constant(s), [])


@law("angle_gain", "drifting", "factor - 1 grows by 20 % over the session", "assumed: a potentiometer that warms")
def drifting_gain(s, size, rng):
    return _gain(s, SIZES["angle_gain"]["factor"] ** size, drifting(s), ["factor"])


@law("angle_gain", "by_velocity", "factor - 1 is 10 % less at the lowest velocity and 10 % more at the highest", "assumed: a coupling that gives")
def gain_by_velocity(s, size, rng):
    return _gain(s, SIZES["angle_gain"]["factor"] ** size, by_velocity(s), ["factor"])


def _gain(s, factor, share, nominal):
    """The encoder is also the servo's, so the record follows the command and the true movement is the smaller."""
    g = factor if np.isscalar(share) else 1 + (factor - 1) * share
    t = s.trials
    t.x_e = t.x_e * s.person.x_e(t.velocity_rad_s / g, t.torque_nm) / s.person.x_e(t.velocity_rad_s, t.torque_nm)
    s.ramp.velocity_rad_s = s.ramp.velocity_rad_s / g
    s.ramp.amplitude_rad = s.ramp.amplitude_rad / g
    s.angle_factor = g if np.isscalar(share) else g[:, None]
    return {"factor": factor}, nominal, "recorded over true"
