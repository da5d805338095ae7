"""Which build a figure is of."""

import re
import subprocess


def commit_of(program):
    """The commit that a program says it is of, its first seven digits."""
    version = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    return re.search(r"commit ([0-9a-f]{7})|$", version)[1] or "unknown"
