"""Own mechanisms without Rust."""

import numpy as np
import pytest
from conftest import PARAMETERS, QUICK, ramp_at

import ramphold


def friction(omega):
    return 0.15 * np.tanh(omega / 0.8)


@pytest.fixture(scope="module")
def law():
    return ramphold.OwnLaw.from_function("joint", "speed", friction, -1.0, 4.0, tolerance=0.01)


def test_a_law_is_the_function_that_was_given(law):
    u = np.linspace(-1.0, 4.0, 77)
    assert np.abs(law(u) - (friction(u) - friction(0.0))).max() < 2 * law.deviation + 1e-12
    assert 0.0 < law.deviation < 0.01


@pytest.mark.parametrize(("sample_rate_hz", "largest_nm"), [(2500.0, 1e-5), (40_000.0, 1e-9)])
def test_a_line_is_met_exactly_and_acts_as_the_mechanism_that_it_is(sample_rate_hz, largest_nm):
    """A torque in proportion to the joint's speed is the catalogue's joint damping.

    The damping is part of the plant, which is solved exactly, and the law a torque that is a cubic over a step. With the sample rate, the
    steps become short, and the difference goes to nothing.
    """
    ramp = ramp_at(sample_rate_hz)
    law = ramphold.OwnLaw.from_points("joint", "speed", np.linspace(-20, 20, 9), 0.03 * np.linspace(-20, 20, 9), tolerance=1e-9)
    own = ramphold.simulate(PARAMETERS, ramp, mechanisms=[law]).torque_nm
    # The catalogue's damping includes the model's b_j of 1e-5.
    damping = {"mechanism": "joint_damping", "parameters": {"b_j_nm_s_per_rad": 0.03 + 1e-5}}
    known = ramphold.simulate(PARAMETERS, ramp, mechanisms=[damping]).torque_nm
    assert np.abs(known - ramphold.simulate(PARAMETERS, ramp).torque_nm).max() > 1e-3
    assert np.abs(own - known).max() < largest_nm


def test_a_law_may_be_a_spline_through_a_few_knots():
    """SciPy's functions give arrays, of no dimension for one number."""
    interpolate = pytest.importorskip("scipy.interpolate")
    knots, values = [-1.0, 0.0, 1.5, 4.0], [-0.1, 0.0, 0.12, 0.15]
    own = ramphold.OwnLaw.from_function("joint", "speed", interpolate.CubicSpline(knots, values), -1.0, 4.0, tolerance=0.002)
    assert own(np.array(knots)) == pytest.approx(values, abs=0.002)
    with pytest.raises(ramphold.InputError, match="the function's value"):
        ramphold.OwnLaw.from_function("joint", "speed", lambda u: np.zeros(2), 0.0, 1.0, tolerance=0.01)


@pytest.mark.parametrize("count", [2, 3, 5, 7])
def test_a_few_knots_are_joined_by_the_natural_spline(count):
    interpolate = pytest.importorskip("scipy.interpolate")
    knots = np.linspace(-1.0, 1.6, count) ** 3
    values = 0.15 * np.tanh(knots / 3.0)
    own = ramphold.OwnLaw.from_points("joint", "speed", knots, values, tolerance=0.01)
    known = interpolate.CubicSpline(knots, values, bc_type="natural") if count > 2 else interpolate.interp1d(knots, values)
    u = np.linspace(knots[0], knots[-1], 401)
    shift = own(u) - known(u)
    assert np.abs(shift - shift.mean()).max() < 2 * own.deviation + 1e-12
    assert own.deviation == pytest.approx(
        ramphold.OwnLaw.from_function("joint", "speed", known, knots[0], knots[-1], tolerance=0.01).deviation, abs=1e-12
    )
    with pytest.raises(ramphold.InputError, match="tolerance"):
        ramphold.OwnLaw.from_points("joint", "speed", [0.0, 0.1, 4.0], [0.0, 1.0, 0.0], tolerance=1e-6)


def test_a_function_that_the_spline_cannot_follow_is_refused():
    with pytest.raises(ramphold.InputError, match="tolerance"):
        ramphold.OwnLaw.from_function("joint", "speed", lambda u: np.sin(40 * u), 0.0, 4.0, tolerance=0.01)
    with pytest.raises(ramphold.InputError, match="joint speed"):
        ramphold.OwnLaw.from_function("elbow", "speed", friction, 0.0, 4.0, tolerance=0.01)


def test_a_law_is_simulated_fitted_and_diagnosed(law):
    session = ramphold.Session.simulate(QUICK, 3, mechanisms=[law])
    without, whole = session.fit(), session.fit(mechanisms=[law])
    k_srs = [own.to_frame("conditions")["k_srs_nm_per_rad"].mean() for own in (without, whole)]
    truth = ramphold.Session.simulate(QUICK, 3).fit().to_frame("conditions")["k_srs_nm_per_rad"].mean()
    assert abs(k_srs[1] - truth) < abs(k_srs[0] - truth)
    assert session.diagnose(mechanisms=[law]).verdict == "adequate"
    assert session.diagnose().verdict != "adequate"


def test_coefficients_of_a_law_can_be_fitted(law):
    session = ramphold.Session.simulate(QUICK, 3, mechanisms=[law])
    fit = session.fit(model={"mechanisms": [law.in_model(fitted=True)]})
    assert any(name.startswith("free_joint_speed") for name in fit.parameters().columns)


def test_what_a_law_costs_is_measured(law, ramp):
    base = [PARAMETERS[name] for name in ramphold.BASE_PARAMETERS]
    assert law.slowdown(ramp, base, repetitions=20) > 0.5


def test_a_law_of_no_arguments_has_no_values_and_of_nan_none():
    law = ramphold.OwnLaw("joint", "speed", 0.0, 1.0, np.arange(8.0))
    assert law([]).shape == (0,) and law(np.zeros((0, 3))).shape == (0, 3)
    for wrong in (np.nan, [0.0, np.inf]):
        with pytest.raises(ramphold.InputError, match="u: .* is not finite"):
            law(wrong)
