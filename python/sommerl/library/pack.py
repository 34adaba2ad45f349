"""Puts a library into one file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..compression.smrl import library_file
from ..system.errors import MaterialError, OptionError
from ..system.files import atomic_write
from .library import Library, entry_of

EXTENSION = ".smrlib"


def pack(library: Library, path: str | Path, *, progress: Callable[[int, int], None] | None = None) -> int:
    """Writes a library as one file (.smrlib); returns its length [bytes]. The same library gives the same bytes.

    progress: called with materials done and in all; each is read twice. Raises MaterialError for an empty library,
    OptionError if the name does not end in .smrlib, FormatError for a material that is damaged, and OSError if the file
    cannot be written.
    """
    path = Path(path)
    check_packed(library, path)
    done = 0

    def read(name: str) -> bytes:
        nonlocal done
        done += 1
        if progress:
            progress(done, 2 * len(library))
        return library.data(name)

    with atomic_write(path) as out:
        return library_file.write(out, [entry_of(record) for record in library.records], read)


def check_packed(library: Library, path: Path) -> None:
    """Raises MaterialError for an empty library, and OptionError for a name that does not end in .smrlib."""
    if path.suffix.lower() != EXTENSION:
        raise OptionError(f"{path}: expected a name that ends in {EXTENSION}, found {path.suffix!r}")
    if not library:
        raise MaterialError(f"{library.path}: expected materials in it, found none")
