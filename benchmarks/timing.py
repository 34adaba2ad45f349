"""Interleaved timing: every contestant once in each round, so that a machine that gets slower does so for all."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from typing import Any

Seconds = dict[str, list[float]]


def interleaved(contestants: Mapping[str, Callable[[], Any]], rounds: int) -> Seconds:
    """Seconds of each contestant in each round."""
    seconds: Seconds = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            started = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - started)
    return seconds


def ratio(seconds: Seconds, peer: str, ours: str) -> dict[str, float]:
    """How many times the peer's time is ours: median, least and most over rounds."""
    ratios = [a / b for a, b in zip(seconds[peer], seconds[ours], strict=True)]
    return {"median": statistics.median(ratios), "least": min(ratios), "most": max(ratios)}


def text(value: Mapping[str, float]) -> str:
    """A ratio as it is printed."""
    return f"{value['median']:.2f} ({value['least']:.2f}-{value['most']:.2f})"
