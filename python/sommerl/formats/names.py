"""Names of materials, from names of files."""

from __future__ import annotations

import os
from pathlib import Path


def printable(name: str) -> str:
    """A file's name without the bytes that are not text."""
    return os.fsencode(name).decode("utf-8", "replace")


def split_member(source: str | Path) -> tuple[Path, str]:
    """A file, and which of the materials in it: "FILE:NAME", where FILE exists and "FILE:NAME" does not."""
    text = str(source)
    if not os.path.exists(text):  # unlike a Path's, it takes all that is no name for none
        for at, character in enumerate(text):
            if character == ":" and os.path.isfile(text[:at]):
                return Path(text[:at]), text[at + 1 :]
    return Path(text), ""
