"""Rig trials hold the rig of the session, with its faults and without its person."""

import csv
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from hidden_effects.benchmark import plan, score
from hidden_effects.benchmark.run import Outcome
from hidden_effects.generator import generate
from hidden_effects.laboratories import LABORATORIES
from hidden_effects.plant import FINE_HZ
from hidden_effects.rig import loads, motion, trials
from hidden_effects.rig.bearing import FRICTION, fit_bearing
from hidden_effects.rig.writer import TABLE
from hidden_effects.scenario import base_scenario
from hidden_effects.session_writer import truth_of, write_session

SCRIPTS = Path(__file__).resolve().parents[2]
PAPER = LABORATORIES["paper"]
SHORT = {"repetitions": 1, "duration_s": 0.6}


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Multisines of 0.6 s: the integration takes seconds otherwise."""
    for name, blocks in loads.BLOCKS.items():
        monkeypatch.setitem(loads.BLOCKS, name, tuple(replace(b, duration_s=0.6) if b.duration_s else b for b in blocks))


def rig(effect="none", laboratory="paper", trap=None, seed=4):
    """Rig trials without the session's person, who takes time."""
    names = [] if effect == "none" else [effect]
    return trials.rig_trials(seed, names, 1.0, LABORATORIES[laboratory], [], trap)


def moved(blocks, laboratory=PAPER, bearing=("smooth", 0.005, 0.2)):
    run = loads.expanded(blocks, laboratory.velocities_rad_s)
    s = trials.rig_scenario(base_scenario(4, laboratory), run)
    if bearing:
        fit_bearing(s, *bearing)
    return s, run, trials.moved(s, run)


def of(recordings, load, **fields):
    return [r for r in recordings if r.trial.load == load and all(getattr(r.trial, k) == v for k, v in fields.items())]


@pytest.mark.parametrize("name", LABORATORIES)
def test_each_laboratory_writes_rig_trials_as_the_format_says(name, tmp_path):
    laboratory = LABORATORIES[name]
    write_session(generate(5, repetitions=1, laboratory=laboratory, with_rig_trials=True), tmp_path / "s")
    lines = (tmp_path / "s/rig-trials.csv").read_text().splitlines()
    assert lines[0] == TABLE
    rows = list(csv.DictReader(lines))
    assert [int(r["trial"]) for r in rows] == list(range(1, len(rows) + 1)) and {r["load"] for r in rows} <= set(loads.LOADS)
    for r in rows:
        data = np.genfromtxt(tmp_path / "s" / r["file"], delimiter=",", names=True)
        assert data.dtype.names == ("t_s", "target_rad", "theta_m_rad", "torque_l_nm") and data["t_s"][0] == 0
        assert np.allclose(np.diff(data["t_s"]), 1 / laboratory.sample_hz, atol=1e-9)
        before = data["t_s"] < 0.2
        assert np.ptp(data["target_rad"][before]) == 0 and np.ptp(data["theta_m_rad"][before]) <= 2 * np.pi / laboratory.encoder_counts
        counts = data["theta_m_rad"] / (2 * np.pi / laboratory.encoder_counts)
        assert np.abs(counts - np.round(counts)).max() < 1e-7 / (2 * np.pi / laboratory.encoder_counts)
        assert (r["velocity_rad_s"] != "") == (r["motion"] == "ramp") and (r["sign"] != "") == (r["load"] == "known_weight")
        assert (r["relative_error"] != "") == (r["load"] in loads.PROPERTY)


def test_a_session_without_rig_trials_has_none(tmp_path):
    write_session(generate(5, repetitions=1), tmp_path / "s")
    assert not (tmp_path / "s/rig-trials.csv").exists() and "rig_trials" not in truth_of(generate(5, repetitions=1), "none")


def test_some_laboratories_have_a_weight_alone_beside_the_empty_handle_and_some_have_all_loads():
    kinds = {name: {b.load for b in blocks} for name, blocks in loads.BLOCKS.items()}
    assert set(kinds) == set(LABORATORIES)
    assert kinds["slow"] == {"empty_handle", "known_weight"} and kinds["flicker"] == set(loads.LOADS)
    assert all("clamped_handle" not in kinds[n] for n, own in LABORATORIES.items() if own.lever is None)


