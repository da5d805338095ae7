"""Generates a case's session, has it diagnosed, and reads the answer. The program sees the session folder alone."""

import json
import shutil
import subprocess
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from .. import oracle
from ..generator import generate
from ..noise import CannotHold
from ..session_writer import truth_of, write_session
from .plan import Case


@dataclass
class Outcome:
    case: Case
    truth: dict
    diagnosis: dict | None  # None where the program failed; then `error` says how
    error: str | None
    seconds: float
    oracle: dict | None = None  # see oracle.Finding


def run_case(case: Case, program: list[str], work: Path, limit_s: float, keep: bool, ask_oracle: bool = False) -> Outcome:
    session, out = work / f"session-{case.seed:06d}", work / f"out-{case.seed:06d}"
    try:
        generated = generate(case.seed, case.effect, case.size, laboratory=case.where(), with_rig_trials=case.rig_trials, trap=case.trap)
    except CannotHold as error:
        hidden = [{"mechanism": m, "class": "", "parameters": {}} for m in case.causes]
        return Outcome(case, {"hidden": hidden, "means": {}}, None, str(error), 0.0)
    write_session(generated, session)
    truth = json.loads(json.dumps(truth_of(generated, case.effect, case.laboratory), default=float))
    started = time.monotonic()
    written = work / f"rig-calibration-{case.seed:06d}.json"
    calibration, error = _calibrate(program, session, written, limit_s) if case.rig_trials else ([], None)
    diagnosis = None
    if error is None:
        diagnosis, error = _diagnose([*program, "diagnose", str(session), "--out", str(out), "--seed", str(case.seed), *calibration], out,
                                     limit_s)
    seconds = time.monotonic() - started
    if keep:
        (work / "truth").mkdir(exist_ok=True)
        (work / "truth" / f"{session.name}.json").write_text(json.dumps(truth, indent=1))
    else:
        shutil.rmtree(session)
        shutil.rmtree(out, ignore_errors=True)
        written.unlink(missing_ok=True)
    found = oracle.finding(case.seed, case.effect, case.where(), case.size).as_json() if ask_oracle and case.causes else None
    return Outcome(case, truth, diagnosis, error, seconds, found)


def _calibrate(program, session, written, limit_s):
    """The arguments that give `diagnose` the calibration of the session's rig trials, or an error."""
    error = _failure([*program, "calibrate", str(session), "--out", str(written)], limit_s)
    if error is None and not written.is_file():
        error = "wrote no rig-calibration.json"
    return (None, f"calibrate: {error}") if error else (["--calibration", str(written)], None)


def _failure(command, limit_s):
    """How the command failed; None where it did not."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit_s, check=False)
    except subprocess.TimeoutExpired:
        return f"took more than {limit_s:g} s"
    return f"exit code {done.returncode}: {done.stderr.strip()[-300:]}" if done.returncode != 0 else None


def _diagnose(command, out, limit_s):
    error = _failure(command, limit_s)
    if error is not None:
        return None, error
    try:
        diagnosis = json.loads((out / "diagnosis.json").read_text())
    except (OSError, ValueError) as e:
        return None, f"diagnosis.json: {e}"
    problem = _format_problem(diagnosis)
    return (None, problem) if problem else (diagnosis, None)


def _format_problem(d):
    if d.get("format") != "ramphold-diagnosis/1":
        return f"format is {d.get('format')!r}"
    if d.get("verdict") not in ("adequate", "named", "ambiguous", "unexplained"):
        return f"verdict is {d.get('verdict')!r}"
    for cause in d.get("causes", [None]):
        if not isinstance(cause, dict) or not {"mechanism", "parameters", "indistinguishable"} <= cause.keys():
            return "a cause lacks mechanism, parameters or indistinguishable"
    return None if "causes" in d else "causes are missing"


def run_all(cases, program, work, jobs, limit_s, keep, told, ask_oracle=False):
    """Outcomes in the order of the cases; `told(done, outcome)` hears of each as it comes."""
    found = {}
    with ProcessPoolExecutor(jobs) as pool:
        waiting = {pool.submit(run_case, c, program, work, limit_s, keep, ask_oracle): i for i, c in enumerate(cases)}
        for future in as_completed(waiting):
            found[waiting[future]] = future.result()
            told(len(found), found[waiting[future]])
    return [found[i] for i in range(len(cases))]
