"""The report as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .report import VERDICTS

MARK = "<!-- Written by Sommerl -->"
MANY = 1e5  # from here on, numbers are whole and have commas
HEADINGS = ("", "paper", "Eq. 2 as printed", "default", "difference", "verdict")


def document(content: Mapping[str, Any]) -> str:
    """The whole report."""
    lines = [MARK, "", f"# {content['title']}", "", *_head(content), ""]
    for item in content["items"]:
        lines += [f"## {item['title']}", "", item["about"], "", f"    {item['command']}", ""]
        for sentence in item["sentences"]:
            lines += [f"* {sentence}"]
        lines += [""] if item["sentences"] else []
        if item["numbers"]:
            lines += [*_numbers(item["numbers"]), ""]
        for table in item["tables"]:
            lines += [f"**{table['title']}**", "", *_table(table["columns"], table["rows"]), ""]
        for picture in item["pictures"]:
            files = [picture["file"], *([picture["difference"]] if picture["difference"] else [])]
            lines += [" ".join(f"![{picture['caption']}]({file})" for file in files), "", f"*{picture['caption']}*", ""]
    return "\n".join(lines).rstrip() + "\n"


def of_number(value: float | None, unit: str) -> str:
    """A number as both pages show it."""
    if value is None:
        return "–"
    if unit == "dB":
        return f"{value:.2f} dB"
    return f"{value:,.0f} {unit}".rstrip() if abs(value) >= MANY else f"{value:.5g} {unit}".rstrip()


def of_difference(number: Mapping[str, Any]) -> str:
    if number["difference"] is None:
        return "–"
    return f"{number['difference']:+.2f}" if number["unit"] == "dB" else f"{number['difference']:+.3g}"


def of_interval(number: Mapping[str, Any]) -> str:
    """A confidence interval, with a space before it, if there is one."""
    found = number["interval"]
    return f" ({found[0]:.3f} to {found[1]:.3f})" if found else ""


def reasons(numbers: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """A letter for each reason that several numbers share or have, in the order in which they come."""
    found = dict.fromkeys(number["reason"] for number in numbers if number["verdict"] != "reproduced")
    return {reason: chr(ord("a") + place) for place, reason in enumerate(found)}


def _head(content: Mapping[str, Any]) -> list[str]:
    versions = ", ".join(f"{name} {version}" for name, version in content["versions"].items())
    counts = ", ".join(
        f"{content['verdicts'][verdict]} {verdict}" for verdict in VERDICTS if content["verdicts"][verdict]
    )
    return [
        f"Made from {content['data']}, none of which are MERL's measurements unless this says so. {content['date']}; "
        f"{versions}; "
        f"{content['machine']}; {content['seconds']} s of work in all; a {content['extent']} run.",
        "",
        f"**Of the paper's numbers: {counts}.** The verdict is the default's. PSNRs are over the frame: the paper "
        f"does not tell "
        "whether its background counts.",
    ]


def _numbers(numbers: Sequence[Mapping[str, Any]]) -> list[str]:
    letters = reasons(numbers)
    rows = [
        [
            number["key"].replace("/", ", "),
            of_number(number["paper"], number["unit"]),
            of_number(number["eq2"], number["unit"]) + (" (worse)" if number["verdict_eq2"] == "worse" else ""),
            of_number(number["default"], number["unit"]) + of_interval(number),
            of_difference(number),
            _verdict(number["verdict"]) + (f" ({letters[number['reason']]})" if number["reason"] in letters else ""),
        ]
        for number in numbers
    ]
    notes = [f"{letter}: {reason}." for reason, letter in letters.items()]
    return [*_table(HEADINGS, rows), "", *(f"{note}  " for note in notes), "", f"One alone: `{numbers[0]['command']}`"]


def _verdict(verdict: str) -> str:
    return f"**{verdict}**" if verdict == "worse" else verdict


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A table; vertical bars in cells are escaped."""
    cells = [[cell.replace("|", "\\|") for cell in row] for row in (columns, *rows)]
    lines = ["| " + " | ".join(row) + " |" for row in cells]
    return [lines[0], "|" + "---|" * len(columns), *lines[1:]]
