"""Materials of a library as the rows and keys that the command line shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from ..library.finding import QUALITY, digits
from ..library.library import Library
from ..library.record import Record
from ..reflectance.metric import decibels
from ..render.judge import MOST
from . import answers, console

COLUMNS = ("material", "size", "soft light", "colour", "gloss", "metal")
PICTURES = {"psnr_soft_db": "in soft light", "psnr_lamp_db": "under one lamp"}  # of which mean and worst are said


def argument(library: Library, record: Record) -> str:
    """What other commands take for a material of a library; of one at an address, nothing does."""
    return str(Path(library.path) / record.file) if record.file else f"{library.path}:{record.name}"


def described(library: Library, record: Record) -> dict[str, Any]:
    """What is said of a material with --json."""
    kept = {"bytes_disk": record.bytes, "sha256": record.sha256 or None, "options": dict(record.options)}
    source = {name: getattr(record, name) or None for name in ("source", "source_bytes", "source_sha256")}
    looks = {"colour": list(record.colour), "colour_srgb": digits(record.colour)}
    looks |= {"gloss": record.gloss, "metalness": record.metalness}
    said = {"input": argument(library, record), "name": record.name}
    return {**said, **kept, **source, "metrics": dict(record.metrics), **looks}


def cells(record: Record) -> list[str]:
    """A row of the table, by COLUMNS."""
    quality = record.metrics.get(QUALITY)
    shown = "" if quality is None else decibels(quality)
    looks = (digits(record.colour), f"{record.gloss:.2f}", f"{record.metalness:.2f}")
    return [record.name, console.size(record.bytes), shown, *looks]


def quality(metrics: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Mean and worst [dB] of each of PICTURES that some materials have, and which is the worst. metrics: by names."""
    found: dict[str, dict[str, Any]] = {}
    for key in PICTURES:
        values = {name: min(each[key], MOST) for name, each in metrics.items() if key in each}
        if values:
            worst = min(values, key=lambda name: values[name])
            found[key] = {"mean": fmean(values.values()), "worst": values[worst], "worst_name": worst}
    return found


def answer(found: Sequence[Mapping[str, Any]], library: Library, **others: Any) -> dict[str, Any]:
    """The answer on materials of a library."""
    return answers.of_materials(found, library=library.path, **others)
