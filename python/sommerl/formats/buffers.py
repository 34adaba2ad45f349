"""The arrays of a compressed material as bytes for buffers (.bin), and a manifest (.bin.json) that names them.

They are those of the source code (`shader`), whose functions read them if the macros that the manifest names do.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..compression.material import SomManBrdf
from .format import Format
from .manifest import manifest, write_all

MARK = b"Written by Sommerl"  # after the arrays, so that commands know the file for their own
TYPES = {"uint": ("uint32", "<u4"), "real": ("float32", "<f4")}


def write(material: SomManBrdf, path: str | Path) -> SomManBrdf:
    """Writes the arrays, one behind the other, and the manifest."""
    from .shader.source import arrays_of, identifier  # only when it is needed

    path = Path(path)
    prefix = identifier(path.stem)
    data = b""
    listed: list[dict[str, Any]] = []
    for array in arrays_of(material):
        name, kind = TYPES[array.kind]
        numbers = [int(text.rstrip("u"), 16) if array.kind == "uint" else float(text) for text in array.values]
        reader = array.reader.replace("@NAME@", prefix)
        listed.append({"reader": reader, "type": name, "offset": len(data), "count": len(numbers)})
        data += np.array(numbers, kind).tobytes()
    said = manifest("buffers", material, material.metrics, {"byte_order": "little", "arrays": listed})
    write_all(dict(zip(beside(path), (data + MARK, said), strict=True)))
    return material


def beside(path: Path) -> list[Path]:
    """All files that are written for a path."""
    return [path, path.with_name(f"{path.name}.json")]


FORMAT = Format(
    "buffers",
    (".bin",),
    "the arrays of the source code as bytes, with a manifest",
    write=write,
    beside=beside,
    compressed=True,
)
