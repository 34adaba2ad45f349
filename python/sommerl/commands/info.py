"""The command `info`: what a material is; of several, a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..formats.load import load
from ..reflectance.brdf import Brdf
from ..reflectance.info import Counts
from . import answers, console
from .arguments import Material, ReadingArguments, positional
from .inputs import expanded, readable
from .parser import add_command
from .rows import fact_rows, lobe_text, origin_rows, surface_text, text

COUNTS = tuple(asdict(Counts()))
HIDDEN = (
    "facts",
    "input",
    "lobes",
    "made_from",
    "measured_against",
    "surface",
)  # keys that people see in rows of their own
SIZES = ("bytes_paper", "bytes_memory", "bytes_disk")
COLUMNS = {
    "kind": "kind",
    "lattice": "lattice",
    "clusters": "palette",
    "interpolation": "lookup",
    "bytes_memory": "memory",
    "bytes_disk": "disk",
}


@dataclass(frozen=True, kw_only=True)
class InfoArguments(ReadingArguments):
    """What `info` is asked for."""

    materials: tuple[Material, ...] = positional(
        "MATERIAL", help="a file, a built-in name, a folder, or a pattern in quotes; several are shown as a table"
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Says what a material is: its lattice, its sizes, how it was made and how good it is."
    example = "sommerl info nickel.smrl\n  sommerl info nickel.binary nickel.smrl\n  sommerl info 'materials/*.smrl'"
    add_command(add, "info", info, InfoArguments, summary, example)


def info(options: InfoArguments) -> dict[str, Any]:
    sources = expanded(options.materials)
    if len(sources) > 1:
        sources = readable(sources, options.materials)
    found: list[Mapping[str, Any]] = []
    for source in sources:
        brdf = load(source)
        path = Path(source)
        found.append(answers.described(source, brdf, path.stat().st_size if path.is_file() else None))
        if len(sources) == 1 and not options.json:
            console.print_rows(source, _rows(found[0], brdf))
    if len(sources) > 1 and not options.json:
        _print_table(found)
    return answers.of_materials(found)


def _rows(known: Mapping[str, Any], brdf: Brdf) -> dict[str, str]:
    """All that is known of one material, for people."""
    apart = (*HIDDEN, *COUNTS)
    shown = {key: value for key, value in known.items() if value not in (None, "", {}) and key not in apart}
    rows = {key: console.size(value) if key in SIZES else text(value) for key, value in shown.items()}
    counted = {key: known[key] for key in COUNTS if known[key] is not None}
    rows |= fact_rows(counted | (known["facts"] or {})) | origin_rows(brdf)
    rows |= {f"lobe {number}": lobe_text(lobe) for number, lobe in enumerate(known["lobes"] or [], 1)}
    return rows | ({known["surface"]["model"]: surface_text(known["surface"])} if known["surface"] else {})


def _print_table(found: Sequence[Mapping[str, Any]]) -> None:
    """A row for each of several materials, with those columns that say something."""
    keys = [key for key in COLUMNS if any(each[key] is not None for each in found)]
    files = [Path(each["input"]).name for each in found]
    rows = [
        [
            file if files.count(file) == 1 else each["input"],
            *(_cell(key, each["preset"] or each[key] if key == "kind" else each[key]) for key in keys),
        ]
        for file, each in zip(files, found, strict=True)
    ]
    console.print_table(f"{len(found)} materials", ["material", *(COLUMNS[key] for key in keys)], rows)


def _cell(key: str, value: Any) -> str:
    if value is None:
        return ""
    return console.size(value) if key in SIZES else text(value).replace(" × ", "×")
