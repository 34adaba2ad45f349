"""What Sommerl knows of a file format: how its files are recognised, read and written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..reflectance.brdf import Brdf


@dataclass(frozen=True)
class Format:
    """A file format. One that is only read has no `write`; one that is only written has neither `sniff` nor `read`.

    name: what people call it. extensions: in lower case, each with its dot. summary: what is in a file, for help and
        docs. needs: the extra of the package that reading takes, as in sommerl[needs]; "" for none.
    sniff: whether a file that begins with these bytes, at most `door.HEAD_BYTES` of them, is in this format. Of all
        formats, one at most may say so.
    read: makes the material from a file's path and bytes, and, if `members`, from the name of a material in the file,
        "" for the first or only one. Raises FormatError for what is not in this format.
    largest: the most bytes of a file that is read.
    members: whether a file may hold several materials, so that FILE:NAME is one of them.
    write: writes a material to a path, and returns what the file holds: that material, or a table made from it.
    write_several: writes any number of compact materials into one file; None if a file holds one material.
    compressed: whether it is written from compressed materials alone.
    names_source: whether a file that is written names the material's own file and holds nothing of it. `write` then
        takes that name in place of the material.
    """

    name: str
    extensions: tuple[str, ...]
    summary: str
    needs: str = ""
    sniff: Callable[[bytes], bool] | None = None
    read: Callable[..., Brdf] | None = None
    largest: int = 0
    members: bool = False
    write: Callable[[Any, Path], Any] | None = None
    write_several: Callable[[Sequence[Any], Path], None] | None = None
    compressed: bool = False
    names_source: bool = False

    def __str__(self) -> str:
        return f"{self.name} {' '.join(self.extensions)}"
