"""The study on a cluster of worker processes: the same bytes as on this machine alone, whatever becomes of a worker."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from distributed import Client, LocalCluster

ROOT = Path(__file__).resolve().parents[2]
PARTS = 24


@pytest.fixture
def study(tmp_path):
    file = tmp_path / "study.json"
    file.write_text(json.dumps({
        "format": "ramphold-study/1", "name": "on a cluster", "units_per_part": 1,
        "persons": {"kind": "virtual", "count": PARTS, "protocol": str(ROOT / "protocols/de-vlugt-2011.json"),
                    "spread": {"short_range_stiffness": {"level": 0.1}}},
    }), encoding="utf-8")
    return file


def files(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and not path.name.endswith(".new")}


def on_dask(study, out, *more):
    command = [sys.executable, ROOT / "scripts/cohort-dask", study, "--seed", "3", "--out", out, *more]
    return subprocess.Popen([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def counts(process):
    stdout, stderr = process.communicate(timeout=300)
    assert process.returncode == 0, stderr
    return json.loads(stdout.splitlines()[0])


def wait_for_parts(out, least):
    for _ in range(1200):
        done = len(list((out / "parts").glob("part-*.csv")))
        if done >= least:
            return done
        time.sleep(0.05)
    raise AssertionError("no parts were done within a minute")


def test_a_worker_that_is_killed_changes_nothing_and_a_restart_skips_what_is_done(program, study, tmp_path):
    alone, out = tmp_path / "alone", tmp_path / "out"
    subprocess.run([program, "cohort", study, "--seed", "3", "--out", alone, "--quiet"], check=True,
                   stdout=subprocess.DEVNULL)
    with LocalCluster(n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None) as cluster, \
            Client(cluster) as client:
        workers = client.run(os.getpid)
        assert len(set(workers.values())) == 3
        running = on_dask(study, out, "--scheduler", cluster.scheduler_address)
        done = wait_for_parts(out, 2)
        assert done < PARTS - 3, "too late to kill a worker in mid-run"
        victim = next(iter(workers.values()))
        os.kill(victim, signal.SIGKILL)
        told = counts(running)
        assert victim not in client.run(os.getpid).values()
    assert told["parts"] == PARTS
    assert files(out) == files(alone)

    for lost in (4, 11):
        (out / f"parts/part-{lost:06}.csv").unlink()
    (out / "study.csv").unlink()
    told = counts(on_dask(study, out, "--workers", "2"))
    assert (told["units"], told["skipped"]) == (2, PARTS - 2)
    assert files(out) == files(alone)


def test_what_a_study_takes_in_memory_does_not_grow_with_its_persons(program, tmp_path):
    def peak_kb(persons):
        table = tmp_path / f"{persons}.csv"
        with table.open("w", encoding="utf-8") as file:
            file.write("subject,velocity_rad_s,torque_nm,k_srs_nm_per_rad,x_e_rad,converged,session\n")
            for person in range(persons):
                for velocity in (1.3, 1.95, 2.6, 3.25):
                    file.writelines(f"P{person:06},{velocity},{torque},{15 + person % 7 + torque},{velocity / 50},true,1\n"
                                    for torque in (0.9, 1.5, 2.1))
        out = tmp_path / f"out-{persons}"
        code = ("import resource,subprocess,sys;subprocess.run(sys.argv[1:],stdout=-3,stderr=-3);"
                "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)")
        done = subprocess.run([sys.executable, "-c", code, program, "cohort", table, "--out", out], check=True,
                              capture_output=True, text=True)
        assert (out / "anova.csv").exists()
        return int(done.stdout)

    few, many = peak_kb(200), peak_kb(40_000)
    # A table that anybody may have written is also watched for persons who come twice: some 60 bytes a person.
    assert many - few < 40_000 * 0.2, f"{few} kB for 200 persons, {many} kB for 40000"


def test_a_part_that_cannot_be_done_ends_the_study_with_what_was_said(study, tmp_path):
    broken = json.loads(study.read_text(encoding="utf-8"))
    broken["persons"]["protocol"] = "missing.json"
    study.write_text(json.dumps(broken), encoding="utf-8")
    process = on_dask(study, tmp_path / "out")
    _, stderr = process.communicate(timeout=120)
    assert process.returncode == 2
    assert "missing.json" in stderr


def test_the_slurm_cluster_takes_the_settings_that_the_script_hands_it(tmp_path):
    """Without a Slurm here, the job script that would be submitted is looked at."""
    from dask_jobqueue import SLURMCluster

    settings = {"queue": "short", "account": "wrist", "cores": 4, "processes": 4, "memory": "4GB", "walltime": "01:00:00",
                "log_directory": str(tmp_path)}
    with SLURMCluster(**settings, scheduler_options={"dashboard_address": None}) as cluster:
        script = cluster.job_script()
    for line in ("#SBATCH -p short", "#SBATCH -A wrist", "#SBATCH --cpus-per-task=4", "#SBATCH -t 01:00:00"):
        assert line in script, script
