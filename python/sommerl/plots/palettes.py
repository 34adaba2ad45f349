"""Draws the palette of a compressed material, and how often its entries are used."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compression.material import SomManBrdf
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
    f_r, shown = _products(compressed) if compressed.grid is None else _swatches(compressed)
    tone = Tone.of(f_r[shown])
    pixels = np.zeros((*shown.shape, 4), np.uint8)
    pixels[shown, :3] = tone.srgb8(f_r[shown])
    pixels[..., 3] = np.where(shown, 255, 0)
    ax.imshow(pixels, aspect="auto", interpolation="nearest")
    ax.set_facecolor("0.6")  # on white, white products would look like unused ones
    ax.set(xticks=[], yticks=[])
    if compressed.grid is None:
        ax.set(xlabel=f"{len(compressed.lut)} shapes", ylabel=f"{len(compressed.gains)} gains")
        ax.set_title(f"palette: {shown.sum()} products in use")
    else:
        low, high = f_r[shown].mean(axis=-1).min(), f_r[shown].mean(axis=-1).max()
        ax.set_title(f"palette: {len(compressed.lut)} entries, {number(low)} to {number(high)}/sr")


def usage(ax: Any, material: Brdf) -> None:
    """Draws how often each entry is used.

    Preset `paper`: the number of cells above the horizon that have each entry, with entries from dark to bright. Preset
    `compact`: the number of nodes that have each shape, and each gain, in the palette's order. The bars of a kind add
    up to the number of cells or nodes. Raises MaterialError for a material that has no palette.
    """
    compressed = _compressed(material)
    index = compressed.index
    if compressed.grid is None:
        what = "nodes"
        series = {
            "shapes": np.bincount(index, minlength=len(compressed.lut)),
            "gains": np.bincount(compressed.gain_index, minlength=len(compressed.gains)),
        }
    else:
        what = "cells"
        counts = np.bincount(index[compressed.grid.above_horizon], minlength=len(compressed.lut))
        series = {"entries": counts[_order(compressed)]}
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


def _order(material: SomManBrdf) -> NDArray[np.int64]:
    """The numbers of the LUT's entries, from dark to bright."""
    return np.argsort(material.lut.sum(axis=1), kind="stable")


def _swatches(material: SomManBrdf) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """f_r of each swatch of a material on cells, and where there is a swatch."""
    entries = len(material.lut)
    columns = int(np.ceil(np.sqrt(entries)))
    rows = -(-entries // columns)
    f_r = np.zeros((rows * columns, 3))
    f_r[:entries] = material.lut[_order(material)]
    return f_r.reshape(rows, columns, 3), (np.arange(rows * columns) < entries).reshape(rows, columns)


def _products(material: SomManBrdf) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The same for a material on nodes: the products of gains and shapes."""
    gains = np.argsort(-material.gains, kind="stable")
    used = np.zeros((len(gains), len(material.lut)), np.bool_)
    used[material.gain_index, material.index] = True
    y = np.maximum(material.gains[:, None, None] * material.lut, 0.0)
    return (material.scale * y**3)[gains], used[gains]
