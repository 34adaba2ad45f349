"""What commands answer with --json; docs/json.md lists the keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..compression.material import SomManBrdf
from ..reflectance.brdf import Brdf
from .rows import describe


def described(source: str, brdf: Brdf, bytes_disk: int | None) -> dict[str, Any]:
    """What is said of a material. source: what it was read from, or made of, as it was given."""
    return {"input": source, "preset": preset(brdf), **describe(brdf, bytes_disk)}


def preset(brdf: Brdf) -> str | None:
    """By which preset a material was compressed; None for one that was not."""
    if not isinstance(brdf, SomManBrdf):
        return None
    return "paper" if brdf.grid else "compact"


def of_materials(materials: Sequence[Mapping[str, Any]], **others: Any) -> dict[str, Any]:
    """The answer on any number of materials: `materials`, and the keys of exactly one on the top level, too."""
    alone: Mapping[str, Any] = materials[0] if len(materials) == 1 else {}
    return {**alone, **others, "materials": [dict(each) for each in materials]}
