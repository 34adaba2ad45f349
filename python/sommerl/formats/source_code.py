"""Source code as a format; the room `shader` writes it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..compression.material import SomManBrdf
from ..reflectance.brdf import Brdf
from .format import Format
from .shader.language import LANGUAGES


def _write(material: SomManBrdf, path: Path) -> SomManBrdf:
    from .shader import source  # so that reading a file does not load it

    source.write(material, path)
    return material


def _write_several(materials: Sequence[Brdf], path: Path) -> None:
    from .shader import source

    source.write_atlas(materials, path)


FORMAT = Format(
    "source code",
    tuple(LANGUAGES),
    "C++, GLSL or HLSL with eval, sample and pdf",
    write=_write,
    write_several=_write_several,
    compressed=True,
)
