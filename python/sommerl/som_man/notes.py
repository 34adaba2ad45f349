"""What a material file notes of how it was made: options and metrics, each under its name, of plain values.

Whatever is read is shown to people, and some of it is calculated with: so the types are checked when a file is read,
and before one is written. docs/format.md lists the names that have a meaning, and says how others may join.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, cast

from ..errors import FormatError

Notes = dict[str, Any]

LONGEST_NAME, LONGEST_TEXT, MOST, LARGEST = 100, 1000, 64, 1e300
FACTS = "source_facts"  # among the options: what was reported of the source, by the name of the fact
NUMBER, WHOLE, FLAG, TEXT = "a number", "a whole number", "true or false", "a text"
PLAIN = f"a number, true, false, null or a text of at most {LONGEST_TEXT} characters"
KNOWN: dict[str, dict[str, str]] = {
    "options": {
        **dict.fromkeys(("clusters", "epochs", "seed"), WHOLE),
        **dict.fromkeys(("alpha", "radius"), NUMBER),
        **dict.fromkeys(("rule", "order", "topology"), TEXT),
    },
    "metrics": dict.fromkeys(("rmse", "log_error_cosine", "relative_error", "quantisation_error"), NUMBER),
    FACTS: {
        **dict.fromkeys(("reciprocal", "mirrored"), FLAG),
        **dict.fromkeys(("asymmetry", "coverage", "energy_clamped"), NUMBER),
        **dict.fromkeys(("held_out_log_error_cosine", "held_out_median_relative_error"), NUMBER),
        **dict.fromkeys(("samples", "samples_at_the_horizon", "samples_negative"), WHOLE),
        **dict.fromkeys(("cells_near_grazing", "cells_not_measured", "cells_clamped"), WHOLE),
    },
}


def parsed(data: bytes) -> dict[str, Notes]:
    """Options and metrics, from a file's bytes. Raises FormatError."""
    try:
        notes = _object("notes", json.loads(data.decode() or "{}", parse_constant=_no_number))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"expected notes that are JSON, found others ({error})") from error
    found = {name: _object(name, notes.get(name, {})) for name in ("options", "metrics")}
    check(**found)
    return found


def check(options: Mapping[str, Any], metrics: Mapping[str, Any]) -> None:
    """Raises FormatError for what a file cannot note."""
    facts = _object(FACTS, options.get(FACTS, {}))
    plain = {name: value for name, value in options.items() if name != FACTS}
    for group, values in (("options", plain), ("metrics", metrics), (FACTS, facts)):
        if len(values) > MOST:
            raise FormatError(f"{group}: expected at most {MOST} notes, found {len(values)}")
        for name, value in values.items():
            if len(name) > LONGEST_NAME or not all(map(_is_text, (name, value))) or not _is(value, PLAIN):
                raise FormatError(f"{group}: {name[:LONGEST_NAME]}: expected {PLAIN}, found {value!r:.60}")
            wanted = KNOWN[group].get(name, PLAIN)
            if not _is(value, wanted):
                raise FormatError(f"{group}: {name}: expected {wanted}, found {value!r:.60}")


def _is(value: Any, wanted: str) -> bool:
    """Whether a value is of a kind."""
    if value is None:
        return wanted == PLAIN
    if isinstance(value, bool):
        return wanted in (PLAIN, FLAG)
    if isinstance(value, int | float):
        kinds = (PLAIN, NUMBER, WHOLE) if isinstance(value, int) else (PLAIN, NUMBER)
        return wanted in kinds and abs(value) <= LARGEST  # nor is NaN
    return isinstance(value, str) and wanted in (PLAIN, TEXT) and len(value) <= LONGEST_TEXT


def _is_text(value: Any) -> bool:
    """Whether it is no text, or one that can be written: UTF-8 has no halves of pairs of code units."""
    return not isinstance(value, str) or not any("\ud800" <= c <= "\udfff" for c in value)


def _no_number(constant: str) -> None:
    raise FormatError(f"expected notes that are JSON, whose numbers are finite, found {constant}")


def _object(name: str, value: Any) -> Notes:
    if not isinstance(value, dict):
        raise FormatError(f"{name}: expected a JSON object, found {type(value).__name__}")
    return cast(Notes, value)
