"""The angle recorded is the command; the motor follows it as its servo can."""

import numpy as np

from ..ramp import ResonantServo, smoothed
from ..scenario import SIZES
from .law import law


@law("servo_following", "cascade", "two poles a factor 10 apart", "the usual cascade of a position and a speed loop")
def cascade(s, size, rng):
    s.servo.bandwidth_hz = SIZES["servo_following"]["bandwidth_hz"] / size
    s.servo.stiffness_nm_per_rad = np.inf
    s.record_command = True
    return {"bandwidth_hz": s.servo.delay_matched_natural_hz()}, ["bandwidth_hz"], \
        "poles a factor 10 apart; the value is the natural frequency of a critically damped servo of the same delay; " \
        "no droop under load"


@law("servo_following", "resonant", "second order with a damping ratio of 0.6", "assumed: a drive tuned to overshoot by 10 %")
def resonant(s, size, rng):
    return _follow(s, SIZES["servo_following@resonant"]["natural_hz"] / size, 0.6, None)


@law("servo_following", "third_order", "a critically damped second order behind a first-order lag of the command", "assumed: a smoothed command")
def third_order(s, size, rng):
    d = SIZES["servo_following@third_order"]
    return _follow(s, d["natural_hz"] / size, 1.0, d["command_corner_hz"] / size)


def _follow(s, natural_hz, damping_ratio, command_corner_hz):
    s.servo = ResonantServo(natural_hz, damping_ratio)
    s.record_command = True
    delay_s = 2 * damping_ratio / (2 * np.pi * natural_hz)
    if command_corner_hz:
        s.followed = smoothed(s.ramp.angle, command_corner_hz, s.ramp.times_s())
        delay_s += 1 / (2 * np.pi * command_corner_hz)
    return {"bandwidth_hz": 2 / (2 * np.pi * delay_s)}, ["bandwidth_hz"], \
        "the value is the natural frequency of a critically damped servo of the same delay; no droop under load"
