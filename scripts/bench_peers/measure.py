"""One run of everything: the same problems, the same rounds, ours and theirs in turn."""

import dataclasses
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from . import fits, plain
from .problem import Part, Windows
from .wrist import simulate, simulate_with_slopes

PROBLEMS = ("weighed_repetition", "weighed_session", "plain_repetition", "plain_session")
FIGURES = ("simulation", "simulation_alone", "sensitivities", "sensitivities_alone", *PROBLEMS, "from_nothing", "together", "bootstrap")
# How far from its optimum each parameter of a plain problem starts at most, as a part of it.
NEAR = 0.1
REFITS = 1000
# Sessions of the bootstrap that the peers refit.
DRAWN = 6
# (c) is cut off after so long on the core.
LONGEST_S = 300.0


class Ours:
    """Our side, a program that answers in JSON."""

    def __init__(self, program: str, session: str, work: Path):
        self.program, self.session, self.starts = program, session, work / "starts.json"

    def ask(self, *words: str):
        answer = subprocess.run([self.program, *words], check=True, capture_output=True, text=True)
        return json.loads(answer.stdout)

    def seconds(self, figure: str) -> float:
        return self.ask("time", figure, self.session, str(self.starts))["on_core_s"]


def best(work, least_s=0.2, fewest=3) -> float:
    """The best of several times that `work` takes, on the core."""
    begun, times = time.perf_counter(), []
    while len(times) < fewest or time.perf_counter() - begun < least_s:
        before = time.thread_time()
        work()
        times.append(time.thread_time() - before)
    return min(times)


def told(*what):
    print(*what, file=sys.stderr, flush=True)


def prepare(ours: Ours, work: Path) -> Windows:
    """Writes the problems; the plain ones start near the optimum that (a) finds when it is let run to the end."""
    file = work / "problem.json"
    problem = ours.ask("problem", ours.session, str(DRAWN))
    file.write_text(json.dumps(problem))
    windows = Windows(file)
    settings = fits.Settings(sparse=False, scaled=True, tolerance=1e-10)
    random = np.random.default_rng(1)
    starts = {}
    for name in ("repetition", "session"):
        start = np.array(problem[f"plain_{name}"]["start"])
        for part in windows.parts(f"plain_{name}"):
            optimum = fits.with_sensitivities(part, settings, max_nfev=2000).x
            near = optimum + NEAR * random.uniform(-1.0, 1.0, len(optimum))
            start[part.used] = np.clip(near, part.low, part.high)
        starts[name] = start.tolist()
    ours.starts.write_text(json.dumps(starts))
    problem.update(ours.ask("plain", ours.session, str(ours.starts)))
    file.write_text(json.dumps(problem))
    return Windows(file)


@dataclasses.dataclass
class Agreement:
    """Greatest differences from ours at the start: torque in N m, derivatives relative to the greatest of each."""

    torque: float
    slopes: float
    torque_of_solve_ivp: float


def agreement(w: Windows) -> Agreement:
    """The model is the same, or nothing else here means anything."""
    torque, slopes = np.empty_like(w.torque), np.empty_like(w.slopes)
    for i, p in enumerate(w.parameters):
        simulate_with_slopes(w.theta[i], w.omega[i], p, *w.constants, torque[i], slopes[i])
    apart = np.abs(slopes - w.slopes).max((0, 1)) / np.abs(w.slopes).max((0, 1))
    solved = [plain.simulate(w, w.theta[i], w.omega[i], p) for i, p in enumerate(w.parameters)]
    found = Agreement(np.abs(torque - w.torque).max(), apart.max(), np.abs(np.array(solved) - w.torque).max())
    # Ours takes exact steps, the peers Runge-Kutta ones; each is within 1e-5 N m of the model.
    if found.torque > 2e-5 or found.slopes > 1e-3 or found.torque_of_solve_ivp > 1e-3:
        sys.exit(f"the peers' model is not ours: {found}")
    return found


def one_simulation(w: Windows) -> dict:
    """Times of one simulation, plain and with six sensitivities, by peer; finite differences take seven simulations."""
    torque, slopes, trials = np.empty(w.samples), np.empty((w.samples, 6)), range(len(w.theta))

    def all_plain():
        for i in trials:
            simulate(w.theta[i], w.omega[i], w.parameters[i], *w.constants, torque)

    def all_slopes():
        for i in trials:
            simulate_with_slopes(w.theta[i], w.omega[i], w.parameters[i], *w.constants, torque, slopes)

    one, with_slopes = best(all_plain) / len(trials), best(all_slopes) / len(trials)
    solved = best(lambda: plain.simulate(w, w.theta[0], w.omega[0], w.parameters[0]))
    return {"simulation": {"a": one, "b": one, "c": solved}, "sensitivities": {"a": with_slopes, "b": 7 * one, "c": 7 * solved}}


class CutOff(Exception):
    """(c) took too long."""


@dataclasses.dataclass
class Slow:
    """What became of (c) on a problem."""

    seconds: float
    cut_off: bool
    costs: list[float] | None
    seconds_a_call: float


def solve_ivp_fit(part: Part, settings: fits.Settings, calls_of_b: int) -> Slow:
    """(c), to its end or until it is cut off; then what as many evaluations as (b) needed would take."""
    begun = time.thread_time()

    def watched(x):
        if time.thread_time() - begun > LONGEST_S:
            raise CutOff
        return type(part).residuals_of_solve_ivp(part, x)

    part.calls, part.residuals_of_solve_ivp = 0, watched
    try:
        x = fits.with_solve_ivp(part, settings).x
    except CutOff:
        a_call = (time.thread_time() - begun) / part.calls
        return Slow(a_call * calls_of_b, True, None, a_call)
    finally:
        del part.residuals_of_solve_ivp
    seconds = time.thread_time() - begun
    a_call = seconds / part.calls
    return Slow(seconds, False, [part.cost(x)], a_call)


def peak_bytes() -> int:
    """The most memory that this process ever held."""
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM:"))
    return 1024 * int(line.split()[1])


def memory(file: Path, peer: str, settings: str) -> int:
    """Peak memory of a process of its own that fits the session once; (c) takes a single step."""
    words = [sys.executable, "-m", "bench_peers", "memory", str(file), peer, settings]
    return int(subprocess.run(words, check=True, capture_output=True, text=True, env=os.environ).stdout)


def fit_for_memory(file: Path, peer: str, settings: str) -> int:
    sparse, scaled, tolerance = json.loads(settings)
    more = {"max_nfev": 1} if peer == "c" else {}
    for part in Windows(file).parts("weighed_session"):
        fits.PEERS[peer](part, fits.Settings(sparse, scaled, tolerance), **more)
        if peer == "c":
            break
    return peak_bytes()
