"""Analyses as functions of a session or of its folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ._arguments import path
from ._calibration import CalibrationSource
from ._errors import InputError
from ._law import OwnLaw
from ._results import Diagnosis, Fit, Listener
from ._session import Session

SessionOrFolder = Session | str | os.PathLike[str]
"""A session, or the path of a session's folder."""


def fit(
    session: SessionOrFolder,
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
    """Fits the wrist model to a session: `Session.fit` as a function, which has what each option means.

    session: a `Session`, or the path of its folder, which is read as by `Session.load`.
    window_s: analysed time after the onset, s; else that of the protocol, or 0.040.

    Returns a `Fit`, whose arrays have the shapes (trials, samples) and (trials, parameters). Raises `InputError` if `session` is
    neither, the folder cannot be read, an option is wrong, or the signals contradict the table.
    """
    return _session(session).fit(
        model=model, mechanisms=mechanisms, window_s=window_s, calibration=calibration, plain=plain, independent=independent,
        accept=accept, bootstrap=bootstrap, seed=seed, progress=progress,
    )


def diagnose(
    session: SessionOrFolder,
    *,
    model: Mapping[str, Any] | None = None,
    mechanisms: Sequence[Mapping[str, Any] | OwnLaw] = (),
    window_s: float | None = None,
    calibration: CalibrationSource | None = None,
    accept: Sequence[str] = (),
    seed: int = 1,
    progress: Listener | None = None,
) -> Diagnosis:
    """What the model gets wrong in a session: `Session.diagnose` as a function, which has what each option means.

    session: a `Session`, or the path of its folder, which is read as by `Session.load`.
    window_s: analysed time after the onset, s; else that of the protocol, or 0.040.

    Returns a `Diagnosis`. Raises `InputError` as `ramphold.fit` does.
    """
    return _session(session).diagnose(
        model=model, mechanisms=mechanisms, window_s=window_s, calibration=calibration, accept=accept, seed=seed, progress=progress
    )


def _session(session: SessionOrFolder) -> Session:
    """The session itself, or that of the folder."""
    if isinstance(session, Session):
        return session
    if isinstance(session, (str, os.PathLike)):
        return Session.load(path(session, "session"))
    raise InputError(f"session: {type(session).__name__}; expected a Session, or the path of a session's folder")
