"""The command `paper`: the paper's tables and figures, written to a folder and shown."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import chain
from pathlib import Path
from typing import Any

from ..fitting.options import FitOptions
from ..reproduction import tables
from ..reproduction.data import described
from ..system.errors import FormatError
from ..system.files import atomic_write, check_writable
from . import console
from .arguments import WritingArguments, named_as_typed, option, positional
from .folders import make_folder
from .parser import add_command

DEFAULTS = FitOptions()


TITLES = {
    "table1": "Table 1: errors of two-lobe fits",
    "fig5": "Fig. 5: blue-metallic-paint on a sphere",
    "fig6": "Fig. 6: errors of three-lobe fits to green-metallic-paint",
}
DRAWN = ("fig5", "fig6")  # items with a picture beside their table

HEADINGS = {  # in short lines, so that a table of errors fits 80 columns
    "model": "model",
    "error": "table",
    "error_som_man": "M = 1000,\ndefault",
    "error_printed": "M = 1000,\nEq. 2 as\nprinted",
    "paper": "paper:\ntable",
    "paper_som_man": "paper:\nours",
    "psnr_frame_db": "PSNR, frame",
    "psnr_object_db": "PSNR, object",
    "paper_db": "paper",
}


@dataclass(frozen=True, kw_only=True)
class PaperArguments(WritingArguments):
    """What `paper` is asked for."""

    item: str = positional("ITEM", default="all", choices=[*TITLES, "all"], help="one of those below (%(default)s)")
    data: Path | None = option(
        default=None,
        metavar="DIR",
        help="a folder with a file for each material, like purple-paint.binary, or an .npz archive of neural BRDFs; "
        "if not given, the built-in stand-ins",
    )
    out: Path = option("-o", default=Path("paper"), metavar="DIR", help="folder for tables and pictures (%(default)s)")
    samples: int = option(
        default=DEFAULTS.samples, metavar="N", help="pairs of directions that models are fitted to (%(default)s)"
    )
    seed: int = option(default=DEFAULTS.seed, metavar="N", help="of directions and starts (%(default)s)")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Makes the paper's tables and figures again, beside the figures that it prints."
    example = "sommerl paper table1 --data MERL -o paper"
    items = "\n".join(f"  {name:8}{title}" for name, title in TITLES.items())
    add_command(add, "paper", paper, PaperArguments, summary, example, explained=[f"Items:\n{items}"])


def paper(options: PaperArguments) -> dict[str, Any]:
    """Makes the items asked for. Raises FormatError if there is no such data."""
    if options.data and not options.data.exists():
        raise FormatError(f"{options.data}: expected a folder or an archive of materials, found none")
    with named_as_typed():
        chosen = FitOptions(samples=options.samples, seed=options.seed)
    make_folder(options.out)
    of_what = described(options.data)
    result: dict[str, Any] = {"input": str(options.data) if options.data else None, "data": of_what, "output": []}
    files = {
        item: [options.out / f"{item}.{extension}" for extension in ("csv", "png")[: 2 if item in DRAWN else 1]]
        for item in (TITLES if options.item == "all" else [options.item])
    }
    for path in chain(*files.values()):
        check_writable(path)
    for item, written in files.items():
        title = TITLES[item]
        with console.progress(title) as advance:
            rows = [asdict(row) for row in _made(item, options.data, chosen, written[-1], advance)]
        _write(written[0], rows)
        result[item] = rows
        result["output"] += map(str, written)
        if not options.json:
            _show(f"{title}, of {of_what}", rows)
            console.say("→ " + ", ".join(map(str, written)), "")
    return result


def _made(
    item: str, data: Path | None, options: FitOptions, picture: Path, progress: tables.Progress | None
) -> Sequence[tables.FitRow] | Sequence[tables.ImageRow]:
    """The rows of an item; its picture, if it has one, is written."""
    if item == "table1":
        return tables.table1(data, options, progress=progress)
    if item == "fig5":
        return tables.figure5(data, picture, options, progress=progress)
    return tables.figure6(data, picture, options, progress=progress)


def _show(title: str, rows: Sequence[dict[str, Any]]) -> None:
    """On standard output, a table for each material."""
    for material in dict.fromkeys(row.get("material") for row in rows):
        shown: list[list[str]] = []
        for row in rows:
            if row.get("material") == material:
                found = [value for key, value in row.items() if key != "material"]
                shown.append([f"{value:.5g}" if isinstance(value, float) else str(value) for value in found])
        columns = [HEADINGS[key] for key in rows[0] if key != "material"]
        console.print_table(f"{title}: {material}" if material else title, columns, shown)


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    with atomic_write(path) as out:
        out.write(text.getvalue().encode())
