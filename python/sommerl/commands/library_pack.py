"""The command `library pack`: a library's folder into one file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..library.library import Library
from ..library.pack import EXTENSION, pack
from ..library.share import LARGEST_PART, SMALLEST_PART, pack_shared
from ..system.errors import OptionError
from ..system.first_few import first_few
from . import console
from .arguments import WritingArguments, byte_count, named_as_typed, option, positional
from .checks import check_output
from .library_rows import PICTURES, quality
from .parser import add_command


@dataclass(frozen=True, kw_only=True)
class PackArguments(WritingArguments):
    """What `library pack` is asked for."""

    library: str = positional("LIBRARY", help="a folder that `library build` made")
    output: Path = option("-o", metavar="FILE", help=f"a name that ends in {EXTENSION}")
    shared: int | None = option(
        default=None,
        metavar="BYTES",
        read=byte_count,
        help="let materials share lattices: each is compressed anew, from its source, to at most that size, "
        f"{SMALLEST_PART} to {LARGEST_PART} bytes, also as 0.4kB",
    )
    sources: Path | None = option(
        default=None, metavar="IN", help="for --shared: the folder that the library was built from"
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Puts a library into one file, of which FILE.smrlib:NAME is a material for every command."
    example = """sommerl library pack metals/ -o metals.smrlib
  sommerl library pack metals/ -o small.smrlib --shared 400 --sources measured/
  sommerl view metals.smrlib:nickel"""
    add_command(add, "pack", packed, PackArguments, summary, example)


def packed(options: PackArguments) -> dict[str, Any]:
    """Packs a library. Raises OptionError for one of --shared and --sources without the other."""
    check_output(options.output, (EXTENSION,), options.library)
    if (options.shared is None) != (options.sources is None):
        raise OptionError("--shared, --sources: expected both or neither; materials are compressed from their sources")
    found = {"input": options.library, "output": str(options.output)}
    with Library(options.library) as library:
        if options.shared is not None and options.sources is not None:
            return found | _shared(options, library, options.sources, options.shared)
        with console.progress("packing") as advance:
            written = pack(library, options.output, progress=advance)
        materials, count = sum(record.bytes for record in library.records), len(library)
    if not options.json:
        more = (written - materials) / count
        console.say(f"{count} materials → {options.output} ({console.size(written)}, {more:.0f} B each for the index)")
    return {"materials": [], **found, "bytes_disk": written, "count": count, "bytes_materials": materials}


def _shared(options: PackArguments, library: Library, sources: Path, size: int) -> dict[str, Any]:
    count = len(library)
    with console.progress("packing") as advance, named_as_typed():
        done = pack_shared(library, sources, options.output, size, progress=advance)
    if done.whole:
        console.warn(f"{first_few(list(done.whole))}: as in the library, since no shared lattice can hold them")
    measured = quality(done.metrics)
    if not options.json:
        each = done.bytes_disk / count
        said = f"{console.size(done.bytes_disk)}, {each:.0f} B each, of which {done.bytes_shared / count:.0f} B shared"
        means = ", ".join(
            f"{measured[key]['mean']:.1f} dB {where}" for key, where in PICTURES.items() if key in measured
        )
        console.say(f"{count} materials → {options.output} ({said}{'; ' + means if means else ''})")
    materials = [{"name": name} | dict(metrics) for name, metrics in done.metrics.items()]
    sizes = {"bytes_disk": done.bytes_disk, "bytes_shared": done.bytes_shared, "count": count}
    return {"materials": materials, **sizes, "whole": dict(done.whole), "quality": measured}
