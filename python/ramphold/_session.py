"""Sessions: read, given as arrays or simulated; fitted and diagnosed."""

from __future__ import annotations

import difflib
import json
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._arguments import PathOrJson, count, flag, json_text, label, listener, names, number, optional_number, path, text_of
from ._arrays import cell_text, channel_arrays, is_empty, optional_mapping, sample_rate, table_rows, time_arrays, whole_number
from ._calibration import CalibrationSource, calibration_argument
from ._errors import InputError
from ._law import OwnLaw, mechanism_list, model_text, outside_catalogue
from ._native import NativeSession
from ._pickles import folder_files, from_folder_files
from ._protocol import Protocol
from ._results import Diagnosis, Fit, Listener

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

_TABLE = ("trial", "velocity_rad_s", "torque_nm", "repetition", "condition", "onset_s", "status")


class Session:
    """A measured or simulated session: signals and table of its trials, checked by the rules for a session's folder."""

    def __init__(self, native: NativeSession) -> None:
        """Sessions are made by `load`, `from_arrays` and `simulate`."""
        if not isinstance(native, NativeSession):
            raise InputError("a session is made by Session.load, Session.from_arrays or Session.simulate")
        self._native = native
        self._description: dict[str, Any] = json.loads(native.description)

    @classmethod
    def load(cls, folder: str | Path) -> Session:
        """Reads a session's folder. Window and filter of the session's protocol and the calibration in its folder hold for its
        analysis, as in the program.

        Raises `InputError` with file, line, column and what was expected.
        """
        return cls(NativeSession.load(path(folder, "folder")))

    @classmethod
    def from_arrays(
        cls,
        t: Array | Sequence[Array],
        theta: Array | Sequence[Array],
        torque: Array | Sequence[Array],
        *,
        trials: Any,
        lever: Mapping[str, float] | None,
        recorded_filter: Mapping[str, Any] | None = None,
        subject: str = "S01",
        sample_rate_hz: float | None = None,
        emg_fcr: Array | Sequence[Array | None] | None = None,
        emg_ecr: Array | Sequence[Array | None] | None = None,
        theta_l: Array | Sequence[Array] | None = None,
        alpha_l: Array | Sequence[Array] | None = None,
        torque_h: Array | Sequence[Array] | None = None,
        theta_j: Array | Sequence[Array] | None = None,
    ) -> Session:
        """A session from a lab's own arrays.

        t: time, shape (samples,) for all trials, or (trials, samples), or a list of one array a trial; s.
        theta: angle of the motor, shape (trials, samples) or a list of arrays, rad; unfiltered, offsets not removed.
        torque: torque in the lever, as `theta`, N m; what resists a positive ramp is positive.
        trials: the table, one row a trial: a pandas or polars frame, a dict of columns, or a list of dicts. Needed: velocity_rad_s,
            torque_nm (target). Known: trial (number; else 1, 2, ...), repetition (else counted in each condition), onset_s (on the
            axis of t; else found by the analysis), status (ok, aborted or rejected; else ok), condition (a label). Other columns
            are kept as text; the analysis reads rest_s (rest before the trial, s; a number or empty). Spaces around names do not count;
            a column `file` is refused, since a saved session has one of its own.
        lever: None for a rigid lever, else a dict of inertia_kg_m2, damping_nm_s_per_rad and stiffness_nm_per_rad.
        recorded_filter: None if nothing was filtered before recording, else the filter, such as
            {"kind": "butterworth", "order": 3, "cutoff_hz": 50}.
        sample_rate_hz: samples a second; else from `t`: a whole number where that moves no sample by more than a twentieth of a sample.
        emg_fcr, emg_ecr: EMG, as `theta`, fraction of maximal voluntary contraction; a list may hold None for a trial without.
        theta_l, alpha_l, torque_h, theta_j: further channels, as `theta`: angle of the handle (rad), its acceleration (rad/s2), torque
            between handle and hand (N m), angle of the joint (rad). The fit uses what there is; all trials have the same channels.

        Arrays are contiguous and of float64; each is copied once. Raises `InputError` otherwise, and if times have gaps, values are
        not finite, or the table does not fit the signals. Wrong units are found by `fit` and `diagnose`, which hold the signals
        against the table.
        """
        rows = table_rows(trials)
        given = {
            "theta": theta, "torque": torque, "emg_fcr": emg_fcr, "emg_ecr": emg_ecr,
            "theta_l": theta_l, "alpha_l": alpha_l, "torque_h": torque_h, "theta_j": theta_j,
        }
        channels = channel_arrays(given, ("theta", "torque"), len(rows))
        times = time_arrays(t, len(rows))
        rate = number(sample_rate_hz, "sample_rate_hz") if sample_rate_hz is not None else sample_rate(times)
        description = {
            "subject": label(subject, "subject"),
            "sample_rate_hz": rate,
            "lever": optional_mapping(lever, "lever"),
            "recorded_filter": optional_mapping(recorded_filter, "recorded_filter"),
            "trials": _table(rows),
        }
        columns = {"t": times, **channels}
        signals = [
            {name: own[index] for name, own in columns.items() if own[index] is not None or name not in ("emg_fcr", "emg_ecr")}
            for index in range(len(rows))
        ]
        return cls(NativeSession.from_arrays(json_text(description, "session"), signals))

    @classmethod
    def simulate(
        cls,
        protocol: Protocol | PathOrJson,
        seed: int,
        *,
        person: PathOrJson | None = None,
        rig: PathOrJson | None = None,
        mechanisms: Sequence[Mapping[str, Any] | OwnLaw] = (),
        subject: str = "V01",
        subject_number: int = 1,
    ) -> Session:
        """The session of a virtual subject on a virtual rig.

        person, rig: files or dicts, as for `ramphold run`; without them the average person and the assumed rig.
        mechanisms: what the wrist or the rig does beyond the model: a list of {"mechanism": id, "parameters": {name: value}} with
            every parameter (`ramphold.mechanisms()` lists them), or `OwnLaw`. Warns of values outside of their bounds there.
        """
        own = protocol if isinstance(protocol, Protocol) else Protocol(protocol)
        added = mechanism_list(mechanisms)
        native = NativeSession.simulate(
            own._native,
            count(seed, "seed"),
            text_of(person, "person"),
            text_of(rig, "rig"),
            json_text(added, "mechanisms") if added else None,
            label(subject, "subject"),
            count(subject_number, "subject_number", 1, 2**32 - 1),
        )
        for outside in outside_catalogue(added):
            warnings.warn(f"{outside}, where diagnose looks for it: is its unit right?", stacklevel=2)
        return cls(native)

    def __copy__(self) -> Session:
        return Session(self._native)

    def __deepcopy__(self, memo: dict[int, object]) -> Session:
        # The native session never changes, so that copies can share it.
        return Session(self._native)

    def __reduce__(self) -> tuple[object, ...]:
        # A folder keeps all that an analysis reads, protocol and calibration too.
        try:
            return _session_of_files, (folder_files(self._native.save),)
        except InputError as error:
            raise TypeError(f"the session cannot be saved, and so not pickled: {error}; load its folder where it is needed") from None

    @property
    def subject(self) -> str:
        """Id of the subject."""
        return str(self._description["subject"])

    @property
    def sample_rate_hz(self) -> float:
        """Samples a second."""
        return float(self._description["sample_rate_hz"])

    @property
    def lever(self) -> dict[str, float] | None:
        """The lever between motor and handle; None for a rigid one."""
        lever: dict[str, float] | None = self._description["lever"]
        return lever

    @property
    def recorded_filter(self) -> dict[str, Any] | None:
        """What the rig filtered before recording; None if nothing."""
        recorded: dict[str, Any] | None = self._description["recorded_filter"]
        return recorded

    @property
    def digest(self) -> str:
        """SHA-256 over all that an analysis reads; results name it as session_sha256."""
        return self._native.digest

    def to_frame(self) -> pd.DataFrame:
        """The table: one row a trial."""
        import pandas as pd

        rows = [{**{key: own[key] for key in _TABLE}, **own["extra"]} for own in self._description["trials"]]
        return pd.DataFrame(rows)

    def record(self, trial: int) -> pd.DataFrame:
        """The signals of trial number `trial`: columns t_s (s), theta_m_rad (rad), torque_l_nm (N m), EMG and further channels where
        measured."""
        import pandas as pd

        numbers = [own["trial"] for own in self._description["trials"]]
        if count(trial, "trial", 0, 2**32 - 1) not in numbers:
            raise InputError(f"trial {trial}: not among the trials {numbers}")
        return pd.DataFrame(dict(self._native.record(numbers.index(trial))))

    def save(self, folder: str | Path) -> None:
        """Writes a new session folder, which the program analyses with the same results: numbers have as many digits as it takes to
        read back the same, and protocol and calibration of the session come along."""
        self._native.save(path(folder, "folder"))

    def check(self) -> list[dict[str, Any]]:
        """What the signals say against the table, such as a unit that is not SI; empty if nothing."""
        found: list[dict[str, Any]] = json.loads(self._native.contradictions())
        return found

    def fit(
        self,
        *,
        model: Mapping[str, Any] | None = None,
        mechanisms: Sequence[Mapping[str, Any] | OwnLaw] = (),
        window_s: float | None = None,
        calibration: CalibrationSource | None = None,
        plain: bool = False,
        independent: bool = False,
        accept: Sequence[str] = (),
        bootstrap: int | None = None,
        seed: int = 1,
        progress: Callable[[int, int], object] | None = None,
    ) -> Fit:
        """Fits the wrist model; the options are those of `ramphold fit`.

        model: the contents of a model file; else the model of the paper.
        mechanisms: what is added to the model: entries of a model file, or `OwnLaw`, which keeps its values (`OwnLaw.in_model` also
            makes one whose coefficients are fitted).
        window_s: analysed time after the onset, s; else that of the protocol, or 0.040.
        calibration: constants of the rig: a `Calibration`, its file, or its contents; "none" uses what the session states. Else that in
            the session's folder, if there is one.
        plain: weight every sample equally instead of by the noise measured in the holds.
        independent: each trial on its own, without the model of the session.
        accept: names of checks of the signals against the table that may fail, such as "onset".
        bootstrap: refit so many simulated sessions, and give the scatter of the estimates.
        progress: called before each refit of a bootstrap with the number of refits that have begun, and of all.

        Other threads of Python run meanwhile. Ctrl-C raises KeyboardInterrupt at once; the work itself ends in the background.
        """
        refits = None if bootstrap is None else count(bootstrap, "bootstrap", 2, 1_000_000)
        own = model_text(model, mechanisms)
        text = None if own is None else json_text(own, "model")
        window = optional_number(window_s, "window_s")
        file, calibrated = calibration_argument(calibration)
        tell, begun = listener(progress), 0

        def refit(_: str) -> None:
            nonlocal begun
            begun += 1
            if tell is not None and refits is not None:
                tell(begun, refits)

        fitted = self._native.fit(
            text, window, file, calibrated, flag(plain, "plain"), flag(independent, "independent"), names(accept, "accept"), refits,
            count(seed, "seed"), refit,
        )
        return Fit(fitted)

    def diagnose(
        self,
        *,
        model: Mapping[str, Any] | None = None,
        mechanisms: Sequence[Mapping[str, Any] | OwnLaw] = (),
        window_s: float | None = None,
        calibration: CalibrationSource | None = None,
        accept: Sequence[str] = (),
        seed: int = 1,
        progress: Listener | None = None,
    ) -> Diagnosis:
        """Diagnoses the session; the options are those of `ramphold diagnose`, and otherwise as for `fit`.

        seed: of the draws of noise that give the null distributions.
        progress: called with the name of each stage.

        Ctrl-C raises KeyboardInterrupt at once; the work stops in the background at its next stage.
        """
        own = model_text(model, mechanisms)
        text = None if own is None else json_text(own, "model")
        window = optional_number(window_s, "window_s")
        file, calibrated = calibration_argument(calibration)
        return Diagnosis(self._native.diagnose(
            text, window, file, calibrated, names(accept, "accept"), count(seed, "seed"), listener(progress)
        ))

    def plot(self) -> Figure:
        """Angle and torque of every trial about its onset: a Matplotlib figure."""
        from ._plots import figure_of_session

        return figure_of_session(self)

    def _repr_html_(self) -> str:
        from ._plots import embedded

        table = self.to_frame().to_html(index=False, na_rep="", float_format="%.4g", max_rows=12)
        return str(table) + embedded(self.plot)

    def __repr__(self) -> str:
        return f"<ramphold.Session of {self.subject}: {len(self._description['trials'])} trials at {self.sample_rate_hz:g} Hz>"


