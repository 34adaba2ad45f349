"""The command `library sheet`: a page with a picture of each material of a library."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..library.finding import SORTED_BY, in_order
from ..library.library import Library
from ..system.errors import OptionError
from ..system.files import atomic_write
from ..viewer.sheet import Shown, sheet
from ..viewer.thumbnails import thumbnail
from . import console
from .arguments import WritingArguments, option, positional
from .checks import check_output
from .library_rows import answer, argument, described
from .parser import add_command

EXTENSION = ".html"
LARGEST_PAGE = 2**28  # bytes: browsers do not take much longer ones


@dataclass(frozen=True, kw_only=True)
class SheetArguments(WritingArguments):
    """What `library sheet` is asked for."""

    library: str = positional("LIBRARY", help="a folder, a .smrlib file, or the address of one")
    output: Path = option("-o", metavar="PAGE", help="an .html, which needs nothing else")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Writes one page with a picture of each material of a library, of which a click opens the viewer."
    example = "sommerl library sheet metals.smrlib -o metals.html"
    add_command(add, "sheet", sheeted, SheetArguments, summary, example)


def sheeted(options: SheetArguments) -> dict[str, Any]:
    check_output(options.output, (EXTENSION,), options.library)
    with Library(options.library, cache=0) as library:
        records = in_order(library.records, next(iter(SORTED_BY)))
        _check_size(sum(record.bytes for record in records))
        shown: list[Shown] = []
        with console.progress("drawing") as advance:
            for number, record in enumerate(records, 1):
                picture = thumbnail(library[record.name])
                shown.append(Shown(record, argument(library, record), library.data(record.name), picture))
                if advance:
                    advance(number, len(records))
        made = sheet(Path(options.library).stem or options.library, shown).encode()
        _check_size(len(made))
        with atomic_write(options.output) as out:
            out.write(made)
        if not options.json:
            console.say(f"{len(shown)} materials → {options.output} ({console.size(len(made))})")
        rows = [described(library, record) for record in records]
        return answer(rows, library, output=str(options.output), bytes_page=len(made))


def _check_size(size: int) -> None:
    if size > LARGEST_PAGE:
        most, found = console.size(LARGEST_PAGE), console.size(size)
        raise OptionError(f"LIBRARY: expected materials for a page of at most {most}, found {found}")
