"""What a package does to its process: memory, the interpreter's lock, signals, forks, and the command."""

import gc
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from conftest import PARAMETERS, QUICK, run

import ramphold


def resident_bytes():
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def grows(call, times=10_000, warm=1_000):
    """By how much memory grows over `times` calls, after `warm` that fill caches."""
    for _ in range(warm):
        call()
    gc.collect()
    before = resident_bytes()
    for _ in range(times):
        call()
    gc.collect()
    return resident_bytes() - before


def test_memory_does_not_grow_over_ten_thousand_simulations(ramp):
    base = [PARAMETERS[name] for name in ramphold.BASE_PARAMETERS]
    # If each call kept its torque, the smallest array there is: 100 samples.
    kept = 10_000 * ramp.time_s.size * 8
    assert grows(lambda: ramphold.simulate(base, ramp, derivatives=True)) < kept / 2


def test_memory_does_not_grow_over_ten_thousand_refusals_and_readings(arrays, fitted, ramp):
    short = {**arrays, "theta": [own[:50].copy() for own in arrays["theta"]]}
    trial = fitted.trials[0]

    def call():
        with pytest.raises(ramphold.InputError):
            ramphold.Session.from_arrays(**short)
        fitted.motion(trial)
        fitted.measured_nm

    kept = 10_000 * fitted.measured_nm.nbytes
    assert grows(call, warm=300) < kept / 4


def test_memory_does_not_grow_over_sessions_and_fits(arrays):
    one = {**arrays, "trials": arrays["trials"].iloc[:2]}
    for name in ("t", "theta", "torque", "emg_fcr", "emg_ecr"):
        one[name] = arrays[name][:2]
    session = ramphold.Session.from_arrays(**one)
    size = sum(own.nbytes for own in [*one["theta"], *one["torque"]])
    assert grows(lambda: ramphold.Session.from_arrays(**one), times=1_000, warm=100) < 1_000 * size / 4
    assert grows(lambda: session.fit(independent=True).measured_nm, times=60, warm=20) < 60 * size / 4


def test_other_threads_run_while_the_crate_works(loaded):
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    try:
        at_start = counted[0]
        loaded.fit(bootstrap=20)
        during = counted[0] - at_start
    finally:
        stop.set()
        thread.join()
    assert during > 10


SCRIPT = """
import sys, time, ramphold
session = ramphold.Session.load(sys.argv[1])
print("begins", flush=True)
try:
    session.fit(bootstrap=1_000_000)
except KeyboardInterrupt:
    print("interrupted", flush=True)
    print(session.fit(independent=True), flush=True)
"""


def test_ctrl_c_ends_a_long_fit_and_python_goes_on(folder):
    process = subprocess.Popen([sys.executable, "-c", SCRIPT, folder], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "begins\n"
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        # A million refits take hours.
        out, _ = process.communicate(timeout=120)
    finally:
        process.kill()
    assert out.startswith("interrupted\n<ramphold.Fit of")


def test_an_exception_of_the_listener_arrives(loaded):
    class Stop(Exception):
        pass

    def listen(stage):
        raise Stop(stage)

    with pytest.raises(Stop, match="fitting"):
        loaded.diagnose(progress=listen)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_process_has_workers_of_its_own(loaded, fitted):
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(write, b"same" if loaded.fit().json == fitted.json else b"other")
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as told:
        assert told.read() == b"same"
    assert os.waitpid(child, 0)[1] == 0


def test_exceptions_have_the_text_of_the_program(folder, arrays, tmp_path):
    for arguments, call in [
        (["fit", tmp_path / "nothing"], lambda: ramphold.Session.load(tmp_path / "nothing")),
        (["schedule", tmp_path / "p.json", "--seed", 1], lambda: ramphold.Protocol(tmp_path / "p.json")),
        (["fit", folder, "--window", "99"], lambda: ramphold.Session.load(folder).fit(window_s=99)),
    ]:
        with pytest.raises(ramphold.InputError) as caught:
            call()
        assert run(*arguments, code=caught.value.exit_code).rstrip("\n") == f"error: {caught.value}"


def test_a_session_that_contradicts_its_table_says_what_the_program_says(arrays, tmp_path):
    own = {**arrays, "theta": [57.3 * theta for theta in arrays["theta"]]}
    session = ramphold.Session.from_arrays(**own)
    session.save(tmp_path / "s")
    with pytest.raises(ramphold.InputError) as caught:
        ramphold.Session.load(tmp_path / "s").fit()
    assert run("fit", tmp_path / "s", code=2).rstrip("\n") == f"error: {caught.value}"


def test_the_command_of_the_wheel_is_the_program(tmp_path):
    command = [sys.executable, "-m", "ramphold"]
    version = subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout
    assert version == f"ramphold {ramphold.VERSION}\n"
    assert "matlab, parquet, terminal, tls" in version
    done = subprocess.run([*command, "schedule", "nothing.json", "--seed", "1"], capture_output=True, text=True)
    assert done.returncode == 2 and done.stderr.startswith("error: nothing.json")
    done = subprocess.run([*command, "run", QUICK, "--seed", "1", "--out", tmp_path / "s"], capture_output=True, text=True)
    assert done.returncode == 0 and (tmp_path / "s/results/fit.json").exists(), done.stderr
    assert subprocess.run([*command, "fly"], capture_output=True).returncode == 2


def test_arrays_are_given_as_numpy_arrays(fitted):
    assert fitted.measured_nm.dtype == np.float64 and fitted.measured_nm.shape == (len(fitted.trials), fitted.time_s.size)
