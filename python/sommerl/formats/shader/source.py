"""Materials as source code: a C++ header, GLSL or HLSL, with palette, packed indices, a sampler's table, and the
functions `eval`, `sample` and `pdf`.

One text serves the three languages; they differ in a few lines before and after it and in how an array is written
(`language.py`). The text is in the folder `templates`, where @WORDS@ stand for what differs between materials.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compression.material import SomManBrdf
from ...compression.palette import GainsAndShapes
from ...reflectance.brdf import Brdf
from ...reflectance.cells import Lattice
from ...reflectance.half_diff import phi_d_range
from ...reflectance.nodes import ABOVE, BELOW, FINE, HALF_PI, HORIZON, KNEE, SMALLEST_COSINE, NodeLattice
from ...sampling import half_vector
from ...system.errors import FormatError
from ...system.files import atomic_write
from ...system.visible import visible
from .language import LANGUAGES, Language

A_LINE = 10  # numbers
LONGEST_TITLE = 300
OF_SAMPLER = ("ROWS", "COLUMNS", "ELEVATIONS", "CELLS", "SLOTS", "SLOT_BITS", "WHOLE", "TINY", "LOWEST", "SMALLEST")


@dataclass(frozen=True)
class _Array:
    """An array of constants. macro: through which the functions read it. kind: uint or real."""

    macro: str
    name: str
    kind: str
    values: list[str]


@dataclass(frozen=True)
class _Parts:
    """What the text holds for one kind of lattice, cells or nodes.

    contents, functions, fold, lookup: filled-in templates; see `contents_…`, `cells`, `nodes`, `fold_…`, `lookup_…`.
    values: what stands for the words between @.
    """

    contents: str
    arrays: list[_Array]
    functions: str
    fold: str
    lookup: str
    values: dict[str, str]


def write(material: Brdf, path: str | Path) -> None:
    """Writes a compressed material as source code in the language that the path's extension names, of LANGUAGES.

    Raises FormatError for a table that is not compressed.
    """
    path = Path(path)
    with atomic_write(path) as out:
        out.write(source(material, LANGUAGES[path.suffix.lower()], identifier(path.stem)).encode())


def identifier(name: str) -> str:
    """A name that all three languages take: "material_", then the ASCII letters and digits of `name`.

    A checksum of `name` follows where it is not ASCII, so that names in other scripts stay different.
    """
    plain = re.sub(r"[^0-9A-Za-z]+", "_", name).strip("_")
    lost = "" if name.isascii() else f"{zlib.crc32(name.encode('utf-8', 'surrogatepass')):08x}"
    return "_".join(part for part in ("material", plain, lost) if part)


def comment(text: str) -> str:
    """A text that is safe within a comment of one line: without line breaks, without backslashes and C's trigraphs
    ("??/" was one for a backslash), which would join the next line to it, and without "*/"."""
    return re.sub(r"\s+", " ", re.sub(r"\\|\?(?=\?)|\*(?=/)", " ", visible(text, LONGEST_TITLE)))


def source(material: Brdf, language: Language, name: str) -> str:
    """The source code of a compressed material. name: of the namespace in C++; the prefix of all functions elsewhere.

    Raises FormatError for a material that is not compressed.
    """
    if not isinstance(material, SomManBrdf):
        raise FormatError(f"{material.name}: expected a compressed material, with a palette, found a {material.kind}")
    buffers, lut = material.buffers(), material.lut
    if material.grid is None:
        parts = _nodes(material, buffers)
    else:
        parts = _cells(material.grid, material.interpolation, buffers["index"], lut)
    table = half_vector.HalfVectorSampler.fitted(material).table
    arrays = [*parts.arrays, _words("SOMMERL_SAMPLER", "sampler", table.reshape(-1))]
    macros = [array.macro for array in arrays]
    blocks = [
        _template("head", CONTENTS=parts.contents),
        _template(f"{language.name}_begin"),
        *(_guarded(array, language) for array in arrays),
        _template("entry"),
        parts.functions,
        _template("eval", FOLD=parts.fold, LOOKUP=parts.lookup),
        _template("sampling"),
    ]
    for_the_next_file = ("SOMMERL_FUNCTION", "SOMMERL_OUT", *macros)
    undefined = "".join(f"#undef {macro}\n" for macro in for_the_next_file)
    whole = "\n".join(blocks) + _template(f"{language.name}_end") + undefined
    values = parts.values | {constant: repr(getattr(half_vector, constant)) for constant in OF_SAMPLER}
    values |= {
        "TITLE": comment(material.name),
        "SHA": comment(material.source.sha256) or "unknown",
        "NAME": name,
        "CALL": f"{name}{language.qualifier}",
        "MACROS": " and ".join((", ".join(f"{macro}(i)" for macro in macros[:-1]), f"{macros[-1]}(i)")),
        "SHARE_THETA": repr(2 / np.pi),
    }
    # In one pass, so that a name with such a mark in it stays what it is.
    return re.sub(r"@([A-Z_]+)@", lambda mark: values.get(mark[1], mark[0]), whole)


def _template(name: str, **parts: str) -> str:
    """A template, with a text in place of each line that is nothing but @PART@."""
    text = resources.files("sommerl.formats.shader").joinpath("templates", f"{name}.template").read_text("utf-8")
    for part, inserted in parts.items():
        text = text.replace(f"@{part}@\n", inserted)
    return text


def _cells(lattice: Lattice, interpolation: str, index: NDArray[Any], lut: NDArray[np.float64]) -> _Parts:
    """Of a lattice of cells: the LUT entry of each."""
    words, values = _packed(index)
    values |= {
        "BINS_H": str(lattice.theta_h),
        "BINS_D": str(lattice.theta_d),
        "BINS_P": str(lattice.phi_d),
        "LAST_H": str(lattice.theta_h - 1),
        "LAST_D": str(lattice.theta_d - 1),
        "SHARE_PHI": repr(1 / lattice.phi_d_range),
    }
    return _Parts(
        contents=_template("contents_cells"),
        arrays=[words, _reals("SOMMERL_LUT", "palette", lut)],
        functions=_template("cells"),
        fold=_fold(lattice.reciprocal),
        lookup=_template(f"lookup_{interpolation}", BINS=_template("bins")),
        values=values,
    )


def _fold(reciprocal: bool, mirrored: bool = False) -> str:
    """How φ_d is folded."""
    return _template(f"fold{'_mirrored' if mirrored else ''}{'' if reciprocal else '_not'}_reciprocal")


def _nodes(material: SomManBrdf, buffers: Mapping[str, NDArray[Any]]) -> _Parts:
    """Of a lattice of nodes: the two entries of each, that of the LUT in the lower bits. buffers: the material's."""
    palette, places = material.palette, material.lattice
    assert isinstance(palette, GainsAndShapes)
    assert isinstance(places, NodeLattice)
    gains, lut = palette.gains, palette.lut
    shape_bits = max(1, (len(lut) - 1).bit_length())
    bits = shape_bits + max(1, (len(gains) - 1).bit_length())
    entries = buffers["index"].astype(np.uint32) | buffers["gain_index"].astype(np.uint32) << np.uint32(shape_bits)
    words, values = _packed(entries.astype(np.uint8 if bits <= 8 else np.uint16 if bits <= 16 else np.uint32))
    lattice = _lattice(buffers)
    values |= {
        "SHAPE_BITS": str(shape_bits),
        "SHAPE_MASK": str(2**shape_bits - 1),
        "FINE": str(FINE),
        "FIRST_ROW": str(len(lattice) - 2 * len(buffers["base"])),
        "KNEE": str(KNEE),
        "KNEE_AT": repr(KNEE / BELOW),
        "BELOW": str(BELOW),
        "ABOVE": str(ABOVE),
        "STEPS_THETA": repr(FINE / HALF_PI),
        "STEPS_PHI": repr(FINE / phi_d_range(**places.folds)),
        "SMALLEST_COSINE": repr(SMALLEST_COSINE),
        "HORIZON": repr(HORIZON),
        "SCALE": _numbers(buffers["scale"])[0],
    }
    reals = [_reals("SOMMERL_LUT", "palette", lut), _reals("SOMMERL_GAIN", "gains", gains)]
    return _Parts(
        contents=_template("contents_nodes"),
        arrays=[words, *reals, _words("SOMMERL_LATTICE", "lattice", lattice)],
        functions=_template("nodes", CUBE=_template("cube_signed" if palette.signed else "cube_not_signed")),
        fold=_fold(**places.folds),
        lookup=_template(
            "lookup_nodes",
            TURN="" if places.mirrored else _template("turn"),
            DAMPED=_template("damped_smooth" if palette.smooth else "damped"),
        ),
        values=values,
    )


