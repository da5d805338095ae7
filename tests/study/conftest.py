"""Tables of `ramphold cohort` made from values that are known."""

import csv
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "target/release/ramphold"


@pytest.fixture(scope="session")
def program():
    assert PROGRAM.exists(), f"{PROGRAM} is missing: cargo build --release"
    return PROGRAM


@pytest.fixture
def tables(program, tmp_path):
    """From (subject, session, velocity, torque, value) to the tables, the value standing for k_srs."""

    def make(rows, code=0):
        study = tmp_path / "study.csv"
        with study.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["subject", "velocity_rad_s", "torque_nm", "k_srs_nm_per_rad", "converged", "session"])
            writer.writerows([subject, velocity, torque, repr(float(value)), "true", session]
                             for subject, session, velocity, torque, value in rows)
        out = tmp_path / "out"
        done = subprocess.run([program, "cohort", study, "--out", out], capture_output=True, text=True, check=False)
        assert done.returncode == code, done.stderr
        found = {}
        for path in out.glob("*.csv"):
            with path.open(newline="", encoding="utf-8") as file:
                found[path.stem] = [row for row in csv.DictReader(file) if row["quantity"] == "k_srs_nm_per_rad"]
        return found

    return make


@pytest.fixture
def mixed_model(tmp_path):
    """Runs scripts/mixed-model on the table that `tables` was given."""

    def run():
        out = tmp_path / "mixed.csv"
        command = [sys.executable, ROOT / "scripts/mixed-model", tmp_path / "study.csv", "--quantity", "k_srs_nm_per_rad"]
        subprocess.run([*command, "--out", out], check=True)
        with out.open(newline="", encoding="utf-8") as file:
            return {row["effect"]: row for row in csv.DictReader(file)}

    return run
