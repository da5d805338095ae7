"""Own mechanisms without Rust: a function of one argument at a place of the model."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import callback, count, flag, number, unmasked
from ._errors import InputError
from ._native import catalogue, spline_basis

if TYPE_CHECKING:
    from ._simulate import Motion

Array = NDArray[np.float64]

_SAMPLES = 401
"""Points at which a function is sampled."""

_COEFFICIENTS = 8
"""Coefficients of a free law."""


def _laws() -> dict[tuple[str, str], dict[str, Any]]:
    """The free laws that are splines, by place and argument."""
    entries = [entry for entry in json.loads(catalogue()) if entry["is_free_law"]]
    return {(own["place"], own["argument"]): own for own in entries if len(own["parameters"]) == 10}


class OwnLaw:
    """An own mechanism: a smooth function h of one argument, added at a place of the model.

    It acts as a free law of the crate does: h is represented by a cubic spline with eight coefficients over a range, and is constant
    beyond it. At rest it adds nothing. `deviation` says how far the spline is from the function that was given. The function itself
    is not called during a simulation. What a law costs, `slowdown` measures: its ten parameters have derivatives too, and the model
    without mechanisms takes a shorter way.

    Places and arguments: `OwnLaw.places()`. A law of past speed or past torque, of two arguments, or with a state of its own is not
    possible here; it takes a mechanism in Rust (see "Add a mechanism" in the book).
    """

    def __init__(self, place: str, argument: str, low: float, high: float, coefficients: ArrayLike) -> None:
        """The law with these eight coefficients over the range `low` to `high`; see `from_points` and `from_function`."""
        laws = _laws()
        if not isinstance(place, str) or not isinstance(argument, str) or (place, argument) not in laws:
            known = ", ".join(f"{own} {of}" for own, of in laws)
            raise InputError(f"law at {place!r} of {argument!r}; expected a place and an argument: {known}")
        self._entry = laws[(place, argument)]
        self.place, self.argument = place, argument
        self.low, self.high = number(low, "low"), number(high, "high")
        if self.low >= self.high:
            raise InputError(f"range {low} to {high}; expected the lower end first")
        given = np.ravel(np.asarray(unmasked(coefficients, "coefficients")))
        self.coefficients: Array = np.array([number(own, "coefficients") for own in given])
        if self.coefficients.shape != (_COEFFICIENTS,):
            raise InputError(f"coefficients: {self.coefficients.size}; expected {_COEFFICIENTS}")
        self.deviation = 0.0

    @staticmethod
    def places() -> list[tuple[str, str, str]]:
        """Place, argument and equation of every law that there can be."""
        return [(place, argument, own["equation"]) for (place, argument), own in _laws().items()]

    @classmethod
    def from_points(cls, place: str, argument: str, u: ArrayLike, h: ArrayLike, *, tolerance: float) -> OwnLaw:
        """The law through points, such as the knots of a spline.

        u: arguments in rising order, shape (points,), at least 2, in the argument's unit. Between fewer than 8 the law is the natural
            cubic spline through them; 8 or more are met in the least-squares sense.
        h: values there, shape (points,), N m (rad at the angle channel); a constant in h has no effect.
        tolerance: largest distance that you accept between the law and the points, or that natural spline, in the unit of h.
        """
        at, values = _array(u, "points, u"), _array(h, "points, h")
        if at.ndim != 1 or at.shape != values.shape or at.size < 2:
            raise InputError(f"points of shape {at.shape} and {values.shape}; expected two rows of the same length, 2 or more")
        if not (np.isfinite(at).all() and np.isfinite(values).all() and (np.diff(at) > 0).all()):
            raise InputError("points: expected finite numbers, the arguments in rising order")
        if at.size < _COEFFICIENTS:
            with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
                at, values = _natural_spline(at, values)
            if not np.isfinite(values).all():
                raise InputError("points: too large or too close to each other for a spline through them")
        basis = spline_basis(np.ascontiguousarray(at), float(at[0]), float(at[-1]))
        design = np.column_stack([basis, np.ones(at.size)])
        solution = np.linalg.lstsq(design, values, rcond=None)[0]
        own = solution[:_COEFFICIENTS]
        law = cls(place, argument, float(at[0]), float(at[-1]), own - own.mean())
        law.deviation = float(np.abs(design @ solution - values).max())
        if not law.deviation <= number(tolerance, "tolerance"):
            raise InputError(
                f"the spline of eight coefficients is {law.deviation:.3g} from the points; expected at most the tolerance of "
                f"{tolerance:.3g}: give a shorter range, or a smoother law"
            )
        return law

    @classmethod
    def from_function(
        cls, place: str, argument: str, function: Callable[[float], float], low: float, high: float, *, tolerance: float
    ) -> OwnLaw:
        """The law of a Python function of one number, over the range `low` to `high` of its argument: also a spline of SciPy, such as
        `scipy.interpolate.CubicSpline(knots, values)`.

        tolerance: largest distance between spline and function that you accept, N m (rad at the angle channel).
        """
        begin, end = number(low, "low"), number(high, "high")
        if begin >= end:
            raise InputError(f"range {low} to {high}; expected the lower end first")
        h = callback(function, "function")
        u = np.linspace(begin, end, _SAMPLES)
        return cls.from_points(place, argument, u, [_value(h(float(own))) for own in u], tolerance=tolerance)

    def __call__(self, u: ArrayLike) -> Array:
        """h(u) - h(0), shape as `u`."""
        at = _array(u, "u")
        if at.size == 0:
            return at
        if not np.isfinite(at).all():
            raise InputError(f"u: {at[~np.isfinite(at)][0]} is not finite; expected finite numbers")
        basis = spline_basis(np.ascontiguousarray(at.reshape(-1)), self.low, self.high)
        return np.asarray((basis @ self.coefficients).reshape(at.shape))

    def as_mechanism(self) -> dict[str, Any]:
        """The law with its values, for `simulate` and `Session.simulate`."""
        names = [own["name"] for own in self._entry["parameters"]]
        return {"mechanism": self._entry["id"],
                "parameters": dict(zip(names, [self.low, self.high, *map(float, self.coefficients)], strict=True))}

    def in_model(self, *, fitted: bool = False) -> dict[str, Any]:
        """The law in a model file: as it is, or with coefficients that a fit estimates from these on, one value a session."""
        own = self.as_mechanism()
        if flag(fitted, "fitted"):
            ends = list(own["parameters"])[:2]
            own["parameters"] = {
                name: value if name in ends else {"scope": "session", "value": value}
                for name, value in own["parameters"].items()
            }
        return own

    def slowdown(self, motion: Motion, parameters: ArrayLike, *, repetitions: int = 200) -> float:
        """How many times longer a simulation with derivatives takes with the law than without, measured here and now."""
        import time

        from ._simulate import simulate

        times = count(repetitions, "repetitions", 1, 1_000_000)

        def lasts(added: list[OwnLaw]) -> float:
            taken: list[float] = []
            for _ in range(times):
                begin = time.perf_counter()
                simulate(parameters, motion, mechanisms=added, derivatives=True)
                taken.append(time.perf_counter() - begin)
            return float(np.median(taken))

        return lasts([self]) / lasts([])


def _array(values: ArrayLike, name: str) -> Array:
    """Numbers as an array."""
    try:
        return np.asarray(unmasked(values, name), dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: {error}; expected numbers") from None


def _value(found: object) -> float:
    """What a function gave: a number, or an array of one number, as functions of SciPy give."""
    return number(found.item() if isinstance(found, np.ndarray) and found.size == 1 else found, "the function's value")


def _natural_spline(knots: Array, values: Array) -> tuple[Array, Array]:
    """Points on the cubic spline through the knots that is straight at its ends."""
    steps = np.diff(knots)
    slopes = np.diff(values) / steps
    # Second derivatives at the knots.
    system, wanted = np.eye(knots.size), np.zeros(knots.size)
    for inner in range(1, knots.size - 1):
        before, after = steps[inner - 1], steps[inner]
        system[inner, inner - 1 : inner + 2] = before, 2.0 * (before + after), after
        wanted[inner] = 6.0 * (slopes[inner] - slopes[inner - 1])
    bends = np.linalg.solve(system, wanted)
    u = np.linspace(knots[0], knots[-1], _SAMPLES)
    piece = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, knots.size - 2)
    step, past = steps[piece], u - knots[piece]
    first = slopes[piece] - step * (2.0 * bends[piece] + bends[piece + 1]) / 6.0
    third = (bends[piece + 1] - bends[piece]) / (6.0 * step)
    return u, values[piece] + past * (first + past * (bends[piece] / 2.0 + past * third))


def mechanism_list(added: Sequence[Mapping[str, Any] | OwnLaw]) -> list[dict[str, Any]]:
    """Mechanisms as JSON."""
    return [own.as_mechanism() if isinstance(own, OwnLaw) else own for own in _sequence(added)]


def check_for_model(added: Sequence[Mapping[str, Any]]) -> None:
    """Refuses mechanisms that are not in the model of the wrist, and values outside of the catalogue's bounds, with the words of `fit`."""
    for index, own in enumerate(added):
        if own.get("mechanism") == "mains_hum":
            raise InputError(
                f"mechanisms[{index}]: mains_hum is in the record and not in the model of the wrist, so it changes nothing here; subtract"
                " the hum from the record: diagnose finds it in the hold and subtracts it, and Session.simulate makes records with it"
            )
    if outside := outside_catalogue(added):
        raise InputError(outside[0])


