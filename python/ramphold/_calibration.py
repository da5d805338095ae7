"""The constants of a rig, from trials without a person."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._arguments import json_text, label, path, text_of, write_new
from ._errors import InputError
from ._native import calibrate as native_calibrate
from ._native import check_calibration, compare_calibration
from ._rig_trials import RigTrials

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


class Calibration:
    """The measured constants of a rig, with their standard errors: what rig-calibration.json holds.

    `calibrate` makes one from rig trials, `Calibration.load` reads one. `fit` and `diagnose` of a session take it as `calibration`.
    """

    def __init__(self, text: str, name: str = "calibration", found: Mapping[str, Any] | None = None) -> None:
        check_calibration(label(text, "calibration"), label(name, "name"))
        self._json = text
        self._read: dict[str, Any] = json.loads(text)
        self._found = found

    @classmethod
    def load(cls, file: str | Path) -> Calibration:
        """Reads a file that `ramphold calibrate` or `Calibration.save` wrote. Raises `InputError` if it is none."""
        text = text_of(path(file, "file"), "file")
        assert text is not None
        return cls(text, str(file))

    @property
    def json(self) -> str:
        """The text of rig-calibration.json."""
        return self._json

    @property
    def dict(self) -> dict[str, Any]:
        """The contents of rig-calibration.json: quantities, their covariance, loads, noise, and from what they were measured."""
        return self._read

    @property
    def warnings(self) -> list[str]:
        """Loads that disagree with the others; `fit` and `diagnose` refuse a calibration that has any."""
        return list(self._read["warnings"])

    def to_frame(self) -> pd.DataFrame:
        """One row a constant: name, value and standard error in the unit of the name, the value that the session states, and why there is
        no value where the loads do not tell it."""
        import pandas as pd

        rows = [{key: own.get(key) for key in ("name", "value", "se", "stated", "reason")} for own in self._read["quantities"]]
        return pd.DataFrame(rows).astype({"value": float, "se": float, "stated": float})

    def residuals(self) -> pd.DataFrame:
        """What the model of the rig leaves of the trials with each load: its size beside what noise and encoder make (ratio, 1 as
        expected), and p. Only of a calibration that `calibrate` made."""
        import pandas as pd

        if self._found is None:
            raise InputError("the residuals are not in the file of a calibration; ramphold.calibrate gives them")
        return pd.DataFrame(self._found["residuals_by_load"])

    def compare(self, source: str | Path | RigTrials) -> RigComparison:
        """Whether the empty-handle trials of a session's folder, or among rig trials given as arrays, agree with this calibration."""
        if isinstance(source, RigTrials):
            return RigComparison(json.loads(source._native.compare(self._json)))
        return RigComparison(json.loads(compare_calibration(self._json, path(source, "source"))))

    def save(self, file: str | Path) -> None:
        """Writes the file, which `ramphold run`, `fit` and `diagnose` take as `--calibration`."""
        write_new(file, self._json)

    def plot(self) -> Figure:
        """How far each constant is from what the session states, with 95 % intervals: a Matplotlib figure."""
        from ._plots import figure_of_calibration

        return figure_of_calibration(self)

    def _repr_html_(self) -> str:
        from ._plots import embedded

        frame = self.to_frame()
        frame["reason"] = frame["reason"].fillna("")
        return str(frame.to_html(index=False, na_rep="", float_format="%.5g")) + embedded(self.plot)

    def __repr__(self) -> str:
        known = sum(own["value"] is not None for own in self._read["quantities"])
        return f"<ramphold.Calibration of {self._read['session']}: {known} of {len(self._read['quantities'])} constants>"


class RigComparison:
    """A rig today beside a calibration; `dict` holds what `ramphold calibrate --compare --json` prints."""

    def __init__(self, found: dict[str, Any]) -> None:
        self.dict = found

    @property
    def changed(self) -> list[str]:
        """Names of the constants that differ, or of which one does; empty if none."""
        return list(self.dict["changed"])

    @property
    def verdict(self) -> str:
        """`agrees`; `differs`, in the constants of `changed`; `differs_unexplained`, where a change of no single constant explains it; or
        `not_comparable`, for the reason in `dict`."""
        return str(self.dict["verdict"])

    def to_frame(self) -> pd.DataFrame:
        """One row a constant: its calibrated value, and if it alone differs, by how much, with standard error and p."""
        import pandas as pd

        return pd.DataFrame(self.dict["quantities"])

    def _repr_html_(self) -> str:
        p = self.dict["p_value"]
        head = f"<p>{self._said()}, p = {'not known' if p is None else format(p, '.3g')}</p>"
        return head + str(self.to_frame().to_html(index=False, float_format="%.4g"))

    def __repr__(self) -> str:
        return f"<ramphold.RigComparison: {self._said()}>"

    def _said(self) -> str:
        if self.verdict == "not_comparable":
            return f"not comparable: {self.dict['reason']}"
        if self.verdict == "differs_unexplained":
            return "differs, but a change of no single constant explains it"
        return f"{', '.join(self.changed) or 'nothing'} changed"


CalibrationSource = Calibration | str | os.PathLike[str] | Mapping[str, Any]
"""A calibration, its file, its contents, or the word "none"."""


def calibrate(source: str | Path | RigTrials) -> Calibration:
    """Fits the constants of the rig to rig trials, as `ramphold calibrate` does.

    source: the folder of a session with rig trials (rig-trials.csv), or `RigTrials.from_arrays(...)`.

    Nothing is written; `save` does that. Raises `InputError` if there are no rig trials or none can be analysed.
    """
    text, found = source._native.calibrate() if isinstance(source, RigTrials) else native_calibrate(path(source, "source"))
    return Calibration(text, found=json.loads(found))


def calibration_argument(source: CalibrationSource | None) -> tuple[str | None, str | None]:
    """A calibration as the native part takes it: file or "none", and text."""
    if source is None:
        return None, None
    if isinstance(source, Calibration):
        return None, source.json
    if isinstance(source, Mapping):
        return None, json_text(dict(source), "calibration")
    if isinstance(source, (str, os.PathLike)):
        return path(source, "calibration"), None
    raise InputError(f"calibration: {type(source).__name__}; expected a Calibration, a file, a dict or \"none\"")
