"""The tries: each causes one fault, and says what the program promises for it.

`ROW` texts are the first cells of the fault table in docs/explanation/safety.md.
"""

import re
import signal
import time

from .bench import Bench
from .promises import Verdict

# Longest time from a fault to the loss of power, ms: frames under way and a few periods of 4 ms; the quick-stop ramp from the highest
# speed at 200 rad/s2, and those; half a second of holding, and those; the drive's wait for a heartbeat, and the ramp.
OFF, STOP, HOLD, WATCHDOG = 40, 100, 700, 220
SAFE = r"fault, the motor was made safe"
HELD, IN_RAMP = "at=cyclic after=0.7", "at=ramp after=0.022"

# What ends a session on a machine that is too busy for its period; where the try expects no end, it says nothing.
BUSY = re.compile(r"the program was \d+ us late for SYNC")

CASES = {}


def case(row, name):
    """Registers a try under a row of the table."""
    def register(function):
        CASES[name] = (row, function)
        return function
    return register


def fault(row, name, text, within_ms, says, drive=(), rig="drive.json", status=1, never=(), changes=None, check=None, speed=True, more=()):
    """A fault that the drive or the bus causes by itself, in an otherwise ordinary session."""
    def run(open_bench):
        verdict = Verdict(name, row)
        with open_bench(rig=rig, rig_changes=changes, drive=drive, faults=[text, *more]) as bench:
            ended = bench.start().wait()
            seen = bench.seen()
        struck = seen.first("fault")
        if struck is None:
            verdict.blind = "the program ended before the fault: " + last_line(ended.text)
            return verdict
        if not seen.powered_at(struck["t_s"] - 1e-6):
            verdict.blind = "the power was off before the fault: " + last_line(ended.text)
            return verdict
        if status == 0 and BUSY.search(ended.text):
            verdict.blind = "the machine was busy: " + BUSY.search(ended.text).group(0)
        verdict.targets_are_within_limits(seen)
        if within_ms is not None:
            verdict.power_goes(seen, struck["t_s"], within_ms)
        verdict.no_power_at_end(seen)
        if speed:
            verdict.shaft_is_slow(seen)
        verdict.ends(ended, status, says, never)
        if check:
            check(verdict, seen, struck, ended)
        return verdict
    CASES[name] = (row, run)


def last_line(text):
    """The program's first error, or else its last line."""
    lines = [line for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("error")]
    return (errors or lines[-1:] or ["it said nothing"])[0][:160]


def never_reverses(verdict, seen, struck, _):
    """A hold decelerates from the motion there was; it does not drive the handle back."""
    lowest = seen.lowest_speed(struck["t_s"], struck["t_s"] + 0.1)
    verdict.require(lowest > -0.35, f"the handle was driven back at {lowest:.2f} rad/s within 0.1 s of the fault")


def stands_when_power_goes(verdict, seen, struck, _):
    off = seen.first("power_off", after_s=struck["t_s"])
    if off:
        speed = abs(off["speed_rad_s"])
        verdict.require(speed < 0.4, f"the power was cut at {speed:.2f} rad/s: the handle coasts")


def holds(verdict, seen, struck, _):
    took_s = seen.power_off_after(struck["t_s"])
    if took_s is not None:
        verdict.require(took_s > 0.4, f"the hold ended after {took_s * 1000:.0f} ms, half a second is due")


def sync_goes_on(verdict, seen, struck, _):
    """A frame that is missing does not keep the program from its next target: what has power is commanded in every period."""
    rows = [row["t_s"] for stretch in seen.commanded for row in stretch if row["t_s"] >= struck["t_s"] - 0.02]
    changed = [event["t_s"] for event in seen.all("state") if rows and event["t_s"] > rows[-1]]
    rows += changed[:1]
    longest = max((b - a for a, b in zip(rows, rows[1:])), default=0.0)
    verdict.require(longest <= 3.2 * seen.period_s, f"{longest * 1000:.0f} ms without a target while the motor had power")


def both(*checks):
    def run(*what):
        for check in checks:
            check(*what)
    return run


# The drive

fault("limit switch closes", "limit switch", f"emcy code=FF06 {HELD}", OFF, [SAFE, "FF06h"])
fault("emergency message of a drive that goes on", "EMCY, goes on", f"emcy code=4310 {HELD}", OFF, [SAFE, "4310h"])
fault("emergency message of a drive that goes on", "EMCY, in the ramp", f"emcy code=4310 {IN_RAMP}", OFF, [SAFE, "4310h"])
fault("emergency message of a drive that stops by itself", "EMCY, stops itself", f"emcy code=2310 fatal=1 {IN_RAMP}", STOP,
      [SAFE, "2310h"])