def outside_catalogue(added: Sequence[Mapping[str, Any]]) -> list[str]:
    """What is outside of the catalogue's bounds, such as a latency in ms."""
    entries = {own["id"]: own for own in json.loads(catalogue())}
    found = []
    for index, own in enumerate(added):
        values = own.get("parameters")
        entry = entries.get(str(own.get("mechanism")))
        if entry is None or not isinstance(values, Mapping):
            continue
        for known in entry["parameters"]:
            value = values.get(known["name"])
            if isinstance(value, (int, float, np.integer, np.floating)) and not known["low"] <= value <= known["high"]:
                found.append(f"mechanisms[{index}].parameters.{known['name']}: value {value} is outside {known['low']:g} to {known['high']:g}")
    return found


def model_text(model: Mapping[str, Any] | None, added: Sequence[Mapping[str, Any] | OwnLaw]) -> dict[str, Any] | None:
    """A model with mechanisms added to it; None for the model of the paper."""
    if model is not None and not isinstance(model, Mapping):
        raise InputError(f"model: {type(model).__name__}; expected a dict, as in a model file")
    own = [entry.in_model() if isinstance(entry, OwnLaw) else entry for entry in _sequence(added)]
    if model is None and not own:
        return None
    whole: dict[str, Any] = {"format": "ramphold-model/1", **(model or {})}
    whole["mechanisms"] = [*whole.get("mechanisms", []), *own]
    return whole


def _sequence(added: Sequence[Mapping[str, Any] | OwnLaw]) -> list[Any]:
    if isinstance(added, (str, bytes, Mapping, OwnLaw)) or not isinstance(added, Sequence):
        raise InputError(f"mechanisms: {type(added).__name__}; expected a list")
    for own in added:
        if not isinstance(own, (Mapping, OwnLaw)):
            raise InputError(f"mechanisms: {type(own).__name__}; expected dicts and OwnLaw")
        if isinstance(own, Mapping) and own.get("mechanism") == "outlier_trial":
            raise InputError(
                "mechanisms: outlier_trial changes neither the model nor a record, and cannot be added; diagnose finds such trials, and the"
                " status rejected in the table leaves them out"
            )
    return [own if isinstance(own, OwnLaw) else dict(own) for own in added]
