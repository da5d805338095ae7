"""The model as a function: torque and derivatives for a motion of the motor."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import count, flag, json_text, number, unmasked
from ._errors import InputError
from ._law import OwnLaw, check_for_model, mechanism_list
from ._native import BASE_PARAMETERS, NativeMotion, catalogue

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

Parameters = Mapping[str, float] | ArrayLike
"""Parameters by name (a dict, a pandas Series, or the columns of a frame), or in the order of their names."""

_HOLD_RAD = 0.02
"""Largest angle at which a motion may begin, rad: noise and drift of a hold are far below it."""


def mechanisms() -> pd.DataFrame:
    """The catalogue: one row a parameter of a mechanism or of a free law, with its equation, bounds and typical value."""
    import pandas as pd

    rows = [
        {
            "mechanism": entry["id"],
            "title": entry["title"],
            "equation": entry["equation"],
            "is_free_law": entry["is_free_law"],
            "parameter": parameter["name"],
            "meaning": parameter["meaning"],
            "low": parameter["low"],
            "high": parameter["high"],
            "typical": parameter["typical"],
        }
        for entry in json.loads(catalogue())
        for parameter in entry["parameters"]
    ]
    return pd.DataFrame(rows)


class Motion:
    """A motion of the motor, with the lever and the filter between the model's torque and the measured one.

    theta: recorded angle, shape (samples,), rad, as a change from the hold: near 0 at first, and at most pi; a contiguous array of float64.
    sample_rate_hz: samples a second.
    onset: index in `theta` at which the ramp begins; the model is at rest at sample 0.
    window_s: time after the onset that is simulated, s.
    lever: None for a rigid lever, else a dict of inertia_kg_m2, damping_nm_s_per_rad and stiffness_nm_per_rad.
    filter: None, or the low-pass that the torque passes, such as {"kind": "butterworth", "order": 3, "cutoff_hz": 50}.
    velocity_rad_s, torque_nm, progress, rest_s, flexor_emg_excess_mvc, extensor_emg_mvc: what some mechanisms ask of a trial:
        its ramp velocity, the torque before the ramp, its place in the session from 0 to 1, the rest before it, and EMG.
    """

    def __init__(
        self,
        theta: Array,
        sample_rate_hz: float,
        *,
        onset: int,
        window_s: float = 0.040,
        lever: Mapping[str, float] | None,
        filter: Mapping[str, Any] | None = None,
        velocity_rad_s: float = 0.0,
        torque_nm: float = 0.0,
        progress: float = 0.0,
        rest_s: float = 0.0,
        flexor_emg_excess_mvc: float = 0.0,
        extensor_emg_mvc: float = 0.0,
    ) -> None:
        settings = {
            "sample_rate_hz": number(sample_rate_hz, "sample_rate_hz"),
            "onset": count(onset, "onset", 0, 2**40),
            "window_s": number(window_s, "window_s"),
            "lever": None if lever is None else dict(_mapping(lever, "lever")),
            "filter": None if filter is None else dict(_mapping(filter, "filter")),
            "velocity_rad_s": number(velocity_rad_s, "velocity_rad_s"),
            "torque_nm": number(torque_nm, "torque_nm"),
            "progress": number(progress, "progress"),
            "rest_s": number(rest_s, "rest_s"),
            "flexor_emg_excess_mvc": number(flexor_emg_excess_mvc, "flexor_emg_excess_mvc"),
            "extensor_emg_mvc": number(extensor_emg_mvc, "extensor_emg_mvc"),
        }
        own, text = unmasked(theta, "theta"), json_text(settings, "motion")
        self._native = NativeMotion(own, text)
        _check_angles(own, onset)
        self._given: tuple[Array, str] | None = (own.copy(), text)

    @classmethod
    def _of(cls, native: NativeMotion) -> Motion:
        return cls._made(native, None)

    @classmethod
    def _made(cls, native: NativeMotion, given: tuple[Array, str] | None) -> Motion:
        motion = cls.__new__(cls)
        motion._native, motion._given = native, given
        return motion

    def __copy__(self) -> Motion:
        return self._made(self._native, self._given)

    def __deepcopy__(self, memo: dict[int, object]) -> Motion:
        # The native motion never changes, so that copies can share it.
        return self._made(self._native, self._given)

    def __reduce__(self) -> tuple[object, ...]:
        if self._given is None:
            raise TypeError("the motion of a fitted trial cannot be pickled; pickle the session, and fit there")
        return _motion_of, self._given

    @property
    def time_s(self) -> Array:
        """Time after the onset, shape (samples,), s."""
        return np.arange(self._native.samples) / self._native.sample_rate_hz

    @property
    def theta_rad(self) -> Array:
        """Angle of the motor after the onset, smoothed, shape (samples,), rad: a change from the hold."""
        return self._native.window()[0]

    @property
    def omega_rad_s(self) -> Array:
        """Speed of the motor after the onset, shape (samples,), rad/s."""
        return self._native.window()[1]


def _motion_of(theta: Array, settings: str) -> Motion:
    """The motion that was pickled."""
    return Motion._made(NativeMotion(theta, settings), (theta, settings))


@dataclass(frozen=True)
class Simulation:
    """What `simulate` gives."""

    time_s: Array
    """Time after the onset, shape (samples,), s."""
    torque_nm: Array
    """Predicted torque, shape (samples,) or (points, samples), N m: a change from the torque before the ramp."""
    parameter_names: tuple[str, ...]
    """Names with units of the parameters that the Jacobian has columns for: the six of the model, then those of the mechanisms."""
    jacobian: Array | None
    """Derivatives of the torque by the parameters, shape (samples, parameters) or (points, samples, parameters); None if not asked
    for."""


def simulate(
    parameters: Parameters,
    motion: Motion,
    *,
    mechanisms: Sequence[Mapping[str, Any] | OwnLaw] = (),
    derivatives: bool = False,
) -> Simulation:
    """The torque that the model predicts for a motion.

    parameters: the six of the model, in the order of `BASE_PARAMETERS`, shape (6,) or (points, 6), or a dict by name: i_j_kg_m2
        (kg m2), b_h_nm_s_per_rad (N m s/rad), k_h_nm_per_rad, k_srs_nm_per_rad, k_dec_nm_per_rad (N m/rad), x_e_rad (rad).
        A pandas Series and the columns of a frame are taken by their names.
    motion: `Motion(...)`, or that of a fitted trial, `fit.motion(trial)`.
    mechanisms: what is added to the model: a list of {"mechanism": id, "parameters": {name: value}} or `OwnLaw`, with values within the
        bounds of `mechanisms()`. mains_hum and outlier_trial are not in the model of the wrist, and are refused.
    derivatives: whether the Jacobian is computed as well: exact derivatives of the integration, not differences. Those by the ends of a
        free law's range (`from_...`, `to_...`, `to_s`) are 0 by convention: the ends are fixed, not fitted.

    Raises `InputError` if a value is not finite or out of bounds, or the simulation does not stay finite.
    """
    if not isinstance(motion, Motion):
        raise InputError(f"motion: {type(motion).__name__}; expected a ramphold.Motion")
    values = point_array(parameters, BASE_PARAMETERS)
    several = values.ndim == 2
    flat = values.reshape(-1)
    points = values.shape[0] if several else 1
    added = mechanism_list(mechanisms)
    check_for_model(added)
    torque, slopes = motion._native.simulate(flat, points, json_text(added, "mechanisms"), flag(derivatives, "derivatives"))
    names = list(BASE_PARAMETERS)
    for entry in added:
        order = [own["name"] for own in _entry(entry["mechanism"])["parameters"]]
        names += [f"{entry['mechanism']}.{name}" for name in order]
    jacobian = None
    if slopes is not None:
        jacobian = slopes.reshape(points, motion._native.samples, len(names))
    return Simulation(
        time_s=motion.time_s,
        torque_nm=torque if several else torque[0],
        parameter_names=tuple(names),
        jacobian=jacobian if several or jacobian is None else jacobian[0],
    )


def _entry(mechanism: str) -> dict[str, Any]:
    found: dict[str, Any] = next(own for own in json.loads(catalogue()) if own["id"] == mechanism)
    return found


def point_array(parameters: Parameters, names: Sequence[str]) -> Array:
    """Parameters with these names as a contiguous array, shape (parameters,) or (points, parameters)."""
    if isinstance(parameters, Mapping):
        named = dict(parameters)
        if set(named) != set(names):
            raise InputError(f"parameters: {sorted(map(str, named))}; expected {', '.join(names)}")
        return np.array([number(named[name], name) for name in names])
    if isinstance(parameters, (str, bytes, os.PathLike)):
        raise InputError("parameters: text; expected numbers")
    try:
        array = np.asarray(_in_order(unmasked(parameters, "parameters"), names))
    except (TypeError, ValueError) as error:
        raise InputError(f"parameters: {error}; expected numbers") from None
    if array.dtype != np.float64 and array.dtype.kind not in "iu":
        raise InputError(f"parameters: dtype {array.dtype}; expected float64")
    if array.ndim not in (1, 2) or array.shape[-1] != len(names) or array.shape[0] == 0:
        raise InputError(f"parameters: shape {array.shape}; expected ({len(names)},) or (points, {len(names)}): {', '.join(names)}")
    whole = np.ascontiguousarray(array, dtype=np.float64)
    wrong = np.argwhere(~np.isfinite(whole))
    if len(wrong):
        raise InputError(f"parameters, {names[wrong[0][-1]]}: {whole[tuple(wrong[0])]} is not valid; expected a finite number")
    return whole


def _in_order(parameters: Any, names: Sequence[str]) -> Any:
    """A series or a frame whose values have names, in the order of `names`; anything else as it is."""
    if not hasattr(parameters, "to_numpy"):
        return parameters
    # Columns of a frame of pandas or polars, or the index of a series of pandas; a series of polars has no names of its values.
    labels = list(getattr(parameters, "columns", getattr(parameters, "index", [])))
    if not labels or labels == list(range(len(labels))):
        return parameters.to_numpy()
    if len(labels) != len(names) or set(labels) != set(names):
        raise InputError(f"parameters: {', '.join(map(str, labels))}; expected these names, each once: {', '.join(names)}")
    return parameters.to_numpy()[..., [labels.index(name) for name in names]]


def _check_angles(theta: Array, onset: int) -> None:
    """Refuses angles of a motion that can be no change from the hold, rad."""
    largest = float(np.abs(theta).max())
    if largest > np.pi:
        raise InputError(f"theta: up to {largest:g} in magnitude; expected rad, at most pi: numpy.radians converts degrees")
    begins = float(np.median(theta[: max(1, min(onset, 10))]))
    if abs(begins) > _HOLD_RAD:
        raise InputError(
            f"theta: begins at {begins:g} rad; expected a change from the hold, within {_HOLD_RAD} rad of 0 at first: subtract the mean"
            " of the hold"
        )


def _mapping(value: object, name: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{name}: {type(value).__name__}; expected a dict or None")
    return value