fault("overspeed, found by the drive", "8400h", f"runaway rad_s=9 detected=1 {HELD}", 100 + STOP, [SAFE], speed=False)
fault("overspeed, found by the program", "turns at 9 rad/s, says nothing", f"runaway rad_s=9 {HELD}", 100 + STOP, [SAFE, "beyond the limit|should be"],
      speed=False)
# At rest the emulated muscle takes 0.12 s x ln(14 / (14 - 10)) = 150 ms to push with the limit of 10 N m.
fault("the subject's torque is beyond its limit", "push of 14 N m", f"push nm=14 {HELD}", 150 + STOP, [SAFE, "beyond the limit of 10"],
      speed=False)
fault("shaft runs away from its target", "runs away at 1 rad/s", f"runaway rad_s=1 {HELD}", 60 + STOP, [SAFE, "should be"])
fault("shaft jams in the ramp", "jammed shaft", f"jam {IN_RAMP}", STOP, [SAFE, "should be|8611h|holds the motion back|13"])
fault("position is reported unchanged while the motor moves", "frozen position", f"position_freeze at=ramp after=0.01", 60 + STOP,
      [SAFE, "should be|beyond"])
fault("drive leaves OPERATIONAL, restarts, or leaves OPERATION ENABLED", "leaves OPERATIONAL", f"leave_operational {HELD}", OFF + 120,
      [SAFE])
fault("drive leaves OPERATIONAL, restarts, or leaves OPERATION ENABLED", "restarts", f"restart {HELD}", OFF, [SAFE])
fault("drive leaves OPERATIONAL, restarts, or leaves OPERATION ENABLED", "leaves OPERATION ENABLED", f"disable {HELD}", OFF,
      [SAFE, "OPERATION ENABLED"])
fault("heartbeat of the drive stays away", "no heartbeat", f"heartbeat_stop {HELD}", 100 + OFF, [SAFE, "no heartbeat of node 12"])
fault("drive loses its power, or sends nothing", "loses its power", f"power_loss {HELD}", OFF, ["no answer|no heartbeat|not be confirmed"])
fault("drive loses its power, or sends nothing", "sends nothing", f"silent {IN_RAMP}", WATCHDOG, ["no answer|no heartbeat"])

# Sensors

fault("torque is no number", "NaN while held", f"nan_torque count=0 {HELD}", HOLD, [SAFE, "no number"], check=holds)
fault("torque is no number", "NaN in the ramp", f"nan_torque count=0 {IN_RAMP}", HOLD, [SAFE, "no number"],
      check=both(holds, never_reverses))
fault("torque, or its counter alone, stands still", "torque stands still", f"torque_freeze {HELD}", 80 + HOLD, [SAFE],
      never=[r"sample counter went from (\d+) to \1\b"])
fault("torque, or its counter alone, stands still", "counter stands still", f"counter_freeze {HELD}", HOLD, [SAFE, "counter"])
fault("torque sensor of a node of its own falls silent in the ramp", "sensor unplugged", f"sensor_silent {IN_RAMP}", STOP + 60,
      [SAFE], rig="sensor.json", check=both(stands_when_power_goes, sync_goes_on))

# Frames

fault("frames come later than their period, swapped, or not at all", "one frame lost, tolerated", f"drop count=1 {IN_RAMP}", None, [],
      status=0, check=sync_goes_on)
fault("frames come later than their period, swapped, or not at all", "one frame lost while held, tolerated", f"drop count=1 {HELD}", None,
      [], status=0, check=sync_goes_on)
fault("frames come later than their period, swapped, or not at all", "one frame 5 ms late while held, tolerated", f"late ms=5 count=1 {HELD}",
      None, [], status=0)
fault("frames come later than their period, swapped, or not at all", "one frame 5 ms late while homing, tolerated",
      "late ms=5 count=1 at=homing after=0.1", None, [], status=0, drive=["--homing-s", "0.4"])
fault("frames come later than their period, swapped, or not at all", "swapped within their periods", f"swap count=0 {HELD}", None, [], status=0)
fault("frames come later than their period, swapped, or not at all", "no more frames", f"drop count=0 {HELD}", 60 + OFF + STOP,
      [SAFE, "no answer to SYNC"])
