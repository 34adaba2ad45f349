"""A library as a mapping: materials by their names, read when they are asked for."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from threading import Lock
from typing import Any, Protocol, Self

from ..compression.material import SomManBrdf
from ..compression.smrl import file
from ..compression.smrl.library_file import LibraryFile
from ..compression.smrl.library_index import Entry
from ..system import door
from ..system.errors import FormatError, MaterialError, told_of
from ..system.near import did_you_mean
from . import index, remote
from .record import Record

CACHE = 2**27  # bytes
NEAREST = 3  # names that are told if there is none of the name asked for


class NoSuchMaterial(MaterialError, KeyError):
    """A library has no material of a name."""

    __str__ = Exception.__str__  # KeyError's own quotes the sentence


class Store(Protocol):
    """Where a library's materials are."""

    def names(self) -> list[str]: ...
    def __contains__(self, name: str) -> bool: ...
    def record(self, name: str) -> Record: ...
    def data(self, name: str) -> bytes:
        """The .smrl of a material, whose checksum is right. Raises FormatError."""
        ...


class Library(Mapping[str, SomManBrdf]):
    """The materials of a library, by their names: `Library("metals.smrlib")["nickel"]`.

    path: a folder that `sommerl library build` made, a .smrlib file, or the address of one, like https://… or s3://…,
        which takes the packages of sommerl[library]. Of a file, only the index is read, and then what is asked for.
    cache: the most bytes that decoded materials may take in memory (`Brdf.bytes_memory`) to be given again without
        being read; those that were asked for last are kept.

    Threads may ask at the same time. Raises MaterialError for what is no library, FormatError for a damaged one, and
    MissingDependencyError without a package that an address needs.

    >>> library = Library("metals.smrlib")
    >>> library.names, library["nickel"].compressed
    (['blue', 'nickel'], True)
    """

    def __init__(self, path: str | Path, *, cache: int = CACHE) -> None:
        self.path = str(path)
        self._stack = ExitStack()
        self._store = self._opened()
        self._most, self._lock = cache, Lock()
        self._kept: OrderedDict[str, tuple[SomManBrdf, int]] = OrderedDict()
        self._taken = 0

    def _opened(self) -> Store:
        if remote.is_address(self.path):
            return _Packed(self.path, *remote.parts(self.path))
        if Path(self.path).is_dir():
            return _Folder(Path(self.path))
        opened = self._stack.enter_context(door.opened(self.path, "a library"))
        return _Packed(self.path, opened.part, opened.length)

    @property
    def names(self) -> list[str]:
        """The names of all materials, sorted."""
        return self._store.names()

    @property
    def records(self) -> list[Record]:
        """What is known of all materials, in the order of their names. No material is read for it."""
        return [self._store.record(name) for name in self._store.names()]

    def record(self, name: str) -> Record:
        """What is known of a material. Raises NoSuchMaterial."""
        return self._store.record(self._known(name))

    def data(self, name: str) -> bytes:
        """The bytes of a material's .smrl. Raises NoSuchMaterial, or FormatError if they are damaged."""
        return self._store.data(self._known(name))

    def __getitem__(self, name: str) -> SomManBrdf:
        with self._lock:
            if name in self._kept:
                self._kept.move_to_end(name)
                return self._kept[name][0]
        material = file.parse(Path(f"{self.path}:{name}"), self.data(name))
        self._keep(name, material)
        return material

    def _keep(self, name: str, material: SomManBrdf) -> None:
        size = material.bytes_memory
        with self._lock:
            if size > self._most or name in self._kept:
                return
            self._kept[name] = material, size
            self._taken += size
            while self._taken > self._most:
                self._taken -= self._kept.popitem(last=False)[1][1]

    @property
    def bytes_cached(self) -> int:
        """What the materials that are kept take in memory."""
        return self._taken

    def __iter__(self) -> Iterator[str]:
        return iter(self._store.names())

    def __len__(self) -> int:
        return len(self._store.names())

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._store

    def __repr__(self) -> str:
        return f"Library({self.path!r}: {len(self)} materials)"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the file. Materials that were read stay as they are."""
        self._stack.close()

    def _known(self, name: str) -> str:
        if name in self:
            return name
        names = self._store.names()
        hint = did_you_mean(name, names, NEAREST) or (f"; it has {', '.join(names[:NEAREST])}" if names else "")
        more = ", …" if hint.startswith("; it has") and len(names) > NEAREST else ""
        raise NoSuchMaterial(f"{self.path}: expected a material in it, found none of the name {name}{hint}{more}")


class _Folder:
    """A folder that `sommerl library build` made."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._records = folder, index.records(folder)
        self._names = list(self._records)

    def names(self) -> list[str]:
        return self._names

    def __contains__(self, name: str) -> bool:
        return name in self._records

    def record(self, name: str) -> Record:
        return self._records[name]

    def data(self, name: str) -> bytes:
        record = self._records[name]
        path = self._folder / record.file
        data = door.read(path, file.LONGEST_FILE)
        if hashlib.sha256(data).hexdigest() != record.sha256:
            raise FormatError(f"{path}: expected the SHA-256 in the library's index, found another")
        return data


class _Packed:
    """A .smrlib file. Its records have no file of their own, and no SHA-256 of one."""

    def __init__(self, path: str, read: Any, length: int | None) -> None:
        self._path = path
        with told_of(path):
            self._file = LibraryFile(read, length)
        self._names: list[str] | None = None

    def names(self) -> list[str]:
        if self._names is None:
            self._names = self._file.index.names()
        return self._names

    def __contains__(self, name: str) -> bool:
        return self._file.index.number(name) is not None

    def record(self, name: str) -> Record:
        number = self._file.index.number(name)
        assert number is not None
        return record_of(self._file.index.entry(number))

    def data(self, name: str) -> bytes:
        with told_of(f"{self._path}:{name}"):
            return self._file.data(name)


def record_of(entry: Entry) -> Record:
    """What a library's file says of a material, as a record."""
    return Record(file="", sha256="", **vars(entry))


def entry_of(record: Record) -> Entry:
    """What a library's file keeps of a record."""
    return Entry(**{name: value for name, value in vars(record).items() if name not in ("file", "sha256")})
