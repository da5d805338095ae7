"""What others rely on in the generated sessions."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hidden_effects import noise
from hidden_effects.generator import base_model_response, generate
from hidden_effects.session_writer import write_session

SCRIPTS = Path(__file__).resolve().parents[2]
WINDOW = slice(2000, 2100)  # 40 ms from the onset, in the uncut traces


@pytest.fixture(scope="module")
def empty():
    return generate(5)


def files_of(folder):
    return {p.relative_to(folder): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def command_line(out, *args):
    return subprocess.run([sys.executable, "-m", "hidden_effects", "--out", str(out), *args], cwd=SCRIPTS,
                          capture_output=True, text=True, check=False)


def test_a_session_loads_as_the_format_says(tmp_path, empty):
    write_session(empty, tmp_path / "s")
    described = json.loads((tmp_path / "s/session.json").read_text())
    assert described["format"] == "ramphold-session/1" and described["sample_rate_hz"] == 2500
    rows = list(csv.DictReader((tmp_path / "s/trials.csv").open()))
    assert len(rows) == 36
    assert len({(r["velocity_rad_s"], r["torque_nm"], r["repetition"]) for r in rows}) == 36
    for row in rows:
        data = np.genfromtxt(tmp_path / "s" / row["file"], delimiter=",", names=True)
        assert data.dtype.names == ("t_s", "theta_m_rad", "torque_l_nm", "emg_fcr_mvc", "emg_ecr_mvc")
        assert np.isfinite(data.view((float, 5))).all()
        assert np.allclose(np.diff(data["t_s"]), 1 / 2500, atol=1e-9)
        onset = float(row["onset_s"])
        assert onset >= 0.6 and data["t_s"][-1] - onset >= 0.15
        before = data["t_s"] <= onset
        start = data["theta_m_rad"][0]
        assert np.ptp(data["theta_m_rad"][before]) == 0
        assert data["theta_m_rad"][-1] - start == pytest.approx(float(row["amplitude_rad"]), rel=0.05)
        assert np.min(data["emg_fcr_mvc"]) >= 0


def test_the_same_seed_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        assert command_line(tmp_path / name, "--effect", "stretch_reflex", "--seed", "3").returncode == 0
    assert files_of(tmp_path / "a") == files_of(tmp_path / "b")
    assert command_line(tmp_path / "c", "--effect", "stretch_reflex", "--seed", "4").returncode == 0
    assert files_of(tmp_path / "a").keys() != files_of(tmp_path / "c").keys()


def test_the_session_folder_does_not_tell_what_is_hidden(tmp_path):
    assert command_line(tmp_path / "a", "--effect", "lever_stiffness", "--seed", "3").returncode == 0
    assert command_line(tmp_path / "b", "--effect", "none", "--seed", "3").returncode == 0
    hidden, plain = files_of(tmp_path / "a/session-000003"), files_of(tmp_path / "b/session-000003")
    assert hidden.keys() == plain.keys()
    for name in ("session.json", "trials.csv"):
        assert hidden[Path(name)] == plain[Path(name)]
    truth = json.loads((tmp_path / "a/truth/session-000003.json").read_text())
    assert truth["hidden"][0]["parameters"]["stiffness_nm_per_rad"]["value"] == pytest.approx(900 * 0.75)
    assert len(truth["trials"]) == 36


def test_an_unknown_effect_and_an_existing_folder_are_refused(tmp_path):
    assert command_line(tmp_path, "--effect", "gremlins").returncode == 2
    assert command_line(tmp_path, "--seed", "3").returncode == 0
    assert command_line(tmp_path, "--seed", "3").returncode == 2


def test_with_nothing_hidden_the_base_model_explains_the_window(empty):
    m = empty.motion
    window = (m.t_s >= 0) & (m.t_s <= 0.04)
    answer = base_model_response(empty.scenario, m).torque_l
    assert np.abs(answer - m.torque_l)[:, window].max() < 0.002


def test_the_base_plant_solves_equations_1_to_7(empty):
    """Against the equations written out again for one trial, by another method, on the motor's recorded path."""
    m, t, i = empty.motion, empty.trials, 7
    motor = lambda x: (np.interp(x, m.t_s, m.theta_m[i]), np.interp(x, m.t_s, m.speed_m[i]))

    def rates(x, y):
        (a, va), (l, vl, j, vj) = motor(x), y
        tl = 0.4 * (va - vl) + 900 * (a - l)
        th = t.b_h[i] * (vl - vj) + t.k_h[i] * (l - j)
        tj = 1e-5 * vj + t.k_srs[i] * j - np.log(1 + np.exp(100 * t.k_dec[i] * (j - t.x_e[i]))) / 100
        return [vl, (tl - th) / 0.0016, vj, (th - tj) / t.i_j[i]]

    at = np.arange(0, 0.0401, 0.001)
    y = solve_ivp(rates, (0, 0.04), [0, 0, 0, 0], "Radau", t_eval=at, rtol=1e-8, atol=1e-10, max_step=5e-4).y
    a, va = motor(at)
    torque = 0.4 * (va - y[1]) + 900 * (a - y[0])
    assert np.abs(torque - np.interp(at, m.t_s, m.torque_l[i])).max() < 0.002


def test_yield_comes_at_about_thirty_milliseconds():
    times = np.concatenate([generate(seed).x_t_s() for seed in range(4)])
    assert np.all((times > 0.025) & (times < 0.037))
    assert 0.029 < times.mean() < 0.032


def test_every_hold_passes_the_gate(empty):
    assert noise.gate_held(empty.torque_l_nm, empty.trials.torque_nm, empty.t_s, empty.scenario.laboratory).all()


def test_the_late_reflex_spares_the_window():
    """The reflex that everybody has begins after 40 ms."""
    assert all(generate(seed).scenario.person.late_reflex["latency_s"] > 0.04 for seed in range(3))


def test_a_timed_yield_has_limits_proportional_to_speed_and_others_have_not():
    timed, plain = generate(5, "timed_yield").trials, generate(5).trials
    offset = lambda t: np.polyfit(t.velocity_rad_s, t.x_e, 1)[1]
    assert abs(offset(timed)) < 0.0015 < 0.004 < abs(offset(plain))


def test_effects_across_trials_leave_the_ramp_of_a_trial_alone():
    """Fatigue changes k_srs and nothing else, and by the stated part at the end."""
    tired, plain = generate(5, "fatigue"), generate(5)
    ratio = tired.trials.k_srs / plain.trials.k_srs
    assert ratio[0] == 1 and ratio[-1] == pytest.approx(0.75)
    assert np.array_equal(tired.trials.x_e, plain.trials.x_e)


def test_a_late_torque_is_the_same_torque_later():
    late, plain = generate(5, "channel_skew"), generate(5)
    delay = late.hidden[0].parameters["delay_s"]
    whole = np.interp(late.t_s - delay, plain.t_s, plain.torque_l_nm[3] - plain.torque_l_nm[3, 0])
    apart = late.torque_l_nm[3] - late.torque_l_nm[3, 0] - whole
    assert apart[WINDOW].std() < 3 * plain.scenario.person.gauge_noise_nm
    assert (late.torque_l_nm[3] - plain.torque_l_nm[3])[WINDOW].std() > 2 * apart[WINDOW].std()


def test_two_effects_are_both_there_and_both_told():
    both = generate(5, "channel_skew+fatigue")
    assert [h.mechanism for h in both.hidden] == ["channel_skew", "fatigue"]
    assert both.trials.k_srs[-1] < generate(5).trials.k_srs[-1]
