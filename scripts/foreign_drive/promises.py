"""What the program promises of every try, and the verdict on one."""

import re

# Beyond a limit by rounding: a count of the encoder is 0.03 mrad, over a period 8 mrad/s.
ANGLE_SLACK_RAD = 0.0005
SPEED_SLACK = 1.02
ACCELERATION_SLACK = 1.05
SHAFT_SPEED_SLACK = 1.15  # the shaft follows an unsteady target with a little overshoot


class Verdict:
    """What was seen in one try, and which promises were broken."""

    def __init__(self, name, row):
        self.name, self.row = name, row
        self.notes, self.broken = [], []
        self.blind = None  # why the try says nothing

    def note(self, text):
        self.notes.append(text)

    def require(self, kept, text):
        if not kept:
            self.broken.append(text)
        return kept

    # Promises

    def targets_are_within_limits(self, seen):
        """No target beyond the angle limits, no step faster than the speed limit, no commanded acceleration beyond the limit."""
        limits = seen.limits
        low, high = seen.targets()
        self.require(low >= limits["low"] - ANGLE_SLACK_RAD and high <= limits["high"] + ANGLE_SLACK_RAD,
                     f"targets from {low:.3f} to {high:.3f} rad, the limits are {limits['low']} to {limits['high']}")
        step = seen.largest_step_rad_s()
        self.require(step <= limits["speed"] * SPEED_SLACK + 0.01,
                     f"a step between two targets is {step:.2f} rad/s, the limit is {limits['speed']}")
        acceleration = seen.largest_acceleration_rad_s2()
        self.require(acceleration <= limits["acceleration"] * ACCELERATION_SLACK + 8.0,
                     f"the targets accelerate by {acceleration:.0f} rad/s2, the limit is {limits['acceleration']}")

    def shaft_is_slow(self, seen, limit=None, after_s=-1.0):
        limit = limit or seen.limits["speed"] * SHAFT_SPEED_SLACK
        peak = seen.peak_speed(after_s)
        self.require(peak <= limit, f"the shaft turned at {peak:.2f} rad/s, {limit:.2f} at most are due")

    def power_goes(self, seen, at_s, within_ms, what=""):
        """Power off within a time after something, and it stays off."""
        took_s = seen.power_off_after(at_s)
        if took_s is None:
            self.broken.append(f"{what}the power stays on")
            return None
        self.require(took_s * 1000.0 <= within_ms, f"{what}power is off after {took_s * 1000:.0f} ms, {within_ms} at most are due")
        again = seen.first("power_on", after_s=at_s + took_s + 1e-4)
        self.require(again is None, f"{what}the power came on again")
        off = seen.first("power_off", after_s=at_s)
        self.note(f"off after {took_s * 1000:.0f} ms" + (f" at {abs(off['speed_rad_s']):.1f} rad/s" if off else ""))
        return took_s

    def no_power_at_end(self, seen):
        self.require(not seen.powered_at_end(), "the motor has power at the end")

    def ends(self, ended, status, says=(), never=()):
        """Exit code and message."""
        if ended.status is None:
            self.broken.append(f"the program did not end within {ended.took_s:.0f} s")
            return
        self.require(ended.status == status, f"exit code {ended.status}, {status} is due")
        for pattern in says:
            self.require(re.search(pattern, ended.text, re.I), f"the message does not say {pattern!r}")
        for pattern in never:
            found = re.search(pattern, ended.text, re.I)
            self.require(not found, f"the message says {found.group(0)!r}" if found else "")
        unconfirmed = "could not be confirmed" in ended.text
        self.require(not (unconfirmed and "was made safe" in ended.text),
                     "the message says both that the motor was made safe and that this could not be confirmed")

    def cell(self):
        """The cell of the table."""
        seen = "; ".join(self.notes)
        if self.blind:
            return f"{self.name}: not seen ({self.blind})"
        if self.broken:
            return f"{self.name}: **not as promised**: " + "; ".join(self.broken)
        return f"{self.name}: {seen}" if seen else f"{self.name}: as promised"
