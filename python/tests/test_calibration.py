"""The constants of a rig."""

import json
import subprocess

import numpy as np
import pandas as pd
import pytest
from conftest import QUICK, ROOT, program, run

import ramphold

MULTISINE = {"kind": "multisine", "amplitude_rad": 0.005, "lowest_hz": 2, "highest_hz": 60, "duration_s": 1}
RIG_TRIALS = [
    {"kind": "empty_handle", "motion": {"kind": "ramps"}, "repetitions": 2},
    {"kind": "empty_handle", "motion": MULTISINE, "repetitions": 2},
    {"kind": "known_weight", "mass_kg": 3.0, "arm_m": 0.1, "relative_error": 0.002, "duration_s": 1, "repetitions": 2},
    {"kind": "known_inertia", "inertia_kg_m2": 0.004, "relative_error": 0.01, "motion": {**MULTISINE, "highest_hz": 40}, "repetitions": 2},
    {"kind": "clamped_handle", "motion": MULTISINE, "repetitions": 2},
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A session with rig trials."""
    folder = tmp_path_factory.mktemp("rig")
    protocol = {**ramphold.Protocol(QUICK).dict, "rig_trials": RIG_TRIALS}
    (folder / "protocol.json").write_text(json.dumps(protocol))
    run("run", "protocol.json", "--rig", ROOT / "protocols/de-vlugt-2011-rig.json", "--seed", 3, "--out", "S01", "--quiet", folder=folder)
    return folder / "S01"


@pytest.fixture(scope="module")
def calibration(folder):
    return ramphold.calibrate(folder)


def test_a_calibration_is_the_one_that_the_program_writes(folder, calibration, tmp_path):
    printed = json.loads(run("calibrate", folder, "--out", tmp_path / "rig.json", "--json"))
    own = ramphold.Calibration.load(tmp_path / "rig.json")
    made = "made_utc"
    assert {**own.dict, made: None} == {**calibration.dict, made: None} == {**printed["calibration"], made: None}
    assert own.json == (tmp_path / "rig.json").read_text()
    pd.testing.assert_frame_equal(calibration.residuals(), pd.DataFrame(printed["residuals_by_load"]), check_exact=True)


def test_a_fit_and_a_diagnosis_with_a_calibration_have_the_bytes_of_the_program(folder, calibration, tmp_path):
    calibration.save(tmp_path / "rig.json")
    session = ramphold.Session.load(folder)
    texts = set()
    for name, source in [("rig", tmp_path / "rig.json"), ("none", "none")]:
        run("fit", folder, "--calibration", source, "--out", tmp_path / "fit" / name)
        texts.add(text := (tmp_path / "fit" / name / "fit.json").read_text())
        assert session.fit(calibration=source).json == text
    assert session.fit(calibration=calibration).json in texts and len(texts) == 2
    run("diagnose", folder, "--calibration", tmp_path / "rig.json", "--out", tmp_path / "diagnosis")
    assert session.diagnose(calibration=calibration).json == (tmp_path / "diagnosis/diagnosis.json").read_text()


def test_a_calibration_in_the_sessions_folder_is_used_and_kept(folder, calibration, tmp_path):
    session = ramphold.Session.load(folder)
    session.save(tmp_path / "s")
    calibration.save(tmp_path / "s/rig-calibration.json")
    own = ramphold.Session.load(tmp_path / "s")
    assert own.fit().json == session.fit(calibration=calibration).json != session.fit().json
    own.save(tmp_path / "again")
    assert ramphold.Session.load(tmp_path / "again").fit().json == own.fit().json


def test_a_rig_is_compared_with_an_earlier_calibration(folder, calibration, tmp_path):
    other = json.loads(calibration.json)
    offset = next(own for own in other["quantities"] if own["name"] == "torque_offset_nm")
    offset["value"] += 100 * offset["se"]
    (tmp_path / "rig.json").write_text(json.dumps(other))
    found = ramphold.Calibration.load(tmp_path / "rig.json").compare(folder)
    # The program's exit code 1 says that the rig has changed; it prints what it found all the same.
    program_says = subprocess.run(
        [program(), "calibrate", folder, "--compare", tmp_path / "rig.json", "--json"], capture_output=True, text=True
    )
    assert program_says.returncode == 1 and json.loads(program_says.stdout) == found.dict
    assert found.changed and all(name in found._repr_html_() for name in found.changed)
    assert found.verdict == "differs" and found.dict["reason"] is None
    # Nothing named is no agreement.
    unexplained = ramphold.RigComparison({**found.dict, "changed": [], "verdict": "differs_unexplained"})
    assert "no single constant explains it" in repr(unexplained)
    unknown = {**found.dict, "changed": [], "verdict": "not_comparable", "reason": "no number", "p_value": None}
    assert "not comparable: no number, p = not known" in ramphold.RigComparison(unknown)._repr_html_()


def test_what_a_notebook_shows_of_a_calibration(calibration):
    html = calibration._repr_html_()
    assert "lever_stiffness_nm_per_rad" in html and "data:image/png;base64," in html
    assert len(calibration.to_frame()) == 11 and np.isfinite(calibration.to_frame()["value"].dropna()).all()


@pytest.fixture(scope="module")
def arrays(folder):
    """The rig trials of the session's folder as a lab's own arrays, read without ramphold."""
    table = pd.read_csv(folder / "rig-trials.csv")
    records = [np.loadtxt(folder / file, delimiter=",", skiprows=1) for file in table["file"]]
    signals = {name: [own[:, column].copy() for own in records] for column, name in enumerate(("t", "target", "theta", "torque"))}
    about = json.loads((folder / "session.json").read_text())
    return {**signals, "trials": table, "lever": about["rig"]["lever"], "name": "S01"}


@pytest.fixture(scope="module")
def given(arrays):
    return ramphold.RigTrials.from_arrays(**arrays)


def without(own, *names):
    return {key: value for key, value in own.items() if key not in names}


def test_rig_trials_as_arrays_are_calibrated_as_those_of_a_folder(given, calibration, tmp_path):
    own = ramphold.calibrate(given)
    # The sums are those of the files that `save` writes, whose numbers have more digits.
    assert without(own.dict, "made_utc", "sources") == without(calibration.dict, "made_utc", "sources")
    pd.testing.assert_frame_equal(own.residuals(), calibration.residuals(), check_exact=True)
    given.save(tmp_path / "S01")
    printed = json.loads(run("calibrate", tmp_path / "S01", "--json"))
    assert without(printed["calibration"], "made_utc") == without(own.dict, "made_utc")
    assert (tmp_path / "S01/rig-calibration.json").read_text() == own.json.replace(own.dict["made_utc"], printed["calibration"]["made_utc"])
    with pytest.raises(ramphold.InputError, match="exists already"):
        given.save(tmp_path / "S01")


def test_rig_trials_as_arrays_are_compared_as_those_of_a_folder(folder, given, calibration):
    assert calibration.compare(given).dict == calibration.compare(folder).dict


def test_the_table_of_rig_trials_may_be_short_and_of_any_kind(arrays, given):
    table = arrays["trials"].drop(columns=["trial", "file", "repetition", "status"]).assign(remark="Tuesday")
    polars = pytest.importorskip("polars")
    for trials in (table, polars.DataFrame(table.to_dict("list")), table.to_dict("list"), table.to_dict("records")):
        own = ramphold.RigTrials.from_arrays(**{**arrays, "trials": trials})
        pd.testing.assert_frame_equal(own.to_frame(), given.to_frame())
    pd.testing.assert_frame_equal(given.to_frame(), arrays["trials"].drop(columns="file"))


def set_cell(row, column, value):
    def change(arrays):
        trials = arrays["trials"].astype(object).copy()
        trials.loc[row, column] = value
        return {**arrays, "trials": trials}

    return change


def set_sample(channel, trial, sample, value):
    def change(arrays):
        own = [record.copy() for record in arrays[channel]]
        own[trial][sample] = value
        return {**arrays, channel: own}

    return change


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (set_cell(0, "load", "elbow"), 'rig trial 1, load: "elbow"'),
        (set_cell(0, "motion", "chirp"), "still, ramp or multisine"),
        (set_cell(0, "mass_kg", 1.0), "an empty cell"),
        (set_cell(1, "trial", 1), "a number that no other trial has"),
        (set_cell(0, "trial", 0), "a whole number from 1 up"),
        (set_cell(0, "status", "fine"), "row 0, status"),
        (set_sample("torque", 0, 7, float("nan")), r"rig trial 1, torque_l_nm\[7\]"),
        (set_sample("target", 0, 7, 0.5), "0.2 s: the noise is measured at rest"),
        (lambda own: {**own, "t": [1e3 * t for t in own["t"]], "sample_rate_hz": 2500}, "milliseconds|samples a second"),
        (lambda own: {**own, "t": [t + 1.0 for t in own["t"]]}, "time 0"),
        (lambda own: {**own, "theta": [theta.astype("float32") for theta in own["theta"]]}, "float64"),
        (lambda own: {**own, "theta": own["theta"][:-1]}, "records; expected"),
        (lambda own: {**own, "torque": [torque[:-1] for torque in own["torque"]]}, "one for each time"),
        (lambda own: {**own, "started_utc": "yesterday"}, "a time in UTC"),
        (lambda own: {**own, "name": None}, "name: None"),
        (lambda own: {**own, "lever": {}}, "inertia_kg_m2"),
    ],
)
def test_wrong_rig_trials_are_refused(arrays, change, word):
    with pytest.raises(ramphold.InputError, match=word):
        ramphold.RigTrials.from_arrays(**change(arrays))


def test_rig_trials_that_cannot_be_analysed_are_refused(arrays):
    none_ok = ramphold.RigTrials.from_arrays(**{**arrays, "trials": arrays["trials"].assign(status="rejected")})
    with pytest.raises(ramphold.RampholdError):
        ramphold.calibrate(none_ok)
    with pytest.raises(ramphold.InputError, match="from_arrays"):
        ramphold.RigTrials(3)
