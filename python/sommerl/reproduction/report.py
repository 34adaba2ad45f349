"""The report: what every item shows, with the paper's numbers beside ours, as plain values for JSON."""

from __future__ import annotations

import datetime
import os
import platform
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

from .. import __version__
from .cells import Outcome, Setting, kind_of
from .items import ITEMS
from .printed import Printed, printed
from .section import Ours, Section

MARK = "sommerl_paper"  # the first key of the JSON, by which it is known
FORMAT = 1
VERDICTS = ("reproduced", "better", "worse", "not comparable", "not measured")
PACKAGES = ("numpy", "scipy", "mitsuba", "drjit")
DIGITS = 6


@dataclass(frozen=True)
class Report:
    """content: for JSON. pictures: the bytes of the files that it names."""

    content: dict[str, Any]
    pictures: Mapping[str, bytes] = field(default_factory=dict[str, bytes])


def made(items: Sequence[str], setting: Setting, outcomes: Mapping[str, Outcome], command: str) -> Report:
    """The report on some items. outcomes: of all their cells. command: what made it, without its options."""
    pictures: dict[str, bytes] = {}
    found: list[dict[str, Any]] = []
    for name in items:
        own = {cell.name: outcomes[cell.name] for cell in ITEMS[name].plan(setting)}
        found.append(_item(name, ITEMS[name].show(setting, own), command, pictures))
    verdicts = Counter(number["verdict"] for item in found for number in item["numbers"])
    content = {
        MARK: FORMAT,
        "title": "Representing BRDFs Using SOMs and MANs, reproduced",
        "data": setting.data.caption,
        "extent": setting.extent.name,
        "figure": setting.mesh.name if setting.mesh and "fig1" in items else None,
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "versions": {"sommerl": __version__, "python": platform.python_version(), **_versions()},
        "machine": _machine(),
        "seconds": round(sum(outcome.seconds for outcome in outcomes.values())),
        "verdicts": {verdict: verdicts[verdict] for verdict in VERDICTS},
        "items": found,
    }
    return Report(content, pictures)


def _item(name: str, section: Section, command: str, pictures: dict[str, bytes]) -> dict[str, Any]:
    shown: list[dict[str, Any]] = []
    for place, each in enumerate(section.pictures):
        files = [
            f"pictures/{name}-{place + 1}{suffix}.{kind_of(data)}"
            for suffix, data in (("", each.image), ("-difference", each.below))
            if data
        ]
        pictures |= dict(zip(files, (data for data in (each.image, each.below) if data), strict=True))
        below = files[1] if each.below else None
        shown.append({"caption": each.caption, "file": files[0], "difference": below, "wide": each.wide})
    return {
        "name": name,
        "title": ITEMS[name].title,
        "about": ITEMS[name].about,
        "command": f"{command} {name}",
        "sentences": list(section.sentences),
        "numbers": [number(one, section.ours.get(key), f"{command} {name}") for key, one in printed(name).items()],
        "tables": [
            {"title": t.title, "columns": list(t.columns), "rows": [list(r) for r in t.rows]} for t in section.tables
        ],
        "pictures": shown,
    }


def number(of: Printed, ours: Ours | None, command: str) -> dict[str, Any]:
    """A number of the paper beside ours."""
    default, eq2 = (ours.default, ours.printed) if ours else (None, None)
    return {
        "key": of.key,
        "place": of.place,
        "unit": of.unit,
        "paper": of.value,
        "eq2": _rounded(eq2),
        "default": _rounded(default),
        "interval": [_rounded(end) for end in ours.interval] if ours and ours.interval else None,
        "difference": None if default is None else _rounded(default - of.value),
        "verdict": of.verdict(default),
        "verdict_eq2": None if eq2 is None else of.verdict(eq2),
        "reason": _reason(of, default),
        "command": f"{command} --only {ours.only}" if ours else command,
    }


def _reason(of: Printed, ours: float | None) -> str:
    verdict = of.verdict(ours)
    if verdict == "not comparable":
        return of.incomparable
    if verdict == "reproduced":
        return f"within {of.tolerance:.3g} {of.unit}".rstrip()
    if verdict == "not measured":
        return "left out of this run"
    return of.note or ("more than" if (ours or 0.0) > of.value else "less than") + " the paper has"


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{DIGITS}g}")


def _versions() -> dict[str, str]:
    found: dict[str, str] = {}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def _machine() -> str:
    """The processor, as the system calls it, and how many of them there are."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            name = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        pass
    return f"{name}, {os.cpu_count()} processors, {platform.system()}"
