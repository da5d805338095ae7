"""A thousand bad arguments: each gives an exception of ramphold with a text, and none ends the process."""

import itertools
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from conftest import LEVER, PARAMETERS, QUICK

import ramphold

NAN, INF = float("nan"), float("inf")


def spoiled_records(good):
    """Signals that cannot be a channel of trials like `good`, a list of arrays."""
    for which in (0, len(good) - 1):
        yield from spoiled_record(good, which)
    yield good[:-1]
    yield [*good, good[0]]
    yield []
    for whole in (None, 3, "theta", {}, np.zeros((3, 4, 5)), np.zeros((2, 7), order="F"), object()):
        yield whole


def spoiled_record(good, which):
    """The same of the record at `which`."""
    first = good[which]

    def with_first(value):
        return [*good[:which], value, *good[which + 1 :]]

    for place, value in itertools.product((0, 1, len(first) // 2, len(first) - 1), (NAN, INF, -INF)):
        own = first.copy()
        own[place] = value
        yield with_first(own)
    kinds = ("float32", "float16", "int64", "int32", "uint8", "complex128", "bool", "object", "datetime64[s]", ">f8", "U8")
    for kind in kinds:
        yield with_first(np.zeros(len(first)).astype(kind))
    yield with_first(np.ascontiguousarray(np.repeat(first, 2))[::2])
    yield with_first(first[::-1])
    for shape in [(len(first), 1), (1, len(first)), (), (0,), (2, 2, 2)]:
        yield with_first(np.zeros(shape))
    for cut in (1, 2, 10, len(first) - 3):
        yield with_first(first[:-cut].copy())
    for other in (None, 3, 1.5, "theta", b"theta", {}, [], [1.0, 2.0], object(), first.tolist(), memoryview(first)):
        yield with_first(other)


def spoiled_tables(good):
    numbers = (None, NAN, INF, -INF, "fast", [], {}, True, 1j, "", b"1", object())
    for column, value in itertools.product(("velocity_rad_s", "torque_nm"), numbers):
        rows = [dict(row) for row in good]
        rows[0][column] = value
        yield rows
    for value in (-1, 1.5, INF, "one", [], 2**32, -(2**63), 1e300, True):
        for column in ("trial", "repetition"):
            rows = [dict(row) for row in good]
            rows[0][column] = value
            yield rows
    for value in (INF, -INF, "soon", 1e9, -1e9, [], True):
        rows = [dict(row) for row in good]
        rows[0]["onset_s"] = value
        yield rows
    for value in ("fine", 1, None, True, "OK", pd.NA, np.array(["ok", "ok"])):
        rows = [dict(row) for row in good]
        rows[0]["status"] = value
        yield rows
    for column in ("velocity_rad_s", "torque_nm"):
        yield [{key: value for key, value in row.items() if key != column} for row in good]
        yield [{key: value for key, value in row.items() if key != column} if index else row for index, row in enumerate(good)]
    rows = [dict(row) for row in good]
    rows[0]["velocity_rad_s"] = 0.0
    yield rows
    yield [good[0]] * len(good)
    yield from (good[:-1], [*good, good[0]], [], {}, None, 3, "table", [1, 2], [[]], [{}], {"velocity_rad_s": 3}, {"a": [1], "b": []})


def spoiled_arguments(arrays):
    table = arrays["trials"].to_dict("records")
    for channel in ("t", "theta", "torque", "emg_fcr", "emg_ecr"):
        for own in spoiled_records(arrays[channel]):
            # EMG may be missing, of all trials or of one.
            if channel.startswith("emg") and (own is None or (isinstance(own, list) and any(one is None for one in own))):
                continue
            yield {**arrays, channel: own}
    for own in spoiled_tables(table):
        yield {**arrays, "trials": own}
    bad = (0, -1.0, NAN, INF, None, "1", [], True)
    for field, value in itertools.product(LEVER, bad):
        if field == "damping_nm_s_per_rad" and value == 0:
            continue
        yield {**arrays, "lever": {**LEVER, field: value}}
    for field in LEVER:
        yield {**arrays, "lever": {key: value for key, value in LEVER.items() if key != field}}
    yield from ({**arrays, "lever": value} for value in (3, "rigid", [], {**LEVER, "length_m": 1.0}, {}, True))
    filters = (3, "low", [], {}, {"kind": "butterworth"}, {"kind": "chebyshev", "order": 3, "cutoff_hz": 50.0},
               {"kind": "butterworth", "order": 0, "cutoff_hz": 50.0}, {"kind": "butterworth", "order": 3, "cutoff_hz": -1.0},
               {"kind": "butterworth", "order": 3, "cutoff_hz": 1e9}, {"kind": "butterworth", "order": 3, "cutoff_hz": NAN},
               {"kind": "butterworth", "order": 2.5, "cutoff_hz": 50.0})
    yield from ({**arrays, "recorded_filter": value} for value in filters)
    yield from ({**arrays, "sample_rate_hz": value} for value in (0, -1, NAN, INF, 1e9, "2500", [], 1.0, True))
    yield from ({**arrays, "subject": value} for value in (None, 3, [], b"S01", "\ud800"))
    milliseconds = [1e3 * own for own in arrays["t"]]
    yield {**arrays, "t": milliseconds}
    # A rate that is not finite.
    tiny = [np.linspace(0.0, 1e-320, own.size) for own in arrays["t"]]
    yield {key: own for key, own in {**arrays, "t": tiny}.items() if key != "sample_rate_hz"}
    for change in (lambda t: t[::-1].copy(), lambda t: np.zeros_like(t), lambda t: t + 0.01 * (t > t[9])):
        yield {**arrays, "t": [change(own) for own in arrays["t"]]}


def rig_trials():
    """Arguments of RigTrials.from_arrays."""
    t = np.arange(600) / 1000.0
    target = np.where(t < 0.3, 0.0, 0.01)
    rows = [{"load": "empty_handle", "motion": "multisine"}, {"load": "known_spring", "motion": "multisine",
             "stiffness_nm_per_rad": 20.0, "relative_error": 0.01}]
    signals = {name: [own.copy(), own.copy()] for name, own in (("t", t), ("target", target), ("theta", target), ("torque", t))}
    return {**signals, "trials": rows, "lever": None}


def spoiled_rig_trials():
    good = rig_trials()
    for channel in ("t", "target", "theta", "torque", "theta_l"):
        for own in spoiled_records(good["theta" if channel == "theta_l" else channel]):
            if channel != "theta_l" or own is not None:
                yield {**good, channel: own}
    for column in ("load", "motion", "stiffness_nm_per_rad", "relative_error"):
        for value in (None, NAN, INF, -1.0, "soft", [], {}, True, 1j, "", object()):
            yield {**good, "trials": [good["trials"][0], {**good["trials"][1], column: value}]}
    for value in ("fine", 1, None, pd.NA, np.array(["ok", "ok"])):
        yield {**good, "trials": [{**good["trials"][0], "status": value}, good["trials"][1]]}
    for column in ("mass_kg", "sign", "velocity_rad_s", "arm_m", "inertia_kg_m2"):
        yield {**good, "trials": [good["trials"][0], {**good["trials"][1], column: 1.0}]}
    for column, value in itertools.product(("trial", "repetition"), (0, -1, 1.5, INF, "one", [], 2**32, True)):
        yield {**good, "trials": [{**good["trials"][0], column: value}, good["trials"][1]]}
    for own in (None, 3, "table", [], {}, [{}], [3, 4], good["trials"][:1], 2 * good["trials"]):
        yield {**good, "trials": own}
    for field, bad in {"lever": (3, {}, "rigid"), "name": (None, 3), "started_utc": (3, "now"), "sample_rate_hz": (0, NAN, 1.0, "1", 1e9)}.items():
        yield from ({**good, field: value} for value in bad)


def other_calls(session, fit, motion):
    """Calls of everything else."""
    simulate = ramphold.simulate
    values = (NAN, INF, -INF, None, "20", [], 1j, True)
    for name, value in itertools.product(PARAMETERS, values):
        yield lambda name=name, value=value: simulate({**PARAMETERS, name: value}, motion)
    for name in PARAMETERS:
        yield lambda name=name: simulate({key: own for key, own in PARAMETERS.items() if key != name}, motion)
    good = np.array(list(PARAMETERS.values()))
    shapes = [(), (0,), (5,), (7,), (0, 6), (2, 5), (2, 2, 6), (6, 1)]
    for shape in shapes:
        yield lambda shape=shape: simulate(np.ones(shape), motion)
    for kind in ("float32", "float16", "complex128", "bool", "object", "U8", ">f4"):
        yield lambda kind=kind: simulate(good.astype(kind), motion)
    for place, value in itertools.product(range(6), (NAN, INF, -INF)):
        own = np.tile(good, (3, 1))
        own[1, place] = value
        yield lambda own=own: simulate(own, motion)
    for own in (None, 3, "p", b"p", object(), [[1, 2], [3]], {}):
        yield lambda own=own: simulate(own, motion)
    yield lambda: simulate({**PARAMETERS, "i_j_kg_m2": 0.0}, motion)
    yield lambda: simulate({**PARAMETERS, "i_j_kg_m2": -1.0}, motion)
    yield lambda: simulate({**PARAMETERS, "i_j_kg_m2": 1e-300}, motion)
    yield lambda: simulate(PARAMETERS, None)
    yield lambda: simulate(PARAMETERS, session)
    lists = (3, "x", None, {}, [3], ["joint_damping"], [{}], [{"mechanism": "ghost", "parameters": {}}],
             [{"mechanism": "joint_damping", "parameters": {}}], [{"mechanism": "joint_damping"}],
             [{"mechanism": "joint_damping", "parameters": {"b_j_nm_s_per_rad": NAN}}],
             [{"mechanism": "joint_damping", "parameters": {"b_j_nm_s_per_rad": "1"}}],
             [{"mechanism": "joint_damping", "parameters": {"b_j_nm_s_per_rad": 0.1, "more": 1}}],
             2 * [{"mechanism": "joint_damping", "parameters": {"b_j_nm_s_per_rad": 0.1}}])
    for own in lists:
        yield lambda own=own: simulate(PARAMETERS, motion, mechanisms=own)
        yield lambda own=own: ramphold.Session.simulate(QUICK, 1, mechanisms=own)
    theta = np.zeros(300)
    motions = {"sample_rate_hz": (0, -1, NAN, INF, 1e9, None, "2500"), "onset": (-1, 290, 1.5, 10**9, None, 2**63),
               "window_s": (0, -1, NAN, INF, 11, 1e-9, None), "lever": (3, {}, {**LEVER, "inertia_kg_m2": 0.0}, "rigid"),
               "filter": (3, {}, {"kind": "butterworth", "order": 99, "cutoff_hz": 50.0}), "velocity_rad_s": (NAN, None, "fast"),
               "torque_nm": (NAN, None), "rest_s": (INF, "a"), "progress": (NAN,)}
    for name, bad in motions.items():
        for value in bad:
            own = {"sample_rate_hz": 2500.0, "onset": 100, "lever": None, name: value}
            yield lambda own=own: ramphold.Motion(theta, **own)
    for own in (None, 3, [0.0] * 300, theta.astype("float32"), np.zeros(600)[::2], np.zeros((300, 1)), np.full(300, NAN), np.zeros(4)):
        yield lambda own=own: ramphold.Motion(own, 2500.0, onset=100, lever=None)
    analyses = (ramphold.fit, ramphold.diagnose)
    for analysis in analyses:
        for source in (None, 3, [], b"S01", "", "\0", "/nowhere", fit, motion, Path("/nowhere")):
            yield lambda analysis=analysis, source=source: analysis(source)
    for verb in (session.fit, session.diagnose, *(partial(own, session) for own in analyses)):
        for window in (0, -1, NAN, INF, 11, "0.04", [], True):
            yield lambda verb=verb, window=window: verb(window_s=window)
        for accept in ("onset", ["ghost"], [3], 3, None, [None]):
            yield lambda verb=verb, accept=accept: verb(accept=accept)
        for seed in (-1, 1.5, 2**64, None, "1", True, NAN):
            yield lambda verb=verb, seed=seed: verb(seed=seed)
        for model in (3, "model.json", [], {"format": "ramphold-model/9"}, {"mechanisms": [3]}, {"ghost": 1},
                      {"parameters": {"ghost": {"scope": "trial"}}}, {"parameters": {"x_e_rad": {"scope": "never"}}},
                      {"parameters": {"x_e_rad": {"scope": "fixed", "value": NAN}}}, {"parameters": {"x_e_rad": {"scope": "fixed"}}}):
            yield lambda verb=verb, model=model: verb(model=model)
        for calibration in (3, [], {}, "/nowhere.json", "\0", b"x", {"format": "ramphold-rig-calibration/1"}, {"a": NAN}, True):
            yield lambda verb=verb, calibration=calibration: verb(calibration=calibration)
    for name in PARAMETERS:
        for call in (fit.residuals, fit.log_likelihood):
            yield lambda call=call, name=name: call(fit.trials[0], {**PARAMETERS, name: NAN})
            yield lambda call=call, name=name: call(fit.trials[0], {key: own for key, own in PARAMETERS.items() if key != name})
    for channel in (None, 0, "theta", "theta_l_rad", "", [], np.zeros(3), pd.NA, pd.Series([1.0])):
        yield lambda channel=channel: fit.measured(channel)
        yield lambda channel=channel: fit.predicted(channel)
    ramphold.RigTrials.from_arrays(**rig_trials())
    for own in spoiled_rig_trials():
        yield lambda own=own: ramphold.RigTrials.from_arrays(**own)
    for own in (None, 3, session):
        yield lambda own=own: ramphold.RigTrials(own)
    for own in (None, 3, "/nowhere.json", "\0", QUICK):
        yield lambda own=own: ramphold.calibrate(own)
        yield lambda own=own: ramphold.Calibration.load(own)
    for text in ("", "{}", "[]", "\0", "null", None, 3, b"{}", "\ud800"):
        yield lambda text=text: ramphold.Calibration(text)
        yield lambda text=text: ramphold.Diagnosis(text)
    for refits in (0, 1, -1, 1.5, 10**7, "2", True, NAN):
        yield lambda refits=refits: session.fit(bootstrap=refits)
    for listener in (3, "print", []):
        yield lambda listener=listener: session.diagnose(progress=listener)
    for own in ("no", "false", 0, 1, None, [], [True], np.array([True, False])):
        yield lambda own=own: session.fit(plain=own)
        yield lambda own=own: session.fit(independent=own)
        for call in (fit.to_frame, fit.predicted_nm, fit.parameters, fit.plot):
            yield lambda call=call, own=own: call(independent=own)
        yield lambda own=own: simulate(PARAMETERS, motion, derivatives=own)
        yield lambda own=own: fit.residuals(fit.trials[0], PARAMETERS, derivatives=own)
    for own in (None, 3, [], b"S01", "\ud800"):
        yield lambda own=own: ramphold.Session.simulate(QUICK, 1, subject=own)
    for trial in (0, -1, 999, 1.5, None, "1", 2**40, True, NAN):
        for call in (
            session.record, fit.motion, lambda own: fit.residuals(own, PARAMETERS), lambda own: fit.log_likelihood(own, PARAMETERS)
        ):
            yield lambda call=call, trial=trial: call(trial)
    for table in ("trial", None, 3, ["trials"], np.zeros(3), pd.NA, pd.Series([1.0])):
        yield lambda table=table: fit.to_frame(table)
    for source in (None, 3, [], "/nowhere.json", "\0", {}, {"velocities_rad_s": [74.5]}, b"x", {1: 2}, {"a": NAN}, {"a": object()}):
        yield lambda source=source: ramphold.Protocol(source)
        yield lambda source=source: ramphold.schedule(source, 1)
        yield lambda source=source: ramphold.Session.simulate(source, 1)
    for source in (3, [], "/nowhere.json", "\0", {"ghost": 1}, {"a": NAN}, b"x"):
        yield lambda source=source: ramphold.Session.simulate(QUICK, 1, person=source)
        yield lambda source=source: ramphold.Session.simulate(QUICK, 1, rig=source)
        yield lambda source=source: ramphold.Session.load(source)
        yield lambda source=source: ramphold.Study(source, 1)
        yield lambda source=source: session.save(source if source != "/nowhere.json" else "/proc/nowhere")
    for seed in (-1, 1.5, None, "1", 2**64, True):
        yield lambda seed=seed: ramphold.schedule(QUICK, seed)
        yield lambda seed=seed: ramphold.Session.simulate(QUICK, seed)
    for own in (3, None, session):
        yield lambda own=own: ramphold.Session(own)
    law = ramphold.OwnLaw
    for low, high in ((1, 1), (2, 1), (NAN, 1), (0, INF), (None, 1), ("0", 1)):
        yield lambda low=low, high=high: law.from_function("joint", "speed", abs, low, high, tolerance=1.0)
    for own in ([], {}, None, 3, np.array("joint"), pd.Series(["joint"])):
        yield lambda own=own: law(own, "speed", 0.0, 1.0, np.zeros(8))
        yield lambda own=own: law("joint", own, 0.0, 1.0, np.zeros(8))
    of_zeros = law("joint", "speed", 0.0, 1.0, np.zeros(8))
    for own in ("u", None, {}, object(), 1j, [[1.0], [2.0, 3.0]]):
        yield lambda own=own: of_zeros(own)
    for own in (0, -1, 1.5, None, "2", True, 2**70):
        yield lambda own=own: of_zeros.slowdown(motion, good, repetitions=own)
    for own in (None, 3, "abs", [], np.zeros(3)):
        yield lambda own=own: law.from_function("joint", "speed", own, 0.0, 1.0, tolerance=1.0)
    for own in (lambda u: NAN, lambda u: "h", lambda u: None, lambda u: INF):
        yield lambda own=own: law.from_function("joint", "speed", own, 0.0, 1.0, tolerance=1.0)
    for u, h in (([0.0], [1.0]), ([0.0, 5e-324, 1.0], [0.0, 1.0, 2.0]), ([0.0, 1.0, 2.0], [0.0, 1e308, -1e308]), (np.arange(9.0), np.arange(9.0) * 2e307)):
        yield lambda u=u, h=h: law.from_points("joint", "speed", u, h, tolerance=1.0)
    for own in (np.zeros(3), np.zeros((8, 2)), np.full(9, NAN), "points", None, np.arange(9)[::-1]):
        yield lambda own=own: law.from_points("joint", "speed", own, np.zeros(9), tolerance=1.0)
    for own in (np.zeros(7), np.zeros(9), [NAN] * 8, "eight", None):
        yield lambda own=own: law("joint", "speed", 0.0, 1.0, own)


def test_a_thousand_bad_arguments_are_refused_with_a_text(arrays, loaded, fitted, ramp):
    calls = [(lambda own=own: ramphold.Session.from_arrays(**own)) for own in spoiled_arguments(arrays)]
    calls += list(other_calls(loaded, fitted, ramp))
    accepted, wordless = [], []
    for number, call in enumerate(calls):
        try:
            call()
        except ramphold.RampholdError as error:
            if not str(error).strip() or "mistake in ramphold" in str(error):
                wordless.append((number, error, call.__defaults__))
        except TypeError as error:
            # Python's own word where an argument cannot even be passed on.
            wordless.append((number, error, call.__defaults__))
        else:
            accepted.append((number, call.__defaults__))
    print(len(calls), "calls")
    assert len(calls) >= 1000
    assert not wordless, wordless[:5]
    assert not accepted, [str(own)[:300] for own in accepted[:5]]


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda own: {**own, "theta": [57.29577951308232 * theta for theta in own["theta"]]}, "deg"),
        (lambda own: {**own, "torque": [-torque for torque in own["torque"]]}, "torque"),
        (lambda own: {**own, "torque": [1e3 * torque for torque in own["torque"]]}, "torque"),
        (lambda own: {**own, "theta": own["torque"], "torque": own["theta"]}, "swapped"),
    ],
    ids=["degrees", "sign", "millinewton", "swapped"],
)
def test_a_wrong_unit_or_sign_is_found_before_the_fit(arrays, change, word):
    session = ramphold.Session.from_arrays(**change(arrays))
    assert session.check()
    for verb in (session.fit, session.diagnose):
        with pytest.raises(ramphold.InputError, match=word):
            verb()
