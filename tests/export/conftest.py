"""Sessions to export, made by the program under test: RAMPHOLD names it, else target/release or target/debug."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def program():
    places = [os.environ.get("RAMPHOLD"), ROOT / "target/release/ramphold", ROOT / "target/debug/ramphold"]
    for place in places:
        if place and Path(place).exists():
            return str(place)
    raise RuntimeError("no ramphold: build it, or name it with RAMPHOLD")


def ramphold(*arguments):
    return subprocess.run([program(), *map(str, arguments)], capture_output=True, text=True, check=False)


def done(*arguments):
    result = ramphold(*arguments)
    assert result.returncode == 0, result.stderr
    return result


@pytest.fixture(scope="session")
def session(tmp_path_factory):
    """A session with EMG, fitted."""
    folder = tmp_path_factory.mktemp("sessions") / "first"
    done("run", ROOT / "protocols/quick.json", "--seed", 3, "--subject", "S01", "--out", folder)
    return folder


@pytest.fixture(scope="session")
def measured(session, tmp_path_factory):
    """The same person's records from a rig without EMG and with a rigid lever, not fitted."""
    folder = tmp_path_factory.mktemp("sessions") / "second"
    (folder / "trials").mkdir(parents=True)
    text = (session / "session.json").read_text()
    (folder / "session.json").write_text(text)
    shutil.copy(session / "trials.csv", folder)
    for record in (session / "trials").iterdir():
        rows = [",".join(row.split(",")[:3]) for row in record.read_text().splitlines()]
        (folder / "trials" / record.name).write_text("\n".join(rows) + "\n")
    return folder
