"""The sizes that the paper tells: in memory, and compressed."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np

from ..compression.smrl.file import encode
from ..factored import file as factored_file
from ..formats import merl
from .cells import Cell, Outcome, Setting
from .data import DEFAULT, RULES
from .section import Item, Ours, Outcomes, Section, Table

BLUE = "blue-metallic-paint"
CLUSTERS = (64, 256, 1000)
MIB, KB = 2**20, 1e3


def sizes(setting: Setting) -> Outcome:
    """Bytes of one material in every representation that the paper has sizes of."""
    table = setting.data.table(BLUE)
    stored = np.where(table.lattice.above_horizon[..., None], table.values / merl.SCALE, merl.BELOW_HORIZON)
    planes = np.moveaxis(stored, -1, 0).astype("<f8").tobytes()
    found: dict[str, float] = {
        "table": merl.bytes_on_disk(table.lattice),
        "single": 3 * 4 * table.lattice.size,
        "table, compressed": len(zlib.compress(planes)),
    }
    for m in CLUSTERS:
        for title, material in setting.both(table, m).items():
            found |= {f"M = {m}, {title}": material.bytes_paper, f"M = {m}, {title}, file": len(encode(material))}
    lawrence = setting.factored(table)
    found |= {"lawrence": lawrence.bytes_memory, "lawrence, file": len(factored_file.encode(lawrence))}
    return Outcome(found)


def _show(setting: Setting, outcomes: Outcomes) -> Section:
    found = outcomes["sizes/bytes"].values

    def both_of(name: str, unit: float) -> Ours:
        return Ours("bytes", *(found[name.format(title)] / unit for title in RULES))

    def ratio(above: str, below: str) -> Ours:
        return Ours("bytes", *(found[above] / found[below.format(title)] for title in RULES))

    ours = {
        "table/raw table": Ours("bytes", found["table"] / MIB),
        "float/raw table in single precision": Ours("bytes", found["single"] / MIB),
        "compressed/raw table, compressed": Ours("bytes", found["table, compressed"] / MIB),
        "ours/M = 64": both_of("M = 64, {}", MIB),
        "ours/M = 1000": both_of("M = 1000, {}", MIB),
        "text/M = 256": both_of("M = 256, {}", MIB),
        "file/M = 256, compressed": both_of("M = 256, {}, file", KB),
        "lawrence/Lawrence, in memory": Ours("bytes", found["lawrence"] / KB),
        "lawrence/Lawrence, compressed": Ours("bytes", found["lawrence, file"] / KB),
        "ratio/raw table : ours": ratio("table", "M = 256, {}"),
        "ratio/raw table, compressed : ours, compressed": ratio("table, compressed", "M = 256, {}, file"),
    }
    rows = [[name, f"{value:,.0f}"] for name, value in found.items()]
    sentence = (
        f"A table of {found['table']:,.0f} bytes becomes {found[f'M = 256, {DEFAULT}']:,.0f} bytes as the paper "
        f"counts them, "
        f"{found['table'] / found[f'M = 256, {DEFAULT}']:.1f} times less, and a file of "
        f"{found[f'M = 256, {DEFAULT}, file']:,.0f} "
        f"bytes, {found['table'] / found[f'M = 256, {DEFAULT}, file']:.0f} times less than the table as it is, and "
        f"{found['table, compressed'] / found[f'M = 256, {DEFAULT}, file']:.0f} times less than the table with deflate."
    )
    return Section(ours, [Table(f"Bytes of {BLUE}", ["", "bytes"], rows)], (), [sentence])


def _plan(setting: Setting) -> Sequence[Cell]:
    return [Cell("sizes/bytes", sizes, {}, (BLUE,), 30.0)]


SIZES = Item("Sizes", "What the paper tells of memory and of compressed files, for blue-metallic-paint.", _plan, _show)
