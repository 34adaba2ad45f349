"""The command `library pack`: a library's folder into one file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..library.library import Library
from ..library.pack import EXTENSION, pack
from . import console
from .arguments import WritingArguments, option, positional
from .checks import check_output
from .parser import add_command


@dataclass(frozen=True, kw_only=True)
class PackArguments(WritingArguments):
    """What `library pack` is asked for."""

    library: str = positional("LIBRARY", help="a folder that `library build` made")
    output: Path = option("-o", metavar="FILE", help=f"a name that ends in {EXTENSION}")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Puts a library into one file, of which FILE.smrlib:NAME is a material for every command."
    example = "sommerl library pack metals/ -o metals.smrlib\n  sommerl view metals.smrlib:nickel"
    add_command(add, "pack", packed, PackArguments, summary, example)


def packed(options: PackArguments) -> dict[str, Any]:
    check_output(options.output, (EXTENSION,), options.library)
    with Library(options.library) as library, console.progress("packing") as advance:
        written = pack(library, options.output, progress=advance)
        materials = sum(record.bytes for record in library.records)
        count = len(library)
    if not options.json:
        more = (written - materials) / count
        console.say(f"{count} materials → {options.output} ({console.size(written)}, {more:.0f} B each for the index)")
    found = {"input": options.library, "output": str(options.output), "bytes_disk": written}
    return {"materials": [], **found, "count": count, "bytes_materials": materials}
