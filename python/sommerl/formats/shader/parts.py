"""What the text of a material holds for its kind of lattice, cells or nodes: arrays, and filled-in templates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compression.material import SomManBrdf
from ...compression.palette import GainsAndShapes
from ...reflectance.cells import Lattice
from ...reflectance.half_diff import phi_d_range
from ...reflectance.nodes import ABOVE, BELOW, FINE, HALF_PI, HORIZON, KNEE, SMALLEST_COSINE, NodeLattice
from .arrays import Array, numbers, of_reals, of_words, packed
from .render import template

RECORD = ("ENTRY", "SHAPE", "GAIN", "AXIS", "ROW", "KIND")  # of a material in the array `material`: where what begins
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


@dataclass(frozen=True)
class Parts:
    """What the text holds for one kind of lattice, cells or nodes.

    contents, functions, fold, lookup: filled-in templates; see `contents_…`, `cells`, `nodes`, `fold_…`, `lookup_…`.
    values: what stands for the words between @.
    """

    contents: str
    arrays: list[Array]
    functions: str
    fold: str
    lookup: str
    values: dict[str, str]


def of_cells(lattice: Lattice, interpolation: str, index: NDArray[Any], lut: NDArray[np.float64]) -> Parts:
    """Of a lattice of cells: the LUT entry of each."""
    words, values = packed(index)
    values |= {
        "FIRST_ENTRY": "",
        "BINS_H": str(lattice.theta_h),
        "BINS_D": str(lattice.theta_d),
        "BINS_P": str(lattice.phi_d),
        "LAST_H": str(lattice.theta_h - 1),
        "LAST_D": str(lattice.theta_d - 1),
        "LAST_P": str(lattice.phi_d - 1),
        "SHARE_PHI": repr(1 / lattice.phi_d_range),
    }
    return Parts(
        contents=template("contents_cells"),
        arrays=[words, of_reals("lut", lut)],
        functions=template("cells"),
        fold=_fold(lattice.reciprocal),
        lookup=template(f"lookup_{interpolation}", BINS=template("bins")),
        values=values,
    )


def _fold(reciprocal: bool, mirrored: bool = False) -> str:
    """How φ_d is folded."""
    return template(f"fold{'_mirrored' if mirrored else ''}{'' if reciprocal else '_not'}_reciprocal")


def of_nodes(materials: Sequence[SomManBrdf], *, numbered: bool) -> Parts:
    """Of lattices of nodes: the two entries of each, that of the LUT in the lower bits, and where the nodes are.

    If numbered, each array has them one behind the other, and `material` says where each one begins.
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
        of_reals("lut", np.concatenate([palette.lut for palette in palettes])),
        of_reals("gain", np.concatenate([palette.gains for palette in palettes])),
        of_words("lattice", np.concatenate(lattices)),
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
            of_words("material", records.reshape(-1)),
            of_reals("scale", scales),
        ]
        values |= {f"FIRST_{part}": f"{_of_record(part)} + " for part in RECORD[: len(starts)]}
        values |= {"FIRST_ROW": _of_record("ROW"), "SCALE": "@NAME@_SCALE(material)"}
    else:
        values |= {f"FIRST_{part}": "" for part in RECORD[:4]}
        values |= {"FIRST_ROW": f"{rows[0]}u", "SCALE": numbers(scales)[0]}
    phi_d = _call("phi_d", "x, y", len(folds), f"({_of_record('KIND')} & 255u)")
    reflectance = _call("reflectance", "@ON@sum, wi, wo", len(roots), f"({_of_record('KIND')} >> 8u)")
    return Parts(
        contents=template("contents_nodes"),
        arrays=arrays,
        functions=template(
            "nodes",
            PHI_D="\n".join(_phi_d(kind, *each) for kind, each in enumerate(folds)),
            REFLECTANCE="\n".join(_reflectance(kind, *each) for kind, each in enumerate(roots)),
        ),
        fold="",
        lookup=template("lookup_nodes").replace("@CALL_PHI_D@", phi_d).replace("@CALL_REFLECTANCE@", reflectance),
        values=values | NODE_CONSTANTS,
    )


def _entries(
    palettes: Sequence[GainsAndShapes], buffers: Sequence[Mapping[str, NDArray[Any]]]
) -> tuple[Array, dict[str, str]]:
    """The two entries of each node in as few bits as all palettes need; and the values of what reads them."""
    shape_bits = max(1, *((len(palette.lut) - 1).bit_length() for palette in palettes))
    bits = shape_bits + max(1, *((len(palette.gains) - 1).bit_length() for palette in palettes))
    entries = np.concatenate(
        [
            each["index"].astype(np.uint32) | each["gain_index"].astype(np.uint32) << np.uint32(shape_bits)
            for each in buffers
        ]
    )
    words, values = packed(entries.astype(np.uint8 if bits <= 8 else np.uint16 if bits <= 16 else np.uint32))
    return words, values | {"SHAPE_BITS": str(shape_bits), "SHAPE_MASK": str(2**shape_bits - 1)}


def _kinds(flags: Sequence[tuple[bool, ...]]) -> tuple[list[tuple[bool, ...]], NDArray[np.int64]]:
    """The kinds that there are, and of each material the number of its kind."""
    known = list(dict.fromkeys(flags))
    return known, np.array([known.index(each) for each in flags])


def _of_record(part: str) -> str:
    """The expression for a part of a material's record."""
    return f"@NAME@_MATERIAL({len(RECORD)}u * material + {RECORD.index(part)}u)"


def _call(function: str, arguments: str, kinds: int, kind: str) -> str:
    """A call of the function of the material's kind, of so many. kind: the expression for its number."""
    calls = [f"@NAME@_{function}_{k}({arguments})" for k in range(kinds)]
    others = "".join(f"PICK({kind} == {k}u, {call}, " for k, call in enumerate(calls[:-1]))
    return others + calls[-1] + ")" * (kinds - 1)


def _phi_d(kind: int, reciprocal: bool, mirrored: bool) -> str:
    """The function for φ_d of lattices with such folds."""
    text = template(
        "phi_d", FOLD=_fold(reciprocal, mirrored), TURN="" if mirrored else template("turn")
    )  # a mirrored axis ends
    return text.replace("@KIND@", f"_{kind}").replace("@STEPS_PHI@", repr(FINE / phi_d_range(reciprocal, mirrored)))


def _reflectance(kind: int, signed: bool, smooth: bool) -> str:
    """The function for f_r of palettes that are, or are not, signed and smooth."""
    text = template(
        "reflectance",
        CUBE=template("cube_signed" if signed else "cube_not_signed"),
        DAMPED=template("damped_smooth" if smooth else "damped"),
    )
    return text.replace("@KIND@", f"_{kind}")


def _lattice(buffers: Mapping[str, NDArray[Any]]) -> NDArray[np.uint32]:
    """Where the nodes are, as the words of the array `lattice`, whose order the template `nodes` describes.

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