fault("frames come later than their period, swapped, or not at all", "frames 6 ms late", f"late ms=6 count=20 {HELD}", 80 + STOP, [SAFE])
fault("frames come later than their period, swapped, or not at all", "a late frame while it holds", f"nan_torque count=0 {IN_RAMP}",
      HOLD, [SAFE, "no number"], more=["late ms=6 count=1 at=ramp after=0.15"], check=holds)
fault("frames come twice", "doubled", f"double count=0 {HELD}", STOP, [SAFE, "too often"])
fault("a bit of statusword or position is flipped", "statusword bit 0", f"status_bit bit=0 {HELD}", OFF, [SAFE, "OPERATION ENABLED"])
fault("a bit of statusword or position is flipped", "position bit 13 in the ramp", f"position_bit bit=13 {IN_RAMP}", STOP, [SAFE])
fault("a bit of statusword or position is flipped", "position bit 13, limit: hold", f"position_bit bit=13 {IN_RAMP}", HOLD, [SAFE],
      changes={"safe_state": {"limit": "hold"}}, check=never_reverses)
fault("a bit of statusword or position is flipped", "position bit 13 while held, limit: hold", f"position_bit bit=13 {HELD}", HOLD, [SAFE],
      changes={"safe_state": {"limit": "hold"}})
fault("a bit of statusword or position is flipped", "wrong counter and position, sensor: hold", f"counter_and_position bit=13 {HELD}", HOLD,
      [SAFE])
fault("a bit of statusword or position is flipped", "wrong counter and position in the ramp", f"counter_and_position bit=13 {IN_RAMP}", HOLD,
      [SAFE], check=never_reverses)
fault("a bit of statusword or position is flipped", "wrong counter, position bit 31", f"counter_and_position bit=31 {HELD}", HOLD, [SAFE])
fault("a frame is cut short", "7 bytes", f"cut {HELD}", HOLD, [SAFE, "7 bytes instead of 8"])
fault("flood of foreign frames", "2,000 a second", f"flood per_ms=2 {HELD}", OFF + 80, [SAFE, "foreign frames"])
fault("controller bus-off or error passive; adapter refuses or garbles", "error passive", f"error_flags flags=20 {HELD}", OFF + WATCHDOG,
      [SAFE, "in trouble"])
fault("controller bus-off or error passive; adapter refuses or garbles", "refuses frames", f"refuse {HELD}", WATCHDOG, ["trouble|bus"])
fault("controller bus-off or error passive; adapter refuses or garbles", "garbles", f"garble count=1 {HELD}", OFF + WATCHDOG, [SAFE, "garbled"])
fault("controller bus-off or error passive; adapter refuses or garbles", "adapter hangs in the ramp", f"adapter_hangs {IN_RAMP}", WATCHDOG,
      ["no answer|gone|bus"])


# Statusword without bit 12

@case("statusword without bit 12", "drive without bit 12")
def without_bit_12(open_bench):
    verdict = Verdict("drive without bit 12", "statusword without bit 12")
    with open_bench(drive=["--without-bit-12"]) as bench:
        ended = bench.start().wait()
        seen = bench.seen()
    verdict.targets_are_within_limits(seen)
    verdict.no_power_at_end(seen)
    verdict.ends(ended, 1, ["bit 12"], ["holds the motion back at one of its limits"])
    return verdict


# The program is stopped

PHASES = ("homing", "way", "held", "ramp")
WAY = {"motor": {"homing": {"offset_rad": 0.12}, "go_to_start": {"speed_rad_s": 0.05}}}


def stopped(name, row, number, phase, within_ms, status, says=(), folder=True, resumes_after_s=None):
    def run(open_bench):
        verdict = Verdict(name, row)
        drive = ["--homing-s", "4"] if phase == "homing" else []
        with open_bench(rig_changes=WAY if phase == "way" else None, drive=drive) as bench:
            bench.start()
            came = reach(bench, phase)
            if not came:
                verdict.blind = f"the program did not come to the phase: {last_line(bench.wait().text)}"
                return verdict
            at_s = bench.signal(number)
            ended = bench.wait()
            seen = bench.seen()
            if not seen.powered_at(at_s):
                verdict.blind = "the power was off before the signal: " + last_line(ended.text)
                return verdict
            verdict.targets_are_within_limits(seen)
            verdict.shaft_is_slow(seen)
            verdict.power_goes(seen, at_s, within_ms)
            verdict.no_power_at_end(seen)
            if phase == "ramp":
                stands_when_power_goes(verdict, seen, {"t_s": at_s}, ended)
            if status is not None:
                verdict.ends(ended, status, says)
            elif number != signal.SIGKILL:
                verdict.require(ended.status is not None and ended.status >= 0,
                                "the program dies of the signal" if ended.status else "exit code 0")
            if folder and phase in ("held", "ramp"):
                verified = bench.call("verify", bench.out)
                verdict.require(verified.status == 0, "the session folder is not closed: " + last_line(verified.text))
        return verdict
    CASES[name] = (row, run)


