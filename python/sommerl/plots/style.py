"""How matplotlib is used: not as its user has set it up for other work."""

from __future__ import annotations

import warnings
from collections.abc import Generator
from contextlib import contextmanager

from ..system.optional import optional


@contextmanager
def plain_style() -> Generator[None]:
    """Matplotlib as it comes, whatever the user's settings: same input, same picture."""
    library = optional("matplotlib", "matplotlib", "plots", "formats")
    with library.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # names may be in any script
        library.rcdefaults()
        library.rcParams["svg.hashsalt"] = "sommerl"  # else the names inside an SVG file are random
        yield
