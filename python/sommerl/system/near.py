"""Names that were mistyped."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

NEAR = 0.65  # of `difflib`, from 0 to 1: "nickle" is 0.83 from "nickel", "missing" 0.31 from "gold-metallic-paint"


def did_you_mean(word: str, names: Iterable[str]) -> str:
    """The end of a sentence on a wrong name: "; did you mean nickel?", or "" if no name is near."""
    found = difflib.get_close_matches(word.lower(), names, 1, NEAR)
    return f"; did you mean {found[0]}?" if found else ""
