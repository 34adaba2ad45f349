"""The table of formats. What reads, writes or lists files asks this table; a new format is one more row."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ..system.errors import FormatError
from . import (
    alta,
    astm,
    buffers,
    cornell,
    fbrdf,
    fits,
    mbsdf,
    merl,
    nbrdf,
    numpy_materials,
    rgl,
    samples,
    scene,
    smrl,
    smrlib,
    source_code,
    texture,
    xompt,
    zemax,
)
from .format import Format

# In the order in which help and docs list them.
FORMATS: list[Format] = [
    smrl.FORMAT,
    smrlib.FORMAT,
    fbrdf.FORMAT,
    merl.FORMAT,
    rgl.FORMAT,
    mbsdf.FORMAT,
    xompt.FORMAT,
    zemax.FORMAT,
    cornell.FORMAT,
    alta.FORMAT,
    astm.FORMAT,
    samples.FORMAT,
    numpy_materials.ARRAY,
    numpy_materials.ARCHIVE,
    nbrdf.FORMAT,
    fits.FORMAT,
    source_code.FORMAT,
    texture.FORMAT,
    buffers.FORMAT,
    scene.FORMAT,
]


def readable() -> list[Format]:
    """The formats that `load` reads."""
    return [each for each in FORMATS if each.read]


def writable() -> list[Format]:
    """The formats that `convert` writes."""
    return [each for each in FORMATS if each.write]


def extensions(formats: Iterable[Format]) -> tuple[str, ...]:
    """All extensions of some formats, in the order of the table."""
    return tuple(extension for each in formats for extension in each.extensions)


def by_extension(formats: Iterable[Format], path: Path) -> Format | None:
    """The one of some formats that the extension of a path names; None if there is none."""
    extension = path.suffix.lower()
    return next((each for each in formats if extension in each.extensions), None)


def recognised(path: Path, head: bytes) -> Format:
    """The format of a file that begins with these bytes. Raises FormatError if it is in no known one.

    Where the bytes are of no format, the file's extension decides; that format's reader then says what is wrong.
    """
    sniffed = (each for each in readable() if each.sniff and each.sniff(head))
    found = next(sniffed, None) or by_extension(readable(), path)
    if not found:
        raise FormatError(f"{path}: expected a material ({', '.join(map(str, readable()))}), found none of these")
    return found


def listed(formats: Iterable[Format]) -> str:
    """Formats for people, one a line: the extensions, the name, and what is in a file."""
    return "\n".join(
        f"  {' '.join(each.extensions):21} {each.name}: {each.summary}"
        + (f" (needs sommerl[{each.needs}])" if each.needs else "")
        for each in formats
    )
