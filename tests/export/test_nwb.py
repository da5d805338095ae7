"""`ramphold export --nwb`: what pynwb reads in the file, and what nwbinspector finds in it."""

import csv
import json
import shutil
from datetime import datetime, timezone

import numpy
import pytest
from conftest import done, ramphold
from nwbinspector import Importance, inspect_nwbfile
from other_device import with_attached_emg
from pynwb import NWBHDF5IO
from test_bids import records
from test_xdf import streams

UNITS = {"theta_m_rad": "rad", "torque_l_nm": "N m", "emg_fcr_mvc": "MVC", "emg_ecr_mvc": "MVC"}


@pytest.fixture(scope="session")
def file(session, tmp_path_factory):
    file = tmp_path_factory.mktemp("nwb") / "session.nwb"
    done("export", session, "--nwb", file)
    return file


@pytest.fixture(scope="session")
def nwb(file):
    with NWBHDF5IO(file, "r") as io:
        yield io.read()


@pytest.fixture(scope="session")
def xdf(session, tmp_path_factory):
    """The streams of the session's XDF file, which has the same times."""
    file = tmp_path_factory.mktemp("xdf") / "session.xdf"
    done("export", session, "--xdf", file)
    return streams(file)


@pytest.fixture(scope="session")
def known(session, tmp_path_factory):
    """A copy of the session that knows its date, its operator and more of its subject, and has a trial without an onset."""
    folder = tmp_path_factory.mktemp("sessions") / "known"
    shutil.copytree(session, folder)
    about = json.loads((folder / "session.json").read_text())
    about["subject"].update(age=31, sex="female", condition="fatigued")
    about.update(started_utc="2026-02-03T04:05:06Z", operator="Curie, Marie", hand="left")
    (folder / "session.json").write_text(json.dumps(about))
    head, first, *others = (folder / "trials.csv").read_text().splitlines()
    cells = dict(zip(head.split(","), first.split(",")))
    cells.update(onset_s="", status="rejected")
    (folder / "trials.csv").write_text("\n".join([head, ",".join(cells.values()), *others]) + "\n")
    return folder


def with_onset(session):
    return [(row, record) for row, record in records(session) if row["onset_s"]]


def found(file):
    """What the inspector and the validation by the schema find, apart from suggestions."""
    messages = list(inspect_nwbfile(nwbfile_path=file))
    assert all(message.importance is not None for message in messages)
    return [message for message in messages if message.importance != Importance.BEST_PRACTICE_SUGGESTION]


def test_every_sample_of_every_channel_is_in_its_series_at_the_times_of_the_xdf_file(nwb, session, xdf):
    assert set(nwb.acquisition) == set(UNITS)
    trials = with_onset(session)
    assert len(trials) >= 8
    for name, unit in UNITS.items():
        series = nwb.acquisition[name]
        assert (series.unit, series.conversion, series.offset) == (unit, 1, 0)
        assert numpy.array_equal(series.data[:], numpy.concatenate([record[name] for _, record in trials]))
        assert numpy.array_equal(series.timestamps[:], xdf["ramphold signals"]["time_stamps"])
        assert series.timestamps_unit == "seconds" and len(series.description) > 10


def test_the_table_of_trials_has_the_times_and_the_columns_of_the_session(nwb, session, xdf):
    trials = with_onset(session)
    table = nwb.trials.to_dataframe()
    assert list(table.index) == [int(row["trial"]) for row, _ in trials]
    for column in ["velocity_rad_s", "torque_nm", "repetition", "rest_s", "amplitude_rad"]:
        assert list(table[column]) == [float(row[column]) for row, _ in trials], column
    for column in ["status", "reason"]:
        assert list(table[column]) == [row[column] for row, _ in trials], column
    markers = xdf["ramphold markers"]
    times = list(zip([text[0].split()[0] for text in markers["time_series"]], markers["time_stamps"]))
    assert list(table["start_time"]) == [time for event, time in times if event == "begin"]
    assert list(table["onset_time"]) == [time for event, time in times if event == "onset"]
    assert list(table["stop_time"]) == [time for event, time in times if event not in {"begin", "onset"}]


def test_the_samples_of_a_trial_are_found_by_its_interval(nwb, session):
    series = nwb.acquisition["torque_l_nm"]
    times, values = series.timestamps[:], series.data[:]
    for (_, row), (_, record) in zip(nwb.trials.to_dataframe().iterrows(), with_onset(session)):
        own = (times >= row["start_time"]) & (times < row["stop_time"])
        assert numpy.array_equal(values[own], record["torque_l_nm"])


def test_the_fit_of_a_trial_is_in_its_row(nwb, session):
    table = nwb.trials.to_dataframe()
    rows = {int(row["trial"]): row for row in csv.DictReader((session / "results/fit.csv").open())}
    names = set(next(iter(rows.values()))) - {"trial", "velocity_rad_s", "torque_nm", "repetition", "condition"}
    assert {"k_srs_nm_per_rad", "i_j_kg_m2", "vaf"} <= names <= set(table.columns)
    compared = 0
    for trial, own in table.iterrows():
        for name in names:
            is_text = isinstance(own[name], str)
            if trial not in rows:
                assert own[name] == "" if is_text else numpy.isnan(own[name])
            elif is_text:
                assert own[name] == rows[trial][name]
            elif rows[trial][name] == "":
                assert numpy.isnan(own[name])
            else:
                assert own[name] == float(rows[trial][name])
                compared += 1
    assert compared >= 8 * 8


