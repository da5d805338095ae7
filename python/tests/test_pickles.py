"""Copies and pickles, as a pool of processes sends them."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from conftest import PARAMETERS, QUICK

import ramphold


def again(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("how", [again, copy.copy, copy.deepcopy])
def test_a_session_is_the_same_after_a_copy(arrays, loaded, how):
    simulated = ramphold.Session.simulate({**ramphold.Protocol(QUICK).dict, "window_s": 0.035}, 2)
    for session in (loaded, simulated, ramphold.Session.from_arrays(**arrays)):
        own = how(session)
        assert own.digest == session.digest and repr(own) == repr(session)
        assert own.to_frame().equals(session.to_frame())
        trial = session.to_frame()["trial"][0]
        assert own.record(trial).equals(session.record(trial))
    # The protocol's window comes along.
    assert how(simulated).fit(independent=True).json == simulated.fit(independent=True).json


@pytest.mark.parametrize("how", [again, copy.copy, copy.deepcopy])
def test_a_protocol_and_a_motion_are_the_same_after_a_copy(ramp, how):
    protocol = ramphold.Protocol(QUICK)
    assert how(protocol).text == protocol.text and how(protocol).schedule(3).equals(protocol.schedule(3))
    assert np.array_equal(ramphold.simulate(PARAMETERS, how(ramp)).torque_nm, ramphold.simulate(PARAMETERS, ramp).torque_nm)
    assert np.array_equal(how(ramp).theta_rad, ramp.theta_rad)


def test_a_fit_says_that_the_session_is_pickled_instead(fitted):
    for own in (fitted, fitted.motion(fitted.trials[0])):
        with pytest.raises(TypeError, match="pickle the session"):
            pickle.dumps(own)
    assert copy.deepcopy(fitted).json == copy.copy(fitted).json == fitted.json
    motion = fitted.motion(fitted.trials[0])
    assert np.array_equal(copy.deepcopy(motion).theta_rad, motion.theta_rad)


def digest(session):
    return session.digest


def test_sessions_go_to_other_processes(loaded):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        assert pool.submit(digest, loaded).result(timeout=120) == loaded.digest