def test_a_multisine_stays_within_its_amplitude_and_starts_and_ends_at_rest():
    block = loads.multisine(amplitude_rad=0.01)
    t = np.arange(-1000, 40000) / FINE_HZ
    angle = motion.multisine(block, t)
    assert np.max(np.abs(angle)) == pytest.approx(0.01, rel=1e-6)
    assert not angle[t <= 0].any() and not angle[t >= block.duration_s].any()
    assert np.abs(np.diff(angle)[(t[:-1] > -0.01) & (t[:-1] < 0.001)]).max() < 1e-6


def test_the_motion_is_that_of_an_adaptive_integrator():
    blocks = (loads.multisine(**SHORT), loads.bar(0.004, **SHORT), loads.clamp(**SHORT), loads.spring(20.0, **SHORT), loads.weight(1.0, **SHORT))
    s, run, m = moved(blocks)
    lever, at = PAPER.own_lever(), m.t_s[::20]
    for i, trial in enumerate(run):
        told, inertia = CubicSpline(m.t_s, s.ramp.told_rad[i]), lever["inertia_kg_m2"] + trial.true_inertia_kg_m2
        torque = lambda y: 900.0 * (y[0] - y[2]) + 0.4 * (y[1] - y[3]) * (1 + 0.2 * np.abs(y[1] - y[3]))

        def rates(t, y):
            on_handle = 0.005 * np.tanh(y[3] / 0.01) + trial.true_stiffness_nm_per_rad * y[2] + trial.true_torque_nm
            handle = [0.0, 0.0] if trial.load == "clamped_handle" else [y[3], (torque(y) - on_handle) / inertia]
            return [y[1], s.servo.acceleration(told(t), y[0], y[1], torque(y)), *handle]

        load = trial.true_torque_nm
        start = [-load / 1000.0, 0.0, -load / 1000.0 - load / 900.0, 0.0]
        solved = solve_ivp(rates, (at[0], at[-1]), start, t_eval=at, rtol=1e-7, atol=1e-10, max_step=1e-3)
        assert np.abs(torque(solved.y) - m.torque_l[i, ::20]).max() < 1e-3, trial.load
        assert np.abs(solved.y[0] - m.theta_m[i, ::20]).max() < 2e-6


def test_a_rigid_handle_shows_the_load_alone():
    blocks = (loads.multisine(**SHORT), loads.bar(0.004, **SHORT), loads.spring(20.0, **SHORT))
    _, _, m = moved(blocks, LABORATORIES["rigid"])
    acceleration = np.gradient(m.speed_m, m.t_s, axis=1)
    assert not m.torque_l[0].any()
    assert np.allclose(m.torque_l[1], 0.004 * acceleration[1], atol=0.02 * np.abs(m.torque_l[1]).max())
    assert np.allclose(m.torque_l[2], 20.0 * m.theta_m[2])


@pytest.mark.parametrize("law", FRICTION)
def test_friction_resists_by_its_level_once_the_handle_runs(law):
    blocks = (loads.ramps(1),)
    with_it, without = (moved(blocks, bearing=b)[2] for b in ((law, 0.02, 0.0), None))
    running = without.speed_m > 0.8 * without.speed_m.max(axis=1, keepdims=True)
    assert np.mean((with_it.torque_l - without.torque_l)[running]) == pytest.approx(0.02, rel=0.15)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_weight_gives_its_torque_times_the_gain_at_both_signs(sign):
    for effect, gain in (("none", 1.0), ("torque_gain", 1.25)):
        r = rig(effect)
        mean = np.mean([np.mean(one.torque_l_nm) for one in of(r.recordings, "known_weight", sign=sign)])
        load = of(r.recordings, "known_weight", sign=sign)[0].trial.true_torque_nm
        assert mean == pytest.approx(r.quantities["torque_offset_nm"] + gain * load, abs=0.002)
        assert abs(load) == pytest.approx(9.80665 * 0.1, rel=0.006) and r.quantities["torque_gain"] == gain


