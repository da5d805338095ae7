"""EMG of another device in a BIDS dataset: recordings of their own, at the rate and on the clock of the device."""

import csv
import json
import shutil

import edfio
import numpy
import pytest
from conftest import done, ramphold
from other_device import FAST, RATE_HZ, Device
from test_bids import records, validate

AT_MVC = 2.5


@pytest.fixture(scope="module")
def device(session, tmp_path_factory):
    return Device(session, tmp_path_factory.mktemp("device"))


@pytest.fixture(scope="module")
def recording(device, tmp_path_factory):
    """The device's table: EMG that stands still in the ramp of trial 2, and the trigger."""
    emg, trigger, _ = device.samples.astype(float)
    times = numpy.arange(len(emg)) / RATE_HZ
    still = emg.copy()
    still[numpy.abs(times - device.onsets[2]) < 0.2] = 0.125
    file = tmp_path_factory.mktemp("recording") / "emg.csv"
    rows = numpy.column_stack([times, emg, still, trigger])
    numpy.savetxt(file, rows, delimiter=",", header="t,EMG 1,EMG 2,TRIG", comments="", fmt="%.9g")
    return file


def attached(session, folder, recording, *more):
    copy = shutil.copytree(session, folder / "s", symlinks=True)
    done("attach", copy, recording, "--time", "t", "--trigger", "TRIG", "--name", "motion-lab", *more)
    return copy


@pytest.fixture(scope="module")
def own_session(session, recording, tmp_path_factory):
    more = ["--emg-fcr", "EMG 1", "--fcr-at-mvc", AT_MVC, "--emg-ecr", "EMG 2"]
    return attached(session, tmp_path_factory.mktemp("attached"), recording, *more)


