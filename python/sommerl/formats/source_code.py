"""Source code as a format; the room `shader` writes it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..compression.material import SomManBrdf
from ..reflectance.brdf import Brdf
from .format import Format
from .shader.language import LANGUAGES


def write(material: SomManBrdf, path: Path, *, sampler: bool = True, command: str = "") -> SomManBrdf:
    """Writes a compressed material; see `shader.source.write`, which this loads only when it is needed."""
    from .shader import source

    source.write(material, path, source.Settings(sampler=sampler, command=command))
    return material


def write_several(materials: Sequence[Brdf], path: Path, *, sampler: bool = True, command: str = "") -> None:
    """Writes compact materials as one text; see `shader.source.write_atlas`."""
    from .shader import source

    source.write_atlas(materials, path, source.Settings(sampler=sampler, command=command))


FORMAT = Format(
    "source code",
    tuple(LANGUAGES),
    "C++, GLSL, HLSL, MSL or WGSL with eval, sample and pdf",
    write=write,
    write_several=write_several,
    compressed=True,
)
