"""A law: one way in which a mechanism of the catalogue acts."""

from dataclasses import dataclass
from typing import Callable

import numpy as np


@dataclass(frozen=True)
class Law:
    """`make(scenario, size, rng)` changes the scenario and returns its parameters, those that are only nominal, and a note.

    `size` multiplies the default of sizes.json; `rng` varies what differs between subjects and rigs.
    """

    name: str
    equation: str
    source: str
    make: Callable


# By mechanism and name. The first law of a mechanism is the one meant where none is stated.
LAWS: dict[str, dict[str, Law]] = {}


def law(mechanism: str, name: str, equation: str, source: str = "assumed"):
    """Declares the decorated function as a law of `mechanism`."""
    def declare(make):
        laws = LAWS.setdefault(mechanism, {})
        if name in laws:
            raise ValueError(f"{mechanism} has a law {name!r} already")
        laws[name] = Law(name, equation, source, make)
        return make
    return declare


SPREAD = 0.1  # of an effect that is not constant: +-10 % of itself


def constant(scenario):
    return 1.0


def drifting(scenario):
    """Per trial: grows by 20 % of the mean from the first trial to the last."""
    return 1 + SPREAD * (2 * scenario.trials.order() - 1)


def by_torque(scenario):
    """Per trial: 10 % less at the lowest target torque, 10 % more at the highest."""
    return _over_conditions(scenario.trials.torque_nm)


def by_velocity(scenario):
    """Per trial: 10 % less at the lowest velocity, 10 % more at the highest."""
    return _over_conditions(scenario.trials.velocity_rad_s)


def by_trial(scenario, rng):
    """Per trial: at random, with a standard deviation of 10 %."""
    return 1 + SPREAD * np.clip(rng.standard_normal(len(scenario.trials)), -2, 2)


def _over_conditions(x):
    low, high = x.min(), x.max()
    return 1 + SPREAD * (2 * x - low - high) / max(high - low, 1e-9)
