"""Rig trials: trials without a person, which measure the rig."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import json_text, label, number, path
from ._arrays import (
    cell_text, channel_arrays, is_empty, optional_mapping, sample_rate, table_rows, time_arrays, whole_number
)
from ._errors import InputError
from ._native import NativeRigTrials

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

_VALUES = ("velocity_rad_s", "sign", "mass_kg", "arm_m", "inertia_kg_m2", "stiffness_nm_per_rad", "relative_error")


class RigTrials:
    """Rig trials that were given as arrays, checked by the rules for those of a session's folder; `calibrate` takes them."""

    def __init__(self, native: NativeRigTrials) -> None:
        """Rig trials are made by `from_arrays`."""
        if not isinstance(native, NativeRigTrials):
            raise InputError("rig trials are made by RigTrials.from_arrays")
        self._native = native

    @classmethod
    def from_arrays(
        cls,
        t: Array | Sequence[Array],
        target: Array | Sequence[Array],
        theta: Array | Sequence[Array],
        torque: Array | Sequence[Array],
        *,
        trials: Any,
        lever: Mapping[str, float] | None,
        name: str = "rig",
        started_utc: str | None = None,
        sample_rate_hz: float | None = None,
        theta_l: Array | Sequence[Array] | None = None,
        alpha_l: Array | Sequence[Array] | None = None,
        torque_h: Array | Sequence[Array] | None = None,
    ) -> RigTrials:
        """Rig trials from a lab's own arrays.

        t: time, shape (samples,) for all trials, or (trials, samples), or a list of one array a trial; s, from 0.
        target: angle commanded to the motor, shape (trials, samples) or a list of arrays, rad. It stands still for at least the first
            0.2 s of a trial, in which the noise is measured.
        theta: angle of the motor, as `target`, rad; unfiltered, offsets not removed.
        torque: torque in the lever, as `target`, N m; what resists a positive ramp is positive.
        trials: the table, one row a trial, with the columns of rig-trials.csv: a pandas or polars frame, a dict of columns, or a list
            of dicts. Needed: load (empty_handle, known_weight, known_inertia, clamped_handle or known_spring) and motion (still, ramp
            or multisine). velocity_rad_s belongs to a ramp; mass_kg, arm_m, sign (1 if it resists extension, else -1) and
            relative_error (one standard deviation of the stated value, as a fraction) to a known weight; inertia_kg_m2 or
            stiffness_nm_per_rad, and relative_error, to a known inertia or spring. What does not belong to a row is None or NaN in it.
            Known: trial (number; else 1, 2, ...), repetition (else counted for each load and motion), status (ok, aborted or
            rejected; else ok). Other columns are ignored.
        lever: what is stated of it: None for a rigid lever, else a dict of inertia_kg_m2, damping_nm_s_per_rad and
            stiffness_nm_per_rad.
        name: what a calibration says of the session that it was measured in.
        started_utc: when the trials were measured, such as "2026-11-24T15:00:00Z".
        sample_rate_hz: samples a second; else from `t`.
        theta_l, alpha_l, torque_h: further channels, as `target`: angle of the handle (rad), its acceleration (rad/s2), torque between
            handle and load (N m).

        Arrays are contiguous and of float64; each is copied once. Raises `InputError` otherwise, and if times have gaps, values are
        not finite, a load lacks a value or has one that does not belong to it, or a trial begins without its rest.
        """
        rows = table_rows(trials)
        given = {
            "target": target, "theta": theta, "torque": torque, "theta_l": theta_l, "alpha_l": alpha_l, "torque_h": torque_h,
        }
        columns = channel_arrays(given, ("target", "theta", "torque"), len(rows))
        columns["t"] = time_arrays(t, len(rows))
        description = {
            "name": label(name, "name"),
            "sample_rate_hz": sample_rate(columns["t"]) if sample_rate_hz is None else number(sample_rate_hz, "sample_rate_hz"),
            "lever": optional_mapping(lever, "lever"),
            "started_utc": None if started_utc is None else label(started_utc, "started_utc"),
            "trials": _table(rows),
        }
        signals = [{channel: own[index] for channel, own in columns.items()} for index in range(len(rows))]
        return cls(NativeRigTrials.from_arrays(json_text(description, "rig trials"), signals))

    @property
    def name(self) -> str:
        """What a calibration says of the session that it was measured in."""
        return self._native.name

    def to_frame(self) -> pd.DataFrame:
        """The table: one row a trial, with the columns of rig-trials.csv; NaN in what does not belong to a row."""
        import pandas as pd

        rows = csv.DictReader(io.StringIO(self._native.table))
        return pd.DataFrame([{name: _value(name, text) for name, text in row.items() if name != "file"} for row in rows])

    def save(self, folder: str | Path) -> None:
        """Writes a new session folder, which `ramphold calibrate` calibrates with the same results: numbers have as many digits as it
        takes to read back the same."""
        self._native.save(path(folder, "folder"))

    def __repr__(self) -> str:
        return f"<ramphold.RigTrials of {self.name}: {self._native.trial_count} trials>"


def _value(column: str, text: str) -> float | int | str:
    """A cell of rig-trials.csv as its value; NaN for an empty one."""
    if column in _VALUES:
        return float(text or "nan")
    return int(text) if column in ("trial", "repetition") else text


def _table(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The table of rig trials as the native part takes it."""
    seen: dict[object, int] = {}
    table: list[dict[str, Any]] = []
    for index, row in enumerate(rows):
        where = f"trials, row {index}"
        cells = {column: cell_text(row.get(column)) for column in ("load", "motion", *_VALUES)}
        condition = tuple(cells.values())
        seen[condition] = seen.get(condition, 0) + 1
        status = row.get("status", "ok")
        if not isinstance(status, str) or status not in ("ok", "aborted", "rejected"):
            raise InputError(f"{where}, status: {status!r} is not valid; expected ok, aborted or rejected")
        trial, repetition = row.get("trial"), row.get("repetition")
        table.append({
            "trial": index + 1 if is_empty(trial) else whole_number(trial, f"{where}, trial"),
            "repetition": seen[condition] if is_empty(repetition) else whole_number(repetition, f"{where}, repetition"),
            "status": status,
            "cells": cells,
        })
    return table
