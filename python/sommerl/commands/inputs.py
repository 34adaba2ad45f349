"""Materials as they are named on the command line: files, folders, patterns, built-in names."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from ..formats import registry
from ..formats.load import load
from ..formats.names import split_member
from ..formats.reading import AS_IT_IS, reading
from ..models.builtin import NAMES
from ..reflectance.brdf import Brdf
from ..system.errors import MaterialError, SommerlError
from .console import warn

Read = TypeVar("Read")


def stem(source: str) -> str:
    """What a material's outputs are called: as it is in a file of several, else as the file without its extension."""
    path, member = split_member(source)
    return member or (path.stem if _is_material(path) else path.name)


def expanded(given: Iterable[str]) -> list[str]:
    """Materials, with the files in place of each folder and of each pattern ("*.binary"), sorted by their names.

    Raises MaterialError if there are none.
    """
    return [source for one in given for source in (_in_folder(one) or _matching(one) or [one])]


def load_written(path: Path) -> Brdf:
    """A file that the command wrote: what is said of samples (--values, --prior, …) is said of its input."""
    with reading(AS_IT_IS):
        return load(path)


def readable(sources: Iterable[str], given: Sequence[str]) -> list[str]:
    """Those of `sources` that can be read. Each is read now, so that a bad one is found before hours of work."""

    def checked(source: str) -> str:
        load(source)
        return source

    return read_all(sources, given, checked)


def read_all(sources: Iterable[str], given: Sequence[str], read: Callable[[str], Read]) -> list[Read]:
    """What `read` makes of each of `sources`.

    One that was named itself has to be readable, or its error is raised; of a folder or a pattern, one that is not is
    left out with a warning. given: what was named, as `expanded` takes it.
    """
    kept: list[Read] = []
    for source in sources:
        try:
            kept.append(read(source))
        except SommerlError as error:
            if source in given:
                raise
            warn(f"{error}; it is left out")
    if not kept:
        raise MaterialError(f"{given[0]}: expected materials, found none that can be read")
    return kept


def labels(sources: Sequence[str], names: Sequence[str]) -> list[str]:
    """A label for each material: its name; where another one has the same, its file's, or the file as it was given.

    names: those of the materials. What a name says beyond that of its file stands behind it. A built-in material keeps
    its name.
    """
    found = list(names)
    for short in (True, False):
        of_label: dict[str, set[str]] = {}
        for source, label in zip(sources, found, strict=True):
            of_label.setdefault(label, set()).add(source)
        found = [
            label if len(of_label[label]) == 1 or source in NAMES else _with_file(source, name, short=short)
            for source, name, label in zip(sources, names, found, strict=True)
        ]
    return found


def _with_file(source: str, name: str, *, short: bool) -> str:
    """A file and a material's name, or the file alone if that is where the name is from. short: without its folder."""
    file = Path(source).name if short else source
    return file if name == stem(source) else f"{file}: {name}"


def _is_material(path: Path) -> bool:
    """Whether a file's name says that it holds a material."""
    return registry.by_extension(registry.readable(), path) is not None


def _is_folder(source: str) -> bool:
    return source not in NAMES and os.path.isdir(source)


def _is_pattern(source: str) -> bool:
    return glob.has_magic(source) and not os.path.exists(source) and not split_member(source)[1]


def is_several(source: str) -> bool:
    """Whether it is a folder or a pattern, and may stand for any number of materials."""
    return _is_folder(source) or _is_pattern(source)


def _in_folder(source: str) -> list[str]:
    if not _is_folder(source):
        return []
    found = sorted(str(path) for path in Path(source).iterdir() if _is_material(path) and path.is_file())
    if not found:
        raise MaterialError(f"{source}: expected a folder with materials, found none in it")
    return found


def _matching(source: str) -> list[str]:
    if not _is_pattern(source):
        return []
    found = sorted(path for path in glob.glob(source, recursive=True) if os.path.isfile(path))
    if not found:
        raise MaterialError(f"{source}: expected names of files that match, found none")
    return found
