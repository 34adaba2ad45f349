"""Materials as the page holds them: the bytes of a file, in one of the formats that it reads."""

from __future__ import annotations

import base64
import io
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..compression.material import SomManBrdf
from ..compression.smrl import file as smrl
from ..formats import mbsdf, tensor
from ..formats.rgl import RglBrdf
from ..reflectance.brdf import Brdf
from ..reflectance.cells import MERL, Lattice
from ..reflectance.table import BrdfTable
from ..system import door

ONE_SIDED = Lattice(reciprocal=False)  # cells at which BRDFs are sampled whose two orders of directions differ
TABLE = struct.Struct("<4sHHHBB")  # magic number; bins in θ_h, θ_d, φ_d; whether reciprocal; whether trilinear
MAGIC = b"SMTB"
LARGEST = 65504.0  # that half precision holds
LARGEST_MBSDF = 2**27  # bytes: the page reads no longer files
REFERENCE = "reference"  # the step of a source itself


@dataclass(frozen=True)
class Held:
    """A material in the page.

    name: what a command takes for it. label: what it is called; no two in a page are called the same. format: "smrl",
    "bsdf", "mbsdf" or "table". data: the bytes. size: those of its file, None if it has none. group: the label of the
    source that it is a version of. step: which version it is. command: what makes its file, if it is not there. note:
    on what had to be changed, or "".
    """

    name: str
    label: str
    format: str
    data: bytes
    size: int | None
    group: str
    step: str = REFERENCE
    command: str = ""
    note: str = ""

    def packed(self) -> dict[str, Any]:
        """For the page's JSON."""
        small = zlib.compress(self.data, 9, wbits=-15)
        deflated = len(small) < len(self.data)
        data = base64.b64encode(small if deflated else self.data).decode()
        said: Mapping[str, Any] = {"name": self.name, "label": self.label, "group": self.group, "step": self.step}
        facts = {"format": self.format, "deflated": deflated, "bytes": self.size}
        return {**said, "command": self.command, "note": self.note, **facts, "data": data}


def held(brdf: Brdf, label: str, *, name: str | None = None, size: int | None = None, **more: str) -> Held:
    """A material, for the page.

    name: the label if None. size: of its file, if that is known. more: `group`, `step` and `command` of `Held`.
    """
    kind, data, note = _encoded(brdf)
    if isinstance(brdf, SomManBrdf):
        size = len(data)
    return Held(name or label, label, kind, data, size, **{"group": label, "note": note, **more})


def held_mbsdf(path: Path) -> Held | None:
    """A file of NVIDIA's measured BSDFs as it is, so that the page has its own grid; None for a file of any other kind.

    Raises FormatError if it cannot be read, MaterialError if nothing in it is positive.
    """
    with door.opened(path) as file:
        if not mbsdf.looks_like(file.head):
            return None
        data = file.read(LARGEST_MBSDF)
    mbsdf.parse(path, data)
    return Held(str(path), path.stem, "mbsdf", data, len(data), group=path.stem)


def _encoded(brdf: Brdf) -> tuple[str, bytes, str]:
    """The format, the bytes, and a note."""
    if isinstance(brdf, SomManBrdf):
        return "smrl", smrl.encode(brdf), ""
    if isinstance(brdf, RglBrdf):
        return "bsdf", _tensors(brdf), ""
    if isinstance(brdf, BrdfTable):
        return "table", _cells(brdf), ""
    lattice = brdf.grid or (MERL if brdf.reciprocal else ONE_SIDED)
    table = BrdfTable.sampled(brdf, lattice)
    bins = " × ".join(map(str, lattice.shape))
    note = f"It is sampled at {bins} directions (θ_h, θ_d, φ_d), and interpolated."
    if table.counts.cells_clamped:
        note += f" {table.counts.cells_clamped} of them have a negative channel, which is moved to where there is none."
    return "table", _cells(table), note


def _tensors(brdf: RglBrdf) -> bytes:
    out = io.BytesIO()
    tensor.write(out, brdf.fields())
    return out.getvalue()


def _cells(table: BrdfTable) -> bytes:
    """A table in half precision: the bits of ∛f_r, along φ_d each less the one before; of all, first the low bytes.

    So written, they deflate well. Cells below the horizon, which the page fills, are 0.
    """
    lattice = table.lattice
    root = np.cbrt(np.where(lattice.above_horizon[..., None], table.values, 0.0))
    bits = np.moveaxis(np.minimum(root, LARGEST), -1, 0).astype("<f2").view("<u2")
    codes = np.diff(bits, axis=-1, prepend=np.uint16(0))
    planes = np.moveaxis(codes.reshape(-1, 1).view("u1"), -1, 0)
    head = TABLE.pack(MAGIC, *lattice.shape, lattice.reciprocal, table.interpolation == "trilinear")
    return head + np.ascontiguousarray(planes).tobytes()
