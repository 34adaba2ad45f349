"""Materials as source code: palette, packed indices, a sampler's table, and the functions `eval`, `sample` and `pdf`.

One text serves all languages: that in the folder `templates`, where @WORDS@ stand for what differs between materials;
`render` makes the text of a language from it.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...compression.atlas import is_compact
from ...compression.material import SomManBrdf
from ...reflectance.brdf import Brdf
from ...sampling import half_vector
from ...system.errors import FormatError
from ...system.files import atomic_write
from .arrays import Array, of_words
from .head import head_values
from .language import LANGUAGES, Language
from .parts import Parts, of_cells, of_nodes
from .render import rendered, template

OF_SAMPLER = ("ROWS", "COLUMNS", "ELEVATIONS", "CELLS", "SLOTS", "SLOT_BITS", "WHOLE", "TINY", "LOWEST", "SMALLEST")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """sampler: whether the text has `sample` and `pdf`. command: that wrote it, for its head; "" if none did."""

    sampler: bool = True
    command: str = ""


def write(material: Brdf, path: str | Path, settings: Settings = Settings()) -> None:
    """Writes a compressed material as source code in the language that the path's extension names, of LANGUAGES.

    Raises FormatError for a table that is not compressed.
    """
    _write(path, lambda language, name: source(material, language, name, settings))


def write_atlas(materials: Sequence[Brdf], path: str | Path, settings: Settings = Settings()) -> None:
    """Writes compact materials as one source code, whose functions take the number of a material first.

    Raises FormatError for a material that is not compact.
    """
    _write(path, lambda language, name: atlas_source(materials, language, name, settings))


def _write(path: str | Path, text: Callable[[Language, str], str]) -> None:
    path = Path(path)
    with atomic_write(path) as out:
        out.write(text(LANGUAGES[path.suffix.lower()], identifier(path.stem)).encode())


def identifier(name: str) -> str:
    """A name that all languages take: "material_", then the ASCII letters and digits of `name`.

    A checksum of `name` follows where it is not ASCII, so that names in other scripts stay different.
    """
    plain = re.sub(r"[^0-9A-Za-z]+", "_", name).strip("_")
    lost = "" if name.isascii() else f"{zlib.crc32(name.encode('utf-8', 'surrogatepass')):08x}"
    return "_".join(part for part in ("material", plain, lost) if part)


def source(material: Brdf, language: Language, name: str, settings: Settings = Settings()) -> str:
    """The source code of a compressed material. name: how the names of all that is in it begin.

    Raises FormatError for a material that is not compressed.
    """
    parts, compressed = _parts(material)
    return _whole(parts, [compressed], language, name, settings, numbered=False)


def arrays_of(material: Brdf) -> list[Array]:
    """All arrays that the source code of a compressed material reads. Raises FormatError as `source` does."""
    parts, compressed = _parts(material)
    return [*parts.arrays, of_samplers([compressed])]


def of_samplers(materials: Sequence[SomManBrdf]) -> Array:
    """The tables of the samplers, one behind the other."""
    fitted = [half_vector.HalfVectorSampler.fitted(each).table.reshape(-1) for each in materials]
    return of_words("sampler", np.concatenate(fitted))


def _parts(material: Brdf) -> tuple[Parts, SomManBrdf]:
    if not isinstance(material, SomManBrdf):
        raise FormatError(f"{material.name}: expected a compressed material, with a palette, found a {material.kind}")
    if material.grid is None:
        return of_nodes([material], numbered=False), material
    return of_cells(material.grid, material.interpolation, material.buffers()["index"], material.lut), material


def atlas_source(materials: Sequence[Brdf], language: Language, name: str, settings: Settings = Settings()) -> str:
    """The source code of compact materials. name: as in `source`.

    Raises FormatError for a material that is not compact.
    """
    compact = [each for each in materials if isinstance(each, SomManBrdf) and is_compact(each)]
    if len(compact) < len(materials):
        other = next(each for each in materials if not is_compact(each))
        raise FormatError(f"{other.name}: expected compact materials in source code of several, found another kind")
    parts = of_nodes(compact, numbered=True)
    return _whole(parts, compact, language, name, settings, numbered=True)


def _whole(
    parts: Parts,
    materials: Sequence[SomManBrdf],
    language: Language,
    name: str,
    settings: Settings,
    *,
    numbered: bool,
) -> str:
    """The whole text: that of the parts, and what is the same for all kinds.

    numbered: whether functions take the number of a material.
    """
    in_range = template("in_range") if numbered else ""
    arrays = list(parts.arrays)
    blocks = [
        template("entry"),
        parts.functions,
        template("eval", FOLD=parts.fold, LOOKUP=parts.lookup, IN_RANGE=in_range),
    ]
    if settings.sampler:
        arrays.append(of_samplers(materials))
        blocks.append(template("sampling", IN_RANGE=in_range))
    head = template(
        "head",
        CONTENTS=parts.contents,
        SAMPLES=template("head_samples") if settings.sampler else "",
        MATERIALS=template("head_several") if numbered else "",
        ARRAYS="".join(array.described(language) for array in arrays),
        BUFFERS=template(f"buffers_{'macros' if language.macros else 'functions'}"),
    )
    shared = [template(language.shared)] if language.shared else []
    values = {key: value.replace("@NAME@", name) for key, value in parts.values.items()}
    values |= {constant: repr(getattr(half_vector, constant)) for constant in OF_SAMPLER}
    cells = half_vector.ELEVATIONS * half_vector.CELLS
    values |= {
        "NAME": name,
        "SHARE_THETA": repr(2 / np.pi),
        "COUNT": str(len(materials)),
        "OF": "uint material, " if numbered else "",
        "OF_ANY": "uint which, " if numbered else "",
        "ON": "material, " if numbered else "",
        "FIRST_CELL": f"{cells}u * material + " if numbered else "",
    }
    values |= head_values(materials, settings.command, numbered=numbered) | {"LANGUAGE": language.name}

    def filled(text: str) -> str:
        # In one pass, so that a name with such a mark in it stays what it is.
        return re.sub(r"@([A-Z_]+)@", lambda mark: values.get(mark[1], mark[0]), text)

    before = [head, *shared, *(array.declared(language) for array in arrays)]
    return "\n".join([*map(filled, before), *(rendered(filled(block), language, name) for block in blocks)])