@pytest.fixture(scope="module")
def dataset(own_session, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bids") / "study"
    done("export", own_session, "--bids", folder)
    return folder


def stem(trial):
    return f"sub-S01_task-rampandhold_run-{int(trial):03}_recording-motionlab"


def table(path):
    return list(csv.DictReader(path.open(), delimiter="\t"))


def test_the_validator_finds_no_error_in_emg_of_two_rates(dataset):
    status, errors, summary = validate(dataset)
    assert (status, errors) == (0, [])
    assert set(summary["dataTypes"]) == {"emg"}


def test_an_independent_reader_finds_each_sample_of_the_device_at_its_own_rate(dataset, own_session):
    found = json.loads((own_session / "attached/motion-lab/attachment.json").read_text())["trials"]
    assert len(found) == len(list((dataset / "sub-S01/emg").glob("*_recording-motionlab_emg.bdf"))) > 6
    for trial in found:
        with (own_session / "attached/motion-lab" / trial["file"]).open() as file:
            rows = list(csv.DictReader(file))
        path = dataset / "sub-S01/emg" / f"{stem(trial['trial'])}_emg.bdf"
        fcr, ecr = edfio.read_bdf(path).signals
        assert (fcr.label, ecr.label) == ("emg_fcr", "emg_ecr")
        assert fcr.sampling_frequency == pytest.approx(RATE_HZ, rel=1e-6)
        for signal, column, scale in [(fcr, "EMG 1", AT_MVC), (ecr, "EMG 2", 1)]:
            expected = numpy.array([float(row[column]) for row in rows]) / scale
            # 24 bits: a step is a millionth of the range at most.
            assert signal.data.shape == expected.shape and numpy.abs(signal.data - expected).max() < 1e-6
        about = json.loads(path.with_name(f"{stem(trial['trial'])}_emg.json").read_text())
        assert about["SamplingFrequency"] == pytest.approx(RATE_HZ, rel=1e-6)
        assert about["RecordingDuration"] == pytest.approx(len(rows) / RATE_HZ, rel=1e-6)
        assert (about["EMGChannelCount"], about["MISCChannelCount"]) == (2, 0)


def test_the_sessions_own_signals_are_as_without_the_attachment(dataset, session, own_session):
    for row, record in records(session):
        name = f"sub-S01_task-rampandhold_run-{int(row['trial']):03}_emg.bdf"
        signals = edfio.read_bdf(dataset / "sub-S01/emg" / name).signals
        assert [signal.label for signal in signals] == ["emg_fcr", "emg_ecr", "theta_m", "torque_l"]
        assert signals[0].sampling_frequency == 2500
        assert numpy.abs(signals[2].data - record["theta_m_rad"]).max() < 1e-9
    kept = dataset / "sourcedata/sub-S01/attached/motion-lab"
    own = own_session / "attached/motion-lab"
    assert (kept / "source.csv").read_bytes() == (own / "source.csv").read_bytes()


def test_the_ramp_is_an_event_on_the_clock_of_the_device_with_tags(dataset, own_session, device):
    from hed.models import Sidecar, TabularInput
    from hed.schema import load_schema_version

    schema = load_schema_version(json.loads((dataset / "dataset_description.json").read_text())["HEDVersion"])
    sidecar = Sidecar(str(dataset / "task-rampandhold_events.json"))
    for trial in json.loads((own_session / "attached/motion-lab/attachment.json").read_text())["trials"]:
        path = dataset / "sub-S01/emg" / f"{stem(trial['trial'])}_events.tsv"
        (event,) = table(path)
        with (own_session / "attached/motion-lab" / trial["file"]).open() as file:
            start_s = float(next(csv.DictReader(file))["t_s"])
        # The sample of the device before which the trigger rose, of those in the file.
        rows = {int(row["trial"]): row for row in csv.DictReader((own_session / "trials.csv").open())}
        onset_s = float(rows[trial["trial"]]["onset_s"])
        assert float(event["onset"]) == pytest.approx((onset_s - start_s) * (1 + FAST), abs=1e-4)
        assert event["trial"] == str(trial["trial"]) and event["trial_type"] == "ramp"
        events = TabularInput(str(path), sidecar=sidecar)
        assert events.validate(schema) == []
        assert "Experimental-stimulus" in events.series_a[0]


def test_channels_say_unit_rate_and_origin_and_which_stood_still(dataset):
    rows = {row["name"]: row for row in table(dataset / "sub-S01/emg" / f"{stem(1)}_channels.tsv")}
    fcr, ecr = rows["emg_fcr"], rows["emg_ecr"]
    assert (fcr["type"], fcr["units"], ecr["units"]) == ("EMG", "MVC", "n/a")
    assert float(fcr["sampling_frequency"]) == pytest.approx(RATE_HZ, rel=1e-6)
    assert "column EMG 1 of the attachment motion-lab, divided by 2.5" in fcr["description"]
    assert (fcr["target_muscle"], ecr["target_muscle"]) == ("flexor carpi radialis", "extensor carpi radialis")
    assert (fcr["status"], ecr["status"], fcr["low_cutoff"]) == ("good", "good", "n/a")
    still = {row["name"]: row for row in table(dataset / "sub-S01/emg" / f"{stem(2)}_channels.tsv")}
    assert (still["emg_fcr"]["status"], still["emg_ecr"]["status"]) == ("good", "bad")
    assert "keeps one value" in still["emg_ecr"]["status_description"]


def test_a_rig_without_emg_has_motion_recordings_and_beside_them_the_emg_of_the_device(own_session, tmp_path):
    copy = shutil.copytree(own_session, tmp_path / "bare", symlinks=True)
    for record in (copy / "trials").iterdir():
        rows = [",".join(row.split(",")[:3]) for row in record.read_text().splitlines()]
        record.write_text("\n".join(rows) + "\n")
    done("export", copy, "--bids", tmp_path / "study")
    status, errors, summary = validate(tmp_path / "study")
    assert (status, errors) == (0, [])
    assert set(summary["dataTypes"]) == {"emg", "motion"}
    assert {path.name for path in (tmp_path / "study/sub-S01/emg").glob("*_run-001_*_emg.bdf")} == {f"{stem(1)}_emg.bdf"}


def test_an_attachment_that_was_changed_is_an_error_and_nothing_is_written(own_session, tmp_path):
    copy = shutil.copytree(own_session, tmp_path / "s", symlinks=True)
    file = copy / "attached/motion-lab/trial-001.csv"
    file.write_text(file.read_text().replace("EMG 1", "EMG one", 1))
    result = ramphold("export", copy, "--bids", tmp_path / "study")
    assert result.returncode == 2 and "trial-001.csv" in result.stderr, result.stderr
    assert not (tmp_path / "study").exists()
