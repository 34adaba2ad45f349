"""The records of a library's folder.

The folder holds the materials, NAME.smrl, and beside them `.sommerl`:

    .sommerl/records/NAME.json    the record of a material, written when its file is there
    .sommerl/index.json.gz        the records of all materials, put together when a build ends

A record of its own is newer than what the index says of that name. So a material joins the library by two files that
are written whole, whoever else builds at the same time, and thousands are read from one.
"""

from __future__ import annotations

import gzip
import os
import zlib
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, cast

from ..system import door
from ..system.errors import FormatError, MaterialError, SommerlError
from ..system.files import atomic_write, replacing_files
from .record import Record, as_json, from_json, parsed, written

INSIDE = ".sommerl"  # the folder in a library's that holds what is no material
KEY, VERSION = "sommerl_library", 1
LARGEST_RECORD, LARGEST_INDEX = 2**20, 2**28  # bytes, of an index when it is unpacked
GZIP = 16 + zlib.MAX_WBITS  # zlib's number for the format


def records(folder: str | Path) -> dict[str, Record]:
    """The materials of a library's folder by their names, sorted.

    Raises MaterialError for a folder that holds no library, FormatError for a record or an index that is damaged.
    """
    folder = Path(folder)
    if not is_library(folder):
        raise MaterialError(f"{folder}: expected a library, as `sommerl library build` makes it, found none")
    # Those of their own first: a build that ends meanwhile puts them into the index, and then removes them.
    single = [_read_record(path) for path in record_files(folder)]
    found = {record.name: record for record in _read_index(folder)}
    found |= {record.name: record for record in single if record}
    files: dict[str, str] = {}
    for record in found.values():
        if (other := files.setdefault(record.file, record.name)) != record.name:
            raise FormatError(f"{folder}: expected a file for each material, found {record.file} for {other}, too")
    return dict(sorted(found.items()))


def is_library(folder: Path) -> bool:
    """Whether a build has begun to make a library of the folder."""
    return (folder / INSIDE).is_dir()


def record_path(folder: Path, file: str) -> Path:
    """Where the record of a material's file is. file: as in `Record`."""
    return folder / INSIDE / "records" / f"{file.removesuffix('.smrl')}.json"


def index_path(folder: Path) -> Path:
    return folder / INSIDE / "index.json.gz"


def record_files(folder: Path) -> list[Path]:
    """The files of records that are not in the index yet, sorted."""
    top = folder / INSIDE / "records"
    return sorted(
        Path(place, name)
        for place, _, names in os.walk(top, onerror=_raise)
        for name in names
        if name.endswith(".json")
    )


def write_record(folder: Path, record: Record) -> None:
    """Writes a record of its own. Raises OSError."""
    path = record_path(folder, record.file)
    path.parent.mkdir(parents=True, exist_ok=True)
    with _own(path) as out:
        out.write(written({KEY: VERSION, "record": as_json(record)}))


def write_index(folder: Path, all_records: Mapping[str, Record]) -> None:
    """Puts all records together, and removes those of their own. Nobody else may be building. Raises OSError."""
    single = record_files(folder)
    said = {KEY: VERSION, "records": [as_json(all_records[name]) for name in sorted(all_records)]}
    data = gzip.compress(written(said), mtime=0)
    if not (index_path(folder).is_file() and index_path(folder).read_bytes() == data):
        with _own(index_path(folder)) as out:
            out.write(data)
    for path in single:
        path.unlink()
    remove_empty({path.parent for path in single}, folder / INSIDE)


@contextmanager
def _own(path: Path) -> Generator[BinaryIO]:
    """A file within INSIDE to write to, where all files are Sommerl's: whatever is there is replaced."""
    with replacing_files(overwrite=True), atomic_write(path) as out:
        yield out


def remove_empty(folders: Iterable[Path], top: Path) -> None:
    """Removes folders, and those that they are in up to `top`, if nothing is in them."""
    for folder in folders:
        for each in (folder, *folder.parents):
            if each == top:
                break
            try:
                each.rmdir()
            except OSError:
                break


def _read_record(path: Path) -> Record | None:
    """The record in a file; None if a build that ended has put it into the index."""
    try:
        said = _top(door.read(path, LARGEST_RECORD))
        return from_json(said.get("record"))
    except SommerlError as error:
        if not os.path.lexists(path):
            return None
        raise _named(path, error) from error


def _read_index(folder: Path) -> list[Record]:
    path = index_path(folder)
    if not os.path.lexists(path):
        return []
    try:
        found = _top(_unpacked(door.read(path, LARGEST_INDEX))).get("records")
        if not isinstance(found, list):
            raise FormatError("records: expected a list, found another")
        return [from_json(each) for each in cast(list[Any], found)]
    except SommerlError as error:
        raise _named(path, error) from error


def _named(path: Path, error: SommerlError) -> FormatError:
    """The error, with the file's name before it if it is not there yet."""
    return FormatError(str(error) if str(error).startswith(f"{path}: ") else f"{path}: {error}")


def _unpacked(data: bytes) -> bytes:
    unpacker = zlib.decompressobj(GZIP)
    try:
        content = unpacker.decompress(data, LARGEST_INDEX)
    except zlib.error as error:
        raise FormatError(f"expected a file packed by gzip, found another or a damaged one ({error})") from error
    if not unpacker.eof or unpacker.unused_data:
        raise FormatError("expected one file packed by gzip, whole, found a part of one or more")
    return content


def _top(data: bytes) -> dict[str, Any]:
    found = parsed(data)
    if not isinstance(found, dict) or cast(dict[str, Any], found).get(KEY) != VERSION:
        raise FormatError(f'expected an object with "{KEY}": {VERSION}, found another')
    return cast(dict[str, Any], found)


def _raise(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):
        raise error
