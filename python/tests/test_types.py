"""The package's types, and those of its examples, hold in the strict modes of mypy and pyright."""

import subprocess
import sys

from conftest import ROOT


def check(*command):
    done = subprocess.run([sys.executable, "-m", *command], cwd=ROOT / "python", capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stdout + done.stderr


def test_mypy_is_content():
    check("mypy", "ramphold", "examples")


def test_pyright_is_content():
    check("basedpyright", "--pythonpath", sys.executable, "--project", "pyproject.toml", "ramphold", "examples")
