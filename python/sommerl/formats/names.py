"""Names of files, and of what is in them."""

from __future__ import annotations

import os
from pathlib import Path


def split_member(source: str | Path) -> tuple[Path, str]:
    """A file, and which of the materials in it: "FILE:NAME", where FILE exists and "FILE:NAME" does not."""
    text = str(source)
    if not os.path.exists(text):  # unlike a Path's, it takes all that is no name for none
        for at, character in enumerate(text):
            if character == ":" and os.path.isfile(text[:at]):
                return Path(text[:at]), text[at + 1 :]
    return Path(text), ""