def reach(bench, phase):
    """Waits until the program has come to a phase."""
    if phase == "homing":
        came = bench.until("homing_begins")
        sleep(0.5)
    elif phase == "way":
        # On the drive's own profile, or by cyclic targets.
        came = bench.until(("set_point", "cyclic_begins"))
        sleep(0.5)
    elif phase == "held":
        came = bench.until("power_on", mode=8)
        sleep(0.6)
    else:
        came = bench.until("ramp")
        sleep(0.01)
    return came


def sleep(seconds):
    time.sleep(seconds)


OPERATOR = "the operator ends the session (Ctrl-C, SIGTERM, SIGQUIT, closed terminal, Ctrl-Z), whatever the motor does"
for label in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP"):
    number = getattr(signal, label)
    for phase, words in (("homing", "while homing"), ("way", "on the way to the start"), ("held", "while held"), ("ramp", "in the ramp")):
        stopped(f"{label} {words}", OPERATOR, number, phase, 160 if phase != "ramp" else 200, 1 if phase in ("held", "ramp") else None)
KILLED = "heartbeat of the program stays away: program killed or frozen, or the drive hears nothing"
stopped("SIGKILL in the ramp", KILLED, signal.SIGKILL, "ramp", WATCHDOG, None, folder=False)
stopped("SIGKILL on the way to the start", KILLED, signal.SIGKILL, "way", WATCHDOG, None, folder=False)
fault(KILLED, "the drive hears nothing", f"deaf {HELD}", WATCHDOG, [])


def freeze(bench, seconds):
    """Keeps the program from running: when that began, how the program ended, and what the drive saw."""
    at_s = bench.signal(signal.SIGSTOP)
    sleep(seconds)
    bench.signal(signal.SIGCONT)
    return at_s, bench.wait(), bench.seen()


@case(KILLED, "frozen for 0.5 s in the ramp")
def frozen_long(open_bench):
    verdict = Verdict("frozen for 0.5 s in the ramp", KILLED)
    with open_bench() as bench:
        bench.start()
        if not reach(bench, "ramp"):
            verdict.blind = last_line(bench.wait().text)
            return verdict
        at_s, ended, seen = freeze(bench, 0.5)
    verdict.targets_are_within_limits(seen)
    verdict.power_goes(seen, at_s, WATCHDOG)
    verdict.ends(ended, 1, [])
    return verdict


FROZEN = "program wakes up too late too often"


@case(FROZEN, "frozen for 60 ms in the ramp")
def frozen(open_bench):
    """15 periods are missed, 2 are tolerated: a fault, or at least a trial that does not count and is run again."""
    verdict = Verdict("frozen for 60 ms in the ramp", FROZEN)
    with open_bench() as bench:
        bench.start()
        if not reach(bench, "ramp"):
            verdict.blind = last_line(bench.wait().text)
            return verdict
        at_s, ended, seen = freeze(bench, 0.06)
        trials = (bench.out / "trials.csv").read_text().splitlines()[1:] if (bench.out / "trials.csv").exists() else []
    verdict.targets_are_within_limits(seen)
    first = trials[0].split(",")[6] if trials else "none"
    verdict.require(first != "ok", "the trial that was broken off is 'ok'")
    if ended.status != 0:
        verdict.power_goes(seen, at_s, 60 + STOP + OFF)
        verdict.ends(ended, 1, ["late|no answer|gap"])
    verdict.note(f"exit code {ended.status}, the trial is {first}")
    return verdict


@case(FROZEN, "frozen for 60 ms while held")
def frozen_held(open_bench):
    verdict = Verdict("frozen for 60 ms while held", FROZEN)
    with open_bench() as bench:
        bench.start()
        if not reach(bench, "held"):
            verdict.blind = last_line(bench.wait().text)
            return verdict
        at_s, ended, seen = freeze(bench, 0.06)
    verdict.targets_are_within_limits(seen)
    verdict.power_goes(seen, at_s, 60 + STOP + OFF)
    verdict.ends(ended, 1, ["late|no answer|gap"])
    return verdict


