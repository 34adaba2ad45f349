"""Materials and results as the rows and keys that the command line shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..compression.material import SomManBrdf
from ..factored.material import FactoredBrdf
from ..formats.rgl import RglBrdf
from ..models.multi_lobe import MultiLobe
from ..reflectance import metric
from ..reflectance.brdf import Brdf, OnLattice
from ..reflectance.distance import TABLE_METRICS
from ..reflectance.nodes import NodeLattice
from ..reflectance.origin import FIRST, full_chain
from ..reflectance.table import BrdfTable
from ..render.metrics import METRICS

UNKNOWN: dict[str, Any] = dict.fromkeys(("cells_clamped", "energy_clamped"))


def clamped(brdf: Brdf, facts: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """How many cells of a material's source, and which share of their energy, had to be set to 0; None if unknown.

    facts: of the material, if they are at hand.
    """
    if isinstance(brdf, BrdfTable):
        return {"cells_clamped": brdf.cells_clamped, "energy_clamped": brdf.energy_clamped}
    facts = brdf.facts if facts is None else facts
    return {name: facts.get(name) for name in UNKNOWN}


def clamped_text(counted: Mapping[str, Any]) -> str:
    """The same for people; "" if there is nothing to say."""
    cells, share = counted["cells_clamped"], counted["energy_clamped"]
    return f"{cells} ({share:.2%} of the energy)" if cells else ""


def describe(brdf: Brdf, bytes_disk: int | None) -> dict[str, Any]:
    """What `info` says of a material; null where a kind of material has no such thing."""
    known: dict[str, Any] = dict.fromkeys(
        ("clusters", "lattice", "nodes", "interpolation", "domain", "bytes_paper", "terms")
    )
    known |= dict.fromkeys(("bytes_memory", "options", "metrics", "source_sha256", "lobes"))
    kind = "measurement" if isinstance(brdf, RglBrdf) else "model"
    if isinstance(brdf, SomManBrdf):
        kind = "som-man"
        known |= {"clusters": brdf.clusters, "domain": brdf.domain, "bytes_paper": brdf.bytes_paper}
        known |= {"bytes_memory": brdf.bytes_memory, "options": brdf.options, "metrics": brdf.metrics}
    if isinstance(brdf, FactoredBrdf):
        kind = "factored"
        known |= {"terms": list(brdf.terms), "bytes_memory": brdf.bytes_memory}
    if isinstance(brdf, MultiLobe):
        known["lobes"] = [lobe.as_json() for lobe in brdf.lobes]
    if isinstance(brdf, BrdfTable):
        kind = "table"
        known |= {"domain": "linear", "bytes_memory": brdf.values.nbytes}
    if isinstance(brdf, (BrdfTable, SomManBrdf)):
        known |= {"lattice": list(brdf.lattice.shape), "interpolation": brdf.interpolation}
        if isinstance(brdf.lattice, NodeLattice):
            known["nodes"] = brdf.lattice.size
    facts = brdf.facts
    known |= {"source_sha256": getattr(brdf, "source_sha256", None), **clamped(brdf, facts)}
    known["made_from"] = [dict(link) for link in full_chain(brdf)] or None
    known["measured_against"] = _measured_against(brdf)
    return {"kind": kind, "name": brdf.name, **known, "facts": facts or None, "bytes_disk": bytes_disk}


def _measured_against(brdf: Brdf) -> dict[str, str] | None:
    """What figures of a compressed material are against: what it was made from, directly."""
    if not brdf.compressed_as:
        return None
    source = {"kind": FIRST, "name": brdf.name, "sha256": getattr(brdf, "source_sha256", "")}
    return dict(next(iter(full_chain(brdf)), source))


def origin_rows(brdf: Brdf) -> dict[str, str]:
    """The chain of what a material was made from, for people; nothing of what was made from its first source."""
    chain = full_chain(brdf)
    if not chain:
        return {}
    links = [f"{link['name']}, {link['kind']}, {link['sha256'][:12] or 'no file'}" for link in chain]
    rows = {"made from": " ← ".join(links)}
    if isinstance(brdf, SomManBrdf):
        rows["figures are against"] = f"{chain[0]['name']}: a compressed material, not a measurement"
    return rows


def label(brdf: Brdf) -> str:
    """A material's name, and how it is looked up."""
    return f"{brdf.name} ({lookup(brdf)})"


def lookup(brdf: Brdf) -> str:
    """How a material is looked up."""
    if isinstance(brdf, OnLattice):
        return brdf.interpolation
    if isinstance(brdf, RglBrdf):
        return "measurement"
    return "factored" if isinstance(brdf, FactoredBrdf) else "formula"


FACTS = {
    "asymmetry": "asymmetry: |f(a, b) − f(b, a)| over the mean",
    "reciprocal": "both orders averaged",
    "cells_near_grazing": "MERL cells where a cosine below 0.01 was taken for 0.01",
    "cells_clamped": "cells with a channel below 0 or not finite, set to 0",
    "energy_clamped": "share of the energy in that",
    "samples_negative": "samples below 0 in a channel",
    "samples": "samples, at different directions",
    "samples_at_the_horizon": "samples at the horizon, left out",
    "mirrored": "one side measured, mirrored to the other",
    "coverage": "share of the hemispheres within 10° of a sample",
    "cells_not_measured": "cells farther from all samples, extrapolated",
    "held_out_log_error_cosine": "every tenth sample held out: RMS error of the logarithm, cosine-weighted",
    "held_out_median_relative_error": "every tenth sample held out: median relative error",
}


def fact_rows(facts: Mapping[str, Any]) -> dict[str, str]:
    """What a reader reports, for people."""
    rows = {FACTS.get(name, name): value for name, value in facts.items()}
    return {name: f"{value:.3g}" if isinstance(value, float) else str(value) for name, value in rows.items()}


def text(value: Any) -> str:
    """A value of `describe` for people."""
    if isinstance(value, dict):
        return ", ".join(f"{key} {item}" for key, item in value.items())  # pyright: ignore
    return " × ".join(map(str, value)) if isinstance(value, list) else str(value)  # pyright: ignore


def table_rows(metrics: Mapping[str, float]) -> dict[str, str]:
    """Distances between two tables, by the keys of `distance.TABLE_METRICS`."""
    return metric.rows(TABLE_METRICS, metrics)


def image_rows(metrics: Mapping[str, float]) -> dict[str, str]:
    """Distances between two renderings, by the keys of `metrics.METRICS`."""
    return metric.rows(METRICS, metrics)