def test_a_fault_of_the_rig_is_in_its_trials_and_a_fault_of_the_wrist_is_not():
    plain = rig("none").recordings
    difference = lambda effect: max(np.abs(a.torque_l_nm - b.torque_l_nm).max() + np.abs(a.theta_m_rad - b.theta_m_rad).max()
                                    for a, b in zip(plain, rig(effect).recordings))
    for effect in ("lever_damping", "channel_skew", "torque_lag", "servo_following@third_order", "mains_hum", "alien:loose_mass"):
        assert difference(effect) > 0.01, effect
    for effect in ("joint_friction", "interface_slack", "alien:tendon_whip"):
        assert difference(effect) == 0, effect


def test_every_cause_of_the_rig_can_be_hidden_in_rig_trials():
    for mechanism in sorted(trials.RIG_CAUSES - {"torque_saturation"}):
        assert [h.mechanism for h in rig(mechanism).hidden] == [mechanism]
    session = generate(4, "torque_saturation", repetitions=1, with_rig_trials=True)
    assert session.rig.hidden[0].parameters["level_nm"] == session.hidden[0].parameters["level_nm"] > 1.0


def test_the_encoder_follows_the_command_whatever_its_gain():
    """The servo holds the record at the command, so that the handle moves less and the torque is smaller."""
    plain, off = (of(rig(e).recordings, "empty_handle", motion="multisine")[0] for e in ("none", "angle_gain"))
    assert np.abs(off.theta_m_rad - plain.theta_m_rad).max() < 3e-4
    assert np.std(off.torque_l_nm) / np.std(plain.torque_l_nm) == pytest.approx(1 / 1.2, rel=0.01)


def test_a_fault_that_comes_only_with_the_person_is_not_in_the_rig_trials():
    trapped, plain = rig("torque_gain", trap="person_only"), rig("none")
    assert trapped.hidden == [] and trapped.quantities["torque_gain"] == 1.0 and trapped.as_json()["trap"] == "person_only"
    assert all(np.array_equal(a.torque_l_nm, b.torque_l_nm) for a, b in zip(trapped.recordings, plain.recordings))
    with pytest.raises(ValueError, match="needs a hidden fault of the rig"):
        rig("joint_friction", trap="person_only")


@pytest.mark.parametrize("seed", range(3))
def test_a_wrong_load_is_stated_10_to_20_per_cent_off(seed):
    trapped, plain = rig(trap="wrong_load", seed=seed), rig(seed=seed)
    [wrong] = trapped.wrong_loads
    assert 0.1 <= abs(wrong["stated_over_true"] - 1) <= 0.2
    off = {a.trial.load for a, b in zip(trapped.recordings, plain.recordings) if a.trial.true_over_stated != b.trial.true_over_stated}
    assert off == {wrong["load"]} and [r.trial.block for r in trapped.recordings] == [r.trial.block for r in plain.recordings]


def test_rig_trials_of_another_day_are_of_constants_that_drifted():
    trapped = rig("lever_inertia", trap="another_day")
    then = trapped.then_over_now
    assert set(then) == {"inertia_kg_m2", "damping_nm_s_per_rad", "stiffness_nm_per_rad", "torque_gain"}
    assert all(0.94 <= v <= 1.06 and v != 1 for v in then.values())
    assert trapped.quantities["lever_inertia_kg_m2"] == pytest.approx(0.00288 * then["inertia_kg_m2"])


