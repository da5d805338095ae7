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


def test_what_a_notebook_shows_of_a_calibration(calibration):
    html = calibration._repr_html_()
    assert "lever_stiffness_nm_per_rad" in html and "data:image/png;base64," in html
    assert len(calibration.to_frame()) == 11 and np.isfinite(calibration.to_frame()["value"].dropna()).all()
