"""Protocols and the order of their trials."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._arguments import PathOrJson, count, path, text_of
from ._errors import InputError
from ._frames import frame_of_csv
from ._native import EXAMPLES, NativeProtocol

if TYPE_CHECKING:
    import pandas as pd


class Protocol:
    """A protocol that passed every check of the program.

    `source` is the path of a protocol file, or a dict of its fields (`ramphold schema protocol` prints them).

    Raises `InputError` with all mistakes, each with its field, what is there and what was expected.
    """

    def __init__(self, source: PathOrJson) -> None:
        if isinstance(source, dict):
            text = text_of(source, "protocol")
            assert text is not None
            self._native = NativeProtocol.parse(text, "protocol")
        elif isinstance(source, (str, os.PathLike)):
            self._native = NativeProtocol.read(path(source, "protocol"))
        else:
            raise InputError(f"protocol: {type(source).__name__}; expected the path of a JSON file, or a dict")

    def __copy__(self) -> Protocol:
        return _protocol_of(self._native)

    def __deepcopy__(self, memo: object) -> Protocol:
        # The native protocol never changes, so that copies can share it.
        return _protocol_of(self._native)

    def __reduce__(self) -> tuple[object, ...]:
        return _protocol_of_text, (self.text,)

    @property
    def text(self) -> str:
        """The JSON text that it was read from."""
        return self._native.text

    @property
    def dict(self) -> dict[str, Any]:
        """Its fields."""
        fields: dict[str, Any] = json.loads(self.text)
        return fields

    @property
    def trial_count(self) -> int:
        """Number of trials that are analysed if none is rejected."""
        return self._native.trial_count

    def schedule(self, seed: int, subject_number: int | None = None) -> pd.DataFrame:
        """The order of the trials, see `ramphold.schedule`."""
        number = None if subject_number is None else count(subject_number, "subject_number", 1, 2**32 - 1)
        return frame_of_csv(self._native.schedule(count(seed, "seed"), number))

    def __repr__(self) -> str:
        return f"<ramphold.Protocol of {self.trial_count} trials>"


def _protocol_of(native: NativeProtocol) -> Protocol:
    protocol = Protocol.__new__(Protocol)
    protocol._native = native
    return protocol


def _protocol_of_text(text: str) -> Protocol:
    """The protocol that was pickled."""
    return _protocol_of(NativeProtocol.parse(text, "protocol"))


def schedule(protocol: Protocol | PathOrJson, seed: int, subject_number: int | None = None) -> pd.DataFrame:
    """The order of the trials of `protocol`: one row a trial, as `ramphold schedule` prints it.

    Columns: position, velocity_rad_s (rad/s), torque_nm (N m), repetition. The same seed gives the same order on every platform.
    `subject_number`, from 1, is needed by an order of kind "williams" only.
    """
    own = protocol if isinstance(protocol, Protocol) else Protocol(protocol)
    return own.schedule(seed, subject_number)


def write_examples(folder: str | Path) -> Path:
    """Writes the files that come with the program into `folder`, and returns it: two protocols, and the study of the paper with its
    person and rig. A file that is there with another content is not replaced."""
    own = Path(path(folder, "folder"))
    try:
        own.mkdir(parents=True, exist_ok=True)
        for name, text in EXAMPLES.items():
            if (own / name).exists() and (own / name).read_text(encoding="utf-8") != text:
                raise InputError(f"{own / name}: is there with another content and is not replaced; give another folder")
            (own / name).write_text(text, encoding="utf-8", newline="\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{own}: cannot be written: {error}") from None
    return own
