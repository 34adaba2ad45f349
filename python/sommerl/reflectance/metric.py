"""What a metric is: a distance between a reference and a candidate, how it is measured and how it is shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import inf
from typing import Any


@dataclass(frozen=True)
class Metric:
    """A distance.

    key: its name in JSON, in files and in Python. label: its name for people. value: calculates it; what it takes is
        said where the table of metrics is. shown: its value for people.
    """

    key: str
    label: str
    value: Callable[..., float]
    shown: Callable[[float], str]


def measured(metrics: Iterable[Metric], *pair: Any) -> dict[str, float]:
    """The values of some metrics by their keys. pair: what their `value` takes."""
    return {metric.key: metric.value(*pair) for metric in metrics}


def rows(metrics: Iterable[Metric], values: Mapping[str, float]) -> dict[str, str]:
    """The values of some metrics as people read them, by their labels."""
    return {metric.label: metric.shown(values[metric.key]) for metric in metrics}


def decibels(value: float) -> str:
    """A PSNR; identical images have none."""
    return "identical" if value == inf else f"{value:.2f} dB"
