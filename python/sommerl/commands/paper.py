"""The command `paper`: the paper's figures, tables, sizes and claims, measured again, in one report."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..reproduction.cells import FULL, QUICK, Cell, Setting, Store
from ..reproduction.data import Data
from ..reproduction.items import ALL, ITEMS
from ..reproduction.markdown import document, of_difference, of_number
from ..reproduction.page import page
from ..reproduction.report import Report, made
from ..reproduction.runner import run
from ..system.errors import FormatError, OptionError
from ..system.files import atomic_write, check_writable
from ..system.near import did_you_mean
from . import console
from .arguments import WritingArguments, option, positional
from .folders import make_folder
from .parser import add_command

CELLS = "cells"  # the folder of what is measured
WHOLE = "report"  # what the report of all items is called
COMMAND = "sommerl paper"
COLUMNS = ("", "paper", "Eq. 2\nas printed", "default", "difference", "verdict")


@dataclass(frozen=True, kw_only=True)
class PaperArguments(WritingArguments):
    """What `paper` is asked for."""

    item: str = positional("ITEM", default="all", choices=[*ITEMS, "all"], help="one of those below (%(default)s)")
    data: Path | None = option(
        default=None,
        metavar="DIR",
        help="a folder with a file for each material, like purple-paint.binary, or an .npz archive of neural BRDFs; "
        "if not given, the stand-ins that come along",
    )
    called: str | None = option(
        default=None, metavar="TEXT", help="what the report calls these data, like 'NP stand-ins' (the folder's name)"
    )
    mesh: Path | None = option(
        default=None, metavar="FILE", help="the figure of Fig. 1, .obj or .ply (a built-in one; the paper has a Buddha)"
    )
    only: str | None = option(default=None, metavar="CELL", help="measure just this part of ITEM, like spheres of fig5")
    quick: bool = option(
        default=False, help="try all parts, in minutes: with tiny pictures, whose numbers mean nothing"
    )
    out: Path = option(
        "-o",
        default=Path("paper"),
        metavar="DIR",
        help="folder of the report; a run that was stopped goes on (%(default)s)",
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Makes the paper's figures, tables and claims again, beside the numbers that it prints."
    example = "sommerl paper all --data MERL -o paper"
    items = "\n".join(f"  {name:11}{item.title}" for name, item in ITEMS.items())
    add_command(
        add,
        "paper",
        paper,
        PaperArguments,
        summary,
        example,
        explained=[f"Items:\n{items}\n  all        all but benchmark"],
    )


def paper(options: PaperArguments) -> dict[str, Any]:
    """Measures what the items need, and writes the report. Raises FormatError if there is no such data."""
    for path, what in ((options.data, "a folder or an archive of materials"), (options.mesh, "a mesh")):
        if path and not path.exists():
            raise FormatError(f"{path}: expected {what}, found none")
    setting = Setting(Data(options.data, options.called), QUICK if options.quick else FULL, options.mesh)
    items = ALL if options.item == "all" else (options.item,)
    cells = list({cell.name: cell for name in items for cell in ITEMS[name].plan(setting)}.values())
    result: dict[str, Any] = {"input": str(options.data) if options.data else None, "data": setting.data.caption}
    if options.only:
        cells = [_named(options, cells)]
    name = WHOLE if options.item == "all" else options.item
    files = [options.out / f"{name}.{extension}" for extension in ("html", "md", "json")]
    make_folder(options.out)
    for path in [] if options.only else files:
        check_writable(path)
    outcomes = run(cells, setting, Store(options.out / CELLS), console.progress)
    if options.only:
        values = outcomes[cells[0].name].values
        if not options.json:
            console.print_rows(cells[0].name, {key: json.dumps(value) for key, value in values.items()})
        return result | {"output": [], "values": dict(values)}
    report = made(items, setting, outcomes, COMMAND)
    written = _write(options.out, files, report)
    if not options.json:
        _show(report.content)
        console.say("→ " + ", ".join(map(str, files)), "")
    return result | {
        "output": list(map(str, written)),
        "verdicts": report.content["verdicts"],
        "items": report.content["items"],
    }


def _named(options: PaperArguments, cells: list[Cell]) -> Cell:
    """The one cell that is asked for, by its name within the item. Raises OptionError if there is none."""
    known = {cell.name.removeprefix(f"{options.item}/"): cell for cell in cells}
    assert options.only
    if options.only not in known:
        hint = did_you_mean(options.only, known) or f"; there are {', '.join(known)}"
        raise OptionError(f"--only: expected a part of {options.item}, found {options.only}{hint}")
    return known[options.only]


def _write(folder: Path, files: list[Path], report: Report) -> list[Path]:
    """The report in three forms, and its pictures, which two of them name."""
    written: list[Path] = []
    for name, data in report.pictures.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        with atomic_write(path) as out:
            out.write(data)
        written.append(path)
    texts = page(report), document(report.content), json.dumps(report.content, indent=1, ensure_ascii=False) + "\n"
    for path, text in zip(files, texts, strict=True):
        with atomic_write(path) as out:
            out.write(text.encode())
    return [*files, *written]


def _show(content: dict[str, Any]) -> None:
    """On standard output: the numbers of each item, and what was found."""
    for item in content["items"]:
        rows = [
            [
                number["key"].replace("/", ", "),
                *(of_number(number[key], number["unit"]) for key in ("paper", "eq2", "default")),
                of_difference(number),
                number["verdict"],
            ]
            for number in item["numbers"]
        ]
        if rows:
            console.print_table(f"{item['title']}, of {content['data']}", COLUMNS, rows)
        console.say(*item["sentences"])