# The origin

ORIGIN = "`resume` after the handle was moved"


def origin(name, restarted):
    def run(open_bench):
        verdict = Verdict(name, ORIGIN)
        with open_bench() as bench:
            bench.start()
            if not reach(bench, "ramp"):
                verdict.blind = last_line(bench.wait().text)
                return verdict
            bench.signal(signal.SIGKILL)
            bench.wait()
            sleep(0.4)
            bench.tell("put 0.05")
            if restarted:
                bench.tell("fault restart")
                sleep(0.2)
            from_s = bench.now_s()
            ended = bench.resume("--yes").wait()
            seen = bench.seen()
        verdict.no_power_at_end(seen)
        verdict.shaft_is_slow(seen)
        homed = seen.first("homed", after_s=from_s)
        verdict.require(homed is None, "it homed where the shaft happened to stand"
                        + (f", {homed['origin_rad']:.3f} rad from the origin of the trials before" if homed else ""))
        ramp = seen.first("ramp", after_s=from_s)
        if ended.status == 0:
            verdict.require(ramp and abs(ramp["angle_rad"]) < 0.006,
                            f"the trial began at {ramp['angle_rad']:.3f} rad from the session's start position" if ramp else "no trial ran")
            verdict.note("went to the origin that the drive had kept")
        else:
            verdict.require(ramp is None, "a trial ran")
            verdict.require(ended.status is not None, "the program did not end")
            verdict.ends(ended, ended.status, ["origin|start position"])
            verdict.note("refused")
        if restarted:
            verdict.require(ended.status not in (0, None), "the origin is lost, and the session went on")
        return verdict
    CASES[name] = (ORIGIN, run)


origin("the drive kept its origin", False)
origin("the drive was restarted", True)


@case(ORIGIN, "restarted, homed at the mark on the operator's word")
def origin_at_the_mark(open_bench):
    verdict = Verdict("restarted, homed at the mark on the operator's word", ORIGIN)
    with open_bench() as bench:
        bench.start()
        if not reach(bench, "ramp"):
            verdict.blind = last_line(bench.wait().text)
            return verdict
        bench.signal(signal.SIGKILL)
        bench.wait()
        sleep(0.4)
        bench.tell("put 0.0")
        bench.tell("fault restart")
        sleep(0.2)
        from_s = bench.now_s()
        ended = bench.resume("--yes", "--home-here").wait()
        seen = bench.seen()
    ramp = seen.first("ramp", after_s=from_s)
    verdict.require(ramp and abs(ramp["angle_rad"]) < 0.006,
                    f"the trial began at {ramp['angle_rad']:.3f} rad" if ramp else "no trial ran")
    verdict.shaft_is_slow(seen)
    verdict.no_power_at_end(seen)
    verdict.ends(ended, 0)
    verdict.note("homed there, the trial ran")
    return verdict


@case(ORIGIN, "the handle is beyond its limits")
def origin_beyond_limits(open_bench):
    """0.25 rad where 0.2 is the limit: refused, or brought back slowly; no burst."""
    verdict = Verdict("the handle is beyond its limits", ORIGIN)
    with open_bench() as bench:
        bench.start()
        if not reach(bench, "ramp"):
            verdict.blind = last_line(bench.wait().text)
            return verdict
        bench.signal(signal.SIGKILL)
        bench.wait()
        sleep(0.4)
        bench.tell("put 0.25")
        from_s = bench.now_s()
        ended = bench.resume("--yes").wait()
        seen = bench.seen()
    ramp = seen.first("ramp", after_s=from_s)
    until_s = ramp["t_s"] - 0.05 if ramp else 1e9
    speed = seen.peak_speed(from_s, until_s)
    verdict.require(speed <= 0.45, f"{speed:.2f} rad/s before the ramp")
    verdict.require(seen.first("homed", after_s=from_s) is None, "it homed where the shaft happened to stand")
    verdict.no_power_at_end(seen)
    if ended.status:
        verdict.ends(ended, ended.status, ["origin|limit|start position"])
        verdict.require(ramp is None, "a trial ran")
    verdict.note(f"{'refused' if ended.status else 'brought back'}, {speed:.2f} rad/s")
    return verdict


# Units

UNITS = "the drive takes speeds in another unit than the program"


