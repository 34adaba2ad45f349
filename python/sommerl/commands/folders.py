"""Folders for outputs: made where they are missing, and removed again if nothing comes to be in them."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

_made: list[Path] = []  # in this run, outer ones first


def make_folder(folder: Path) -> None:
    """Makes a folder, and those that it is in, if there is none. Raises OSError."""
    missing = [each for each in (folder, *folder.parents) if not os.path.lexists(each)]
    for each in reversed(missing):
        try:
            each.mkdir()
        except OSError as error:
            raise OSError(error.errno, f"the folder cannot be made ({error.strerror})", str(folder)) from error
        _made.append(each)
    if not folder.is_dir():
        raise NotADirectoryError(0, "expected a folder, found something else", str(folder))


@contextmanager
def empty_ones_removed() -> Generator[None]:
    """After the block, which may fail, folders that were made in it are removed if they are empty."""
    _made.clear()
    try:
        yield
    finally:
        for folder in reversed(_made):
            with suppress(OSError):  # something is in it
                folder.rmdir()
