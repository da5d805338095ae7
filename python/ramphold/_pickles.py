"""Copies and pickles of what the native part holds."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

Made = TypeVar("Made")


def folder_files(save: Callable[[str], None]) -> dict[str, bytes]:
    """The files of the new folder that `save` writes, by their paths in it."""
    with tempfile.TemporaryDirectory(prefix="ramphold-pickle-") as place:
        folder = Path(place) / "session"
        save(str(folder))
        return {own.relative_to(folder).as_posix(): own.read_bytes() for own in sorted(folder.rglob("*")) if own.is_file()}


def from_folder_files(files: dict[str, bytes], load: Callable[[str], Made]) -> Made:
    """What `load` reads from a folder of these files."""
    with tempfile.TemporaryDirectory(prefix="ramphold-pickle-") as place:
        folder = Path(place) / "session"
        for name, content in files.items():
            file = folder / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
        return load(str(folder))
