"""Checks a library: every file against its record, and every record against its file."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ..compression.smrl import file as smrl
from ..system import door
from ..system.errors import SommerlError
from .index import records
from .record import Record


@dataclass(frozen=True)
class Fault:
    """name: of the material, or "" for a file of none. file: as in `Record`. sentence: what is wrong."""

    name: str
    file: str
    sentence: str


def verify(folder: Path, progress: Callable[[int, int], None] | None = None) -> tuple[int, list[Fault]]:
    """The number of materials in a library, and what is wrong with any.

    progress: called with materials done, and in all. Raises SommerlError if the index, or a record, cannot be read.
    """
    known = records(folder)
    faults: list[Fault] = []
    for done, record in enumerate(known.values()):
        sentence = _fault(folder, record)
        if sentence:
            faults.append(Fault(record.name, record.file, sentence))
        if progress:
            progress(done + 1, len(known))
    files = {record.file for record in known.values()}
    unknown = [file for file in sorted(_files(folder)) if file not in files]
    faults += [Fault("", file, f"{folder / file}: expected a record of it, found none") for file in unknown]
    return len(known), faults


def _fault(folder: Path, record: Record) -> str:
    """What is wrong with a material's file; "" if nothing is."""
    path = folder / record.file
    if not os.path.lexists(path):
        return f"{path}: expected the file of {record.name}, found none"
    try:
        data = door.read(path, smrl.LONGEST_FILE)
        if len(data) != record.bytes:
            return f"{path}: expected {record.bytes} bytes, found {len(data)}"
        if hashlib.sha256(data).hexdigest() != record.sha256:
            return f"{path}: expected the checksum in its record, found another: the file has changed"
        smrl.parse(path, data)
    except SommerlError as error:
        return str(error)
    return ""


def _files(folder: Path) -> Iterator[str]:
    """All .smrl below a folder, as records name them; names that begin with a dot are passed over."""
    for place, folders, names in os.walk(folder):
        folders[:] = [each for each in folders if not each.startswith(".")]
        for name in names:
            if name.endswith(".smrl") and not name.startswith("."):
                yield Path(place, name).relative_to(folder).as_posix()
