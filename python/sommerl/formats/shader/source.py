"""Materials as source code: a C++ header, GLSL or HLSL, with palette, packed indices, a sampler's table, and the
functions `eval`, `sample` and `pdf`.

One text serves the three languages; they differ in a few lines before and after it and in how an array is written
(`language.py`). The text is in the folder `templates`, where @WORDS@ stand for what differs between materials.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compression.atlas import is_compact
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
RECORD = ("ENTRY", "SHAPE", "GAIN", "AXIS", "ROW", "KIND")  # of a material in SOMMERL_MATERIAL: where what begins
NODE_CONSTANTS = {
    "FINE": str(FINE),
    "KNEE": str(KNEE),
    "KNEE_AT": repr(KNEE / BELOW),
    "BELOW": str(BELOW),
    "ABOVE": str(ABOVE),
    "STEPS_THETA": repr(FINE / HALF_PI),
    "SMALLEST_COSINE": repr(SMALLEST_COSINE),
    "HORIZON": repr(HORIZON),
}
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
    _write(path, lambda language, name: source(material, language, name))


def write_atlas(materials: Sequence[Brdf], path: str | Path) -> None:
    """Writes compact materials as one source code, whose functions take the number of a material first.

    Raises FormatError for a material that is not compact.
    """
    _write(path, lambda language, name: atlas_source(materials, language, name))


def _write(path: str | Path, text: Callable[[Language, str], str]) -> None:
    path = Path(path)
    with atomic_write(path) as out:
        out.write(text(LANGUAGES[path.suffix.lower()], identifier(path.stem)).encode())


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
    if material.grid is None:
        parts = _nodes([material], numbered=False)
    else:
        parts = _cells(material.grid, material.interpolation, material.buffers()["index"], material.lut)
    return _whole(parts, [material], comment(material.name), language, name, numbered=False)


def atlas_source(materials: Sequence[Brdf], language: Language, name: str) -> str:
    """The source code of compact materials. name: as in `source`.

    Raises FormatError for a material that is not compact.
    """
    compact = [each for each in materials if isinstance(each, SomManBrdf) and is_compact(each)]
    if len(compact) < len(materials):
        other = next(each for each in materials if not is_compact(each))
        raise FormatError(f"{other.name}: expected compact materials in source code of several, found another kind")
    parts = _nodes(compact, numbered=True)
    return _whole(parts, compact, f"{len(compact)} materials", language, name, numbered=True)


def _whole(
    parts: _Parts, materials: Sequence[SomManBrdf], title: str, language: Language, name: str, *, numbered: bool
) -> str:
    """The whole text: that of the parts, and what is the same for all kinds.

    numbered: whether functions take the number of a material.
    """
    table = np.concatenate([half_vector.HalfVectorSampler.fitted(each).table.reshape(-1) for each in materials])
    arrays = [*parts.arrays, _words("SOMMERL_SAMPLER", "sampler", table)]
    macros = [array.macro for array in arrays]
    in_range = _template("in_range") if numbered else ""
    blocks = [
        _template("head", CONTENTS=parts.contents, MATERIALS=_template("head_several") if numbered else ""),
        _template(f"{language.name}_begin"),
        *(_guarded(array, language) for array in arrays),
        _template("entry"),
        parts.functions,
        _template("eval", FOLD=parts.fold, LOOKUP=parts.lookup, IN_RANGE=in_range),
        _template("sampling", IN_RANGE=in_range),
    ]
    for_the_next_file = ("SOMMERL_FUNCTION", "SOMMERL_OUT", *macros)
    undefined = "".join(f"#undef {macro}\n" for macro in for_the_next_file)
    whole = "\n".join(blocks) + _template(f"{language.name}_end") + undefined
    values = parts.values | {constant: repr(getattr(half_vector, constant)) for constant in OF_SAMPLER}
    cells = half_vector.ELEVATIONS * half_vector.CELLS
    digests = [comment(each.source.sha256) or "unknown" for each in materials]
    names = [f"//   {k}: {comment(each.name)} ({digests[k]})" for k, each in enumerate(materials)]
    values |= {
        "TITLE": title,
        "SHA": "of each material, below" if numbered else digests[0],
        "NAME": name,
        "CALL": f"{name}{language.qualifier}",
        "MACROS": " and ".join((", ".join(f"{macro}(i)" for macro in macros[:-1]), f"{macros[-1]}(i)")),
        "SHARE_THETA": repr(2 / np.pi),
        "COUNT": str(len(materials)),
        "NAMES": "\n".join(names),
        "OF": "uint material, " if numbered else "",
        "ON": "material, " if numbered else "",
        "FIRST_CELL": f"{cells}u * material + " if numbered else "",
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
        "FIRST_ENTRY": "",
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


def _nodes(materials: Sequence[SomManBrdf], *, numbered: bool) -> _Parts:
    """Of lattices of nodes: the two entries of each, that of the LUT in the lower bits, and where the nodes are.

    If numbered, each array has them one behind the other, and SOMMERL_MATERIAL says where each one begins.
    """
    palettes = [each.palette for each in materials if isinstance(each.palette, GainsAndShapes)]
    places = [each.lattice for each in materials if isinstance(each.lattice, NodeLattice)]
    buffers = [each.buffers() for each in materials]
    lattices = [_lattice(each) for each in buffers]
    words, values = _entries(palettes, buffers)
    folds, fold = _kinds([tuple(lattice.folds.values()) for lattice in places])
    roots, root = _kinds([(palette.signed, palette.smooth) for palette in palettes])
    rows = [len(lattice) - 2 * len(each["base"]) for lattice, each in zip(lattices, buffers, strict=True)]
    scales = np.array([palette.scale for palette in palettes])
    arrays = [
        words,
        _reals("SOMMERL_LUT", "palette", np.concatenate([palette.lut for palette in palettes])),
        _reals("SOMMERL_GAIN", "gains", np.concatenate([palette.gains for palette in palettes])),
        _words("SOMMERL_LATTICE", "lattice", np.concatenate(lattices)),
    ]
    if numbered:
        lengths = [
            [len(each["index"]) for each in buffers],
            [len(palette.lut) for palette in palettes],
            [len(palette.gains) for palette in palettes],
            [len(lattice) for lattice in lattices],
        ]
        starts = [np.cumsum([0, *each[:-1]]) for each in lengths]
        records = np.stack([*starts, starts[-1] + rows, fold | root << 8], axis=-1).astype(np.uint32)
        arrays += [
            _words("SOMMERL_MATERIAL", "materials", records.reshape(-1)),
            _reals("SOMMERL_SCALE", "scales", scales),
        ]
        values |= {f"FIRST_{part}": f"{_of_record(part)} + " for part in RECORD[: len(starts)]}
        values |= {"FIRST_ROW": _of_record("ROW"), "SCALE": "SOMMERL_SCALE(material)"}
    else:
        values |= {f"FIRST_{part}": "" for part in RECORD[:4]}
        values |= {"FIRST_ROW": f"{rows[0]}u", "SCALE": _numbers(scales)[0]}
    phi_d = _call("phi_d", "x, y", len(folds), f"({_of_record('KIND')} & 255u)")
    reflectance = _call("reflectance", "@ON@sum, wi, wo", len(roots), f"({_of_record('KIND')} >> 8u)")
    return _Parts(
        contents=_template("contents_nodes"),
        arrays=arrays,
        functions=_template(
            "nodes",
            PHI_D="\n".join(_phi_d(kind, *each) for kind, each in enumerate(folds)),
            REFLECTANCE="\n".join(_reflectance(kind, *each) for kind, each in enumerate(roots)),
        ),
        fold="",
        lookup=_template("lookup_nodes").replace("@CALL_PHI_D@", phi_d).replace("@CALL_REFLECTANCE@", reflectance),
        values=values | NODE_CONSTANTS,
    )


def _entries(
    palettes: Sequence[GainsAndShapes], buffers: Sequence[Mapping[str, NDArray[Any]]]
) -> tuple[_Array, dict[str, str]]:
    """The two entries of each node in as few bits as all palettes need; and the values of what reads them."""
    shape_bits = max(1, *((len(palette.lut) - 1).bit_length() for palette in palettes))
    bits = shape_bits + max(1, *((len(palette.gains) - 1).bit_length() for palette in palettes))
    entries = np.concatenate(
        [
            each["index"].astype(np.uint32) | each["gain_index"].astype(np.uint32) << np.uint32(shape_bits)
            for each in buffers
        ]
    )
    words, values = _packed(entries.astype(np.uint8 if bits <= 8 else np.uint16 if bits <= 16 else np.uint32))
    return words, values | {"SHAPE_BITS": str(shape_bits), "SHAPE_MASK": str(2**shape_bits - 1)}


def _kinds(flags: Sequence[tuple[bool, ...]]) -> tuple[list[tuple[bool, ...]], NDArray[np.int64]]:
    """The kinds that there are, and of each material the number of its kind."""
    known = list(dict.fromkeys(flags))
    return known, np.array([known.index(each) for each in flags])


def _of_record(part: str) -> str:
    """The expression for a part of a material's record."""
    return f"SOMMERL_MATERIAL({len(RECORD)}u * material + {RECORD.index(part)}u)"


def _call(function: str, arguments: str, kinds: int, kind: str) -> str:
    """A call of the function of the material's kind, of so many. kind: the expression for its number."""
    calls = [f"@NAME@_{function}_{k}({arguments})" for k in range(kinds)]
    return "".join(f"{kind} == {k}u ? {call} : " for k, call in enumerate(calls[:-1])) + calls[-1]


def _phi_d(kind: int, reciprocal: bool, mirrored: bool) -> str:
    """The function for φ_d of lattices with such folds."""
    text = _template(
        "phi_d", FOLD=_fold(reciprocal, mirrored), TURN="" if mirrored else _template("turn")
    )  # a mirrored axis ends
    return text.replace("@KIND@", f"_{kind}").replace("@STEPS_PHI@", repr(FINE / phi_d_range(reciprocal, mirrored)))


def _reflectance(kind: int, signed: bool, smooth: bool) -> str:
    """The function for f_r of palettes that are, or are not, signed and smooth."""
    text = _template(
        "reflectance",
        CUBE=_template("cube_signed" if signed else "cube_not_signed"),
        DAMPED=_template("damped_smooth" if smooth else "damped"),
    )
    return text.replace("@KIND@", f"_{kind}")


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
