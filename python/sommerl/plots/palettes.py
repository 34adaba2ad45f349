"""Draws the palette of a compressed material, and how often its entries are used."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compression.material import SomManBrdf
from ..compression.palette import GainsAndShapes, Palette
from ..reflectance.brdf import Brdf
from ..system.errors import MaterialError
from .page import number
from .tone import Tone


def palette(ax: Any, material: Brdf) -> None:
    """Draws the palette of a compressed material as swatches.

    Preset `paper`: the entries of the LUT, from dark to bright, row by row from the top left. The image has shape
    (rows, columns, 4), RGBA in 8 bits (`Tone`), and is transparent at the end of a last row that is not full.

    Preset `compact`: a swatch for each product of a gain and a shape. There is a column for each shape, in the LUT's
    order, and a row for each gain, the largest at the top; products that no node uses are transparent. Colours are
    those at normal incidence, scale · max(0, gain · shape)³.

    Raises MaterialError for a material that has no palette.
    """
    compressed = _compressed(material)
    entries = compressed.palette
    if isinstance(entries, GainsAndShapes):
        f_r, shown = _products(entries, compressed.index)
        title = f"palette: {shown.sum()} products in use"
        ax.set(xlabel=f"{len(entries.lut)} shapes", ylabel=f"{len(entries.gains)} gains")
    else:
        f_r, shown = _swatches(entries)
        means = f_r[shown].mean(axis=-1)
        title = f"palette: {len(entries.lut)} entries, {number(means.min())} to {number(means.max())}/sr"
    tone = Tone.of(f_r[shown])
    pixels = np.zeros((*shown.shape, 4), np.uint8)
    pixels[shown, :3] = tone.srgb8(f_r[shown])
    pixels[..., 3] = np.where(shown, 255, 0)
    ax.imshow(pixels, aspect="auto", interpolation="nearest")
    ax.set_facecolor("0.6")  # on white, white products would look like unused ones
    ax.set(xticks=[], yticks=[], title=title)


def usage(ax: Any, material: Brdf) -> None:
    """Draws how often each entry is used.

    Preset `paper`: the number of cells above the horizon that have each entry, with entries from dark to bright. Preset
    `compact`: the number of nodes that have each shape, and each gain, in the palette's order. The bars of a kind add
    up to the number of cells or nodes. Raises MaterialError for a material that has no palette.
    """
    compressed = _compressed(material)
    entries, index = compressed.palette, compressed.index
    if isinstance(entries, GainsAndShapes):
        what, (gains, shapes) = "nodes", index
        series = {
            "shapes": np.bincount(shapes, minlength=len(entries.lut)),
            "gains": np.bincount(gains, minlength=len(entries.gains)),
        }
    else:
        what, above = "cells", compressed.table_lattice.above_horizon
        series = {"entries": np.bincount(index[above], minlength=len(entries.lut))[_order(entries)]}
    for n, (name, counts) in enumerate(series.items()):
        ax.stairs(counts, np.arange(len(counts) + 1), fill=n == 0, color=f"C{n}", label=name, linewidth=1.2)
    ax.set_yscale("log")
    ax.set(
        ylim=(0.5 * min(counts[counts > 0].min() for counts in series.values()), None),
        xlim=(0, max(map(len, series.values()))),
    )
    ax.set(xlabel="number of the entry", ylabel=what, title=f"{what} of each entry")
    if len(series) > 1:
        ax.legend(fontsize=7)


def _compressed(material: Brdf) -> SomManBrdf:
    if not isinstance(material, SomManBrdf):
        raise MaterialError(f"{material.name}: it has no palette, since it is not a compressed material")
    return material


def _order(palette: Palette) -> NDArray[np.int64]:
    """The numbers of the LUT's entries, from dark to bright."""
    return np.argsort(palette.lut.sum(axis=1), kind="stable")


def _swatches(palette: Palette) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """f_r of each swatch of a material on cells, and where there is a swatch."""
    entries = len(palette.lut)
    columns = int(np.ceil(np.sqrt(entries)))
    rows = -(-entries // columns)
    f_r = np.zeros((rows * columns, 3))
    f_r[:entries] = palette.lut[_order(palette)]
    return f_r.reshape(rows, columns, 3), (np.arange(rows * columns) < entries).reshape(rows, columns)


def _products(palette: GainsAndShapes, index: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The same for a material on nodes: the products of gains and shapes."""
    gains = np.argsort(-palette.gains, kind="stable")
    used = np.zeros((len(gains), len(palette.lut)), np.bool_)
    used[tuple(index)] = True
    y = np.maximum(palette.gains[:, None, None] * palette.lut, 0.0)
    return (palette.scale * y**3)[gains], used[gains]
