"""The commanded ramp, in closed form, and the servo that follows it."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import cont2discrete, lfilter

from .plant import FINE_HZ, START_S


def _raised_cosine(t, rise_s):
    return 0.5 * (t - rise_s / np.pi * np.sin(np.pi * t / rise_s))


def _trapezoid(t, rise_s):
    return t**2 / (2 * rise_s)


def _minimum_jerk(t, rise_s):
    u = t / rise_s
    return rise_s * u**4 * (2.5 + u * (u - 3.0))


# Angle per velocity while the speed rises from 0 to that velocity, at times from 0 to `rise_s`. All end at rise_s / 2.
PROFILES = {"raised cosine": _raised_cosine, "trapezoid": _trapezoid, "minimum jerk": _minimum_jerk}


@dataclass
class Ramp:
    """Speed rises and falls as the profile says; position is its exact integral. Arrays run over trials."""

    velocity_rad_s: np.ndarray
    amplitude_rad: float
    rise_s: float
    profile: str = "raised cosine"

    def angle(self, t):
        """Commanded angle at time `t` after the onset (a scalar, or anything that broadcasts over the trials)."""
        duration = self.amplitude_rad / self.velocity_rad_s  # from onset to the start of the fall
        return self._risen(t) - self._risen(t - duration)

    def times_s(self):
        """An even grid from before the onset to beyond the end of a trial."""
        return np.arange(round(START_S * FINE_HZ), round(0.25 * FINE_HZ)) / FINE_HZ

    def _risen(self, t):
        """Integral of a speed that rises to `velocity` and stays: the ramp is one of these less a later one."""
        u = np.clip(t, 0.0, self.rise_s)
        rising = PROFILES[self.profile](u, self.rise_s)
        return self.velocity_rad_s * (rising + np.maximum(t - self.rise_s, 0.0))


@dataclass
class Servo:
    """A cascade drive: the position loop gives the slow pole, the speed loop one ten times faster."""

    bandwidth_hz: float
    stiffness_nm_per_rad: float  # the droop under load; infinite where the load is fed forward

    SPEED_LOOP_RATIO = 10.0

    def acceleration(self, command, angle, speed, load_nm):
        slow = 2 * np.pi * self.bandwidth_hz
        fast = self.SPEED_LOOP_RATIO * slow
        return slow * fast * (command - load_nm / self.stiffness_nm_per_rad - angle) - (slow + fast) * speed

    def delay_matched_natural_hz(self):
        """Natural frequency of the critically damped servo that delays slow movement as much as this one does."""
        return 2 * self.bandwidth_hz / (1 + 1 / self.SPEED_LOOP_RATIO)


@dataclass
class ResonantServo:
    """A drive tuned to overshoot: second order, with its load fed forward."""

    natural_hz: float
    damping_ratio: float

    def acceleration(self, command, angle, speed, load_nm):
        w = 2 * np.pi * self.natural_hz
        return w**2 * (command - angle) - 2 * self.damping_ratio * w * speed

    def delay_matched_natural_hz(self):
        """As of the cascade."""
        return self.natural_hz / self.damping_ratio


def smoothed(command, corner_hz, times):
    """`command` behind a first-order lag, as a function of time; `times` is an even grid that begins before the onset."""
    steps = np.stack([command(t) for t in times], axis=1)
    pole = 2 * np.pi * corner_hz
    num, den, _ = cont2discrete(([pole], [1, pole]), times[1] - times[0], method="foh")
    return CubicSpline(times, lfilter(num.ravel(), den, steps, axis=1), axis=1)
