"""The numbers that the paper prints, from expected.toml, and how ours compare with them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Literal

Better = Literal["higher", "lower", "near"]
Verdict = Literal["reproduced", "better", "worse", "not comparable", "not measured"]

WORDS = ("place", "unit", "better", "tolerance", "tolerance_percent", "incomparable", "note", "columns")
PUBLISHED = "published"  # the table of what others publish


@dataclass(frozen=True)
class Printed:
    """A number of the paper.

    key: its name within its item, like "purple-paint/ward/table". place: in the paper. better: which of ours would be
    better. tolerance: how far ours may be from it, in its unit, and count as reproduced. incomparable: why it is no
    fault if ours is not; "" if it is one. note: what has to be known.
    """

    key: str
    value: float
    place: str
    unit: str
    better: Better
    tolerance: float
    incomparable: str
    note: str

    def verdict(self, ours: float | None) -> Verdict:
        """Of a number of ours; None if it was not measured."""
        if ours is None:
            return "not comparable" if self.incomparable else "not measured"
        more = ours - self.value
        if abs(more) <= self.tolerance:
            return "reproduced"
        if self.incomparable:
            return "not comparable"
        good = {"higher": more > 0, "lower": more < 0, "near": False}[self.better]
        return "better" if good else "worse"


@cache
def printed(item: str) -> Mapping[str, Printed]:
    """The numbers of an item, by their keys, in the paper's order; none for an item without any."""
    return {each.key: each for each in _numbers(_all().get(item, {}), "", {})}


def items() -> list[str]:
    """The items that have numbers."""
    return [name for name in _all() if name != PUBLISHED]


def published() -> Mapping[str, Mapping[str, Any]]:
    """What others publish of their representations, by their names: psnr_db, bytes, shared, source."""
    return _all()[PUBLISHED]


@cache
def _all() -> dict[str, Any]:
    return tomllib.loads(resources.files("sommerl.reproduction").joinpath("expected.toml").read_text("utf-8"))


def _numbers(table: Mapping[str, Any], above: str, words: Mapping[str, Any]) -> Iterator[Printed]:
    """The numbers in a table and below. above: what their keys begin with. words: what holds for them."""
    found = dict(words)
    if "tolerance_percent" in table:
        found.pop("tolerance", None)
    found |= {word: table[word] for word in WORDS if word in table}
    for name, value in table.items():
        if name in WORDS:
            continue
        key = f"{above}/{name}" if above else name
        if isinstance(value, dict):
            yield from _numbers(value, key, found)  # pyright: ignore[reportUnknownArgumentType]
        elif isinstance(value, list):
            for column, number in zip(found["columns"], value, strict=True):  # pyright: ignore
                yield _one(f"{key}/{column}", float(number), found)  # pyright: ignore
        else:
            yield _one(key, float(value), found)


def _one(key: str, value: float, words: Mapping[str, Any]) -> Printed:
    tolerance = words["tolerance"] if "tolerance" in words else abs(value) * words["tolerance_percent"] / 100
    return Printed(
        key,
        value,
        words["place"],
        words["unit"],
        words["better"],
        float(tolerance),
        words.get("incomparable", ""),
        words.get("note", ""),
    )