def _lattice(buffers: Mapping[str, NDArray[Any]]) -> NDArray[np.uint32]:
    """Where the nodes are, as the words of SOMMERL_LATTICE, whose order the template `nodes` describes.

    buffers: those of `NodeLattice.buffers`.
    """
    counts = buffers["phi_d_count"].astype(np.uint32)
    bands, none = len(counts), np.zeros_like(counts)
    theta_h = _steps(buffers["row_below"], buffers["row_place"], none[:1])
    theta_d = _steps(buffers["theta_d_below"], buffers["theta_d_place"], none)
    phi_d = _steps(buffers["phi_d_below"], buffers["phi_d_place"], counts)
    axes = np.stack([theta_d, phi_d], axis=1).reshape(2 * bands, FINE)
    band = buffers["band"].astype(np.uint32)
    rows = np.stack([buffers["base"].astype(np.uint32), band | counts[band] << np.uint32(8)], axis=-1)
    return np.concatenate([theta_h.reshape(-1), axes.reshape(-1), rows.reshape(-1)])


def _steps(below: NDArray[Any], places: NDArray[Any], turns: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """One word for each step of the fine grid, shape (axes, FINE): between which nodes of its axis the step lies.

    From the lowest byte: the node at or below the step, the node after that, and the places of the two.
    below: (axes × FINE), for each step, the number of the node at or below it. places: (axes × nodes), for each node,
        its place on the fine grid. turns: (axes,), the number of nodes of an axis that is periodic, on which the node
        after the last one is the first; 0 for an axis that ends.
    """
    axes = len(turns)
    below = below.astype(np.uint32).reshape(axes, FINE)
    places = places.astype(np.uint32).reshape(axes, -1)
    after = below + np.uint32(1)
    near, far = (np.take_along_axis(places, node, axis=1) for node in (below, after))
    parts = below, np.where(after == turns[:, None], np.uint32(0), after), near, far
    words = np.stack(parts, axis=-1).astype(np.uint8).view("<u4")
    return words.reshape(axes, FINE).astype(np.uint32)


def _packed(index: NDArray[Any]) -> tuple[_Array, dict[str, str]]:
    """All indices in words of 32 bits, the first in the lowest bits; and the values of the template `entry`."""
    flat, bits = index.reshape(-1), 8 * index.dtype.itemsize
    padded = np.append(flat, np.zeros(-len(flat) % (32 // bits), flat.dtype))
    words = padded.astype(padded.dtype.newbyteorder("<")).view("<u4")
    return _words("SOMMERL_WORD", "words", words), {
        "PER_WORD": str(32 // bits),
        "BITS": str(bits),
        "MASK": str(2**bits - 1),
    }


def _words(macro: str, name: str, words: NDArray[np.uint32]) -> _Array:
    return _Array(macro, name, "uint", [f"{word:#x}u" for word in words.tolist()])


def _reals(macro: str, name: str, values: NDArray[np.float64]) -> _Array:
    return _Array(macro, name, "real", _numbers(values))


def _guarded(array: _Array, language: Language) -> str:
    """The declaration of an array and of the macro that reads it, left out where the user has defined that macro."""
    size, name = len(array.values), f"@NAME@_{array.name}"
    lines = ("    " + ", ".join(array.values[i : i + A_LINE]) for i in range(0, size, A_LINE))
    constants = language.array.format(type=array.kind, name=name, size=size, values=",\n".join(lines))
    return f"#ifndef {array.macro}\n{constants}\n#define {array.macro}(i) {name}[i]\n#endif\n"


def _numbers(values: NDArray[np.float64]) -> list[str]:
    """Literals that all three languages take for real numbers, exact in single precision."""
    texts = [f"{value:.9g}" for value in values.reshape(-1)]
    return [text if "." in text or "e" in text else f"{text}.0" for text in texts]
