"""Exceptions. Their text is the one that the program prints."""


class RampholdError(Exception):
    """Something failed in ramphold."""

    exit_code: int = 1
    """The exit code with which the program ends for the same reason."""


class InputError(RampholdError, ValueError):
    """The input is wrong; the text says where, what was expected and what to do."""

    exit_code = 2


class WorkError(RampholdError, RuntimeError):
    """The work failed although the input was right."""

    exit_code = 1
