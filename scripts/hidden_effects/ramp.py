"""The commanded ramp, in closed form, and the servo that follows it."""

from dataclasses import dataclass

import numpy as np

AMPLITUDE_RAD = 0.14


@dataclass
class Ramp:
    """Speed rises and falls as a raised cosine; position is its exact integral. Arrays run over trials."""

    velocity_rad_s: np.ndarray
    amplitude_rad: float
    rise_s: float

    def angle(self, t):
        """Commanded angle at time `t` after the onset (a scalar, or anything that broadcasts over the trials)."""
        duration = self.amplitude_rad / self.velocity_rad_s  # from onset to the start of the fall
        return self._risen(t) - self._risen(t - duration)

    def _risen(self, t):
        """Integral of a speed that rises to `velocity` and stays: the ramp is one of these less a later one."""
        u = np.clip(t, 0.0, self.rise_s)
        rising = 0.5 * (u - self.rise_s / np.pi * np.sin(np.pi * u / self.rise_s))
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
