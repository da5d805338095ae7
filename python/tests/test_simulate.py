"""The model as a function."""

import numpy as np
import pandas as pd
import polars
import pytest
from conftest import LEVER, PARAMETERS, QUICK

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
    # The hum is in the record, not in the model.
    known = ramphold.mechanisms()
    for mechanism, own in known[known["mechanism"] != "mains_hum"].groupby("mechanism"):
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


def test_parameters_with_names_are_taken_by_name(loaded, ramp):
    """A Series in another order was taken by position."""
    known = ramphold.simulate(PARAMETERS, ramp).torque_nm
    shuffled = pd.Series(PARAMETERS)[::-1]
    points = pd.DataFrame([PARAMETERS, PARAMETERS])[list(shuffled.index)]
    frames = [points, polars.DataFrame(points.to_dict("list"))]
    assert np.array_equal(ramphold.simulate(shuffled, ramp).torque_nm, known)
    for frame in frames:
        assert np.array_equal(ramphold.simulate(frame, ramp).torque_nm, np.stack([known, known]))
    # Without names, the place counts.
    assert np.array_equal(ramphold.simulate(pd.Series(list(PARAMETERS.values())), ramp).torque_nm, known)
    fit = loaded.fit(mechanisms=DAMPING, independent=True)
    trial = fit.trials[0]
    best = fit.parameters(independent=True).loc[trial]
    assert np.array_equal(fit.residuals(trial, best[::-1]), fit.residuals(trial, best))
    assert fit.log_likelihood(trial, best[::-1]) == fit.log_likelihood(trial, best)
    for wrong in (best, shuffled.rename({"x_e_rad": "x_e"}), shuffled[1:], pd.concat([shuffled[1:], shuffled[1:2]]), points.iloc[:, 1:]):
        with pytest.raises(ramphold.InputError, match="expected these names"):
            ramphold.simulate(wrong, ramp)


def test_mechanisms_that_the_model_does_not_have_are_refused(loaded, ramp):
    hum = {"mechanism": "mains_hum", "parameters": {"amplitude_nm": 0.03, "frequency_hz": 50.0}}
    with pytest.raises(ramphold.InputError, match="mains_hum is in the record and not in the model of the wrist"):
        ramphold.simulate(PARAMETERS, ramp, mechanisms=[hum])
    outlier = {"mechanism": "outlier_trial", "parameters": {}}
    for call in (
        lambda: ramphold.simulate(PARAMETERS, ramp, mechanisms=[outlier]),
        lambda: ramphold.Session.simulate(QUICK, 1, mechanisms=[outlier]),
        lambda: loaded.fit(mechanisms=[outlier]),
    ):
        with pytest.raises(ramphold.InputError, match="outlier_trial changes neither"):
            call()


def test_values_outside_the_bounds_are_refused_with_the_words_of_the_fit(loaded, ramp):
    """A latency in ms was simulated as 25 s."""
    reflex = {"mechanism": "stretch_reflex", "parameters": {"gain_nm_s_per_rad": 0.3, "latency_s": 25.0, "time_constant_s": 0.01}}
    for call in (lambda: ramphold.simulate(PARAMETERS, ramp, mechanisms=[reflex]), lambda: loaded.fit(mechanisms=[reflex])):
        with pytest.raises(ramphold.InputError, match=r"mechanisms\[0\].parameters.latency_s: value 25.* is outside 0.012 to 0.2"):
            call()


def test_a_session_may_have_values_outside_the_bounds_and_says_so():
    reflex = {"mechanism": "stretch_reflex", "parameters": {"gain_nm_s_per_rad": 0.3, "latency_s": 25.0, "time_constant_s": 0.01}}
    with pytest.warns(UserWarning, match=r"mechanisms\[0\].parameters.latency_s: value 25.* is outside 0.012 to 0.2"):
        ramphold.Session.simulate(QUICK, 1, mechanisms=[reflex])


def test_angles_that_are_no_change_from_the_hold_are_refused(ramp):
    theta = np.clip(2.0 * (np.arange(260) / 2500.0 - 0.04), 0.0, 0.09)
    settings = {"onset": 100, "lever": LEVER}
    for onset in (0, 3, 100):
        with pytest.raises(ramphold.InputError, match="begins at 1 rad; expected a change from the hold"):
            ramphold.Motion(theta + 1.0, 2500.0, **{**settings, "onset": onset})
    with pytest.raises(ramphold.InputError, match="degrees"):
        ramphold.Motion(np.degrees(theta), 2500.0, **settings)
    ramphold.Motion(theta + 1e-3, 2500.0, **settings)


def test_the_ends_of_a_free_law_have_no_derivatives(ramp):
    law = ramphold.OwnLaw.from_function("joint", "speed", np.tanh, -1.0, 4.0, tolerance=0.1)
    own = ramphold.simulate(PARAMETERS, ramp, mechanisms=[law], derivatives=True)
    slopes = dict(zip(own.parameter_names, np.abs(own.jacobian).max(axis=0), strict=True))
    assert slopes["free_joint_speed.from_rad_s"] == slopes["free_joint_speed.to_rad_s"] == 0.0 < slopes["free_joint_speed.c3_nm"]