def units(name, drive, travel_rad, says):
    def run(open_bench):
        verdict = Verdict(name, UNITS)
        with open_bench(rig_changes={"motor": {"homing": {"offset_rad": 0.15}}}, drive=drive) as bench:
            ended = bench.start().wait()
            seen = bench.seen()
        ramp = seen.first("ramp")
        until_s = ramp["t_s"] - 0.05 if ramp else 1e9
        peak = seen.peak_speed(-1.0, until_s)
        low, high = seen.angles(-1.0, until_s)
        verdict.require(peak <= 0.45 or high - low <= travel_rad,
                        f"the shaft turned at {peak:.2f} rad/s on the way to the start (0.3 are due), over {high - low:.3f} rad")
        # A program that does not use the drive's profiles need not know their unit.
        verdict.require(ended.status is not None, "the program did not end")
        if ended.status:
            verdict.ends(ended, ended.status, says)
        verdict.no_power_at_end(seen)
        verdict.note(f"{peak:.2f} rad/s over {1000 * (high - low):.0f} mrad")
        return verdict
    CASES[name] = (UNITS, run)


units("rpm, told by 60A9h", ["--profile-unit", "rpm"], 0.0, ["60A9h|rpm|unit"])
units("rpm, told by nobody", ["--profile-unit", "rpm", "--without-si-units"], 0.02, ["speed|unit|scale"])


# The terminal

TERMINAL = "the terminal takes no text"


@case(TERMINAL, "EMCY while standard error is blocked")
def blocked_terminal(open_bench):
    verdict = Verdict("EMCY while standard error is blocked", TERMINAL)
    with open_bench(faults=[f"emcy code=4310 {HELD}"]) as bench:
        with bench.own_output() as terminal:
            bench.start()
            bench.until("cyclic_begins")
            terminal.block()
            came = bench.until("fault")
            sleep(0.8)
            seen = bench.seen()
        ended = bench.wait()
    struck = seen.first("fault")
    if not came or not seen.powered_at(struck["t_s"] - 1e-6):
        verdict.blind = "the program ended before the fault: " + last_line(ended.text)
        return verdict
    verdict.targets_are_within_limits(seen)
    verdict.power_goes(seen, struck["t_s"], OFF)
    verdict.ends(ended, 1, [SAFE, "4310h"])
    return verdict


# Opening

OPENING = "the adapter is never silent, or ignores `C`"
for habit in ("never_silent", "ignores_close"):
    def opening(open_bench, habit=habit):
        name = f"adapter {habit.replace('_', ' ')}"
        verdict = Verdict(name, OPENING)
        with open_bench(drive=["--adapter", habit]) as bench:
            ended = bench.start().wait(15)
            seen = bench.seen()
        verdict.require(ended.status is not None, "the program hangs while it opens the adapter; killed after 15 s")
        verdict.no_power_at_end(seen)
        verdict.note(f"ended after {ended.took_s:.1f} s with code {ended.status}")
        if ended.status:
            verdict.ends(ended, ended.status, ["adapter|foreign"])
        return verdict
    CASES[f"adapter {habit.replace('_', ' ')}"] = (OPENING, opening)


# Arming and an ordinary session

@case("no fault at all", "ordinary session")
def ordinary(open_bench):
    verdict = Verdict("ordinary session", "no fault at all")
    with open_bench(rig_changes={"motor": {"homing": {"offset_rad": 0.1}}}) as bench:
        ended = bench.start().wait()
        seen = bench.seen()
    if BUSY.search(ended.text) or "no answer to SYNC" in ended.text:
        verdict.blind = "the machine was busy: " + last_line(ended.text)
        return verdict
    verdict.targets_are_within_limits(seen)
    verdict.shaft_is_slow(seen)
    verdict.no_power_at_end(seen)
    ramp = seen.first("ramp")
    if verdict.require(ramp is not None, "no ramp came"):
        way = seen.peak_speed(-1.0, ramp["t_s"] - 0.05)
        verdict.require(way <= 0.45, f"{way:.2f} rad/s on the way to the start, 0.3 are due")
    verdict.ends(ended, 0)
    low, high = seen.targets()
    verdict.note(f"targets {low:.3f} to {high:.3f} rad, steps up to {seen.largest_step_rad_s():.2f} rad/s, "
                 f"accelerations up to {seen.largest_acceleration_rad_s2():.0f} rad/s2")
    return verdict


__all__ = ["Bench", "CASES"]
