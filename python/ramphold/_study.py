"""Studies of many subjects."""

from __future__ import annotations

import json
import shutil
import tempfile
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._arguments import count, flag, listener, path
from ._errors import InputError, WorkError
from ._frames import frame_of_csv
from ._native import NativeStudy

if TYPE_CHECKING:
    import pandas as pd


def _do_part(study: str, seed: int, out: str, part: int) -> int:
    """One part, on a worker."""
    NativeStudy(study, seed).compute(out, [part], None)
    return part


class Study:
    """A study: many subjects through one protocol, every session fitted.

    file: a study file (`ramphold schema study` prints its schema).
    seed: seed of all random draws.
    """

    def __init__(self, file: str | Path, seed: int) -> None:
        self._file, self._seed = path(file, "file"), count(seed, "seed")
        self._native = NativeStudy(self._file, self._seed)
        self._folder: Path | None = None

    @property
    def name(self) -> str:
        """Name of the study."""
        return self._native.name

    @property
    def sessions(self) -> int:
        """Number of its sessions."""
        return self._native.units

    def compute(
        self,
        client: Any = None,
        *,
        out: str | Path | None = None,
        resume: bool = False,
        progress: Callable[[int, int], object] | None = None,
    ) -> Study:
        """Fits every session and makes the tables; returns the study itself.

        client: a `distributed.Client`, whose workers must see study file and `out` under the same paths, and have this package;
            None computes here, on all cores. The results are the same bytes.
        out: the study's folder, which gets what `ramphold cohort` writes, except the report and the folders of sessions. None is a
            temporary folder, which goes with the study; workers of a client must then be on this machine.
        resume: go on in a folder in which the same study was begun.
        progress: called with the number of parts that are done, and of all.

        Raises `WorkError` if sessions are missing from the tables; what there is has been written.
        """
        if client is not None and not hasattr(client, "map"):
            raise InputError(f"client: {type(client).__name__}; expected a distributed.Client or None")
        heard = listener(progress)
        if out is None:
            if flag(resume, "resume"):
                raise InputError("resume: True without out; expected the folder in which the study was begun")
            temporary = tempfile.mkdtemp(prefix="ramphold-")
            weakref.finalize(self, shutil.rmtree, temporary, ignore_errors=True)
            out = Path(temporary) / "study"
        folder = Path(path(out, "out")).resolve()
        self._native.begin(folder, flag(resume, "resume"))
        pending = self._native.pending(folder)

        def tell(done: int) -> None:
            if heard is not None:
                heard(done, self._native.parts)

        done = self._native.parts - len(pending)
        if client is None:
            # A few parts at a time, so that progress is told; each uses all cores.
            for first in range(0, len(pending), 4):
                own = pending[first : first + 4]
                self._native.compute(folder, own, None)
                tell(done := done + len(own))
        else:
            from distributed import as_completed

            same = (str(Path(self._file).resolve()), self._seed, str(folder))
            futures = client.map(_do_part, *([own] * len(pending) for own in same), pending, pure=False, retries=3)
            finished: Any = as_completed(futures)  # type: ignore[no-untyped-call, unused-ignore]
            for future in finished:
                future.result()
                tell(done := done + 1)
        missing = self._native.tables(folder)
        self._folder = folder
        if missing:
            raise WorkError(f"the study is incomplete: {len(missing)} problems exclude subjects from its tables: " + "; ".join(missing))
        return self

    @property
    def folder(self) -> Path:
        """The folder of the results; `compute` comes first."""
        if self._folder is None:
            raise WorkError("the study is not computed yet; call compute first")
        return self._folder

    def to_frame(self) -> pd.DataFrame:
        """study.csv: one row a subject, session and trial, with parameters, errors and what was fitted."""
        return frame_of_csv((self.folder / "study.csv").read_text(encoding="utf-8"))

    @property
    def dict(self) -> dict[str, Any]:
        """study.json: the repeated-measures analysis of every quantity."""
        results: dict[str, Any] = json.loads((self.folder / "study.json").read_text(encoding="utf-8"))
        return results

    def effects(self) -> pd.DataFrame:
        """anova.csv: the effects of velocity and torque on every quantity."""
        return frame_of_csv((self.folder / "anova.csv").read_text(encoding="utf-8"))

    def __repr__(self) -> str:
        return f"<ramphold.Study {self.name!r} of {self.sessions} sessions>"
