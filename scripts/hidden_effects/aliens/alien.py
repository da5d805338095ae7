"""An alien: a cause that is in no catalogue."""

from dataclasses import dataclass
from typing import Callable

PLACES = ("joint", "interface", "handle", "torque_channel", "angle_channel")
ARGUMENTS = ("angle", "speed", "angle_beyond_yield", "time", "deflection", "torque")


@dataclass(frozen=True)
class Alien:
    """`place` and `argument` are those of a plain function of one argument at one place, in the names of the program; else None."""

    make: Callable
    description: str
    place: str | None
    argument: str | None


ALIENS: dict[str, Alien] = {}


def alien(place: str | None = None, argument: str | None = None):
    """Declares the decorated function, whose first line of documentation describes the cause."""
    def declare(make):
        assert place is None or (place in PLACES and argument in ARGUMENTS)
        ALIENS[make.__name__] = Alien(make, make.__doc__.splitlines()[0].rstrip(".").strip(), place, argument)
        return make
    return declare
