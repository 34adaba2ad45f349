"""ASTM E1392 text: lines with a keyword and its value, then `VARS` with the names of columns, and rows between commas.

The standard was withdrawn; files like these are written by BSDF processors (libbsdf, pbrt's and ALTA's tools), with θ_s
and φ_s of the scattered light, in radians, and R, G, B, X, Y, Z, or wavelengths as 465nm.
"""

from __future__ import annotations

import re

from . import sample_text, samples
from .format import Format
from .text import LARGEST_FILE, decoded

VARS = re.compile(r"^VARS[ \t]", re.MULTILINE)


def looks_like(head: bytes) -> bool:
    """Whether a file that starts with these bytes has a line VARS that names columns of angles."""
    text = decoded(head)
    found = VARS.search(text)
    return found is not None and "\0" not in text and sample_text.has_names(text[found.start() :])


FORMAT = Format(
    "ASTM E1392",
    (".astm",),
    "samples below a line VARS that names their columns",
    needs="lab",
    sniff=looks_like,
    read=samples.parse,
    largest=LARGEST_FILE,
)
