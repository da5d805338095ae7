"""The program `ramphold`, as the wheel installs it."""

import os
import signal
import sys

from ._native import command


def main() -> None:
    """Runs the program with the arguments of this process, and ends the process with its exit code."""
    # The program handles signals itself, as if no Python were there.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    code = command(["ramphold", *sys.argv[1:]])
    # The program's threads are not Python's, and must not hold up the end.
    sys.stdout.flush()
    os._exit(code)


if __name__ == "__main__":
    main()
