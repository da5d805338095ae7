"""`ramphold attach` of C3D files that two independent programs wrote: ezc3d and the package c3d."""

import csv
import io
import json
import shutil

import c3d
import ezc3d
import numpy
import pytest
from conftest import done, ramphold
from other_device import RATE_HZ, Device

LABELS = ["EMG 1", "TRIG", "torque"]
BY_TRIGGER = ["--trigger", "TRIG", "--emg-fcr", "EMG 1", "--fcr-at-mvc", "2"]


@pytest.fixture(scope="session")
def device(session, tmp_path_factory):
    return Device(session, tmp_path_factory.mktemp("device"))


@pytest.fixture
def own_session(session, tmp_path):
    """A copy, to which recordings are attached."""
    return shutil.copytree(session, tmp_path / "s", symlinks=True)


def write(file, samples, labels=LABELS, in_frame=20, **parameters):
    """Writes a file with ezc3d; `parameters` are those of the group TRIAL."""
    own = ezc3d.c3d()
    own["parameters"]["POINT"]["RATE"]["value"] = [RATE_HZ / in_frame]
    own["parameters"]["POINT"]["LABELS"]["value"] = []
    own["data"]["points"] = numpy.zeros((4, 0, samples.shape[1] // in_frame))
    own["parameters"]["ANALOG"]["RATE"]["value"] = [RATE_HZ]
    own["parameters"]["ANALOG"]["LABELS"]["value"] = labels
    own["parameters"]["ANALOG"]["UNITS"]["value"] = ["mV"] * len(labels)
    own["data"]["analogs"] = samples[numpy.newaxis].astype(float)
    for name, value in parameters.items():
        own.add_parameter("TRIAL", name, value)
    own.write(str(file))
    return file


def written_by_c3d(file, samples, in_frame=20, scale=1.0):
    """Writes a file with the package c3d, with a marker: multiples of a `scale` that is not 1 as integers."""
    writer = c3d.Writer(point_rate=RATE_HZ / in_frame, analog_rate=RATE_HZ, point_scale=-1.0 if scale == 1 else 0.1)
    points = numpy.zeros((1, 5))
    frames = samples.reshape(len(samples), -1, in_frame).swapaxes(0, 1)
    writer.add_frames([(points, frame) for frame in frames])
    writer.set_point_labels(["wrist"])
    writer.set_analog_labels(LABELS)
    writer.set_analog_scales(numpy.full(len(LABELS), scale))
    writer.set_analog_offsets(numpy.zeros(len(LABELS)))
    with file.open("wb") as handle:
        writer.write(handle)
    return file


def attachment(session, name):
    return json.loads((session / "attached" / name / "attachment.json").read_text())


def largest_error_s(device, own):
    return max(abs(trial["onset_s"] - device.onsets[trial["trial"]]) for trial in own["trials"])


def rows(session, name, trial):
    text = (session / "attached" / name / trial["file"]).read_text()
    header, *lines = csv.reader(io.StringIO(text))
    return header, numpy.array(lines, dtype=float)


def assert_attached_whole(session, device, name, samples):
    """The ramps are where they were, and each row of each trial is a sample of the recording, in order and without a gap."""
    own = attachment(session, name)
    assert own["columns"] == LABELS and own["left_out"] == []
    assert {trial["trial"] for trial in own["trials"]} == set(device.onsets)
    assert largest_error_s(device, own) < 1 / RATE_HZ
    assert abs(own["clock"]["drift_ppm"] - 80) < 40
    for trial in own["trials"]:
        header, table = rows(session, name, trial)
        assert header == ["t_s", *LABELS] and len(table) == trial["samples"]
        (places,) = numpy.nonzero((samples.T == table[0, 1:]).all(axis=1))
        assert numpy.array_equal(table[:, 1:], samples.T[places[0] : places[0] + len(table)])


def test_a_recording_of_ezc3d_is_cut_into_the_trials_and_no_sample_is_changed(own_session, device, tmp_path):
    file = write(tmp_path / "motion.c3d", device.samples)
    result = done("attach", own_session, file, *BY_TRIGGER)
    print(result.stdout)
    assert_attached_whole(own_session, device, "motion", device.samples)
    assert (own_session / "attached/motion/source.c3d").read_bytes() == file.read_bytes()
    done("verify", own_session)
    done("report", own_session)
    report = (own_session / "results/report.html").read_text()
    assert "The EMG is that of the attachment motion, 2000 samples a second." in report


def test_a_shared_torque_aligns_to_a_fraction_of_a_millisecond(own_session, device, tmp_path):
    file = write(tmp_path / "motion.c3d", device.samples)
    done("attach", own_session, file, "--signal", "torque", "--shared", "torque_l_nm")
    own = attachment(own_session, "motion")
    print(f"largest error of a ramp: {1e3 * largest_error_s(device, own):.3f} ms; drift {own['clock']['drift_ppm']:.1f} ppm")
    assert largest_error_s(device, own) < 3e-4 and abs(own["clock"]["drift_ppm"] - 80) < 20


@pytest.mark.parametrize("scale", [1.0, 2.0**-10])
def test_floating_point_numbers_and_integers_of_another_writer_are_read(own_session, device, tmp_path, scale):
    samples = device.samples if scale == 1 else numpy.rint(device.samples / scale) * scale
    file = written_by_c3d(tmp_path / "motion.c3d", samples, scale=scale)
    done("attach", own_session, file, *BY_TRIGGER)
    assert_attached_whole(own_session, device, "motion", samples)


def test_a_session_of_more_than_65535_frames_is_attached_whole(own_session, device, tmp_path):
    frames = device.samples.shape[1]
    assert frames > 65535
    last = {"ACTUAL_START_FIELD": [1, 0], "ACTUAL_END_FIELD": [frames % 65536, frames // 65536]}
    # ezc3d itself says only that there are more, the package c3d says how many in POINT:LONG_FRAMES.
    write(tmp_path / "more.c3d", device.samples, in_frame=1)
    write(tmp_path / "trial.c3d", device.samples, in_frame=1, **last)
    written_by_c3d(tmp_path / "long.c3d", device.samples, in_frame=1)
    for name in ["more", "trial", "long"]:
        done("attach", own_session, tmp_path / f"{name}.c3d", *BY_TRIGGER)
        assert_attached_whole(own_session, device, name, device.samples)
    short = {**last, "ACTUAL_END_FIELD": [(frames - 4000) % 65536, (frames - 4000) // 65536]}
    file = write(tmp_path / "short.c3d", device.samples, in_frame=1, **short)
    result = ramphold("attach", own_session, file, *BY_TRIGGER)
    assert result.returncode == 2 and "the count is wrong" in result.stderr, result.stderr
    assert not (own_session / "attached/short").exists()


def test_channels_beyond_255_are_found_by_their_labels(own_session, device, tmp_path):
    few = device.samples[:, ::4]
    many = numpy.zeros((300, few.shape[1] // 20 * 20), dtype=numpy.float32)
    many[[290, 0, 299]] = few[:, : many.shape[1]]
    labels = [f"unused {number}" for number in range(300)]
    for number, label in zip([290, 0, 299], LABELS):
        labels[number] = label
    file = write(tmp_path / "many.c3d", many, labels=labels)
    # The file says that it has 2000 samples a second.
    done("attach", own_session, file, "--trigger", "TRIG", "--emg-fcr", "EMG 1", "--rate", RATE_HZ / 4)
    own = attachment(own_session, "many")
    assert own["columns"] == labels and largest_error_s(device, own) < 4 / RATE_HZ


def test_emg_that_stopped_is_attached_and_told(own_session, device, tmp_path):
    stopped = device.samples.copy()
    trial, onset = sorted(device.onsets.items())[3]
    first = int(RATE_HZ * onset) - 300
    stopped[0, first : first + 320] = 0.25
    result = done("attach", own_session, write(tmp_path / "stopped.c3d", stopped), *BY_TRIGGER)
    assert f'EMG in column "EMG 1", trial {trial}: it stays at 0.25 for 0.1595 s' in result.stderr, result.stderr
    (frozen,) = attachment(own_session, "stopped")["frozen_emg"]
    assert frozen["column"] == "EMG 1" and frozen["trials"] == [trial]
    done("report", own_session)
    report = (own_session / "results/report.html").read_text()
    assert f"Do not trust the attached EMG in column &quot;EMG 1&quot;, trial {trial}" in report


def test_what_is_no_recording_of_the_session_is_refused_and_nothing_is_written(own_session, device, tmp_path):
    def refused(file, *arguments):
        result = ramphold("attach", own_session, file, *(arguments or BY_TRIGGER))
        assert result.returncode == 2 and not (own_session / "attached").exists(), result.stderr
        print(result.stderr.strip())
        return result.stderr

    whole = write(tmp_path / "whole.c3d", device.samples)
    cut = tmp_path / "cut.c3d"
    cut.write_bytes(whole.read_bytes()[:-100_000])
    assert "frames, " in (message := refused(cut)) and "the file is cut off" in message
    cut.write_bytes(whole.read_bytes()[:700])
    assert "the file is cut off in its header or its parameters" in refused(cut)
    cut.write_text("t,TRIG\n0,1\n")
    assert "does not begin as its name says" in refused(cut)
    cut.write_bytes(b"")
    assert "does not begin as its name says" in refused(cut)
    message = refused(whole, "--trigger", "Sync")
    assert 'no column "Sync"; expected one of time_s, EMG 1, TRIG, torque' in message
    message = refused(whole, "--trigger", "TRIG", "--emg-ecr", "EMG 2")
    assert 'has no column "EMG 2"; expected one of time_s, EMG 1, TRIG, torque' in message
    assert "no marker" in refused(whole, "--marker", "onset")

    markers = ezc3d.c3d()
    markers["parameters"]["POINT"]["RATE"]["value"] = [100]
    markers["parameters"]["POINT"]["LABELS"]["value"] = ["wrist"]
    markers["data"]["points"] = numpy.ones((4, 1, 500))
    markers.write(str(tmp_path / "markers.c3d"))
    assert "no analog channels, only markers" in refused(tmp_path / "markers.c3d")

    spoilt = device.samples.copy()
    spoilt[1, 5000] = numpy.nan
    assert 'NaN in column "TRIG", sample 5001' in refused(write(tmp_path / "spoilt.c3d", spoilt))

    # One trial of the session, with one pulse; and the pulses of another session.
    onset = int(RATE_HZ * min(device.onsets.values()))
    one = device.samples[:, onset - 2000 : onset + 2000]
    assert "which may be chance" in refused(write(tmp_path / "one.c3d", one))
    other = device.samples.copy()
    other[1] = 0.1
    pulses = numpy.cumsum(numpy.random.default_rng(2).integers(9000, 20_000, 12))
    other[1, (pulses[pulses < other.shape[1] - 10, numpy.newaxis] + numpy.arange(10)).ravel()] = 4.9
    assert "which may be chance" in refused(write(tmp_path / "other.c3d", other))
    message = refused(write(tmp_path / "noise.c3d", device.samples), "--signal", "EMG 1", "--shared", "torque_l_nm")
    assert "which may be chance" in message
