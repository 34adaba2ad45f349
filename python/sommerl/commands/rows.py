"""Materials and results as the rows and keys that the command line shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ..reflectance import metric
from ..reflectance.brdf import Brdf
from ..reflectance.distance import TABLE_METRICS
from ..reflectance.info import Counts
from ..render.judge import JUDGED
from ..render.metrics import METRICS


def changed_rows(counts: Counts) -> dict[str, str]:
    """What had to be changed in a material's data, for people; nothing of what was not."""
    return fact_rows({name: value for name, value in asdict(counts).items() if value})


def describe(brdf: Brdf, bytes_disk: int | None) -> dict[str, Any]:
    """What `info` says of a material, with the length of its file; null where a kind of material has no such thing."""
    return asdict(brdf.info()) | {"bytes_disk": bytes_disk}


def origin_rows(brdf: Brdf) -> dict[str, str]:
    """The chain of what a material was made from, for people; nothing of what was made from its first source."""
    chain = brdf.source.chain()
    if not chain:
        return {}
    links = [f"{link['name']}, {link['kind']}, {link['sha256'][:12] or 'no file'}" for link in chain]
    rows = {"made from": " ← ".join(links)}
    if brdf.compressed and "metrics" in brdf.details():
        rows["figures are against"] = f"{chain[0]['name']}: a compressed material, not a measurement"
    return rows


FACTS = {
    "asymmetry": "asymmetry: |f(a, b) − f(b, a)| over the mean",
    "reciprocal": "both orders averaged",
    "darkened": "by how much the mean of both orders was darkened at most, so as not to reflect too much",
    "energy_negative": "share of the energy in negative channels",
    "cells_near_grazing": "MERL cells where a cosine below 0.01 was taken for 0.01",
    "cells_clamped": "cells whose negative channels were removed, or that were not finite",
    "energy_clamped": "share of the energy that this moved",
    "energy_averaged": "share of the energy that averaging both orders moved",
    "grid": "angles of light and viewer, and azimuths between them",
    "transmission_left_out": "transmission, which is left out",
    "rows": "rows in the file",
    "rows_without_numbers": "of these, without numbers, left out",
    "rows_below_the_horizon": "of these, below the horizon, left out",
    "angles": "angles are in",
    "values": "values are",
    "plane": "azimuths",
    "samples_negative": "samples below 0 in a channel",
    "samples": "samples, at different directions",
    "samples_at_the_horizon": "samples at the horizon, left out",
    "mirrored": "one side measured, mirrored to the other",
    "coverage": "share of the hemispheres within 10° of a sample",
    "samples_merged": "samples that repeated others",
    "one_sided": "both orders of the directions kept apart",
    "held_out_log_error_cosine": "every tenth sample held out: RMS error of the logarithm, cosine-weighted",
    "held_out_median_relative_error": "every tenth sample held out: median relative error",
    "held_out_lines_log_error_cosine": "lines of incidence held out: RMS error of the logarithm, cosine-weighted",
    "held_out_lines_median_relative_error": "lines of incidence held out: median relative error",
    "prior": "what was not measured is estimated (--prior) from",
    "deviation_median": "standard deviation of log f_r there, median",
    "deviation": "standard deviation of log f_r, for bands of θ_h and θ_d (--json has them)",
    "grid_points_missing": "points of the grid that were not measured, interpolated",
}


def fact_rows(facts: Mapping[str, Any]) -> dict[str, str]:
    """What a reader reports, for people."""
    rows = {FACTS.get(name, name): value for name, value in facts.items()}
    return {name: _fact(value) for name, value in rows.items()}


def _fact(value: Any) -> str:
    if isinstance(value, list) and value and isinstance(value[0], list):
        return f"{len(value)} × {len(value[0])}"  # pyright: ignore[reportUnknownArgumentType]
    return f"{value:.3g}" if isinstance(value, float) else str(value)  # pyright: ignore[reportUnknownArgumentType]


def lobe_text(lobe: Mapping[str, Any]) -> str:
    """A lobe of a formula, as `Lobe.as_json` gives it, for people."""
    numbers = [f"albedo {' '.join(f'{value:.4g}' for value in lobe['albedo'])}"]
    numbers += [f"{key} {value:.4g}" for key, value in lobe.items() if key not in ("family", "albedo")]
    return f"{lobe['family']}: {', '.join(numbers)}"


def surface_text(surface: Mapping[str, Any]) -> str:
    """A standard's surface, as `Surface.as_json` gives it, for people."""
    inputs: list[str] = []
    for key, value in surface.items():
        if key != "model":
            inputs.append(f"{key} {' '.join(f'{x:.4g}' for x in np.atleast_1d(value).tolist())}")
    return ", ".join(inputs)


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


def judged_rows(metrics: Mapping[str, float]) -> dict[str, str]:
    """Distances from a source, by the keys of `judge.JUDGED`."""
    return metric.rows(JUDGED, metrics)
