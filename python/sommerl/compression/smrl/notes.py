"""The notes of a material file: the options it was made with, its metrics, and the sources it was made from.

Notes are shown to people, and some are used in calculations, so names and types are checked when a file is read and
before one is written. docs/format.md lists the names that have a meaning; others are allowed.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from math import isfinite
from typing import Any, cast

from ...reflectance.origin import check_chain
from ...system.errors import FormatError

Notes = dict[str, Any]

LONGEST_NAME, LONGEST_TEXT, MOST, LARGEST = 100, 1000, 64, 1e300
FACTS = "source_facts"  # the option that holds what was reported about the source (`Brdf.facts`)
NUMBER, WHOLE, FLAG, TEXT = "a number", "a whole number", "true or false", "a text"
PLAIN = f"a number, true, false, null or a text of at most {LONGEST_TEXT} characters"
EACH = f"at most {MOST} names of at most {LONGEST_NAME} characters, each with {PLAIN}"
DEEPEST = 32  # levels of objects and lists within each other
KNOWN: dict[str, dict[str, str]] = {
    "options": {
        **dict.fromkeys(("clusters", "epochs", "seed"), WHOLE),
        **dict.fromkeys(("alpha", "radius"), NUMBER),
        **dict.fromkeys(("rule", "order", "topology"), TEXT),
        "distinct": FLAG,
    },
    "metrics": dict.fromkeys(("rmse", "log_error_cosine", "relative_error", "quantisation_error"), NUMBER),
    FACTS: {
        **dict.fromkeys(("reciprocal", "mirrored"), FLAG),
        **dict.fromkeys(
            ("asymmetry", "coverage", "energy_clamped", "energy_averaged", "energy_negative", "darkened"), NUMBER
        ),
        **dict.fromkeys(("held_out_log_error_cosine", "held_out_median_relative_error"), NUMBER),
        **dict.fromkeys(("samples", "samples_at_the_horizon", "samples_negative"), WHOLE),
        **dict.fromkeys(("cells_near_grazing", "cells_not_measured", "cells_clamped"), WHOLE),
    },
}


def written(**known: Any) -> bytes:
    """The bytes of notes, without empty ones. Raises FormatError for values that JSON cannot hold; checks no names."""
    said = {key: value for key, value in known.items() if value}
    if not said:
        return b""
    try:
        data = json.dumps(said, sort_keys=True, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise FormatError(f"expected notes that JSON can hold, found others ({error})") from error
    return data


def parsed(data: bytes) -> dict[str, Any]:
    """Options, metrics and the chain of sources from the bytes of a file's notes.

    Raises FormatError if they are not JSON, too deep, or not as docs/format.md says.
    """
    try:
        said = json.loads(data.decode() or "{}", parse_int=_finite, parse_float=_finite, parse_constant=_finite)
    except (ValueError, RecursionError):
        said = None
    if isinstance(said, dict) and _shallow(said, DEEPEST):
        known = cast(Notes, said)
        found = {name: known.get(name, {}) for name in ("options", "metrics")}
        if all(isinstance(value, dict) for value in found.values()):
            check(**found)
            return found | {"made_from": check_chain(known["made_from"]) if "made_from" in known else ()}
    raise FormatError(f"expected notes of JSON objects, {DEEPEST} deep at most, with finite numbers, found others")


def plain(facts: Mapping[str, Any]) -> Notes:
    """Those of a source's facts that a file can hold. Others, lists and longer texts, are told when it is read."""
    return {name: value for name, value in facts.items() if _is_name(name) and _is(value, PLAIN)}


def check(options: Mapping[str, Any], metrics: Mapping[str, Any]) -> None:
    """Raises FormatError for options or metrics that a file must not hold (docs/format.md)."""
    facts = options.get(FACTS, {})
    if not isinstance(facts, dict):
        raise FormatError(f"{FACTS}: expected a JSON object, found another")
    own = {name: value for name, value in options.items() if name != FACTS}
    groups: dict[str, Mapping[str, Any]] = {"options": own, "metrics": metrics, FACTS: cast(Notes, facts)}
    for group, values in groups.items():
        if len(values) > MOST or not all(_is_name(name) and _is(value, PLAIN) for name, value in values.items()):
            raise FormatError(f"{group}: expected {EACH}, found others")
    for group, values in groups.items():
        for name, value in values.items():
            if not _is(value, KNOWN[group].get(name, PLAIN)):
                raise FormatError(f"{group}: {name}: expected {KNOWN[group][name]}, found {value!r:.60}")


def _finite(text: str) -> int | float:
    """A number in JSON. Raises ValueError for one that is not finite in double precision."""
    if not isfinite(float(text)):
        raise ValueError(text)
    return int(text) if text.lstrip("-").isdigit() else float(text)


def _shallow(value: Any, deepest: int) -> bool:
    """Whether objects and lists are nested at most `deepest` levels deep."""
    if not isinstance(value, dict | list):
        return True
    inner = cast("Iterable[Any]", value.values() if isinstance(value, dict) else value)
    return deepest > 0 and all(_shallow(each, deepest - 1) for each in inner)


def _is_name(name: str) -> bool:
    return len(name) <= LONGEST_NAME and _is_text(name)


def _is(value: Any, wanted: str) -> bool:
    """Whether a value is of one of the kinds above: PLAIN, NUMBER, WHOLE, FLAG or TEXT."""
    if value is None:
        return wanted == PLAIN
    if isinstance(value, bool):
        return wanted in (PLAIN, FLAG)
    if isinstance(value, int | float):
        kinds = (PLAIN, NUMBER, WHOLE) if isinstance(value, int) else (PLAIN, NUMBER)
        return wanted in kinds and abs(value) <= LARGEST  # False for NaN
    return isinstance(value, str) and wanted in (PLAIN, TEXT) and len(value) <= LONGEST_TEXT and _is_text(value)


def _is_text(value: str) -> bool:
    """Whether UTF-8 can encode it: a single half of a surrogate pair cannot be encoded."""
    return not any("\ud800" <= c <= "\udfff" for c in value)
