"""Masked arrays: what is under a mask is not a measured value."""

import numpy as np
import pytest
from conftest import PARAMETERS

import ramphold


def hidden(array, place=-1):
    mask = np.zeros(array.shape, bool)
    mask.flat[place] = True
    return np.ma.MaskedArray(array, mask)


@pytest.mark.parametrize("channel", ["t", "theta", "torque", "emg_fcr"])
def test_masked_signals_are_refused(arrays, channel):
    with pytest.raises(ramphold.InputError, match=f"{channel}.*1 of .* masked"):
        ramphold.Session.from_arrays(**{**arrays, channel: [*arrays[channel][:-1], hidden(arrays[channel][-1])]})


def test_masked_values_are_refused_wherever_arrays_are_taken(fitted, ramp):
    point = np.array(list(PARAMETERS.values()))
    masked = hidden(point)
    law = ramphold.OwnLaw("joint", "speed", 0.0, 1.0, np.zeros(8))
    trial = fitted.trials[0]
    at = np.linspace(0.0, 1.0, 9)
    for call in (
        lambda: ramphold.simulate(masked, ramp),
        lambda: ramphold.simulate([point, masked], ramp),
        lambda: ramphold.simulate(hidden(np.stack([point, point])), ramp),
        lambda: fitted.residuals(trial, masked),
        lambda: fitted.log_likelihood(trial, masked),
        lambda: ramphold.Motion(hidden(np.zeros(300)), 2500.0, onset=100, lever=None),
        lambda: law(hidden(at)),
        lambda: ramphold.OwnLaw("joint", "speed", 0.0, 1.0, hidden(np.zeros(8))),
        lambda: ramphold.OwnLaw.from_points("joint", "speed", at, hidden(at), tolerance=1.0),
        lambda: ramphold.OwnLaw.from_points("joint", "speed", hidden(at), at, tolerance=1.0),
    ):
        with pytest.raises(ramphold.InputError, match="masked"):
            call()


def test_a_mask_that_hides_nothing_changes_nothing(arrays, loaded, ramp):
    own = {name: [np.ma.MaskedArray(one) for one in arrays[name]] for name in ("t", "theta", "torque")}
    assert ramphold.Session.from_arrays(**{**arrays, **own}).digest == loaded.digest
    point = np.array(list(PARAMETERS.values()))
    assert np.array_equal(ramphold.simulate(np.ma.MaskedArray(point), ramp).torque_nm, ramphold.simulate(point, ramp).torque_nm)
