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


def test_residuals_have_the_slopes_that_they_say(loaded):
    fit = loaded.fit(mechanisms=DAMPING, independent=True)
    trial = fit.trials[0]
    best = fit.parameters(independent=True).loc[trial]
    residuals, slopes = fit.residuals(trial, best.to_numpy(), derivatives=True)
    assert list(best.index)[6:] == ["joint_damping.b_j_nm_s_per_rad"] and slopes.shape == (residuals.size, 7)
    assert np.array_equal(residuals, fit.residuals(trial, best.to_dict()))
    for column, name in enumerate(best.index):
        step = 1e-5 * best[name]
        sides = [fit.residuals(trial, {**best, name: best[name] + sign * step}) for sign in (1, -1)]
        slope = (sides[0] - sides[1]) / (2 * step)
        assert np.abs(slope - slopes[:, column]).max() < 1e-4 * np.abs(slope).max(), name


def test_the_likelihood_of_many_points_is_that_of_each(loaded):
    fit = loaded.fit(independent=True)
    trial = fit.trials[0]
    best = fit.parameters(independent=True).loc[trial].to_numpy()
    points = best * np.linspace(0.9, 1.1, 5)[:, None]
    points[1, 0] = -points[1, 0]
    found = fit.log_likelihood(trial, points)
    assert found[1] == -np.inf and np.isfinite(np.delete(found, 1)).all()
    assert [fit.log_likelihood(trial, own) for own in points] == list(found)
    left = fit.residuals(trial, points[2])
    assert found[2] == pytest.approx(-0.5 * left @ left, rel=1e-12)
