"""The model as a function."""

import numpy as np
import pytest
from conftest import PARAMETERS

import ramphold

DAMPING = [{"mechanism": "joint_damping", "parameters": {"b_j_nm_s_per_rad": 0.03}}]


@pytest.mark.parametrize("mechanisms", [[], DAMPING], ids=["base", "joint_damping"])
def test_the_jacobian_is_the_slope_of_the_torque(ramp, mechanisms):
    own = ramphold.simulate(PARAMETERS, ramp, mechanisms=mechanisms, derivatives=True)
    assert own.jacobian.shape == (ramp.time_s.size, len(own.parameter_names))
    for column, name in enumerate(ramphold.BASE_PARAMETERS):
        step = 1e-5 * PARAMETERS[name]
        sides = [
            ramphold.simulate({**PARAMETERS, name: PARAMETERS[name] + sign * step}, ramp, mechanisms=mechanisms).torque_nm
            for sign in (1, -1)
        ]
        slope = (sides[0] - sides[1]) / (2 * step)
        assert np.abs(slope - own.jacobian[:, column]).max() < 1e-5 * np.abs(slope).max()


def test_several_points_are_what_each_is_alone(ramp):
    base = np.array([PARAMETERS[name] for name in ramphold.BASE_PARAMETERS])
    points = base * np.linspace(0.8, 1.3, 37)[:, None]
    whole = ramphold.simulate(points, ramp, derivatives=True)
    assert whole.torque_nm.shape == (37, ramp.time_s.size) and whole.jacobian.shape == (37, ramp.time_s.size, 6)
    for point, torque, jacobian in zip(points, whole.torque_nm, whole.jacobian, strict=True):
        alone = ramphold.simulate(point, ramp, derivatives=True)
        assert np.array_equal(alone.torque_nm, torque) and np.array_equal(alone.jacobian, jacobian)


def test_derivatives_do_not_change_the_torque(ramp):
    assert np.array_equal(
        ramphold.simulate(PARAMETERS, ramp).torque_nm, ramphold.simulate(PARAMETERS, ramp, derivatives=True).torque_nm
    )


def test_every_mechanism_with_its_typical_values_can_be_simulated(ramp):
    without = ramphold.simulate(PARAMETERS, ramp).torque_nm
    changed = []
    for mechanism, own in ramphold.mechanisms().groupby("mechanism"):
        added = [{"mechanism": mechanism, "parameters": dict(zip(own["parameter"], own["typical"], strict=True))}]
        torque = ramphold.simulate(PARAMETERS, ramp, mechanisms=added).torque_nm
        changed.append(not np.array_equal(torque, without))
    assert sum(changed) > 25


def test_the_likelihood_is_highest_at_the_fit(loaded):
    model = {"format": "ramphold-model/1", "parameters": {"i_j_kg_m2": {"scope": "trial"}}}
    fit = loaded.fit(model=model, independent=True)
    trial = fit.trials[0]
    best = fit.parameters().loc[trial].to_dict()
    at_best = fit.log_likelihood(trial, best)
    for name in ramphold.BASE_PARAMETERS:
        for factor in (0.97, 1.03):
            assert fit.log_likelihood(trial, {**best, name: best[name] * factor}) < at_best, name
