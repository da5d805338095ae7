"""Tables of the program as frames, with the bits that were written."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


def frame_of_csv(text: str) -> pd.DataFrame:
    """A table; numbers are read by Python, whose reading gives the number that was printed. An empty cell is NaN among numbers."""
    import pandas as pd

    header, *rows = list(csv.reader(io.StringIO(text)))
    columns = zip(*rows, strict=True) if rows else [()] * len(header)
    return pd.DataFrame({name: _column(values) for name, values in zip(header, columns, strict=True)})


def _column(values: tuple[str, ...]) -> list[Any]:
    if set(values) <= {"true", "false"}:
        return [value == "true" for value in values]
    try:
        return [int(value) for value in values]
    except ValueError:
        pass
    try:
        return [np.nan if value == "" else float(value) for value in values]
    except ValueError:
        return list(values)