def _session_of_files(files: dict[str, bytes]) -> Session:
    """The session that was pickled."""
    return Session(from_folder_files(files, NativeSession.load))


def _with_plain_names(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows with the names of their columns as they are read back from a saved folder: without spaces around them."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    seen: dict[str, str] = {}
    for name in columns:
        own = name.strip()
        if own in seen:
            raise InputError(
                f"trials: columns {seen[own]!r} and {name!r} have one name but for spaces; expected names that differ: rename or leave"
                " out one"
            )
        if own == "file":
            raise InputError(f"trials: column {name!r} is that of the samples in a saved session; rename or leave out the column")
        seen[own] = name
    return [{name.strip(): value for name, value in row.items()} for row in rows]


def _warn_of_onsets(columns: list[str]) -> None:
    """Warns of a column that seems to be of onsets and has another name: it is not used."""
    known = [own for own in columns if own not in _TABLE]
    near = [own for own in known if "onset" in own.lower() or difflib.get_close_matches(own.lower(), ["onset_s"], cutoff=0.8)]
    if near and "onset_s" not in columns:
        warnings.warn(
            f"trials: column {near[0]!r} is kept as text and not used, and the analysis finds the onsets; name the column onset_s (s, on"
            " the axis of t) to give them",
            UserWarning,
            stacklevel=4,
        )


def _extra_cell(name: str, value: object, where: str) -> str:
    """The text of a cell of a further column."""
    text = cell_text(value)
    if name == "rest_s" and text:
        try:
            seconds = float(text)
        except ValueError:
            seconds = float("nan")
        if not math.isfinite(seconds):
            raise InputError(f"{where}, rest_s: {value!r} is not valid; expected a finite number of s, or an empty cell")
    return text


def _table(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The table of a session as the native part takes it."""
    rows = _with_plain_names(rows)
    _warn_of_onsets(list(rows[0]))
    missing = [name for name in ("velocity_rad_s", "torque_nm") if name not in rows[0]]
    if missing:
        raise InputError(f"trials: column {missing[0]} is missing; the columns are: {', '.join(map(str, rows[0]))}")
    seen: dict[object, int] = {}
    table: list[dict[str, Any]] = []
    for index, row in enumerate(rows):
        where = f"trials, row {index}"
        velocity, torque = (number(row.get(name), f"{where}, {name}") for name in ("velocity_rad_s", "torque_nm"))
        named = None if is_empty(row.get("condition")) else str(row["condition"]).strip()
        condition = (velocity, torque, named)
        seen[condition] = seen.get(condition, 0) + 1
        repetition = row.get("repetition")
        onset = row.get("onset_s")
        status = row.get("status", "ok")
        if not isinstance(status, str) or status not in ("ok", "aborted", "rejected"):
            raise InputError(f"{where}, status: {status!r} is not valid; expected ok, aborted or rejected")
        trial = index + 1 if is_empty(row.get("trial")) else whole_number(row["trial"], f"{where}, trial")
        table.append({
            "trial": trial,
            "velocity_rad_s": velocity,
            "torque_nm": torque,
            "repetition": seen[condition] if is_empty(repetition) else whole_number(repetition, f"{where}, repetition"),
            "condition": named,
            "onset_s": None if is_empty(onset) else number(onset, f"{where}, onset_s"),
            "status": status,
            "extra": {name: _extra_cell(name, value, where) for name, value in row.items() if name not in _TABLE},
        })
    return table
