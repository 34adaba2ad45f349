"""Names of materials, from names of files; and what says of a file that it is the same."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path


def printable(name: str) -> str:
    """A file's name without the bytes that are not text."""
    return os.fsencode(name).decode("utf-8", "replace")


def split_member(source: str | Path) -> tuple[Path, str]:
    """A file, and which of the materials in it: "FILE:NAME", where FILE exists and "FILE:NAME" does not."""
    text = str(source)
    if not Path(text).exists():
        for at, character in enumerate(text):
            if character == ":" and Path(text[:at]).is_file():
                return Path(text[:at]), text[at + 1 :]
    return Path(text), ""


def sha256_of(path: Path) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
