"""Laboratories differ as their table says, and all of them give sessions that load."""

import csv
import json

import numpy as np
import pytest

from hidden_effects import noise
from hidden_effects.generator import base_model_response, generate
from hidden_effects.laboratories import LABORATORIES
from hidden_effects.ramp import PROFILES
from hidden_effects.session_writer import truth_of, write_session


@pytest.fixture(scope="module", params=LABORATORIES)
def session(request):
    return generate(5, repetitions=1, laboratory=LABORATORIES[request.param])


def test_a_session_of_each_laboratory_loads_as_the_format_says(session, tmp_path):
    laboratory = session.scenario.laboratory
    write_session(session, tmp_path / "s")
    described = json.loads((tmp_path / "s/session.json").read_text())
    assert described["sample_rate_hz"] == laboratory.sample_hz
    assert described["rig"]["lever"] == laboratory.own_lever()
    rows = list(csv.DictReader((tmp_path / "s/trials.csv").open()))
    assert len(rows) == len(laboratory.velocities_rad_s) * len(laboratory.torques_nm)
    for row in rows:
        data = np.genfromtxt(tmp_path / "s" / row["file"], delimiter=",", names=True)
        assert ("emg_fcr_mvc" in data.dtype.names) == laboratory.has_emg
        assert np.allclose(np.diff(data["t_s"]), 1 / laboratory.sample_hz, atol=1e-9)
        assert (row["onset_s"] == "") == (laboratory.onsets == "none")
        gone = data["theta_m_rad"] - data["theta_m_rad"][0]
        if row["onset_s"]:
            onset = float(row["onset_s"])
            is_late = laboratory.onsets == "2 mrad"
            assert (gone[round(onset * laboratory.sample_hz)] > 0.0015) == is_late
            longest_delay = 0.01 if is_late else 0.0
            assert onset >= laboratory.longest_hold_s - laboratory.hold_spread_s - 1e-9
            assert data["t_s"][-1] - onset >= 0.15 - longest_delay
        moved = gone[-1]
        assert moved == pytest.approx(laboratory.amplitude_rad, rel=0.05)
        counts = data["theta_m_rad"] / (2 * np.pi / laboratory.encoder_counts)
        assert np.abs(counts - np.round(counts)).max() < 1e-7 / (2 * np.pi / laboratory.encoder_counts)


def test_the_hold_passes_the_gate_of_its_laboratory(session):
    s = session.scenario
    assert noise.gate_held(session.torque_l_nm, session.trials.torque_nm, session.t_s, s.laboratory).all()


def test_with_nothing_hidden_the_base_model_explains_the_window_in_each_laboratory(session):
    m = session.motion
    window = (m.t_s >= 0) & (m.t_s <= 0.04)
    assert np.abs(base_model_response(session.scenario, m).torque_l - m.torque_l)[:, window].max() < 0.003


def test_the_joint_yields_within_the_window_in_each_laboratory(session):
    times = session.x_t_s()
    assert np.all((times > 0.02) & (times < 0.0385)), times


def test_a_rigid_handle_measures_the_torque_between_handle_and_hand():
    s = generate(5, repetitions=1, laboratory=LABORATORIES["rigid"])
    m, p = s.motion, s.trials
    assert np.array_equal(m.theta_l, m.theta_m) and truth_of(s, "none", "rigid")["laboratory"] == "rigid"
    expected = p.b_h[:, None] * (m.speed_m - m.speed_j) + p.k_h[:, None] * (m.theta_m - m.theta_j)
    assert np.allclose(m.torque_l, expected)


@pytest.mark.parametrize("profile", PROFILES)
def test_every_ramp_profile_rises_to_the_velocity_and_covers_the_same_angle(profile):
    rise, times = 0.016, np.linspace(0.0, 0.016, 400)
    angle = PROFILES[profile](times, rise)
    speed = np.gradient(angle, times)
    assert angle[-1] == pytest.approx(rise / 2) and speed[-1] == pytest.approx(1.0, abs=0.01)
    assert np.all(np.diff(speed) > -1e-9)


def test_flicker_noise_has_the_standard_deviation_of_white_noise_and_more_at_low_frequency():
    white = np.random.default_rng(1).standard_normal((50, 2000))
    flicker = noise.SPECTRA["1/f"](white, 2000)
    assert flicker.std() == pytest.approx(1.0, abs=0.05)
    power = (np.abs(np.fft.rfft(flicker, axis=1)) ** 2).mean(axis=0)
    assert power[1:10].mean() > 10 * power[500:].mean()


def test_the_tremor_of_a_patient_is_slower_and_larger():
    clinic, paper = (generate(5, laboratory=LABORATORIES[name], repetitions=1).scenario.person for name in ("clinic", "paper"))
    assert 4.0 < clinic.tremor_hz < 5.5 < 8.5 < paper.tremor_hz
    assert clinic.tremor == pytest.approx(3 * paper.tremor)
