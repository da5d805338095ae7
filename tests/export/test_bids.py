"""`ramphold export --bids`: what a validator and independent readers make of it."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import edfio
import numpy
import pytest
from conftest import ROOT, done, ramphold


def validate(dataset):
    validator = Path(sys.executable).with_name("bids-validator-deno")
    command = [validator, "--json", "--max-rows", "-1", dataset]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    report = json.loads(result.stdout)
    errors = [issue for issue in report["issues"]["issues"] if issue["severity"] == "error"]
    return result.returncode, errors, report["summary"]


def records(folder):
    for row in csv.DictReader((folder / "trials.csv").open()):
        with (folder / row["file"]).open() as file:
            names = next(csv.reader(file))
            yield row, dict(zip(names, numpy.loadtxt(file, delimiter=",").T))


@pytest.fixture(scope="session")
def dataset(session, measured, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bids") / "study"
    done("export", session, measured, "--bids", folder)
    return folder


def test_the_validator_finds_no_error(dataset):
    status, errors, summary = validate(dataset)
    assert (status, errors) == (0, [])
    assert set(summary["dataTypes"]) == {"emg", "motion"} and summary["tasks"] == ["rampandhold"]


def test_the_validator_looks_at_all(dataset, tmp_path):
    """What passes above would not pass whatever is written."""
    subprocess.run(["cp", "-r", dataset, tmp_path / "broken"], check=True)
    next((tmp_path / "broken").rglob("*_emg.json")).write_text("{}")
    status, errors, _ = validate(tmp_path / "broken")
    assert status == 16 and errors


def test_an_independent_reader_finds_the_numbers_of_the_session_in_the_emg_recordings(dataset, session):
    for row, record in records(session):
        name = f"sub-S01_ses-01_task-rampandhold_run-{int(row['trial']):03}_emg.bdf"
        recording = edfio.read_bdf(dataset / "sub-S01/ses-01/emg" / name)
        labels = {"emg_fcr": "emg_fcr_mvc", "emg_ecr": "emg_ecr_mvc", "theta_m": "theta_m_rad", "torque_l": "torque_l_nm"}
        assert [signal.label for signal in recording.signals] == list(labels)
        for signal in recording.signals:
            expected = record[labels[signal.label]]
            assert signal.sampling_frequency == 2500
            assert signal.data.shape == expected.shape
            # The records hold 7 decimals of the angle and 5 of the rest: nothing of them is lost.
            assert numpy.abs(signal.data - expected).max() < 1e-9


def test_the_motion_recordings_hold_the_numbers_of_the_session(dataset, measured):
    for row, record in records(measured):
        name = f"sub-S01_ses-02_task-rampandhold_tracksys-motor_run-{int(row['trial']):03}_motion.tsv"
        values = numpy.loadtxt(dataset / "sub-S01/ses-02/motion" / name, delimiter="\t")
        assert numpy.array_equal(values.T, [record["theta_m_rad"], record["torque_l_nm"]])


def test_every_event_has_hed_tags_that_their_tools_take(dataset):
    from hed.models import Sidecar, TabularInput
    from hed.schema import load_schema_version

    schema = load_schema_version(json.loads((dataset / "dataset_description.json").read_text())["HEDVersion"])
    sidecar = Sidecar(str(dataset / "task-rampandhold_events.json"))
    assert sidecar.validate(schema) == []
    tables = [path for path in dataset.rglob("*_events.tsv") if len(path.read_text().splitlines()) > 1]
    assert len(tables) > 8
    for path in tables:
        events = TabularInput(str(path), sidecar=sidecar)
        assert events.validate(schema) == []
        (tags,) = events.series_a
        assert "Experimental-stimulus" in tags and "Parameter-label/Ramp-velocity" in tags
    wrong = Sidecar(str(dataset / "task-rampandhold_events.json"))
    wrong.loaded_dict["trial_type"]["HED"]["ramp"] = "No-such-tag"
    assert wrong.validate(schema) != []


def test_channels_have_their_rate_and_the_band_of_their_amplifier(dataset):
    (path, *_) = (dataset / "sub-S01/ses-01/emg").glob("*_channels.tsv")
    rows = {row["name"]: row for row in csv.DictReader(path.open(), delimiter="\t")}
    assert [row["sampling_frequency"] for row in rows.values()] == ["2500"] * 4
    bands = {name: (row["low_cutoff"], row["high_cutoff"], row["notch"]) for name, row in rows.items()}
    assert bands["emg_fcr"] == ("20", "450", "n/a") and bands["theta_m"] == ("n/a", "n/a", "n/a")


def test_events_tell_the_onset_and_the_condition(dataset, session):
    for row, _ in records(session):
        name = f"sub-S01_ses-01_task-rampandhold_run-{int(row['trial']):03}_events.tsv"
        events = list(csv.DictReader((dataset / "sub-S01/ses-01/emg" / name).open(), delimiter="\t"))
        if not row["onset_s"]:
            assert events == []
            continue
        (event,) = events
        assert float(event["onset"]) == float(row["onset_s"])
        assert (event["velocity_rad_s"], event["torque_nm"]) == (row["velocity_rad_s"], row["torque_nm"])


def test_the_session_is_kept_as_it_was_and_its_results_beside_it(dataset, session):
    kept = dataset / "sourcedata/sub-S01/ses-01"
    names = [path.relative_to(session) for path in session.rglob("*") if path.is_file()]
    for name in names:
        derived = dataset / "derivatives/ramphold/sub-S01/ses-01"
        copy = derived / name.relative_to("results") if name.parts[0] == "results" else kept / name
        assert copy.read_bytes() == (session / name).read_bytes()
    assert (dataset / "derivatives/ramphold/sub-S01/ses-01/fit.csv").exists()


def test_one_session_of_a_person_has_no_session_in_its_names(session, tmp_path):
    done("export", session, "--bids", tmp_path / "study", "--participant", "07")
    assert list((tmp_path / "study/sub-07/emg").glob("sub-07_task-rampandhold_run-*_emg.bdf"))
    assert validate(tmp_path / "study")[:2] == (0, [])
    assert (tmp_path / "study/participants.tsv").read_text() == "participant_id\nsub-07\n"


def test_a_folder_that_is_not_empty_is_refused(session, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    result = ramphold("export", session, "--bids", tmp_path)
    assert result.returncode == 2 and "is not empty" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("subject", ["ankle-0", "../S01", "", "Ä1"])
def test_a_subject_that_is_not_fit_for_a_file_name_is_refused_with_the_rule(measured, tmp_path, subject):
    subprocess.run(["cp", "-r", measured, tmp_path / "session"], check=True)
    about = json.loads((measured / "session.json").read_text())
    about["subject"]["id"] = subject
    (tmp_path / "session/session.json").write_text(json.dumps(about))
    result = ramphold("export", tmp_path / "session", "--bids", tmp_path / "study")
    assert result.returncode == 2, result.stderr
    assert "letters a to z, A to Z and digits only" in result.stderr and "session.json" in result.stderr
    assert not (tmp_path / "study").exists()
    done("export", tmp_path / "session", "--bids", tmp_path / "study", "--participant", "A0")


def test_peoples_data_pass_the_validator(tmp_path):
    ankle = ROOT / "../shared/data/ankle-0"
    if not ankle.exists():
        pytest.skip("../shared/data/ankle-0 is not there")
    done("export", ankle, "--bids", tmp_path / "study", "--participant", "ankle0")
    assert validate(tmp_path / "study")[:2] == (0, [])
