"""Training, and what the material's file notes of it: how near it is to the table, and what the source reports."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ...reflectance.distance import table_metrics
from ...reflectance.table import BrdfTable
from ..material import SomManBrdf
from ..smrl.notes import FACTS, plain
from . import train as training
from .options import TrainOptions
from .train import Progress, TrainReport

DIGITS = 6  # so that the file does not hold the last bits of a machine's sums


def train(
    table: BrdfTable, options: TrainOptions, *, progress: Progress | None = None
) -> tuple[SomManBrdf, TrainReport]:
    """As `train.train`; the material notes its metrics, and those of the source's facts that files hold."""
    material, report = training.train(table, options, progress=progress)
    metrics = table_metrics(table.values, material.values, table.lattice)
    found = metrics | {"quantisation_error": report.quantisation_error[-1]}
    material.metrics = {name: rounded(value) for name, value in found.items()}
    facts = table.facts | {name: value for name, value in asdict(table.counts).items() if value}
    if facts:
        material.options[FACTS] = plain({name: rounded(value) for name, value in facts.items()})
    return material, report


def rounded(value: Any) -> Any:
    """A number as files hold it; anything else as it is."""
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
