"""Names that were mistyped."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

NEAR = 0.65  # of `difflib`, from 0 to 1: "nickle" is 0.83 from "nickel", "missing" 0.31 from "gold-metallic-paint"


def did_you_mean(word: str, names: Iterable[str], most: int = 1) -> str:
    """The end of a sentence on a wrong name: "; did you mean nickel?", or "" if no name is near.

    most: the largest number of names, which are told with "or" between them. Of names whose parts are joined by "/",
    the last part may be near, too.
    """
    known = list(names)
    found = difflib.get_close_matches(word.lower(), known, most, NEAR)
    if len(found) < most:
        last = {name.rpartition("/")[2]: name for name in reversed(known) if "/" in name}
        ends = difflib.get_close_matches(word.lower().rpartition("/")[2], last, most, NEAR)
        found += [last[end] for end in ends if last[end] not in found][: most - len(found)]
    return f"; did you mean {' or '.join(found)}?" if found else ""
