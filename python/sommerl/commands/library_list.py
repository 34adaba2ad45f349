"""The command `library list`: the materials of a library, as a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..library.finding import SORTED_BY, in_order
from ..library.library import Library
from . import console
from .arguments import Arguments, option, positional
from .library_rows import COLUMNS, answer, cells, described
from .parser import add_command


@dataclass(frozen=True, kw_only=True)
class ListArguments(Arguments):
    """What `library list` is asked for."""

    library: str = positional("LIBRARY", help="a folder, a .smrlib file, or the address of one")
    sort: str = option(default="name", choices=SORTED_BY, help="by what (%(default)s)")
    reverse: bool = option(default=False, help="the largest first")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Lists the materials of a library: size, quality, colour, gloss, metalness."
    example = "sommerl library list metals.smrlib --sort quality"
    add_command(add, "list", listed, ListArguments, summary, example)


def listed(options: ListArguments) -> dict[str, Any]:
    with Library(options.library) as library:
        records = in_order(library.records, options.sort, reverse=options.reverse)
        if not options.json:
            total = console.size(sum(record.bytes for record in records))
            console.print_table(f"{len(records)} materials, {total}", COLUMNS, [cells(record) for record in records])
        return answer([described(library, record) for record in records], library)
