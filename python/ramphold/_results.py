"""Results of a fit and of a diagnosis."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from ._arguments import choice, count, flag, label, write_new
from ._errors import InputError
from ._native import BASE_PARAMETERS, NativeFit
from ._simulate import Motion, Parameters, point_array

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


class Fit:
    """A fitted session.

    `dict` holds what fit.json of the program holds, with the same bits; `json` is the file's text, byte for byte.
    """

    def __init__(self, native: NativeFit) -> None:
        self._native = native
        self._read: dict[str, Any] | None = None

    def __copy__(self) -> Fit:
        return Fit(self._native)

    def __deepcopy__(self, memo: object) -> Fit:
        # The native fit never changes, so that copies can share it.
        return Fit(self._native)

    def __reduce__(self) -> tuple[object, ...]:
        raise TypeError("a Fit cannot be pickled; pickle the session and fit there, or keep fit.json and the tables that you need")

    @property
    def json(self) -> str:
        """The text of fit.json."""
        return self._native.json

    @property
    def dict(self) -> dict[str, Any]:
        """The contents of fit.json: estimates, uncertainties, settings and versions."""
        if self._read is None:
            read: dict[str, Any] = json.loads(self._native.json)
            self._read = read
        return self._read

    def to_frame(self, table: str = "trials", *, independent: bool = False) -> pd.DataFrame:
        """A table of the estimates.

        table: "trials", one row a trial, or "conditions", the means over the repetitions.
        independent: the fit of each trial on its own, as in the paper, instead of with the model of the session.

        Columns have the names and units of fit.csv: parameters, `se_` their relative standard errors, `sem_` those of Eq. 9. A value
        that is not determined is NaN.
        """
        import pandas as pd

        alone = flag(independent, "independent")
        if choice(table, "table", ("trials", "conditions")) == "conditions":
            if alone:
                raise InputError("table: conditions of the independent fit are in conditions-independent.csv; expected trials")
            return pd.DataFrame([_condition_row(own) for own in self.dict["conditions"]])
        return pd.DataFrame([_trial_row(own, own["independent"] if alone else own) for own in self.dict["trials"]])

    @property
    def trials(self) -> list[int]:
        """Numbers of the fitted trials, in the order of the rows of the arrays."""
        return self._native.numbers

    @property
    def time_s(self) -> Array:
        """Time after the onset, shape (samples,), s."""
        return self._native.time_s

    @property
    def channels(self) -> list[str]:
        """Columns of the channels that were fitted: torque_l_nm, then the further channels that the session has."""
        return self._native.channels

    @property
    def measured_nm(self) -> Array:
        """Measured torque as it was fitted, filtered and less the torque before the ramp, shape (trials, samples), N m."""
        return self._native.measured(0)

    def predicted_nm(self, *, independent: bool = False) -> Array:
        """Torque of the fitted model, shape (trials, samples), N m."""
        return self._native.predicted(0, flag(independent, "independent"))

    def measured(self, channel: str) -> Array:
        """One of `channels` as it was fitted, shape (trials, samples), in the unit of its name: a change from before the ramp."""
        return self._native.measured(self._channel(channel))

    def predicted(self, channel: str, *, independent: bool = False) -> Array:
        """The same of the fitted model."""
        return self._native.predicted(self._channel(channel), flag(independent, "independent"))

    def parameters(self, *, independent: bool = False) -> pd.DataFrame:
        """All parameters of the model, those of mechanisms too: one row a trial, the trial's number as index, SI units."""
        import pandas as pd

        values = self._native.parameters(flag(independent, "independent"))
        index = pd.Index(self.trials, name="trial")
        return pd.DataFrame(values, index=index, columns=self._native.parameter_names)

    def motion(self, trial: int) -> Motion:
        """The motion that drove the model in trial number `trial`, for `simulate`."""
        return Motion._of(self._native.motion(self._row(trial)))

    @overload
    def residuals(self, trial: int, parameters: Parameters) -> Array: ...
    @overload
    def residuals(self, trial: int, parameters: Parameters, *, derivatives: Literal[False]) -> Array: ...
    @overload
    def residuals(self, trial: int, parameters: Parameters, *, derivatives: Literal[True]) -> tuple[Array, Array]: ...
    def residuals(self, trial: int, parameters: Parameters, *, derivatives: bool = False) -> Array | tuple[Array, Array]:
        """What the model of the fit leaves of trial number `trial` at other parameters: measured less predicted values of all channels,
        weighted so that noise as in the holds gives independent values of variance 1; N m where residuals are not weighted.

        parameters: as the columns of `parameters()`, shape (parameters,) or (points, parameters), or by name: a dict, a pandas Series, or
            the columns of a frame.
        derivatives: whether the Jacobian is given as well.

        Returns shape (values,) or (points, values); the Jacobian has the parameters as a further axis.
        """
        row = self._row(trial)
        points = point_array(parameters, self._native.parameter_names)
        several = points.ndim == 2
        found, slopes = self._native.residuals(
            row, points.reshape(-1), points.shape[0] if several else 1, flag(derivatives, "derivatives")
        )
        residuals = found if several else found[0]
        if slopes is None:
            return residuals
        return residuals, slopes.reshape(*residuals.shape, points.shape[-1])

    def log_likelihood(self, trial: int, parameters: Parameters) -> Any:
        """Log-likelihood of parameters of the model in trial number `trial`, less a constant, for samplers: a float, or shape (points,).

        parameters: as for `residuals`. It is -inf where the inertia is not positive or the model has no finite torque. It raises
        `InputError` if residuals are not weighted, since noise has then no known size.
        """
        self._row(trial)
        if not self._native.is_weighted:
            raise InputError("the session's holds do not determine the noise, so there is no likelihood")
        points = point_array(parameters, self._native.parameter_names)
        flat = np.atleast_2d(points)
        found = np.full(len(flat), -np.inf)
        possible = flat[:, self._native.parameter_names.index("i_j_kg_m2")] > 0.0
        if possible.any():
            left = self.residuals(trial, flat[possible])
            with np.errstate(over="ignore", invalid="ignore"):
                value = -0.5 * np.einsum("ij,ij->i", left, left)
            found[possible] = np.where(np.isfinite(value), value, -np.inf)
        return found if points.ndim == 2 else float(found[0])

    def _channel(self, channel: str) -> int:
        return self.channels.index(choice(channel, "channel", self.channels))

    def _row(self, trial: int) -> int:
        number = count(trial, "trial", 0, 2**32 - 1)
        numbers = self.trials
        if number not in numbers:
            raise InputError(f"trial {number}: not among the fitted trials {numbers}")
        return numbers.index(number)

    def plot(self, *, independent: bool = False) -> Figure:
        """Measured and fitted torque, one panel a condition: a Matplotlib figure."""
        from ._plots import figure_of_fit

        return figure_of_fit(self, independent)

    def save(self, file: str | Path) -> None:
        """Writes fit.json."""
        write_new(file, self.json)

    def _repr_html_(self) -> str:
        from ._plots import embedded

        frame = self.to_frame("conditions")
        shown = ["velocity_rad_s", "torque_nm", "repetitions", *BASE_PARAMETERS, "vaf"]
        kept = [column for column in shown if column in frame.columns]
        return str(frame[kept].to_html(index=False, na_rep="", float_format="%.4g")) + embedded(self.plot)

    def __repr__(self) -> str:
        return f"<ramphold.Fit of {len(self.trials)} trials>"


