"""`ramphold export --mat`: what scipy and Octave read in the file."""

import csv
import json
import shutil
import subprocess

import numpy
import pytest
import scipy.io
from conftest import done, ramphold
from other_device import with_attached_emg
from test_bids import records


@pytest.fixture(scope="session")
def file(session, measured, tmp_path_factory):
    file = tmp_path_factory.mktemp("mat") / "sessions.mat"
    done("export", session, measured, "--mat", file)
    return file


def sessions(file):
    return numpy.atleast_1d(scipy.io.loadmat(file, squeeze_me=True, struct_as_record=False)["sessions"])


def test_scipy_finds_every_sample_of_every_trial(file, session, measured):
    for folder, own in zip([session, measured], sessions(file)):
        about = json.loads((folder / "session.json").read_text())
        assert (own.subject, own.sample_rate_hz, own.format) == ("S01", 2500, "ramphold-session/1")
        assert own.lever.stiffness_nm_per_rad == about["rig"]["lever"]["stiffness_nm_per_rad"]
        assert json.loads(own.channels) == about["channels"]
        assert own.recorded_filter.size == 0
        trials = list(records(folder))
        assert len(own.trials) == len(trials)
        for trial, (row, record) in zip(own.trials, trials):
            assert (trial.trial, trial.status) == (int(row["trial"]), row["status"])
            assert (trial.velocity_rad_s, trial.torque_nm) == (float(row["velocity_rad_s"]), float(row["torque_nm"]))
            assert trial.onset_s == float(row["onset_s"]) if row["onset_s"] else numpy.isnan(trial.onset_s)
            for name in record:
                # Times are computed anew from the rate; everything else is the number of the record.
                assert numpy.allclose(trial.t_s, record["t_s"], atol=1e-9)
                if name != "t_s":
                    assert numpy.array_equal(getattr(trial, name), record[name]), name
            assert trial.table.rest_s == float(row["rest_s"])


def test_what_was_not_measured_is_no_field(file):
    with_emg, without = sessions(file)
    assert {"emg_fcr_mvc", "emg_ecr_mvc"} <= set(with_emg.trials[0]._fieldnames)
    assert not {"emg_fcr_mvc", "emg_ecr_mvc", "theta_l_rad"} & set(without.trials[0]._fieldnames)


def test_the_fit_of_a_trial_is_beside_it(file, session):
    rows = {int(row["trial"]): row for row in csv.DictReader((session / "results/fit.csv").open())}
    fitted, without = sessions(file)
    compared = 0
    for trial in fitted.trials:
        row = rows.get(int(trial.trial))
        if row is None:
            assert trial.fit.size == 0
            continue
        for name in ["k_srs_nm_per_rad", "i_j_kg_m2", "vaf"]:
            assert getattr(trial.fit, name) == float(row[name])
            compared += 1
    assert compared >= 9
    assert all(trial.fit.size == 0 for trial in without.trials)


@pytest.mark.skipif(not shutil.which("octave-cli"), reason="Octave is not installed (Debian package octave)")
def test_octave_finds_the_same(file, session, tmp_path):
    program = f"""
        s = load("{file}").sessions;
        assert (isstruct(s) && isequal(size(s), [1 2]));
        t = s(1).trials;
        assert (ischar(s(1).subject) && strcmp(s(1).subject, "S01"));
        assert (strcmp(t(2).status, "ok") && isfield(t, "emg_ecr_mvc") && ! isfield(s(2).trials, "emg_ecr_mvc"));
        d = dlmread("{session}/trials/trial-002.csv", ",", 1, 0);
        assert (isequal(t(2).theta_m_rad, d(:, 2)) && isequal(t(2).emg_ecr_mvc, d(:, 5)));
        printf("%d trials of %s\\n", numel(t), s(1).name);
    """
    script = tmp_path / "look.m"
    script.write_text(program)
    result = subprocess.run(["octave-cli", "--norc", script], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert result.stdout.endswith(" trials of first\n")


def test_a_file_that_exists_is_not_overwritten(file, session):
    before = file.read_bytes()
    result = ramphold("export", session, "--mat", file)
    assert result.returncode == 2 and "exists already" in result.stderr
    assert file.read_bytes() == before


def test_emg_of_another_device_is_there_at_its_own_rate(session, tmp_path):
    copy = with_attached_emg(session, tmp_path)
    done("export", copy, session, "--mat", tmp_path / "both.mat")
    with_emg, without = sessions(tmp_path / "both.mat")
    own = with_emg.attached
    assert numpy.size(without.attached) == 0
    assert (own.name, own.emg_fcr.column, own.emg_fcr.at_mvc, own.emg_ecr.size) == ("lab", "EMG 1", 2.5, 0)
    found = json.loads((copy / "attached/lab/attachment.json").read_text())["trials"]
    assert [int(trial.trial) for trial in own.trials] == [trial["trial"] for trial in found]
    for trial, told in zip(own.trials, found):
        values = [float(row["EMG 1"]) for row in csv.DictReader((copy / "attached/lab" / told["file"]).open())]
        assert numpy.allclose(trial.emg_fcr, values, rtol=1e-8) and len(values) > 1000
