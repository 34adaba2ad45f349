"""The command `info`: what a material is."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..formats.load import load
from ..reflectance.info import Counts
from . import console
from .parser import command
from .rows import describe, fact_rows, lobe_text, origin_rows, text

COUNTS = tuple(asdict(Counts()))
HIDDEN = ("facts", "lobes", "made_from", "measured_against")  # keys that `info` shows for people in rows of their own


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Says what a material is: its lattice, its sizes, how it was made and how good it is."
    parser = command(add, "info", info, summary, "sommerl info nickel.smrl", writes=False)
    parser.add_argument("material", metavar="MATERIAL")


def info(options: Namespace) -> dict[str, Any]:
    brdf = load(options.material)
    path = Path(options.material)
    on_disk = path.stat().st_size if path.is_file() else None
    result = describe(brdf, on_disk)
    if not options.json:
        apart = (*HIDDEN, *COUNTS)
        shown = {key: value for key, value in result.items() if value not in (None, "", {}) and key not in apart}
        for key in ("bytes_paper", "bytes_memory", "bytes_disk"):
            if key in shown:
                shown[key] = console.size(shown[key])
        counted = {key: result[key] for key in COUNTS if result["cells_clamped"] is not None}
        rows = {key: text(value) for key, value in shown.items()}
        rows |= fact_rows(counted | (result["facts"] or {})) | origin_rows(brdf)
        rows |= {f"lobe {number}": lobe_text(lobe) for number, lobe in enumerate(result["lobes"] or [], 1)}
        console.print_rows(str(options.material), rows)
    return result
