"""The oracle says what can be found at all."""

from dataclasses import replace

import numpy as np
import pytest

from hidden_effects import noise, noise_covariance, oracle
from hidden_effects.generator import generate
from hidden_effects.laboratories import LABORATORIES
from hidden_effects.plant import FINE_HZ
from hidden_effects.scenario import base_scenario

PAPER = LABORATORIES["paper"]


def test_nothing_hidden_leaves_next_to_nothing_in_every_laboratory():
    """What is left is the late reflex and the interpolation of the recorded angle."""
    for name in ("paper", "rigid", "clinic"):
        found = oracle.finding(5, "none", LABORATORIES[name])
        assert found.distance < 1.5 and not found.findable


def test_a_tenth_of_the_size_is_a_tenth_of_the_distance_and_is_no_longer_found():
    whole, tenth = (oracle.finding(5, "fatigue", PAPER, size, with_rivals=False) for size in (1.0, 0.1))
    assert tenth.distance == pytest.approx(whole.distance / 10, rel=0.25)
    assert whole.findable and not tenth.findable


def test_what_differs_between_repetitions_alone_is_not_found_without_them():
    assert not oracle.finding(5, "cocontraction", replace(PAPER, repetitions=1), with_rivals=False).findable


def test_near_twins_cannot_be_told_apart_and_others_can():
    twin = oracle.finding(5, "lever_stiffness", PAPER)
    assert twin.findable and twin.nearest_rival in ("torque_gain", "lever_inertia", "torque_lag", "angle_gain")
    lone = oracle.finding(5, "torque_saturation", PAPER)
    assert lone.told_apart and twin.distance_beyond_rival < lone.distance_beyond_rival


def test_the_limit_is_where_the_bayes_factor_is_twenty():
    for size in (0.3, 1.0, 3.0):
        distance = next(d for d in np.arange(0.1, 20, 0.001) if d > oracle.limit(d, size))
        usual = (distance / size) ** 2
        log_bayes = distance**2 / 2 * usual / (1 + usual) - np.log1p(usual) / 2
        assert log_bayes == pytest.approx(np.log(oracle.BAYES_FACTOR), abs=0.01)


@pytest.mark.parametrize("name", ["paper", "flicker"])
def test_the_covariance_is_that_of_the_noise_that_is_drawn(name):
    laboratory = replace(LABORATORIES[name], gate_fraction=1.0)  # without selection
    s = base_scenario(5, laboratory)
    hz, samples = laboratory.sample_hz, round(0.04 * laboratory.sample_hz)
    fine = np.arange(-3000, 1) / FINE_HZ
    many = np.full(400, 1.5)
    voluntary, gauge = noise.voluntary_torque(1, s.person, many, fine, laboratory)
    drawn = voluntary[:, ::FINE_HZ // hz] + gauge
    before = round(noise_covariance.BASELINE_S * hz)
    change = drawn[:, before:before + samples] - drawn[:, :before].mean(axis=1, keepdims=True)
    expected = noise_covariance.torque_covariance(s, 1.5, samples)
    assert change[:, -1].var() == pytest.approx(expected[-1, -1], rel=0.25)
    assert np.mean(change[:, 0] * change[:, -1]) == pytest.approx(expected[0, -1], abs=0.25 * expected[-1, -1])


def test_a_finer_encoder_leaves_less_in_the_prediction():
    floors = [np.sqrt(noise_covariance.encoder_covariance(base_scenario(5, replace(PAPER, encoder_bits=bits)), 100)[50, 50]) for bits in (13, 17)]
    assert floors[0] == pytest.approx(16 * floors[1])
    assert floors[1] == pytest.approx(0.021, rel=0.1)  # as counted in sessions
