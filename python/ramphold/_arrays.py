"""Tables and signals of trials, as the native part takes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ._arguments import count, number, unmasked
from ._errors import InputError

_RATE_ROUNDING = 0.05
"""A whole rate stands for the exact one where it moves no sample of a record by more than this part of a sample."""


def table_rows(trials: Any) -> list[dict[str, Any]]:
    """The rows of a table, whatever it came as."""
    if hasattr(trials, "to_dicts"):  # polars
        rows: Any = trials.to_dicts()
    elif hasattr(trials, "to_dict") and hasattr(trials, "columns"):  # pandas
        rows = trials.to_dict("records")
    elif isinstance(trials, Mapping):
        try:
            columns = {name: list(values) for name, values in trials.items()}
        except TypeError:
            raise InputError("trials: expected a column of values for each name") from None
        if len({len(values) for values in columns.values()}) > 1:
            raise InputError("trials: the columns have different lengths; expected one value a trial")
        rows = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    elif isinstance(trials, Sequence) and not isinstance(trials, (str, bytes)):
        rows = list(trials)
    else:
        raise InputError(f"trials: {type(trials).__name__}; expected a frame, a dict of columns, or a list of dicts")
    if not rows or not all(isinstance(row, Mapping) and all(isinstance(key, str) for key in row) for row in rows):
        raise InputError("trials: expected at least one row, with a name for each column")
    return [dict(row) for row in rows]


def whole_number(value: object, name: str) -> int:
    """A whole number, also one that a frame with gaps has made a float."""
    found = number(value, name)
    if found != int(found):
        raise InputError(f"{name}: {value!r} is not valid; expected a whole number")
    return count(int(found), name, 0, 2**32 - 1)


def is_empty(value: object) -> bool:
    """Whether a cell of a table has nothing in it."""
    if value is None or isinstance(value, str):
        return not value
    # Frames say that there is nothing in a cell in ways of their own: NaN, NaT and pandas.NA.
    import pandas as pd

    return bool(pd.api.types.is_scalar(value) and pd.isna(value))


def cell_text(value: object) -> str:
    """A cell as text, as a table would hold it."""
    if is_empty(value):
        return ""
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    return str(value).strip()


def _as_array(value: object, name: str) -> Any:
    """A column of a frame as an array of its own, and an array without its mask; anything else as it is."""
    if isinstance(value, np.ndarray):
        return unmasked(value, name)
    to_numpy = getattr(value, "to_numpy", None)
    return value if to_numpy is None else np.ascontiguousarray(to_numpy())


def record_arrays(values: object, name: str, trials: int) -> list[object]:
    """One array a trial."""
    own = _as_array(values, name)
    if isinstance(own, np.ndarray):
        if own.ndim == 1 and trials == 1:
            return [own]
        if own.ndim != 2:
            raise InputError(f"{name}: shape {own.shape}; expected (trials, samples), or a list of one array a trial")
        if not own.flags.c_contiguous:
            raise InputError(f"{name}: not contiguous; expected one trial after the other in memory (numpy.ascontiguousarray copies)")
        records: list[object] = list(own)
    elif isinstance(own, Sequence) and not isinstance(own, (str, bytes)):
        records = [_as_array(record, f"{name}, record {index}") for index, record in enumerate(own)]
    else:
        raise InputError(f"{name}: {type(own).__name__}; expected an array, or a list of one array a trial")
    if len(records) != trials:
        raise InputError(f"{name}: {len(records)} records; expected {trials}, one for each row of trials")
    return records


def channel_arrays(given: Mapping[str, object], needed: Sequence[str], trials: int) -> dict[str, list[object]]:
    """One array a trial for each channel that was given or is needed."""
    return {
        name: record_arrays(values, name, trials) for name, values in given.items() if values is not None or name in needed
    }


def time_arrays(t: object, trials: int) -> list[object]:
    """One time axis a trial."""
    own = _as_array(t, "t")
    if isinstance(own, np.ndarray) and own.ndim == 1:
        return [own] * trials
    return record_arrays(own, "t", trials)


def sample_rate(times: Sequence[object]) -> float:
    """The rate of even time axes, Hz, from the longest; a whole number where it is one but for rounding of the times."""
    return max((_axis_rate(time) for time in times), key=lambda own: own[0])[1]


def _axis_rate(time: object) -> tuple[int, float]:
    """Samples of an even time axis, and its rate, Hz."""
    if not isinstance(time, np.ndarray) or time.dtype != np.float64 or time.ndim != 1 or time.size < 2:
        raise InputError("t: expected an array of float64 with at least two samples for each trial")
    lasts = float(time[-1] - time[0])
    if not (np.isfinite(lasts) and lasts > 0):
        raise InputError("t: does not rise; expected seconds in rising order")
    rate = (time.size - 1) / lasts
    if not np.isfinite(rate):
        raise InputError("t: all times are the same but for rounding; expected seconds in rising order")
    whole = round(rate)
    return time.size, float(whole) if abs(whole / rate - 1.0) * time.size < _RATE_ROUNDING else rate


def optional_mapping(value: object, name: str) -> dict[str, Any] | None:
    """A dict, or nothing."""
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise InputError(f"{name}: {type(value).__name__}; expected a dict or None")
    return dict(value)
