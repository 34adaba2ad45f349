"""How a material in a file is named on the command line: FILE, or FILE:NAME for one of several."""

from __future__ import annotations

import os
from pathlib import Path


def split_member(source: str | Path) -> tuple[Path, str]:
    """The file and the name of a material in it, from "FILE:NAME"; the name is "" where only a file is named.

    A colon may also be part of a file's own name. So the whole text is taken for a file's name if such a file exists,
    and else is split at the first colon before which there is the name of a file.
    """
    text = str(source)
    if not os.path.exists(text):  # os.path takes any text for a name; Path raises ValueError for some
        for at, character in enumerate(text):
            if character == ":" and os.path.isfile(text[:at]):
                return Path(text[:at]), text[at + 1 :]
    return Path(text), ""
