"""What a BRDF says of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Counts:
    """What had to be changed in a material's data; None where that is not known, or nothing was measured.

    cells_clamped: cells whose colour had a negative channel and was moved to where there is none, or was not finite and
        set to 0. energy_clamped: the share of the energy that this moved (`distance.energy_share`). energy_averaged:
        the share that was moved by averaging both orders of the directions (`reciprocal.ReciprocalBrdf`).
    """

    cells_clamped: int | None = None
    energy_clamped: float | None = None
    energy_averaged: float | None = None


@dataclass(frozen=True)
class Info:
    """What `sommerl info` says of a material, by the names of its JSON keys; None where a kind has no such thing.

    kind: see `Brdf.kind`. clusters: entries of the palette. lattice: cells or the most nodes along (θ_h, θ_d, φ_d).
    nodes: their number. domain: in which values are stored and blended, "linear" or "cube-root". bytes_paper: the size
    as the paper counts it. terms: lobes and terms of a factored BRDF. bytes_memory: what a lookup reads. options,
    metrics: how it was compressed, and how well. source_sha256, made_from: see `origin.Source`. lobes: of a formula.
    surface: the model of a standard, and its inputs. reciprocal, signed, mirrored: see `Brdf`. cells_clamped,
    energy_clamped, energy_averaged: see `Counts`. measured_against: what `metrics` compare with. facts: what a reader
    reported.
    """

    kind: str
    name: str
    reciprocal: bool
    signed: bool
    mirrored: bool
    clusters: int | None = None
    lattice: list[int] | None = None
    nodes: int | None = None
    interpolation: str | None = None
    domain: str | None = None
    bytes_paper: int | None = None
    terms: list[int] | None = None
    bytes_memory: int | None = None
    options: Mapping[str, Any] | None = None
    metrics: Mapping[str, Any] | None = None
    source_sha256: str | None = None
    lobes: list[dict[str, Any]] | None = None
    surface: dict[str, Any] | None = None
    cells_clamped: int | None = None
    energy_clamped: float | None = None
    energy_averaged: float | None = None
    made_from: list[dict[str, str]] | None = None
    measured_against: dict[str, str] | None = None
    facts: Mapping[str, Any] | None = None
