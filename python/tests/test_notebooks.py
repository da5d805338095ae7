"""The notebooks run, and their pages are written for the book."""

import subprocess
import sys

import pytest
from conftest import ROOT

NOTEBOOKS = sorted(own.stem for own in (ROOT / "python/notebooks").glob("*.py"))
PAGES = ROOT / "docs/notebooks/built"


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_runs(name):
    done = subprocess.run([sys.executable, ROOT / "scripts/notebooks", name, "--out", PAGES], capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stderr
    page = (PAGES / f"{name.replace('_', '-')}.md").read_text()
    assert "<pre>" in page and (ROOT / f"docs/notebooks/{name.replace('_', '-')}.md").exists()


def test_a_cell_that_fails_fails_the_notebook(tmp_path):
    """A runner that swallowed errors would pass whatever a notebook says."""
    text = (ROOT / "scripts/notebooks").read_text()
    (tmp_path / "scripts").mkdir()
    (tmp_path / "scripts/notebooks").write_text(text)
    (tmp_path / "python/notebooks").mkdir(parents=True)
    (tmp_path / "python/notebooks/broken.py").write_text("# %% [markdown]\n# # Broken\n\n# %%\nassert 1 > 2\n")
    done = subprocess.run(
        [sys.executable, tmp_path / "scripts/notebooks", "--out", tmp_path], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 1 and "AssertionError" in done.stderr and "broken" in done.stderr
