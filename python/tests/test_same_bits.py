"""No result differs from the program's by a bit."""

import csv
import json

import numpy as np
import pandas as pd
import pytest
from conftest import QUICK, ROOT, run, signals_of

import ramphold


def table_of(text):
    """A table of the program, read by Python."""
    rows = list(csv.DictReader(text.splitlines()))

    def value(cell):
        return {"true": True, "false": False, "": np.nan}[cell] if cell in ("true", "false", "") else float(cell)

    return pd.DataFrame([{name: value(cell) for name, cell in row.items()} for row in rows])


MODEL = {"format": "ramphold-model/1", "mechanisms": [{"mechanism": "joint_damping"}]}


@pytest.mark.parametrize(
    ("options", "arguments"),
    [
        ([], {}),
        (["--window", "0.03"], {"window_s": 0.03}),
        (["--plain"], {"plain": True}),
        (["--independent"], {"independent": True}),
        (["--bootstrap", "2", "--seed", "7"], {"bootstrap": 2, "seed": 7}),
        (["--model", "model.json"], {"model": MODEL}),
    ],
    ids=["default", "window", "plain", "independent", "bootstrap", "model"],
)
def test_a_fit_has_the_bytes_of_the_programs_file(folder, loaded, tmp_path, options, arguments):
    (tmp_path / "model.json").write_text(json.dumps(MODEL))
    run("fit", folder, "--out", "out", *options, folder=tmp_path)
    text = (tmp_path / "out/fit.json").read_text()
    own = loaded.fit(**arguments)
    assert own.json == text
    assert own.dict == json.loads(text)


def test_the_frames_of_a_fit_are_the_tables_of_the_program(folder, loaded, fitted, tmp_path):
    run("fit", folder, "--out", tmp_path / "out")
    for name, frame in {
        "fit.csv": fitted.to_frame(),
        "fit-independent.csv": fitted.to_frame(independent=True),
        "conditions.csv": fitted.to_frame("conditions"),
    }.items():
        table = table_of((tmp_path / "out" / name).read_text())
        assert list(frame.columns) == list(table.columns), name
        pd.testing.assert_frame_equal(frame, table, check_exact=True, check_dtype=False)


def test_a_diagnosis_has_the_bytes_of_the_programs_file(folder, loaded, tmp_path):
    run("diagnose", folder, "--seed", 3, "--out", tmp_path / "out")
    stages = []
    own = loaded.diagnose(seed=3, progress=stages.append)
    assert own.json == (tmp_path / "out/diagnosis.json").read_text()
    assert "fitting the model" in stages


def test_arrays_are_analysed_as_the_folder_that_the_program_reads(arrays, tmp_path):
    session = ramphold.Session.from_arrays(**arrays)
    session.save(tmp_path / "S01")
    run("fit", tmp_path / "S01", "--out", tmp_path / "out")
    assert session.fit().json == (tmp_path / "out/fit.json").read_text()
    assert ramphold.Session.load(tmp_path / "S01").digest == session.digest
    record = ramphold.Session.load(tmp_path / "S01").record(1)
    assert np.array_equal(record["theta_m_rad"].to_numpy(), arrays["theta"][0])


def test_a_virtual_session_is_the_one_that_the_program_runs(tmp_path):
    """The program stores decimal numbers, so the folder's samples are those of memory as the converter steps them."""
    mechanisms = [{"mechanism": "joint_damping", "parameters": {"b_j_nm_s_per_rad": 0.03}}]
    own = ramphold.Session.simulate(QUICK, 11, mechanisms=mechanisms, subject="S01")
    (tmp_path / "model.json").write_text(json.dumps({"format": "ramphold-model/1", "mechanisms": mechanisms}))
    run("run", QUICK, "--seed", 11, "--model", "model.json", "--out", "s", "--quiet", folder=tmp_path)
    there = ramphold.Session.load(tmp_path / "s")
    for trial in own.to_frame()["trial"]:
        pd.testing.assert_frame_equal(own.record(trial), there.record(trial), check_exact=True)


def test_a_schedule_is_the_one_that_the_program_prints():
    protocol = ROOT / "protocols/de-vlugt-2011.json"
    printed = table_of(run("schedule", protocol, "--seed", 9))
    pd.testing.assert_frame_equal(ramphold.schedule(protocol, 9), printed, check_exact=True, check_dtype=False)
    assert ramphold.Protocol(protocol).trial_count == len(printed)


def test_a_prediction_is_the_model_at_the_fitted_parameters(fitted):
    parameters = fitted.parameters(independent=True)
    for row, trial in enumerate(fitted.trials[:3]):
        own = ramphold.simulate(parameters.loc[trial].to_dict(), fitted.motion(trial))
        assert np.array_equal(own.torque_nm, fitted.predicted_nm(independent=True)[row])


def test_a_session_with_more_sensors_has_the_results_of_the_program(tmp_path):
    """Handle angle, its acceleration, and the torque at the hand are fitted as well."""
    sensors = {
        "kind": "virtual",
        "handle_encoder_counts_per_revolution": 262144,
        "accelerometer_noise_rad_s2": 5.0,
        "hand_load_cell_noise_nm": 0.01,
    }
    measured = ramphold.Session.simulate(QUICK, 4, rig=sensors)
    table = measured.to_frame().astype({"trial": int, "repetition": int})
    session = ramphold.Session.from_arrays(**signals_of(measured), trials=table, lever=measured.lever)
    session.save(tmp_path / "s")
    run("fit", tmp_path / "s", "--out", tmp_path / "out")
    fit = session.fit()
    assert fit.json == (tmp_path / "out/fit.json").read_text()
    assert fit.channels == ["torque_l_nm", "theta_l_rad", "alpha_l_rad_s2", "torque_h_nm"]
    for channel in fit.channels:
        own, predicted = fit.measured(channel), fit.predicted(channel)
        assert own.shape == predicted.shape == (len(fit.trials), fit.time_s.size)
        assert np.square(own - predicted).sum() < 0.1 * np.square(own).sum(), channel
    assert np.array_equal(fit.measured("torque_l_nm"), fit.measured_nm)
    # Residuals are those of all channels, each as large as its noise.
    parameters = fit.parameters(independent=True)
    trial = fit.trials[0]
    left = fit.residuals(trial, parameters.loc[trial].to_dict())
    assert left.size % 4 == 0 and 0.3 < np.square(left).mean() < 3.0
    # The motor's motion is the same with and without them, and so is the torque of given parameters.
    own = ramphold.simulate(parameters.loc[trial].to_dict(), fit.motion(trial))
    assert np.array_equal(own.torque_nm, fit.predicted_nm(independent=True)[0])


def test_window_and_filter_of_the_protocol_are_kept_with_a_session(tmp_path):
    protocol = ramphold.Protocol(QUICK).dict
    protocol["window_s"] = 0.035
    protocol["signal"]["filter"]["cutoff_hz"] = 80
    session = ramphold.Session.simulate(protocol, 3)
    session.save(tmp_path / "s")
    run("fit", tmp_path / "s", "--out", tmp_path / "out")
    assert session.fit().json == (tmp_path / "out/fit.json").read_text() == ramphold.Session.load(tmp_path / "s").fit().json
    assert session.fit().dict["settings"]["window_s"] == 0.035
