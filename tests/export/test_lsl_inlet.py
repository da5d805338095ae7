"""Streams of a rig file: recorded as they came, placed on the time of the session, and told about when they are not as they must be."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy
import pytest
import pyxdf
from conftest import ROOT, program
from lsl_amplifier_values import sample
from test_lsl import LIBRARY, LOOPBACK

EMG = {
    "name": "Amplifier 7", "type": "EMG", "source_id": "amplifier-7", "unit": "uV", "channel_count": 3, "rate_hz": 2000,
    "emg_fcr": {"label": "FCR", "at_mvc": 120.0, "details": {"delay_s": 0.004}}, "emg_ecr": {"number": 2, "at_mvc": 80.0},
    "tolerate": {"silent_s": 0.5},
}


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab")
    (folder / "lsl.cfg").write_text(LOOPBACK)
    return dict(os.environ, LSLAPICFG=str(folder / "lsl.cfg"))


@pytest.fixture
def lab(tmp_path, environment):
    """Starts amplifiers, and ends them with the test."""
    running = []

    class Lab:
        folder = tmp_path

        def amplifier(self, *arguments):
            command = [sys.executable, Path(__file__).with_name("lsl_amplifier.py"), *map(str, arguments)]
            own = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
            running.append(own)
            assert own.stdout.readline() == "ready\n"
            return own

        def files(self, stream=None, offset_s=1, repetitions=2, **changes):
            protocol = json.loads((ROOT / "protocols/quick.json").read_text())
            protocol.update(velocities_rad_s=[1.3], torques_nm=[0.9], repetitions=repetitions)
            protocol["before"].update(offset_s=offset_s, mvc=None)
            (tmp_path / "protocol.json").write_text(json.dumps(protocol))
            rig = {"kind": "virtual", "streams": [{**(stream or EMG), **changes}]}
            (tmp_path / "rig.json").write_text(json.dumps(rig))
            return ["run", tmp_path / "protocol.json", "--rig", tmp_path / "rig.json", "--seed", 3, "--out", tmp_path / "s"]

        def ramphold(self, *arguments, timeout=240):
            command = [program(), *map(str, arguments)]
            return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=timeout)

        def begin(self, *arguments):
            command = [program(), *map(str, arguments)]
            own = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
            running.append(own)
            return own

    yield Lab()
    for process in running:
        process.kill()
        process.wait()


def real_time(arguments):
    return [*arguments, "--real-time", "--lsl-library", LIBRARY]


def attachment(session, name="Amplifier-7"):
    return json.loads((session / "attached" / name / "attachment.json").read_text())


def trial_starts(session):
    """When each trial's first sample was taken, on the clock of the computer, s: not from what is tested, but from the journal's stamps."""
    starts = {}
    stamp = None
    for line in (session / "journal.log").read_text().splitlines():
        entry = json.loads(line[26:])
        if entry["record"] == "clock":
            stamp = entry["stamp"]["monotonic_ns"] - entry["stamp"]["late_ns"]
        began = (entry.get("detail") or {}).get("began") if isinstance(entry.get("detail"), dict) else None
        if began and not began["practice"]:
            starts[began["number"]] = stamp * 1e-9
    return starts


def offsets_ms(session, name="Amplifier-7"):
    """By how much the samples of the stream are placed late in the trials, ms: of each sample of each trial."""
    starts, found = trial_starts(session), []
    for trial in attachment(session, name)["trials"]:
        with (session / "attached" / name / trial["file"]).open() as file:
            table = numpy.array([[float(cell) for cell in row] for row in list(csv.reader(file))[1:]])
        # Column `clock` says when the sample was taken; `t_s` where it was placed. The record of a trial begins at its first sample.
        own = list(csv.DictReader((session / "trials.csv").open()))
        record = next(row for row in own if int(row["trial"]) == trial["trial"])
        begin_s = float(next(csv.DictReader((session / record["file"]).open()))["t_s"])
        found.append(1e3 * ((table[:, 0] - begin_s) - (table[:, 3] - starts[trial["trial"]])))
    return numpy.concatenate(found)


@pytest.mark.parametrize("parcel", [1, 40])
def test_every_sample_is_kept_as_it_came_and_lies_where_a_common_clock_has_it(lab, parcel):
    amplifier = lab.amplifier("--parcel", parcel)
    result = lab.ramphold(*real_time(lab.files()))
    assert result.returncode == 0, result.stderr
    amplifier.kill()
    session = lab.folder / "s"
    (stream,), _ = pyxdf.load_xdf(session / "streams/Amplifier-7.run-1.xdf", dejitter_timestamps=False)
    values = stream["time_series"]
    # The clock says which sample each is: none is missing, none is twice, each is as it was sent.
    numbers = numpy.rint((values[:, 2] - values[0, 2]) * 2000).astype(int)
    assert (numbers == numpy.arange(len(numbers))).all()
    first = numpy.array([sample(number) for number in range(40_000)])
    (starts,) = numpy.nonzero((first == values[0, :2]).all(axis=1))
    assert numpy.array_equal(first[starts[0] : starts[0] + len(values)][:5000], values[:5000, :2])
    assert len(stream["clock_times"]) >= 2 and numpy.abs(stream["clock_values"]).max() < 1e-3
    own = attachment(session)
    assert [trial["trial"] for trial in own["trials"]] == [1, 2] and own["left_out"] == []
    # The recording is some 10 s long, and parcels are milliseconds late on a busy computer.
    assert abs(own["clock"]["rate_hz"] / 2000 - 1) < (1e-4 if parcel == 1 else 5e-4)
    off = offsets_ms(session)
    print(f"parcels of {parcel}: {len(off)} samples, offset {off.mean():.3f} ms, {numpy.abs(off).max():.3f} ms at most")
    assert numpy.abs(off).max() < 1
    assert own["stream"]["channels"] == {"FCR": {"delay_s": 0.004, "filter": None, "range": None, "origin": None}}
    assert "the attachment Amplifier-7" in (session / "results/report.html").read_text()
    assert lab.ramphold("verify", session).returncode == 0
    assert lab.ramphold("export", session, "--xdf", lab.folder / "s.xdf").returncode == 0
    exported = {one["info"]["name"][0]: one for one in pyxdf.load_xdf(lab.folder / "s.xdf", dejitter_timestamps=False)[0]}
    emg, markers = exported["Amplifier 7"], exported["ramphold markers"]
    assert numpy.array_equal(emg["time_series"], values)
    begins = dict(zip([text for (text,) in markers["time_series"]], markers["time_stamps"]))
    late_s = (emg["time_stamps"] - emg["time_series"][:, 2]).min() - (begins["begin 2"] - trial_starts(session)[2])
    print(f"parcels of {parcel}: in the XDF file {1e3 * late_s:.3f} ms beside the trials")
    assert abs(late_s) < 1e-3


def test_a_stream_that_stops_is_a_fault_and_the_session_goes_on_with_it_when_it_is_resumed(lab):
    amplifier = lab.amplifier("--silent", 9, 1e9)
    result = lab.ramphold(*real_time(lab.files(repetitions=6)))
    assert result.returncode != 0
    assert 'the stream "Amplifier 7" gave no sample for more than the 0.5 s' in result.stderr, result.stderr
    session = lab.folder / "s"
    journal = (session / "journal.log").read_text()
    assert '"stream_silent":{"stream":"Amplifier 7"' in journal and '"kind":"silent_stream"' in journal
    before = attachment(session)["trials"]
    amplifier.kill()
    amplifier.wait()
    lab.amplifier("--seconds", 200)
    result = lab.ramphold("resume", session, "--real-time", "--lsl-library", LIBRARY)
    assert result.returncode == 0, result.stderr
    after = attachment(session, "Amplifier-7-2")["trials"]
    rows = list(csv.DictReader((session / "trials.csv").open()))
    whole = {int(row["trial"]) for row in rows if row["status"] == "ok"}
    # A trial that ended within the silence that is let pass is ok, and its stream is told to end within it.
    missing = whole - {trial["trial"] for trial in before + after}
    assert before and after and len(missing) <= 1
    assert missing <= {left["trial"] for left in attachment(session)["left_out"]}
    report = (session / "results/report.html").read_text()
    assert "stream Amplifier 7 silent" in report
    assert numpy.abs(offsets_ms(session, "Amplifier-7-2")).max() < 1


def test_a_silence_that_is_tolerated_costs_the_trials_in_it_and_no_others(lab):
    lab.amplifier("--silent", 10, 14)
    result = lab.ramphold(*real_time(lab.files(repetitions=4, tolerate={"silent_s": None})))
    assert result.returncode == 0, result.stderr
    assert "the rig file tolerates it" in result.stderr and 'the stream "Amplifier 7" is back after' in result.stderr
    own = attachment(lab.folder / "s")
    left = [left["because"] for left in own["left_out"]]
    rows = list(csv.DictReader((lab.folder / "s/trials.csv").open()))
    assert 1 <= len(left) <= 3
    gaps_s = [float(re.fullmatch(r"the recording has a gap in it: (\d\.\d{3}) s without a sample", told).group(1)) for told in left]
    assert gaps_s == pytest.approx([4] * len(left), abs=0.05)
    assert len(own["trials"]) + len(left) == len(rows)
    assert numpy.abs(offsets_ms(lab.folder / "s")).max() < 1
    report = (lab.folder / "s/results/report.html").read_text()
    assert "stream Amplifier 7 silent" in report and "the recording has a gap in it" in report


@pytest.mark.parametrize(("ahead_s", "told"), [(1.7e9, "ahead of"), (-4000, "behind"), (3, "ahead of")])
def test_a_stream_with_the_stamps_of_another_clock_is_refused_before_there_is_a_session(lab, ahead_s, told):
    lab.amplifier("--ahead", ahead_s)
    result = lab.ramphold(*real_time(lab.files()))
    assert result.returncode == 2 and f"s {told} the clock of Lab Streaming Layer" in result.stderr, result.stderr
    assert not (lab.folder / "s").exists()


@pytest.mark.parametrize(("jump_s", "late"), [(3, "-"), (-3, "")])
def test_a_clock_that_jumps_is_a_fault_while_the_session_runs(lab, jump_s, late):
    lab.amplifier("--jump", 9, 1e9, jump_s)
    result = lab.ramphold(*real_time(lab.files(repetitions=6)))
    assert result.returncode != 0
    assert 'the time stamps of the stream "Amplifier 7" cannot be when its samples were taken' in result.stderr, result.stderr
    session = lab.folder / "s"
    journal = (session / "journal.log").read_text()
    assert '"kind":"stream_stamps_off"' in journal and '"stream_stamps_off":{"stream":"Amplifier 7","late_s":' + late in journal
    # What was attached is from before the jump.
    assert numpy.abs(offsets_ms(session)).max() < 1


@pytest.mark.parametrize("jump_s", [3, -3])
def test_a_jump_that_is_tolerated_costs_the_trials_beside_it_and_no_others(lab, jump_s):
    lab.amplifier("--jump", 10, 12, jump_s)
    result = lab.ramphold(*real_time(lab.files(repetitions=5, tolerate={"silent_s": None})))
    assert result.returncode == 0, result.stderr
    assert "s behind the clock" in result.stderr or "s ahead of the clock" in result.stderr, result.stderr
    assert "are right again" in result.stderr, result.stderr
    own = attachment(lab.folder / "s")
    left = [left["because"] for left in own["left_out"]]
    assert 1 <= len(left) <= 2 and all("the recording has a gap in it" in because for because in left), left
    assert len(own["trials"]) + len(left) == len(list(csv.DictReader((lab.folder / "s/trials.csv").open())))
    assert numpy.abs(offsets_ms(lab.folder / "s")).max() < 1


def test_emg_that_stands_still_is_a_fault_while_the_session_runs(lab):
    lab.amplifier("--frozen", 9, 1e9)
    begun = time.monotonic()
    result = lab.ramphold(*real_time(lab.files(repetitions=6)))
    assert result.returncode != 0
    session = lab.folder / "s"
    journal = (session / "journal.log").read_text()
    assert 'the EMG of the stream "Amplifier 7" kept one value for more than the 0.5 s' in result.stderr, result.stderr
    assert '"kind":"frozen_stream"' in journal and '"stream_frozen":{"stream":"Amplifier 7","channel":"emg_fcr"' in journal
    print(f"over {time.monotonic() - begun:.1f} s after the beginning; the EMG stood still from 9 s after that of the amplifier")
    rows = list(csv.DictReader((session / "trials.csv").open()))
    assert 1 <= sum(row["status"] == "ok" for row in rows) < 6


def test_emg_that_stands_still_is_told_live_where_the_rig_file_tolerates_it_and_so_is_its_return(lab):
    lab.amplifier("--frozen", 10, 14)
    result = lab.ramphold(*real_time(lab.files(repetitions=4, tolerate={"silent_s": None})))
    assert result.returncode == 0, result.stderr
    for channel in ["emg_fcr", "emg_ecr"]:
        told = re.search(rf'the stream "Amplifier 7" has had the same value, \S+, in {channel} for (\d\.\d+) s', result.stderr)
        assert told and 1.0 <= float(told[1]) < 1.5, result.stderr
        back = re.search(rf'{channel} of the stream "Amplifier 7" changes again after (\d\.\d+) s', result.stderr)
        assert back and 3.9 < float(back[1]) < 4.1, result.stderr
    assert "do not trust this EMG" in result.stderr
    session = lab.folder / "s"
    # The end of the session names the trials, and nothing of the stream is missing.
    assert attachment(session)["frozen_emg"] and attachment(session)["left_out"] == []
    report = (session / "results/report.html").read_text()
    assert "stream Amplifier 7 frozen: emg_fcr" in report and "stream Amplifier 7 live: emg_fcr" in report


def test_what_a_kill_leaves_of_a_stream_is_whole_to_the_last_moments_and_is_cut_when_the_session_is_resumed(lab):
    lab.amplifier("--seconds", 200)
    session = lab.folder / "s"
    run = lab.begin(*real_time(lab.files(repetitions=4)))
    while len(list((session / "trials").glob("*.csv"))) < 2:
        time.sleep(0.2)
        assert run.poll() is None, run.stderr.read()
    run.send_signal(signal.SIGKILL)
    run.wait()
    killed = time.monotonic()
    file = session / "streams/Amplifier-7.run-1.xdf"
    # A torn last chunk, as the death of the machine leaves it.
    file.write_bytes(file.read_bytes() + b"\x08\x00\x10")
    result = lab.ramphold("resume", session, "--real-time", "--lsl-library", LIBRARY)
    assert result.returncode == 0, result.stderr
    own = attachment(session)
    (stream,), _ = pyxdf.load_xdf(file, dejitter_timestamps=False)
    assert 0 < killed - stream["time_stamps"][-1] < 0.5
    assert own["stream"]["cut_off_bytes"] == 3 and len(own["trials"]) >= 1
    assert attachment(session, "Amplifier-7-2")["trials"]


def refused(lab, amplifier, words, **changes):
    if amplifier is not None:
        lab.amplifier(*amplifier)
    result = lab.ramphold(*real_time(lab.files(**changes)))
    assert result.returncode == 2 and words in result.stderr, result.stderr
    assert not (lab.folder / "s").exists()
    return result.stderr


@pytest.mark.parametrize("amplifier, changes, words", [
    (["--name", "Another"], {}, "not found within 10 s; on the network are: \"Another\""),
    (["--channels", "4"], {}, "4 channels; expected 3"),
    (["--unit", "mV"], {}, "emg_fcr: channel 1 in mV; expected uV"),
    (["--format", "string"], {}, "values of the format string"),
    (["--nominal", "0"], {}, "a stream without a rate"),
    (["--nominal", "1000"], {}, "1000 samples a second; expected 2000"),
    ([], {"emg_fcr": {"label": "Biceps"}}, 'no channel "Biceps"; expected one of FCR, ECR, clock'),
    ([], {"tolerate": {"silent_s": 0}}, "field streams[0].tolerate.silent_s: expected a number from 0.1"),
    ([], {"emg_ecr": {}}, "field streams[0].emg_ecr: expected label or number"),
])
def test_a_stream_that_is_not_as_the_rig_file_says_is_refused_before_there_is_a_session(lab, amplifier, changes, words):
    refused(lab, amplifier, words, **changes)


def test_two_streams_that_fit_are_refused_until_one_is_named(lab):
    lab.amplifier("--source", "first")
    either = {key: value for key, value in EMG.items() if key != "source_id"}
    refused(lab, ["--source", "second"], "2 streams that fit", stream=either)
    result = lab.ramphold(*real_time(lab.files(stream={**either, "source_id": "second"}, repetitions=1)))
    assert result.returncode == 0, result.stderr


def test_without_the_library_or_real_time_there_is_no_session(lab):
    files = lab.files()
    result = lab.ramphold(*files)
    assert result.returncode == 2 and "add --real-time" in result.stderr
    result = lab.ramphold(*files, "--real-time", "--lsl-library", lab.folder / "none.so")
    assert result.returncode == 2 and "liblsl cannot be loaded" in result.stderr
    result = lab.ramphold("run", lab.folder / "protocol.json", "--out", lab.folder / "s", "--lsl-library", LIBRARY)
    assert result.returncode == 2 and "nothing needs the library" in result.stderr
    assert not (lab.folder / "s").exists()
