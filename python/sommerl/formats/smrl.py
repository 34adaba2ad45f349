"""Sommerl's own .smrl files as a format; `compression.smrl.file` reads and writes them."""

from __future__ import annotations

from pathlib import Path

from ..compression.material import SomManBrdf
from ..compression.smrl import file
from .format import Format


def _write(material: SomManBrdf, path: Path) -> SomManBrdf:
    file.save(material, path)
    return material


FORMAT = Format(
    "Sommerl",
    (".smrl",),
    "a compressed material",
    sniff=file.looks_like,
    read=file.parse,
    largest=file.LONGEST_FILE,
    write=_write,
    compressed=True,
)
