"""`ramphold export --xdf`: what pyxdf reads in the file."""

import json
import subprocess
import time

import numpy
import pytest
import pyxdf
from conftest import ROOT, done, program, ramphold
from test_bids import records


@pytest.fixture(scope="session")
def file(session, tmp_path_factory):
    file = tmp_path_factory.mktemp("xdf") / "session.xdf"
    done("export", session, "--xdf", file)
    return file


def streams(file):
    found, _ = pyxdf.load_xdf(file, dejitter_timestamps=False)
    return {stream["info"]["name"][0]: stream for stream in found}


def test_every_sample_of_every_trial_is_in_the_stream_at_its_time(file, session):
    found = streams(file)
    assert set(found) == {"ramphold signals", "ramphold markers"}
    signals = found["ramphold signals"]
    labels = [channel["label"][0] for channel in signals["info"]["desc"][0]["channels"][0]["channel"]]
    assert labels == ["theta_m_rad", "torque_l_nm", "emg_fcr_mvc", "emg_ecr_mvc"]
    assert float(signals["info"]["nominal_srate"][0]) == 2500
    onsets = {
        int(text[0].split()[1]): time
        for time, text in zip(found["ramphold markers"]["time_stamps"], found["ramphold markers"]["time_series"])
        if text[0].startswith("onset ")
    }
    expected, times = [], []
    for row, record in records(session):
        if not row["onset_s"]:
            continue
        expected.append(numpy.column_stack([record[label] for label in labels]))
        times.append(record["t_s"] - float(row["onset_s"]) + onsets[int(row["trial"])])
    assert len(times) >= 8
    assert numpy.array_equal(signals["time_series"], numpy.concatenate(expected))
    assert numpy.abs(signals["time_stamps"] - numpy.concatenate(times)).max() < 1e-8
    assert (numpy.diff(signals["time_stamps"]) > 0).all()


def test_the_times_between_trials_are_those_of_the_journal(file, session):
    found = streams(file)["ramphold markers"]
    begins = [time for time, text in zip(found["time_stamps"], found["time_series"]) if text[0].startswith("begin ")]
    journal = [json.loads(line[26:]) for line in (session / "journal.log").read_text().splitlines()]
    began = [entry["sample"] / 2500 for entry in journal if "began" in (entry.get("detail") or {})]
    assert numpy.abs(numpy.array(begins) - began[-len(begins):]).max() < 1e-8


def test_what_has_no_times_is_refused(measured, tmp_path):
    result = ramphold("export", measured, "--xdf", tmp_path / "a.xdf")
    assert result.returncode == 2 and "has no journal" in result.stderr
    assert not (tmp_path / "a.xdf").exists()


def test_the_stretches_of_a_resumed_session_are_in_order_and_do_not_overlap(tmp_path):
    protocol = json.loads((ROOT / "protocols/quick.json").read_text())
    protocol.pop("$schema", None)
    protocol.update(velocities_rad_s=[3.25], rest_s=0.2, before={"offset_s": 0.2})
    protocol["signal"]["sample_rate_hz"] = 1000
    (tmp_path / "protocol.json").write_text(json.dumps(protocol))
    session = tmp_path / "s"
    running = subprocess.Popen(
        [program(), "run", tmp_path / "protocol.json", "--seed", "7", "--real-time", "--quiet", "--out", session]
    )
    until = time.monotonic() + 120
    while not (session / "trials/trial-002.csv.part").exists():
        assert running.poll() is None and time.monotonic() < until
        time.sleep(0.01)
    running.kill()
    running.wait()
    done("resume", session, "--yes", "--real-time")
    done("export", session, "--xdf", tmp_path / "s.xdf")
    found = streams(tmp_path / "s.xdf")
    assert set(found) == {"ramphold signals", "ramphold markers", "ramphold signals 2", "ramphold markers 2"}
    for kind in ["signals", "markers"]:
        first, second = found[f"ramphold {kind}"], found[f"ramphold {kind} 2"]
        assert first["time_stamps"][-1] < second["time_stamps"][0]
        assert (numpy.diff(first["time_stamps"]) >= 0).all() and (numpy.diff(second["time_stamps"]) >= 0).all()
        assert second["info"]["desc"][0]["began_utc"][0] > first["info"]["desc"][0]["began_utc"][0]


def test_trials_that_follow_each_other_at_once_keep_their_times_in_a_reader_that_smooths(tmp_path):
    protocol = json.loads((ROOT / "protocols/quick.json").read_text())
    protocol["rest_s"] = 0.5
    (tmp_path / "p.json").write_text(json.dumps(protocol))
    done("run", tmp_path / "p.json", "--seed", 1, "--out", tmp_path / "s")
    done("export", tmp_path / "s", "--xdf", tmp_path / "s.xdf")
    [smoothed, stored] = [
        next(one["time_stamps"] for one in pyxdf.load_xdf(tmp_path / "s.xdf", dejitter_timestamps=smooth)[0]
             if one["info"]["name"][0] == "ramphold signals")
        for smooth in [True, False]
    ]
    assert numpy.abs(smoothed - stored).max() < 1e-6
