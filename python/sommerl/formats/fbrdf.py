"""Files of factored BRDFs, .fbrdf, as a format; `factored.file` reads and writes them."""

from __future__ import annotations

from ..factored import file
from .format import Format

FORMAT = Format(
    "factored BRDF",
    (".fbrdf",),
    "products of small tables, which `factor` writes",
    sniff=file.looks_like,
    read=file.parse,
    largest=file.LONGEST_FILE,
)
