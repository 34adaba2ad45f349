"""Table 2: how long a render takes with each representation, relative to the paper's, from one interleaved run."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compression.compact.search import CompactOptions, compress
from ..fitting import FitOptions, fit
from ..models.multi_lobe import FAMILIES
from ..plots import distortion
from ..reflectance.brdf import Brdf
from ..render.environment import default_environment
from ..render.llvm import mitsuba
from ..render.passes import render
from ..render.scenes import sphere
from .cells import Cell, Outcome, Setting
from .drawn import drawn
from .printed import printed
from .section import Item, Ours, Outcomes, Picture, Section, Table

OURS, RAW, LAWRENCE = "som-man", "raw table", "lawrence"
COMPACT = "compact, 8 kB"
LOBES = ("ward", "cook-torrance")  # models that are rendered with three lobes, too
REFERENCE = 32  # times as many samples has the image to which errors are taken
SAMPLES = 100_000  # of fits at most: time does not depend on how good they are
RESAMPLED, CONFIDENCE = 4000, 95
Ratios = NDArray[np.float64]


def table2(setting: Setting, material: str) -> Outcome:
    """Seconds of each representation in each round, and the error of its image."""
    extent, environment = setting.extent, default_environment()
    found = _representations(setting, material)
    scenes = {name: sphere(brdf, environment, size=extent.size) for name, brdf in found.items()}
    reference = render(scenes[RAW], spp=REFERENCE * extent.time_spp, seed=1)
    images: dict[str, Any] = {}

    def shoot(name: str, seed: int) -> None:
        mi = mitsuba()
        images[name] = np.array(mi.render(scenes[name].mitsuba, spp=extent.time_spp, seed=seed), np.float64)

    for name in scenes:
        shoot(name, 0)  # compiles the kernel
    seconds = interleaved({name: partial(shoot, name) for name in scenes}, extent.rounds)
    mask = reference.mask
    errors = {name: float(np.sqrt(np.square(images[name] - reference.pixels)[mask].mean())) for name in images}
    return Outcome({"seconds": seconds, "errors": errors})


def interleaved(contestants: Mapping[str, Callable[[int], None]], rounds: int) -> dict[str, list[float]]:
    """Seconds of each contestant in each round: one after the other, so that a machine that gets slower does so for
    all. Each is called with the number of the round."""
    seconds: dict[str, list[float]] = {name: [] for name in contestants}
    for number in range(rounds):
        for name, run in contestants.items():
            started = time.perf_counter()
            run(1 + number)
            seconds[name].append(time.perf_counter() - started)
    return seconds


def interval(ratios: Ratios) -> tuple[float, float, float]:
    """The median of ratios, one a round, and its 95 % confidence interval, by the bootstrap (percentiles of the medians
    of as many rounds, drawn again with a fixed seed)."""
    random = np.random.Generator(np.random.PCG64(0))
    medians = np.median(ratios[random.integers(0, len(ratios), (RESAMPLED, len(ratios)))], axis=1)
    tail = (100 - CONFIDENCE) / 2
    low, high = np.percentile(medians, (tail, 100 - tail))
    return float(np.median(ratios)), float(low), float(high)


def _representations(setting: Setting, material: str) -> dict[str, Brdf]:
    """Every way to hold a material, by name; ours first."""
    table = setting.data.table(material)
    options = CompactOptions(target_size=1000 if setting.extent.few else 8000)
    found: dict[str, Brdf] = {OURS: setting.learnt(table, 256), RAW: table.with_interpolation("nearest")}
    found |= {COMPACT: compress(table, options)[0], LAWRENCE: setting.factored(table)}
    models = setting.some((name for name, family in FAMILIES.items() if not family.diffuse), 2)
    samples = min(setting.extent.samples, SAMPLES)
    for model, lobes in [*((name, 2) for name in models), *((name, 3) for name in setting.some(LOBES))]:
        chosen = FitOptions(lobes=lobes, samples=samples, starts=min(setting.extent.starts, 6))
        found[f"{model}, {lobes} lobes"] = fit(table, model, chosen).brdf
    return found


def _plan(setting: Setting) -> Sequence[Cell]:
    materials = dict.fromkeys(key.split("/")[0] for key in printed("table2"))
    return [
        Cell(f"table2/{name}", table2, {"material": name}, (name,), 240.0, alone=True)
        for name in setting.some(materials)
    ]


def _show(setting: Setting, outcomes: Outcomes) -> Section:
    ours: dict[str, Ours] = {}
    tables: list[Table] = []
    pictures: list[Picture] = []
    sentences: list[str] = []
    for name, outcome in outcomes.items():
        if not name.startswith("table2/"):
            continue
        material = name.removeprefix("table2/")
        seconds = {key: np.array(value) for key, value in outcome.values["seconds"].items()}
        errors = outcome.values["errors"]
        found = {key: interval(each / seconds[OURS]) for key, each in seconds.items()}
        rows = [[key, f"{m:.3f}", f"{a:.3f} to {b:.3f}", f"{errors[key]:.4g}"] for key, (m, a, b) in found.items()]
        columns = ["", "time : ours", f"{CONFIDENCE} % interval", "error of the image"]
        tables.append(Table(f"{material}: {len(seconds[OURS])} interleaved rounds", columns, rows))
        points = {key: (errors[key], found[key][0]) for key in found}
        pictures.append(
            Picture(f"{material}: render time and error", drawn(distortion.time_over_error(points)), wide=True)
        )
        for key in printed("table2"):
            kind = key.partition("/")[2]
            if key.startswith(f"{material}/") and kind in found:
                median, low, high = found[kind]
                ours[key] = Ours(material, median, None, (low, high))
        sentences += _told(material, seconds)
    return Section(ours, tables, pictures, sentences)


def _told(material: str, seconds: Mapping[str, Ratios]) -> list[str]:
    """Whether the paper's representation is faster than the table, and than a formula."""
    lobes = np.median([each for name, each in seconds.items() if name.endswith("2 lobes")], axis=0)
    peers = {"the raw table": (seconds[RAW], 1.0), "the median two-lobe formula": (lobes, 1.05)}
    found: list[str] = []
    for peer, (theirs, goal) in peers.items():
        median, low, high = interval(seconds[OURS] / theirs)
        if high <= goal:
            verdict = f"at most {goal:g} times"
        else:
            verdict = (
                f"more than {goal:g} times" if low > goal else f"whether it is at most {goal:g} times, cannot be told"
            )
        found.append(
            f"{material}: the paper's representation takes {median:.3f} times the time of {peer} ({low:.3f} to "
            f"{high:.3f}): "
            f"{verdict}."
        )
    return found


TABLE2 = Item(
    "Table 2: rendering times",
    "A sphere in the built-in light, path traced; each representation once in each round, with a sampler that is "
    "fitted to it. "
    "Times are divided by that of the paper's representation with M = 256.",
    _plan,
    _show,
)
