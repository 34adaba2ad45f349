"""Keeps matplotlib's user settings out of our pictures."""

from __future__ import annotations

import warnings
from collections.abc import Generator
from contextlib import contextmanager

from ..system.optional import optional


@contextmanager
def plain_style() -> Generator[None]:
    """Within the block, matplotlib uses its default settings: the same input gives the same picture for everybody."""
    library = optional("matplotlib", "matplotlib", "plots", "lab")
    with library.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # a name may have letters that the font lacks
        library.rcdefaults()
        library.rcParams["svg.hashsalt"] = "sommerl"  # otherwise SVG files contain random identifiers
        yield
