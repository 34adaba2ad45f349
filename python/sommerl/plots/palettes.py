"""The palette of a compressed material, and how often its entries are used."""

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

    Preset paper: the LUT's entries, from dark to bright, row by row from the top left, an image of shape (rows,
    columns, 4), RGBA in 8 bits (`Tone`), transparent where a last row is not full.

    Preset compact: the palette is gains times shapes, and a swatch is their product, a column for each shape in the
    LUT's order, a row for each gain, the largest at the top. What no node uses is transparent. Colours are those at
    normal incidence, scale · max(0, gain · shape)³.

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
    ax.set_facecolor("0.6")  # or white products would look like unused ones
    ax.set(xticks=[], yticks=[], title=title)


def usage(ax: Any, material: Brdf) -> None:
    """Draws how many cells above the horizon have each entry of the LUT, in the palette's order, dark to bright.

    Preset compact: how many nodes have each shape and each gain, in their order. The bars of each kind add up to the
    number of cells or nodes. Raises MaterialError for a material that has no palette.
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
        raise MaterialError(f"{material.name}: expected a compressed material, with a palette, found another kind")
    return material


def _order(palette: Palette) -> NDArray[np.int64]:
    """The LUT's entries from dark to bright."""
    return np.argsort(palette.lut.sum(axis=1), kind="stable")


def _swatches(palette: Palette) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """f_r of each swatch, and where there is one."""
    entries = len(palette.lut)
    columns = int(np.ceil(np.sqrt(entries)))
    rows = -(-entries // columns)
    f_r = np.zeros((rows * columns, 3))
    f_r[:entries] = palette.lut[_order(palette)]
    return f_r.reshape(rows, columns, 3), (np.arange(rows * columns) < entries).reshape(rows, columns)


def _products(palette: GainsAndShapes, index: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The same of gains times shapes."""
    gains = np.argsort(-palette.gains, kind="stable")
    used = np.zeros((len(gains), len(palette.lut)), np.bool_)
    used[tuple(index)] = True
    y = np.maximum(palette.gains[:, None, None] * palette.lut, 0.0)
    return (palette.scale * y**3)[gains], used[gains]
