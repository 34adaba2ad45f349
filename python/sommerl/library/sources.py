"""The materials in a folder that a library is made of."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ..formats import registry
from ..system import door
from ..system.errors import FormatError, MaterialError, SommerlError
from ..system.visible import visible

UNSAFE = frozenset('/\\:*?"<>|%')  # in names of files, on one system or another


@dataclass(frozen=True)
class Material:
    """A material in the folder of sources.

    name, file, source: as in `Record`. path: of the source, as `load` takes it. parts: the files that it is read from.
    """

    name: str
    file: str
    source: str
    path: str
    parts: tuple[str, ...]


@dataclass(frozen=True)
class Sources:
    """materials: sorted by their names. faults: of a file or a folder that cannot be read, its path and a sentence."""

    materials: Sequence[Material]
    faults: Sequence[tuple[str, str]]


def find(folder: Path, output: Path, warn: Callable[[str], None]) -> Sources:
    """All materials below a folder: the files with an extension of a known format, and each of those that hold many.

    Names that begin with a dot are passed over, and so is `output`, the library's folder. Links are followed; warn: is
    told of those that lead back to where they are. Raises MaterialError if two materials would have one name.
    """
    materials: list[Material] = []
    faults: list[tuple[str, str]] = []
    for path in _files(folder, output, faults, warn):
        kind = registry.by_extension(registry.readable(), path)
        if kind is None:
            continue
        parts = list(kind.parts(path)) if kind.parts else [path]
        if path != parts[0]:
            continue
        try:
            os.fsencode(path).decode()
            members = _members(path) if kind.members else [""]
        except (SommerlError, UnicodeDecodeError) as error:
            faults.append((str(path), str(error) if isinstance(error, SommerlError) else _not_text(path)))
            continue
        place = PurePosixPath(path.relative_to(folder).as_posix())
        several = members if len(members) > 1 else [""]
        materials.extend(_material(place, path, parts, member) for member in several)
    _check_apart(folder, materials)
    return Sources(sorted(materials, key=lambda each: each.name), faults)


def content(parts: Sequence[str]) -> tuple[int, str]:
    """The bytes and the SHA-256 of a material's files, of all in turn if there are several. Raises FormatError."""
    total, digests = 0, list[str]()
    for part in parts:
        with door.opened(part):  # which refuses pipes and devices
            try:
                with open(part, "rb") as file:
                    digests.append(hashlib.file_digest(file, "sha256").hexdigest())
                    total += file.tell()
            except OSError as error:
                raise FormatError(f"{part}: cannot be read ({error.strerror or error})") from error
    return total, digests[0] if len(digests) == 1 else hashlib.sha256("".join(digests).encode()).hexdigest()


def _material(place: PurePosixPath, path: Path, parts: Sequence[Path], member: str) -> Material:
    """place: of the file in the folder. Of a file that holds many, the files of its materials are in a folder."""
    stem, files = str(place.with_suffix("")), tuple(map(str, parts))
    if not member:
        return Material(stem, f"{stem}.smrl", str(place), str(path), files)
    return Material(f"{stem}:{member}", f"{stem}/{_safe(member)}.smrl", f"{place}:{member}", f"{path}:{member}", files)


def _safe(member: str) -> str:
    """A name as one of a file: what has a meaning in paths, or cannot be printed, is %XX, as in addresses."""
    return "".join(
        "".join(f"%{byte:02X}" for byte in c.encode("utf-8", "surrogatepass"))
        if c in UNSAFE or not c.isprintable() or (c == "." and at == 0)
        else c
        for at, c in enumerate(member)
    )


def _members(path: Path) -> Sequence[str]:
    """The materials in a file, by the format that it is in, whatever its extension says."""
    with door.opened(path) as file:
        kind = registry.recognised(path, file.head)
        return kind.members(path, kind.content(file)) if kind.members else [""]


def _files(folder: Path, output: Path, faults: list[tuple[str, str]], warn: Callable[[str], None]) -> Iterator[Path]:
    """All files below a folder, sorted."""
    library = os.path.realpath(output)

    def below(folder: Path, within: frozenset[str]) -> Iterator[Path]:
        real = os.path.realpath(folder)
        if real == library:
            return
        if real in within:
            warn(f"{folder}: expected a folder, found a link back to one that it is in; it is passed over")
            return
        try:
            names = sorted(os.listdir(folder))
        except OSError as error:
            faults.append((str(folder), f"{folder}: cannot be read ({error.strerror or error})"))
            return
        for name in names:
            path = folder / name
            if name.startswith("."):
                continue
            if path.is_dir():
                yield from below(path, within | {real})
            elif registry.by_extension(registry.readable(), path):
                yield path

    yield from below(folder, frozenset())


def _check_apart(folder: Path, materials: Sequence[Material]) -> None:
    """Raises MaterialError if two would have one name, or one file where capitals are not told from small letters."""
    taken: dict[str, Material] = {}
    for each in materials:
        for key in {f"name {each.name}", f"file {each.file.casefold()}"}:
            other = taken.setdefault(key, each)
            if other is not each:
                raise MaterialError(
                    f"{folder}: expected a name for each material, found two that would be {each.file}: "
                    f"{other.source} and {each.source}; rename one"
                )


def _not_text(path: Path) -> str:
    return f"{visible(str(path))}: expected a name in UTF-8, found another"
