"""`ramphold run --lsl`: what a reader of Lab Streaming Layer on this computer gets of a running session."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy
import pylsl
import pytest
from conftest import ROOT, program, ramphold
from test_bids import records

LIBRARY = Path(pylsl.__file__).parent / "lib/liblsl.so"

# Nothing leaves this computer.
LOOPBACK = """[multicast]
ResolveScope = machine
AddressesOverride = {127.0.0.1}
[lab]
KnownPeers = {127.0.0.1}
"""


@pytest.fixture(scope="module")
def streamed(tmp_path_factory):
    """A session that was run in real time, and what was read of it meanwhile."""
    folder = tmp_path_factory.mktemp("lsl")
    (folder / "lsl.cfg").write_text(LOOPBACK)
    environment = dict(os.environ, LSLAPICFG=str(folder / "lsl.cfg"))
    protocol = json.loads((ROOT / "protocols/quick.json").read_text())
    protocol.update(velocities_rad_s=[1.3], torques_nm=[0.9], repetitions=2)
    # Long enough for a reader to find the streams.
    protocol["before"].update(offset_s=8, mvc=None)
    (folder / "protocol.json").write_text(json.dumps(protocol))
    reader = subprocess.Popen(
        [sys.executable, Path(__file__).with_name("lsl_reader.py"), folder / "read.json"],
        env=environment, stdout=subprocess.PIPE, text=True,
    )
    run = subprocess.run(
        [program(), "run", folder / "protocol.json", "--seed", "3", "--out", folder / "s", "--real-time", "--lsl",
         "--lsl-library", LIBRARY],
        env=environment, capture_output=True, text=True, check=False,
    )
    assert run.returncode == 0, run.stderr
    assert "were not published" not in run.stderr
    output, _ = reader.communicate(timeout=60)
    assert output.startswith("connected") and reader.returncode == 0
    return folder / "s", json.loads((folder / "read.json").read_text())


def test_every_sample_of_every_trial_is_in_the_stream_in_order_and_none_is_lost(streamed):
    session, read = streamed
    assert read["labels"][:4] == ["theta_m_rad", "torque_l_nm", "emg_fcr_mvc", "emg_ecr_mvc"]
    assert read["labels"][-1] == "state" and read["rate"] == 2500
    assert read["ended"] == ["ramphold markers", "ramphold signals"]
    stream = numpy.array(read["streams"]["ramphold signals"]["samples"])
    found = 0
    for row, record in records(session):
        own = numpy.column_stack([record[name] for name in read["labels"][:4]])
        (starts,) = numpy.nonzero((stream[:, :4] == own[0]).all(axis=1))
        assert any(numpy.array_equal(stream[at : at + len(own), :4], own) for at in starts), row["trial"]
        found += 1
    assert found == 2


def test_the_marker_of_the_onset_is_at_its_sample(streamed):
    session, read = streamed
    signals, markers = read["streams"]["ramphold signals"], read["streams"]["ramphold markers"]
    stream, times = numpy.array(signals["samples"]), numpy.array(signals["times"])
    assert (numpy.diff(times) > 0).all()
    onsets = {text[0]: time for text, time in zip(markers["samples"], markers["times"]) if "onset" in text[0]}
    rows = list(csv.DictReader((session / "trials.csv").open()))
    assert list(onsets) == [f"onset {row['trial']}" for row in rows]
    for row, record in records(session):
        own = numpy.column_stack([record[name] for name in read["labels"][:4]])
        (starts,) = numpy.nonzero((stream[:, :4] == own[0]).all(axis=1))
        start = next(at for at in starts if numpy.array_equal(stream[at : at + len(own), :4], own))
        onset = start + round(float(row["onset_s"]) * 2500)
        assert times[onset - 1] < onsets[f"onset {row['trial']}"] < times[onset + 1]


def test_without_the_library_or_real_time_the_session_does_not_begin(tmp_path):
    arguments = ["run", ROOT / "protocols/quick.json", "--out", tmp_path / "s", "--lsl"]
    result = ramphold(*arguments)
    assert result.returncode == 2 and "add --real-time" in result.stderr
    result = ramphold(*arguments, "--real-time", "--lsl-library", tmp_path / "none.so")
    assert result.returncode == 2 and "liblsl cannot be loaded" in result.stderr
    assert not (tmp_path / "s").exists()
