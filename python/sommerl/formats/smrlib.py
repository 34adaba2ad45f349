"""Libraries of materials, .smrlib, as a format; `compression.smrl.library_file` reads and writes them."""

from __future__ import annotations

from pathlib import Path

from ..compression.material import SomManBrdf
from ..compression.smrl import file
from ..compression.smrl.library_file import LibraryFile, looks_like
from ..compression.smrl.library_index import MOST_INFLATED
from ..system.door import File
from ..system.errors import FormatError, told_of
from .format import Format

MOST_READ = MOST_INFLATED + file.LONGEST_FILE + 2**12  # bytes: index, one material, and the head


def parse(path: Path, opened: File, member: str) -> SomManBrdf:
    """One of the materials in a library; its name may be left out if it is the only one. Raises FormatError."""
    with told_of(path):
        library = LibraryFile(opened.part, opened.length)
        if not member and len(library.index) != 1:
            first = f", as {path}:{library.index.names()[0]}" if len(library.index) else ""
            raise FormatError(f"expected the name of one of its {len(library.index)} materials{first}")
        name = member or library.index.names()[0]
        data = library.data(name)
    return file.parse(Path(f"{path}:{name}"), data)


def names(path: Path, opened: File) -> list[str]:
    """The names of the materials in a library. Raises FormatError."""
    with told_of(path):
        return LibraryFile(opened.part, opened.length).index.names()


FORMAT = Format(
    "library",
    (".smrlib",),
    "compressed materials, which `library pack` writes; FILE.smrlib:NAME is one",
    sniff=looks_like,
    read=parse,
    largest=MOST_READ,
    opened=True,
    members=names,
)
