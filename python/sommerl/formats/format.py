"""What Sommerl knows of a file format: how its files are recognised, read and written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..reflectance.brdf import Brdf
from ..system.door import File


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
    opened: whether `read` and `members` take the open file (`door.File`) in place of its bytes, and read what they need
        of it.
    members: of a format whose files may hold several materials, so that FILE:NAME is one of them: their names, from a
        file's path and bytes. Raises FormatError as `read` does.
    parts: of a format in which several files may be one material, any of which names it: all of them, in an order that
        is always the same, from the path of one. What it gives of other files is that path alone.
    write: writes a material to a path, and returns what the file holds: that material, or a table made from it.
    beside: all files that `write` writes for a path, the path first; None if it writes that alone.
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
    opened: bool = False
    members: Callable[[Path, Any], Sequence[str]] | None = None
    parts: Callable[[Path], Sequence[Path]] | None = None
    write: Callable[[Any, Path], Any] | None = None
    beside: Callable[[Path], Sequence[Path]] | None = None
    write_several: Callable[[Sequence[Any], Path], None] | None = None
    compressed: bool = False
    names_source: bool = False

    def content(self, file: File) -> Any:
        """What `read` and `members` take of a file. Raises FormatError if it is too long or cannot be read."""
        return file if self.opened else file.read(self.largest)

    def __str__(self) -> str:
        return f"{self.name} {' '.join(self.extensions)}"
