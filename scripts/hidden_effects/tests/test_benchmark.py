"""The benchmark must pass a diagnosis that is right and fail one that is not."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hidden_effects.benchmark import plan, run, score, table
from hidden_effects.benchmark.run import Outcome
from hidden_effects.noise import CannotHold

SCRIPTS = Path(__file__).resolve().parents[2]
STAND_IN = Path(__file__).with_name("stand_in.py")
ALL_KINDS = "channel_skew,fatigue,lever_inertia,none,alien,pair"


def benchmark(mode, tmp_path, only=ALL_KINDS):
    counts = plan.Counts(1, 2, 2, 1)
    wanted = set(only.split(","))
    cases = [c for c in plan.cases(counts, 50) if c.effect in wanted or c.group in wanted]
    effects = ";".join(f"{c.seed}:{c.effect}" for c in cases)
    return subprocess.run(
        [sys.executable, str(SCRIPTS / "hidden-effects"), "--program", f"{sys.executable} {STAND_IN} {mode} '{effects}'",
         "--seed", "50", "--per-mechanism", "1", "--none", "2", "--alien", "2", "--pair", "1", "--only", only,
         "--markdown", str(tmp_path / "table.md")],
        env={**os.environ, "PYTHONPATH": str(SCRIPTS)}, capture_output=True, text=True, check=False)


def test_a_right_diagnosis_passes(tmp_path):
    done = benchmark("right", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "**no**" not in done.stdout and "3/3" in done.stdout
    assert (tmp_path / "table.md").read_text() in done.stdout + "\n"


def test_a_diagnosis_that_sees_nothing_fails(tmp_path):
    done = benchmark("blind", tmp_path, "channel_skew,fatigue,alien,pair")
    assert done.returncode == 1 and done.stdout.count("**no**") >= 4


def test_a_program_that_fails_is_told_and_fails(tmp_path):
    done = benchmark("crash", tmp_path, "channel_skew")
    assert done.returncode == 1 and "no such verb" in done.stdout


def outcome(effect, causes, verdict="named", truth=None):
    hidden = [{"mechanism": m, "class": "sensor", "parameters": {"delay_s": {"value": 1.0, "nominal": False}}}
              for m in effect.split("+")]
    truth = truth or {"hidden": hidden, "means": {"k_srs_nm_per_rad": 20.0, "x_e_rad": 0.05}}
    return Outcome(plan.Case(effect, 1), truth, {"verdict": verdict, "causes": causes}, None, 1.0)


def named(mechanism, others=(), **parameters):
    return {"mechanism": mechanism, "indistinguishable": list(others), "parameters": parameters}


def test_a_set_of_four_does_not_count_as_found():
    three = outcome("channel_skew", [named("torque_gain", ["channel_skew", "torque_lag"])])
    four = outcome("channel_skew", [named("torque_gain", ["channel_skew", "torque_lag", "lever_damping"])])
    assert score.found(three, "channel_skew") and not score.found(four, "channel_skew")


def test_alone_means_one_cause_and_no_rival():
    assert score.alone(outcome("fatigue", [named("fatigue")]), "fatigue")
    assert not score.alone(outcome("fatigue", [named("fatigue"), named("mains_hum")]), "fatigue")
    assert not score.alone(outcome("fatigue", [named("fatigue", ["thixotropy"])]), "fatigue")


def test_a_law_of_the_elastic_limit_is_found_as_a_law_and_not_as_a_cause():
    def with_law(effect, law):
        o = outcome(effect, [], "adequate")
        o.diagnosis["laws"] = {"elastic_limit": {"law": law, "delay_s": {"value": 1, "low": 0.5, "high": 1.5}}}
        return o
    told = with_law("timed_yield", "timed_yield")
    assert score.found(told, "timed_yield") and score.alone(told, "timed_yield")
    assert score.coverage(told) == [("delay_s", True)]
    assert not score.found(with_law("timed_yield", "linear"), "timed_yield")
    assert not score.found(outcome("timed_yield", [named("timed_yield")]), "timed_yield")
    [false] = [r for r in score.rates([with_law("none", "timed_yield"), with_law("none", "linear")])
               if r.name.startswith("a limit that is not a time")]
    assert (false.hits, false.of) == (1, 2)


@pytest.mark.parametrize("low, high, hit", [(0.5, 1.5, True), (1.1, 1.5, False), (None, None, False)])
def test_an_interval_covers_or_does_not(low, high, hit):
    o = outcome("channel_skew", [named("channel_skew", delay_s={"value": 1, "low": low, "high": high})])
    assert score.coverage(o) == [("delay_s", hit)]


def test_a_missing_value_is_not_covered():
    assert score.coverage(outcome("channel_skew", [named("channel_skew")])) == [("delay_s", False)]


def test_a_bias_must_be_halved():
    def with_after(after):
        shift = {"k_srs_nm_per_rad": {"before": 24.0, "after": after}}
        return outcome("channel_skew", [named("channel_skew") | {"parameter_shift": shift}])
    assert score.bias_rate([with_after(21.0)], "k_srs_nm_per_rad").met
    assert not score.bias_rate([with_after(23.0)], "k_srs_nm_per_rad").met


def test_the_full_plan_is_what_the_requirement_says():
    cases = plan.cases(plan.FULL, 1000)
    by = lambda g: [c for c in cases if c.group == g]
    assert min(sum(c.effect == m for c in cases) for m in plan.MECHANISMS) >= 10
    assert len(by("none")) == 100 and len(by("pair")) == 20
    assert len(by("alien")) == 30 and len({c.effect for c in by("alien")}) >= 6
    assert len({c.seed for c in cases}) == len(cases)


def test_a_subject_who_cannot_hold_the_torque_is_told_and_stops_nothing(monkeypatch, tmp_path):
    def refuse(*_, **__):
        raise CannotHold("this person cannot hold the target torque")

    monkeypatch.setattr(run, "generate", refuse)
    case = plan.Case("alien:echo", 1)
    o = run.run_case(case, ["no program"], tmp_path, 1.0, False)
    assert o.diagnosis is None and "cannot hold" in o.error
    assert "cannot hold" in table.markdown([o], score.rates([o]))