def test_the_truth_names_what_is_in_the_rig_trials_and_the_session_does_not(tmp_path):
    done = subprocess.run([sys.executable, "-m", "hidden_effects", "--out", str(tmp_path), "--rig-trials", "--effect", "lever_stiffness",
                           "--trap", "wrong_load", "--laboratory", "clinic"], cwd=SCRIPTS, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = json.loads((tmp_path / "truth/session-000001.json").read_text())["rig_trials"]
    assert told["trap"] == "wrong_load" and told["quantities"]["lever_stiffness_nm_per_rad"] == 675.0
    assert "wrong" not in (tmp_path / "session-000001/rig-trials.csv").read_text()


def test_every_quick_session_gets_rig_trials_and_each_trap_is_a_group():
    cases = plan.with_rig_trials(plan.quick_cases(1000), 6)
    assert all(c.rig_trials for c in cases) and len({c.seed for c in cases}) == len(cases)
    for trap in ("person_only", "wrong_load", "another_day"):
        group = [c for c in cases if c.group == f"trap:{trap}"]
        assert len(group) == 6
        assert all(trials.is_of_the_rig(c.effect) for c in group) == (trap == "person_only")
    assert plan.Case("fatigue", 1).group == "mechanism"


def outcome(effect, named, trap=None, others=()):
    said = [{"mechanism": m, "indistinguishable": list(others), "parameters": {}} for m in named]
    return Outcome(plan.Case(effect, 1, rig_trials=True, trap=trap), {"hidden": [{"mechanism": effect, "class": "rig", "parameters": {}}], "means": {}},
                   {"verdict": "named" if named else "adequate", "causes": said}, None, 1.0)


def rate(outcomes, name):
    [found] = [r for r in score.rig_rates(outcomes) if r.name == name]
    return found.hits, found.of


def test_each_rig_cause_is_asked_alone():
    right, set_of_two = outcome("torque_gain", ["torque_gain"]), outcome("torque_gain", ["torque_gain"], others=["angle_gain"])
    assert rate([right, set_of_two], "torque_gain named alone") == (1, 2)
    assert rate([right], "channel_skew named alone") == (0, 0)


def test_a_rig_cause_for_a_fault_of_the_wrist_is_counted_with_traps_apart():
    wrong, right = outcome("joint_friction", ["torque_gain"]), outcome("joint_friction", ["joint_friction"])
    trapped, silent = outcome("joint_friction", ["lever_inertia"], "wrong_load"), replace(right, diagnosis=None)
    name = "no rig cause named for a fault of the wrist"
    assert rate([wrong, right, trapped, silent], name) == (1, 3)
    assert rate([wrong, right, trapped], f"trap:wrong_load, {name}") == (0, 1)


def test_behind_a_trap_a_fault_of_the_rig_may_be_left_open_but_not_put_on_another():
    name = "trap:person_only, nothing else named for a fault of the rig"
    open_set, another = outcome("torque_gain", ["angle_gain"], "person_only", ["torque_gain"]), outcome("torque_gain", ["stiffening"], "person_only")
    assert rate([open_set, another, outcome("torque_gain", [], "person_only")], name) == (2, 3)


def benchmark(mode, effects, only):
    stand_in = Path(__file__).with_name("stand_in.py")
    return subprocess.run([sys.executable, str(SCRIPTS / "hidden-effects"), "--program", f"{sys.executable} {stand_in} '{mode}' '{effects}'",
                           "--seed", "50", "--per-mechanism", "1", "--none", "1", "--alien", "0", "--pair", "0", "--rig-trials", "--trap", "1",
                           "--only", only],
                          env={**os.environ, "PYTHONPATH": str(SCRIPTS)}, capture_output=True, text=True, check=False)


def effects_of_the_plan():
    cases = plan.with_rig_trials(plan.cases(plan.Counts(1, 1, 0, 0), 50), 1)
    return ";".join(f"{c.seed}:{c.effect}" for c in cases)


def test_the_benchmark_calibrates_and_hands_the_calibration_to_the_diagnosis():
    done = benchmark("right", effects_of_the_plan(), "channel_skew,trap:another_day")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "| channel_skew named alone | 1/1 |" in done.stdout and "none, trap:another_day" in done.stdout
    failed = benchmark("no calibration", effects_of_the_plan(), "channel_skew")
    assert failed.returncode == 1 and "wrote no rig-calibration.json" in failed.stdout


@pytest.mark.parametrize("mode, code, said", [("right", 0, "Met: yes"), ("wrong", 1, "**no**: lever_inertia"), ("silent", 1, "nothing was told"),
                                              ("crash", 1, "no such verb")])
def test_random_rigs_pass_a_calibration_whose_intervals_hold_the_truth_and_no_other(mode, code, said, tmp_path):
    stand_in = Path(__file__).with_name("stand_in_calibrate.py")
    done = subprocess.run([sys.executable, str(SCRIPTS / "rig-laboratories"), "--count", "1", "--seed", "1", "--markdown", str(tmp_path / "t.md"),
                           "--program", f"{sys.executable} {stand_in} {mode}"],
                          env={**os.environ, "PYTHONPATH": str(SCRIPTS)}, capture_output=True, text=True, check=False)
    assert done.returncode == code and said in done.stdout, done.stdout + done.stderr
    assert mode != "silent" or "Without a value, but with a frequency that it lies above (95 %): 1." in done.stdout
    assert (tmp_path / "t.md").read_text() in done.stdout + "\n"
