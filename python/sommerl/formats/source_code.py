"""Source code as a format; the room `shader` writes it."""

from __future__ import annotations

from pathlib import Path

from ..compression.material import SomManBrdf
from .format import Format
from .shader.language import LANGUAGES


def _write(material: SomManBrdf, path: Path) -> SomManBrdf:
    from .shader import source  # so that reading a file does not load it

    source.write(material, path)
    return material


FORMAT = Format(
    "source code",
    tuple(LANGUAGES),
    "C++, GLSL or HLSL with eval, sample and pdf",
    write=_write,
    compressed=True,
)
