"""One try: the emulated drive as a process, the program as another, and what can be done to both."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

from .seen import Seen

ROOT = Path(__file__).resolve().parents[2]
FIXTURES = ROOT / "fixtures"
RIGS = FIXTURES / "foreign_drive" / "rigs"


def merged(base, changes):
    """A rig with some of its fields replaced, however deep."""
    result = dict(base)
    for key, value in changes.items():
        inner = isinstance(value, dict) and isinstance(base.get(key), dict)
        result[key] = merged(base[key], value) if inner else value
    return result


class Ended:
    """How the program ended."""

    def __init__(self, status, text, took_s):
        self.status, self.text, self.took_s = status, text, took_s


class Terminal:
    """A pipe that can be filled so that whoever writes to it waits."""

    def __init__(self):
        self.reads, self.writes = os.pipe()

    def block(self):
        # Another way to the same pipe: that of the program stays one that waits.
        filler = os.open(f"/proc/self/fd/{self.writes}", os.O_WRONLY | os.O_NONBLOCK)
        for size in (4096, 1):
            with suppress(BlockingIOError):
                while True:
                    os.write(filler, b"." * size)
        os.close(filler)

    def open_again(self):
        os.close(self.writes)
        return open(self.reads, encoding="utf-8")


class Bench:
    def __init__(self, program, folder, rig="drive.json", rig_changes=None, drive=(), faults=(), protocol=None):
        self.program, self.folder = str(program), Path(folder)
        self.folder.mkdir(parents=True)
        changes = {"bus": f"slcan:{self.folder / 'drive.tty'}", **(rig_changes or {})}
        self.rig = merged(json.loads((RIGS / rig).read_text()), changes)
        (self.folder / "rig.json").write_text(json.dumps(self.rig, indent=1))
        self.protocol = merged(json.loads((RIGS / "one-trial.json").read_text()), protocol or {})
        (self.folder / "protocol.json").write_text(json.dumps(self.protocol, indent=1))
        self.out = self.folder / "session"
        self.process = None
        self._output, self._blocked = subprocess.PIPE, None
        command = [sys.executable, "-m", "foreign_drive", "--port", str(self.folder / "drive.tty"), "--control",
                   str(self.folder / "control"), "--log", str(self.folder / "seen"), *drive]
        if rig == "sensor.json":
            command += ["--sensor", str(self.rig["sensors"][0]["node"])]
        for fault in faults:
            command += ["--fault", fault]
        self.drive = subprocess.Popen(command, cwd=FIXTURES, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        if self.drive.stdout.readline().strip() != "ready":
            raise RuntimeError("the emulated drive did not start: " + self.drive.stderr.read())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process is not None and self.process.poll() is None:
            self.process.kill()
            self.process.communicate()
        self.quit_drive()

    def quit_drive(self):
        if self.drive.poll() is None:
            try:
                self.tell("quit")
                self.drive.wait(5)
            except (OSError, subprocess.TimeoutExpired):
                self.drive.kill()
                self.drive.wait()

    def tell(self, line):
        """A line to the drive's control socket, and its answer."""
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(5)
            connection.connect(str(self.folder / "control"))
            connection.sendall(line.encode() + b"\n")
            return json.loads(connection.recv(4000))

    # The program

    def start(self, *more):
        command = [self.program, "run", self.folder / "protocol.json", "--rig", self.folder / "rig.json", "--subject", "S1",
                   "--seed", "1", "--yes", "--out", self.out, *more]
        return self._spawn(command)

    def resume(self, *more):
        return self._spawn([self.program, "resume", self.out, *more])

    def _spawn(self, command):
        self.began_s = time.monotonic()
        self.process = subprocess.Popen([str(part) for part in command], stdin=subprocess.DEVNULL, stdout=self._output,
                                        stderr=subprocess.STDOUT, text=True, cwd=self.folder, start_new_session=True)
        return self

    @contextmanager
    def own_output(self):
        """A terminal for a program that is started meanwhile. While it is blocked it takes no text; afterwards everything is read."""
        terminal = Terminal()
        self._output = terminal.writes
        try:
            yield terminal
        finally:
            self._output = subprocess.PIPE
            self._blocked = terminal.open_again()

    def call(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True, timeout=60, cwd=self.folder,
                              stdin=subprocess.DEVNULL)
        return Ended(done.returncode, done.stdout + done.stderr, 0.0)

    def wait(self, timeout_s=40):
        """Waits for the end; a program that does not end is killed, and its status is None."""
        try:
            if self._blocked is None:
                text, _ = self.process.communicate(timeout=timeout_s)
            else:
                text = self._blocked.read()
                self.process.wait(timeout_s)
            status = self.process.returncode
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
            text, _ = self.process.communicate()
            status = None
        time.sleep(0.25)  # the drive writes its log a little later
        ended = Ended(status, text, time.monotonic() - self.began_s)
        with open(self.folder / "output.txt", "a", encoding="utf-8") as kept:
            kept.write(f"{text}\nstatus {status}, {ended.took_s:.1f} s\n\n")
        return ended

    def signal(self, number):
        """Sends a signal; returns when, on the drive's clock."""
        at_s = self.now_s()
        os.kill(self.process.pid, number)
        return at_s

    def now_s(self):
        """The drive's clock."""
        begins = self.seen().events[0]["monotonic_s"]
        return time.clock_gettime(time.CLOCK_MONOTONIC) - begins

    def seen(self):
        return Seen(self.folder / "seen", self.rig, self.protocol)

    def until(self, event, timeout_s=20, count=1, **values):
        """Waits until the drive has seen something, or one of several things; whether it has."""
        events = (event,) if isinstance(event, str) else event
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            seen = self.seen()
            if any(len(seen.all(event, **values)) >= count for event in events):
                return True
            if self.process.poll() is not None:
                return False
            time.sleep(0.004)
        return False