def test_a_session_without_a_date_says_so(nwb, session):
    assert nwb.session_start_time == datetime(1970, 1, 1, tzinfo=timezone.utc)
    assert nwb.timestamps_reference_time == nwb.session_start_time
    assert list(nwb.file_create_date) == [nwb.session_start_time]
    assert "has no date" in nwb.session_description
    assert (nwb.subject.subject_id, nwb.subject.species, nwb.subject.sex) == ("S01", "Homo sapiens", "U")
    assert nwb.subject.age == "P0D/" and nwb.experimenter is None and nwb.institution is None
    about = json.loads((session / "session.json").read_text())
    rig = json.loads(nwb.data_collection.removeprefix("From session.json: "))
    assert rig["lever"] == about["rig"]["lever"] and rig["recorded_filter"] is None


def test_what_a_session_knows_of_itself_is_in_the_file(known, tmp_path):
    done("export", known, "--nwb", tmp_path / "known.nwb")
    with NWBHDF5IO(tmp_path / "known.nwb", "r") as io:
        nwb = io.read()
        assert nwb.session_start_time == datetime(2026, 2, 3, 4, 5, 6, tzinfo=timezone.utc)
        assert "has no date" not in nwb.session_description
        assert tuple(nwb.experimenter) == ("Curie, Marie",)
        assert (nwb.subject.sex, nwb.subject.age) == ("F", "P31Y")
        assert "condition: fatigued" in nwb.subject.description and "hand: left" in nwb.subject.description
        trials = with_onset(known)
        assert list(nwb.trials.id[:]) == [int(row["trial"]) for row, _ in trials]
        assert "left out (1)" in nwb.trials.description
        samples = sum(len(record["t_s"]) for _, record in trials)
        assert len(nwb.acquisition["theta_m_rad"].data) == samples
    assert found(tmp_path / "known.nwb") == []


def test_the_inspector_finds_nothing_but_suggestions(file):
    assert found(file) == []


def test_the_inspector_looks_at_all(file, tmp_path):
    """What passes above would not pass whatever is written."""
    import h5py

    shutil.copy(file, tmp_path / "broken.nwb")
    with h5py.File(tmp_path / "broken.nwb", "r+") as broken:
        del broken["general/subject/species"]
        del broken["acquisition/theta_m_rad/data"].attrs["unit"]
    assert {message.importance for message in found(tmp_path / "broken.nwb")} & {
        Importance.PYNWB_VALIDATION,
        Importance.ERROR,
    }


def test_a_session_always_makes_the_same_file(file, session, tmp_path):
    shutil.copytree(session, tmp_path / "elsewhere")
    done("export", tmp_path / "elsewhere", "--nwb", tmp_path / "again.nwb")
    assert (tmp_path / "again.nwb").read_bytes() == file.read_bytes()


def test_emg_of_another_device_is_a_series_of_its_own_at_the_times_of_the_attachment(session, tmp_path):
    copy = with_attached_emg(session, tmp_path)
    done("export", copy, "--nwb", tmp_path / "s.nwb")
    told = json.loads((copy / "attached/lab/attachment.json").read_text())["trials"]
    with NWBHDF5IO(tmp_path / "s.nwb", "r") as io:
        nwb = io.read()
        assert set(nwb.acquisition) == {*UNITS, "emg_fcr_lab"}
        series, onsets = nwb.acquisition["emg_fcr_lab"], nwb.trials.to_dataframe()["onset_time"]
        rows = {int(row["trial"]): row for row in csv.DictReader((copy / "trials.csv").open())}
        values, times_s = [], []
        for trial in told:
            own = list(csv.DictReader((copy / "attached/lab" / trial["file"]).open()))
            values += [float(row["EMG 1"]) / 2.5 for row in own]
            onset_s = float(rows[trial["trial"]]["onset_s"])
            times_s += [float(row["t_s"]) - onset_s + onsets[trial["trial"]] for row in own]
        assert series.unit == "MVC" and "attachment lab" in series.description
        assert numpy.allclose(series.data[:], values, rtol=1e-8) and len(values) > 1000
        assert numpy.abs(series.timestamps[:] - times_s).max() < 2e-5
    assert found(tmp_path / "s.nwb") == []


def test_a_file_that_exists_is_not_overwritten(file, session):
    before = file.read_bytes()
    result = ramphold("export", session, "--nwb", file)
    assert result.returncode == 2 and "exists already" in result.stderr
    assert file.read_bytes() == before


def test_several_sessions_are_refused(session, known, tmp_path):
    result = ramphold("export", session, known, "--nwb", tmp_path / "both.nwb")
    assert result.returncode == 2 and "export each to a file of its own" in result.stderr
    assert not (tmp_path / "both.nwb").exists()


def test_what_has_no_times_is_refused(measured, tmp_path):
    result = ramphold("export", measured, "--nwb", tmp_path / "a.nwb")
    assert result.returncode == 2 and "has no journal" in result.stderr and "an NWB file" in result.stderr
    assert not (tmp_path / "a.nwb").exists()
