"""Arguments as the native part takes them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ._errors import InputError

Json = Mapping[str, Any] | Sequence[Any]
"""What JSON can hold, as Python holds it."""

Listens = TypeVar("Listens", bound=Callable[..., object])

PathOrJson = str | os.PathLike[str] | Mapping[str, Any]
"""The path of a JSON file, or what is in it."""


def json_text(value: object, name: str) -> str:
    """The JSON text of `value`; `name` is its name in messages. NaN and infinity are refused, as JSON has neither."""
    try:
        return json.dumps(value, allow_nan=False, default=_number)
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{name}: {error}; expected what JSON can hold: numbers, texts, lists and dicts") from None


def _number(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} is not JSON")


def text_of(value: PathOrJson | None, name: str) -> str | None:
    """The JSON text of a file or of a mapping."""
    if value is None:
        return None
    if isinstance(value, Mapping):
        return json_text(dict(value), name)
    if isinstance(value, (str, os.PathLike)):
        try:
            return Path(value).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError, ValueError) as error:
            raise InputError(f"{value}: cannot be read: {error}") from None
    raise InputError(f"{name}: {type(value).__name__}; expected the path of a JSON file, or a dict")


def number(value: object, name: str) -> float:
    """A finite number."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise InputError(f"{name}: {value!r} is not valid; expected a number")
    try:
        found = float(value)
    except OverflowError:
        found = float("inf")
    if not np.isfinite(found):
        raise InputError(f"{name}: {value!r} is not valid; expected a finite number")
    return found


def count(value: object, name: str, low: int = 0, high: int = 2**64 - 1) -> int:
    """A whole number from `low` to `high`."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or not low <= value <= high:
        raise InputError(f"{name}: {value!r} is not valid; expected a whole number from {low} to {high}")
    return int(value)


def path(value: object, name: str) -> str:
    """A path."""
    own = os.fspath(value) if isinstance(value, (str, os.PathLike)) else None
    if not isinstance(own, str) or "\0" in own:
        raise InputError(f"{name}: {value!r} is not valid; expected a path")
    try:
        os.fsencode(own)
    except UnicodeEncodeError:
        raise InputError(f"{name}: {value!r} is not valid; expected a path that the system can name") from None
    return own


def optional_number(value: object, name: str) -> float | None:
    """A finite number, or nothing."""
    return None if value is None else number(value, name)


def label(value: object, name: str) -> str:
    """A text that can be written."""
    if not isinstance(value, str):
        raise InputError(f"{name}: {value!r}; expected a text")
    try:
        value.encode()
    except UnicodeEncodeError as error:
        raise InputError(f"{name}: {value!r}: {error.reason}; expected a text") from None
    return value


def choice(value: object, name: str, known: Sequence[str]) -> str:
    """One of the texts that are known."""
    if not isinstance(value, str) or value not in known:
        raise InputError(f"{name}: {value!r}; expected {known[0] if len(known) == 1 else 'one of ' + ', '.join(known)}")
    return value


def callback(value: Listens, name: str) -> Listens:
    """What can be called."""
    if not callable(value):
        raise InputError(f"{name}: {type(value).__name__}; expected a function")
    return value


def flag(value: object, name: str) -> bool:
    """True or False; a text such as "no" is not taken for True."""
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{name}: {value!r} is not valid; expected True or False")
    return bool(value)


def listener(value: Listens | None) -> Listens | None:
    """A function that is told of the progress, or nothing."""
    return None if value is None else callback(value, "progress")


def unmasked(value: Any, name: str) -> Any:
    """An array without a mask; anything else as it is. Masked values are refused: what is under a mask is not a measured value."""
    if isinstance(value, np.ma.MaskedArray):
        hidden = int(np.count_nonzero(np.ma.getmaskarray(value)))
        if hidden:
            raise InputError(
                f"{name}: {hidden} of {value.size} values are masked; expected an array without masked values: fill them, or leave out"
                " what they belong to"
            )
        return np.ma.getdata(value)
    if isinstance(value, (list, tuple)):
        return [unmasked(own, name) for own in value]
    return value


def names(value: object, name: str) -> list[str]:
    """A list of texts; one text is not taken for its letters."""
    if isinstance(value, str) or not isinstance(value, Sequence) or not all(isinstance(own, str) for own in value):
        raise InputError(f"{name}: {value!r} is not valid; expected a list of texts")
    return list(value)


def write_new(file: str | Path, text: str) -> None:
    """Writes a new file; one that is there is not replaced."""
    name = path(file, "file")
    try:
        with open(name, "x", encoding="utf-8", newline="\n") as out:
            out.write(text)
    except OSError as error:
        raise InputError(f"{name}: cannot be written: {error}") from None
