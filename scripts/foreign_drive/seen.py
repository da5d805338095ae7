"""What the drive saw, read from its log, in the units of the handle."""

import csv
import json
from functools import cached_property

ENABLED, CYCLIC = 5, 8


class Seen:
    def __init__(self, folder, rig, protocol):
        self.folder = folder
        self.rig, self.protocol = rig, protocol
        text = (folder / "events.jsonl").read_text()
        self.events = [json.loads(line) for line in text.splitlines() if line.endswith("}")]

    def all(self, event, after_s=-1.0, **values):
        return [one for one in self.events if one["event"] == event and one["t_s"] >= after_s
                and all(one.get(key) == value for key, value in values.items())]

    def first(self, event, after_s=-1.0, **values):
        found = self.all(event, after_s, **values)
        return found[0] if found else None

    @cached_property
    def rows(self):
        with open(self.folder / "drive.csv", newline="", encoding="ascii") as file:
            whole = file.read()
        whole = whole[: whole.rfind("\n") + 1]
        rows = []
        for row in csv.DictReader(whole.splitlines()):
            values = {key: value for key, value in row.items()}
            for key in row:
                if key not in ("cause", "controlword"):
                    values[key] = float(row[key])
            rows.append(values)
        return rows

    # Limits in force

    @property
    def period_s(self):
        return self.rig["period_us"] * 1e-6

    @property
    def limits(self):
        rig, protocol = self.rig["limits"], self.protocol["limits"]
        return {
            "low": max(rig["angle_rad"][0], protocol["angle_rad"][0]),
            "high": min(rig["angle_rad"][1], protocol["angle_rad"][1]),
            "speed": min(rig["speed_rad_s"], protocol["speed_rad_s"]),
            "acceleration": min(rig["acceleration_rad_s2"], protocol["acceleration_rad_s2"]),
        }

    # What the program commanded: targets that the motor would follow, one for each SYNC.

    @cached_property
    def commanded(self):
        """Stretches of rows in which the motor followed targets; the angle where the power came on stands before the first."""
        stretches, current = [], None
        for row in self.rows:
            following = (row["cause"] == "sync" and row["state"] == ENABLED and row["mode"] == CYCLIC
                         and int(row["controlword"], 16) & 0x0F == 0x0F)
            if following:
                if current is None:
                    current = []
                    stretches.append(current)
                current.append(row)
            elif not (row["powered"] and row["mode"] == CYCLIC and row["state"] == ENABLED):
                current = None
        return stretches

    def targets(self, after_s=-1.0):
        """The lowest and the highest target, rad."""
        told = [row["told_rad"] for stretch in self.commanded for row in stretch if row["t_s"] >= after_s]
        return (min(told), max(told)) if told else (0.0, 0.0)

    def largest_step_rad_s(self):
        """The largest step between two targets in a row, or from the shaft to the first, over the period."""
        largest = 0.0
        for stretch in self.commanded:
            before = stretch[0]["angle_rad"] - stretch[0]["target_rad"] + stretch[0]["told_rad"]
            for row in stretch:
                largest = max(largest, abs(row["told_rad"] - before) / self.period_s)
                before = row["told_rad"]
        return largest

    def largest_acceleration_rad_s2(self):
        """The largest change of the commanded speed in a period."""
        largest = 0.0
        for stretch in self.commanded:
            told = [row["told_rad"] for row in stretch]
            steps = [0.0] + [(b - a) / self.period_s for a, b in zip(told, told[1:])]
            largest = max([largest] + [abs(b - a) / self.period_s for a, b in zip(steps, steps[1:])])
        return largest

    # What the shaft did

    def _between(self, after_s, before_s):
        return [row for row in self.rows if after_s <= row["t_s"] <= before_s]

    def peak_speed(self, after_s=-1.0, before_s=1e9):
        """With power; without it the wrist alone moves the handle."""
        rows = self._between(after_s, before_s)
        return max((row["peak_speed_rad_s"] for before, row in zip(rows, rows[1:]) if before["powered"] and row["powered"]), default=0.0)

    def peak_torque(self, after_s=-1.0, before_s=1e9):
        return max((row["peak_motor_nm"] for row in self._between(after_s, before_s)), default=0.0)

    def lowest_speed(self, after_s, before_s=1e9):
        """With power."""
        return min((row["speed_rad_s"] for row in self._between(after_s, before_s) if row["powered"]), default=0.0)

    def angles(self, after_s=-1.0, before_s=1e9):
        angles = [row["angle_rad"] for row in self._between(after_s, before_s)]
        return (min(angles), max(angles)) if angles else (0.0, 0.0)

    def travel(self, after_s, before_s=1e9):
        low, high = self.angles(after_s, before_s)
        return high - low

    # Power

    def powered_at(self, at_s):
        powered = False
        for event in self.events:
            if event["t_s"] > at_s:
                break
            powered = {"power_on": True, "power_off": False}.get(event["event"], powered)
        return powered

    def powered_at_end(self):
        return self.powered_at(1e12)

    def power_off_after(self, at_s):
        """Seconds from `at_s` to the loss of power; 0 if there was none, None if it is still on."""
        if not self.powered_at(at_s):
            return 0.0
        off = self.first("power_off", after_s=at_s)
        return off["t_s"] - at_s if off else None