def _trial_row(trial: Mapping[str, Any], of: Mapping[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {key: trial[key] for key in ("velocity_rad_s", "torque_nm", "repetition")}
    row.update({name: _number(value) for name, value in of["values"].items()})
    row.update({f"sem_{name}": _number(value) for name, value in of["sem_eq9_relative"].items()})
    row.update({f"se_{name}": _number(value) for name, value in of["se_relative"].items()})
    row.update(trial=trial["trial"], converged=of["converged"], optima=1 + len(of["other_optima"]))
    if "condition" in trial:
        row["condition"] = trial["condition"]
    return row


def _condition_row(condition: Mapping[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {key: condition[key] for key in ("velocity_rad_s", "torque_nm", "repetitions")}
    for name, value in condition["mean"].items():
        row[name], row[f"sd_{name}"] = _number(value), _number(condition["sd"][name])
    row.update({f"se_{name}": _number(value) for name, value in condition["se_relative"].items()})
    if condition["condition"] is not None:
        row["condition"] = condition["condition"]
    return row


def _number(value: float | None) -> float:
    return np.nan if value is None else value


class Diagnosis:
    """What the model gets wrong in a session, which mechanism explains it, and what adding it gains.

    `dict` holds what diagnosis.json of the program holds, with the same bits; `json` is the file's text, byte for byte.
    """

    def __init__(self, text: str) -> None:
        try:
            read = json.loads(label(text, "diagnosis"))
        except ValueError as error:
            raise InputError(f"diagnosis: {error}; expected the text of diagnosis.json") from None
        if not isinstance(read, dict) or not {"verdict", "causes", "misfit"} <= set(read):
            raise InputError("diagnosis: has no verdict, causes and misfit; expected the text of diagnosis.json")
        self._json = text
        self._read: dict[str, Any] = read

    @property
    def json(self) -> str:
        """The text of diagnosis.json."""
        return self._json

    @property
    def dict(self) -> dict[str, Any]:
        """The contents of diagnosis.json."""
        return self._read

    @property
    def verdict(self) -> str:
        """adequate (no misfit beyond the noise), named (every cause has a probability of at least 0.95), ambiguous (a cause can be
        another one) or unexplained (misfit remains that no mechanism explains)."""
        verdict: str = self._read["verdict"]
        return verdict

    @property
    def causes(self) -> list[str]:
        """Ids of the mechanisms that were found, the first cause first."""
        return [cause["mechanism"] for cause in self._read["causes"]]

    def to_frame(self) -> pd.DataFrame:
        """The causes and what they may be instead: one row a candidate, with probability, parameters, and how k_srs changes with it
        in the model."""
        import pandas as pd

        rows: list[dict[str, Any]] = []
        for number, cause in enumerate(self._read["causes"], 1):
            for candidate in [cause, *cause["alternatives"]]:
                shift = candidate["parameter_shift"].get("k_srs_nm_per_rad") or {}
                values = {
                    name: own["value"]
                    for name, own in candidate["parameters"].items()
                    if isinstance(own.get("value"), (int, float))
                }
                rows.append({
                    "cause": number,
                    "mechanism": candidate["mechanism"],
                    "title": candidate["title"],
                    "class": candidate["class"],
                    "probability": candidate["probability"],
                    "parameters": values,
                    "k_srs_before_nm_per_rad": _number(shift.get("before")),
                    "k_srs_after_nm_per_rad": _number(shift.get("after")),
                })
        columns = ["cause", "mechanism", "title", "class", "probability", "parameters", "k_srs_before_nm_per_rad",
                   "k_srs_after_nm_per_rad"]
        return pd.DataFrame(rows, columns=columns)

    def plot(self) -> Figure:
        """What the model leaves of the torque, without and with the causes, one panel a condition: a Matplotlib figure."""
        from ._plots import figure_of_diagnosis

        return figure_of_diagnosis(self)

    def save(self, file: str | Path) -> None:
        """Writes diagnosis.json."""
        write_new(file, self.json)

    def _repr_html_(self) -> str:
        from ._plots import embedded

        p_value = self._read["misfit"]["p_value"]
        head = f"<p>verdict: <b>{self.verdict}</b>" + ("" if p_value is None else f", misfit p = {p_value:.3g}") + "</p>"
        frame = self.to_frame()
        table = frame.to_html(index=False, float_format="%.4g") if len(frame) else ""
        return head + table + embedded(self.plot)

    def __repr__(self) -> str:
        return f"<ramphold.Diagnosis: {self.verdict}{': ' if self.causes else ''}{', '.join(self.causes)}>"


Listener = Callable[[str], object]
"""What is called with the name of each stage of a diagnosis."""
