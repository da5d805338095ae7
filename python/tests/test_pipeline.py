"""The example of a pipeline over many sessions."""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import QUICK, ROOT, program

import ramphold


def snakemake(folder, *options, sessions="sessions", out="results"):
    """Runs the pipeline of the folder, with the command `ramphold` of the tests before all others."""
    (folder / "bin").mkdir(exist_ok=True)
    command = folder / "bin/ramphold"
    if not command.exists():
        command.symlink_to(Path(program()).resolve())
    environment = {**os.environ, "PATH": f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}", "HOME": str(folder)}
    arguments = ["--snakefile", ROOT / "python/pipeline/Snakefile", "--cores", "2", "--config", f"sessions={sessions}", f"out={out}"]
    return subprocess.run(
        [sys.executable, "-m", "snakemake", *map(str, arguments), *options],
        cwd=folder, env=environment, capture_output=True, text=True, timeout=280,
    )


@pytest.fixture
def folder(tmp_path):
    for name, seed in [("S01", 1), ("S02", 2)]:
        session = ramphold.Session.simulate(QUICK, seed, subject=name)
        (tmp_path / "sessions").mkdir(exist_ok=True)
        session.save(tmp_path / "sessions" / name)
    return tmp_path


def test_a_pipeline_fits_every_session_and_names_the_one_that_is_broken(folder):
    done = snakemake(folder)
    assert done.returncode == 0, done.stderr
    with open(folder / "results/summary.csv") as table:
        rows = list(csv.DictReader(table))
    assert [row["session"] for row in rows] == ["S01", "S02"]
    own = ramphold.Session.load(folder / "sessions/S01").fit()
    assert json.loads((folder / "results/S01/fit.json").read_text()) == own.dict
    # A second call has nothing to do.
    assert "Nothing to be done" in (again := snakemake(folder)).stderr + again.stdout

    broken = folder / "sessions/S03"
    broken.mkdir()
    (broken / "session.json").write_text("{}")
    (broken / "trials.csv").write_text("")
    done = snakemake(folder, "--keep-going")
    assert done.returncode != 0
    assert (folder / "results/logs/S03-fit.txt").read_text().startswith("error: sessions/S03/session.json")
    assert not (folder / "results/S03/fit.json").exists() and (folder / "results/S02/fit.json").exists()


def test_folders_with_spaces_are_analysed_and_nothing_else_is_deleted(tmp_path):
    """`rm -rf` of a path without quotes deleted what its first word named."""
    session = ramphold.Session.simulate(QUICK, 1, subject="S01")
    (tmp_path / "my sessions").mkdir()
    session.save(tmp_path / "my sessions/first visit's")
    precious = [tmp_path / name / "precious.txt" for name in ("my", "sessions", "results", "S01", "first", "my results/first")]
    for own in precious:
        own.parent.mkdir(parents=True)
        own.write_text("precious")
    done = snakemake(tmp_path, sessions="my sessions", out="my results")
    assert done.returncode == 0, done.stderr
    assert [own.read_text() for own in precious] == len(precious) * ["precious"]
    with open(tmp_path / "my results/summary.csv") as table:
        assert [row["session"] for row in csv.DictReader(table)] == ["first visit's"]
    assert sorted(own.name for own in (tmp_path / "my results/first visit's").iterdir()) == ["diagnosis.json", "fit.json"]


def test_a_session_is_analysed_anew_when_a_file_that_is_read_has_changed(folder):
    assert snakemake(folder).returncode == 0
    session = folder / "sessions/S02"
    record = next((session / "trials").iterdir())
    for file, text in ((record, record.read_text() + "\n"), (session / "protocol.json", (session / "protocol.json").read_text() + "\n"),
                       (session / "rig-calibration.json", "{}")):
        file.write_text(text)
        planned = snakemake(folder, "--dry-run")
        planned = planned.stdout + planned.stderr
        assert "S02-fit.txt" in planned and "S02-diagnose.txt" in planned, file
        assert "S01-fit.txt" not in planned
        snakemake(folder, "--touch")
