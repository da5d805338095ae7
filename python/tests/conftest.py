"""The program, and sessions that it made."""

import os
import shutil
import subprocess
from pathlib import Path

import matplotlib
import numpy as np
import pytest

import ramphold

matplotlib.use("Agg")

ROOT = Path(__file__).resolve().parents[2]
QUICK = ROOT / "protocols/quick.json"
LEVER = {"inertia_kg_m2": 0.0016, "damping_nm_s_per_rad": 0.4, "stiffness_nm_per_rad": 900.0}


def program():
    """The program that results are compared with: RAMPHOLD, or the command of the wheel."""
    found = os.environ.get("RAMPHOLD") or shutil.which("ramphold")
    assert found, "there is no program to compare with; set RAMPHOLD"
    return found


def run(*arguments, code=0, folder=None):
    """Runs the program; its standard output."""
    done = subprocess.run([program(), *map(str, arguments)], capture_output=True, text=True, cwd=folder, timeout=300)
    assert done.returncode == code, done.stderr
    return done.stdout if code == 0 else done.stderr


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """A session of the virtual wrist that the program ran."""
    path = tmp_path_factory.mktemp("sessions") / "S01"
    run("run", QUICK, "--seed", 4, "--out", path, "--quiet")
    return path


@pytest.fixture(scope="session")
def loaded(folder):
    return ramphold.Session.load(folder)


@pytest.fixture(scope="session")
def arrays(loaded):
    """The arguments of from_arrays that make the session anew."""
    table = loaded.to_frame()
    return {
        **signals_of(loaded),
        "trials": table,
        "lever": loaded.lever,
        "subject": loaded.subject,
        "sample_rate_hz": loaded.sample_rate_hz,
    }


def signals_of(session):
    """The signals of a session by the arguments of from_arrays."""
    columns = {
        "t": "t_s", "theta": "theta_m_rad", "torque": "torque_l_nm", "emg_fcr": "emg_fcr_mvc", "emg_ecr": "emg_ecr_mvc",
        "theta_l": "theta_l_rad", "alpha_l": "alpha_l_rad_s2", "torque_h": "torque_h_nm", "theta_j": "theta_j_rad",
    }
    records = [session.record(trial) for trial in session.to_frame()["trial"]]
    return {
        name: [record[column].to_numpy().copy() for record in records] for name, column in columns.items() if column in records[0]
    }


@pytest.fixture(scope="session")
def fitted(loaded):
    return loaded.fit()


@pytest.fixture(scope="session")
def ramp():
    return ramp_at(2500.0)


def ramp_at(sample_rate_hz):
    """A motion: 40 ms of rest, then a ramp of 2 rad/s for 64 ms."""
    onset = round(0.04 * sample_rate_hz)
    time = np.arange(onset + round(0.064 * sample_rate_hz)) / sample_rate_hz - 0.04
    return ramphold.Motion(
        np.clip(2.0 * time, 0.0, 0.09), sample_rate_hz, onset=onset, lever=LEVER, velocity_rad_s=2.0, torque_nm=1.0
    )


PARAMETERS = {
    "i_j_kg_m2": 0.0025,
    "b_h_nm_s_per_rad": 1.0,
    "k_h_nm_per_rad": 150.0,
    "k_srs_nm_per_rad": 20.0,
    "k_dec_nm_per_rad": 15.0,
    "x_e_rad": 0.03,
}
