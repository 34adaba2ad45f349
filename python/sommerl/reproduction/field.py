"""Beyond the paper, and the benchmark: every method on every material."""

from __future__ import annotations

import statistics
import time
from collections.abc import Mapping, Sequence
from typing import Any

from ..plots import distortion
from ..render.compare import Comparison, compare_on_sphere
from ..render.environment import default_environment
from ..render.images import difference
from ..render.judge import under_one_lamp
from ..system.errors import SommerlError
from .cells import Cell, Outcome, Setting
from .data import NAMES
from .drawn import drawn
from .methods import METHODS, Source, short_name, speed
from .printed import published
from .section import Item, Outcomes, Picture, Section, Table, webp

FEW_METHODS = ("compact-1000", "paper", "som", "k-means-256", "network", "own", "table-nearest")
PICTURED = "nickel"  # a sharp highlight and rings, which each method loses in its own way
SIDE, PAIRS = 200, 200_000  # of pictures, in pixels; pairs of directions of which the speed is measured
COMPARED = 64  # samples a pixel at most: the references have the same directions, so noise cancels

# key, heading, format, and which of several is the worst
COLUMNS = (
    ("bytes", "bytes", ",.0f", max),
    ("psnr_frame_db", "environment [dB]", ".1f", min),
    ("psnr_soft_db", "soft light [dB]", ".1f", min),
    ("psnr_lamp_db", "one lamp [dB]", ".1f", min),
    ("log_error", "log error", ".3f", max),
    ("delta_e_itp", "ΔE_ITP", ".2f", max),
    ("seconds", "to fit [s]", ".1f", max),
    ("evaluations", "million evaluations/s", ".1f", min),
)
GOALS = ((9000, 56.0), (3200, 50.0))  # bytes, and dB in the environment: see `Limits`


def measured(setting: Setting, material: str, method: str) -> Outcome:
    """A material by a method; without values where there is no such form of it."""
    source = Source(material, setting.data)
    _ = source.table, source.judge  # what all methods have for nothing
    started = time.perf_counter()
    try:
        stored = METHODS[method].make(source)
    except SommerlError as error:
        return Outcome({"error": str(error)})
    if stored is None:
        return Outcome({})
    seconds = time.perf_counter() - started
    spp = min(setting.extent.spp, COMPARED)
    image = compare_on_sphere(source.brdf, [stored.brdf], default_environment(), size=setting.extent.size, spp=spp)[0]
    found = {"bytes": stored.size, "seconds": seconds, "evaluations": speed(stored.brdf, PAIRS) / 1e6}
    kept = {key: image.metrics[key] for key in ("psnr_frame_db", "psnr_object_db", "delta_e_itp")}
    pictures = _lamp(source, stored.brdf) if material == PICTURED else {}
    return Outcome(found | kept | source.judge.metrics(stored.brdf), pictures)


def _lamp(source: Source, brdf: Any) -> dict[str, bytes]:
    """The sphere under one lamp, and the difference."""
    found = Comparison(under_one_lamp(source.brdf, SIDE), under_one_lamp(brdf, SIDE), {})
    reference, shown = found.exposed()
    return {"reference": webp(reference), "lamp": webp(shown), "difference": webp(difference(reference, shown))}


def chosen(setting: Setting, materials: Sequence[str]) -> list[tuple[str, str]]:
    """Pairs of a material and a method."""
    methods = [name for name in METHODS if not setting.extent.few or name in FEW_METHODS]
    return [(each, name) for each in setting.some(materials) for name in methods]


def _plan(setting: Setting, materials: Sequence[str]) -> list[Cell]:
    return [
        Cell(
            f"methods/{material}/{method}",
            measured,
            {"material": material, "method": method},
            (material,),
            METHODS[method].cost,
        )
        for material, method in chosen(setting, materials)
    ]


def rows_of(outcomes: Outcomes, materials: Sequence[str]) -> list[dict[str, Any]]:
    """What was measured, a row for each material and method that there is."""
    found: list[dict[str, Any]] = []
    for material in materials:
        for method, about in METHODS.items():
            outcome = outcomes.get(f"methods/{material}/{method}")
            if outcome and "bytes" in outcome.values:
                head = {"material": short_name(material), "label": about.label, "family": about.family}
                found.append(head | dict(outcome.values))
    return found


def means(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Mean and worst of each method over its materials; of what is identical, the PSNR counts as none."""
    found: list[dict[str, Any]] = []
    for label in dict.fromkeys(row["label"] for row in rows):
        group = [row for row in rows if row["label"] == label]
        mean: dict[str, Any] = {"label": label, "family": group[0]["family"], "materials": len(group), "worst": {}}
        for key, _, _, worst in COLUMNS:
            numbers = [row[key] for row in group if row[key] is not None]
            mean[key] = statistics.fmean(numbers) if numbers else None
            mean["worst"][key] = worst(numbers) if numbers else None
        found.append(mean)
    return found


def table_of(title: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Rows as a table; means with the worst behind them."""
    shown: list[list[str]] = []
    for row in rows:
        cells = [row["label"]]
        for key, _, form, _ in COLUMNS:
            numbers = [row[key], *([row["worst"][key]] if key.startswith("psnr") and "worst" in row else [])]
            cells.append(", ".join("∞" if n is None else f"{n:{form}}" for n in numbers))
        shown.append(cells)
    return Table(title, ["method", *(heading for _, heading, _, _ in COLUMNS)], shown)


def _section(setting: Setting, outcomes: Outcomes, materials: Sequence[str]) -> Section:
    rows = rows_of(outcomes, materials)
    averages = means(rows)
    count = len({row["material"] for row in rows})
    tables = [table_of(f"Mean, worst over {count} materials", averages)]
    tables += [
        table_of(name, [row for row in rows if row["material"] == name])
        for name in dict.fromkeys(row["material"] for row in rows)
    ]
    figure = drawn(distortion.drawn(rows, averages))
    pictures = [Picture("PSNR over bytes, against the source: means, and thin a material each", figure, wide=True)]
    return Section({}, tables, [*pictures, *_failures(outcomes)], [*_compressed(setting), *_goals(averages)])


def _failures(outcomes: Outcomes) -> list[Picture]:
    """Where the eye sees what each method loses."""
    found: list[Picture] = []
    for method, about in METHODS.items():
        outcome = outcomes.get(f"methods/{PICTURED}/{method}")
        if outcome and outcome.pictures:
            if not found:
                found.append(Picture(f"{PICTURED} under one lamp: the source", outcome.pictures["reference"]))
            value = outcome.values["psnr_lamp_db"]
            text = f"{about.label}: {'identical' if value is None else f'{value:.1f} dB'}"
            found.append(Picture(text, outcome.pictures["lamp"], outcome.pictures["difference"]))
    return found


def _compressed(setting: Setting) -> list[str]:
    if not setting.data.compressed:
        return []
    return [
        "These stand-ins are compact files themselves, so the compact preset has it easier here than on other "
        "sources: its "
        "numbers are not comparable with those of the others."
    ]


def _goals(averages: Sequence[Mapping[str, Any]]) -> list[str]:
    """Whether what others publish is reached."""
    found: list[str] = []
    for size, goal in GOALS:
        best = [row for row in averages if row["family"] == "compact" and row["worst"]["bytes"] <= size]
        if best:
            row = max(best, key=lambda row: row["psnr_frame_db"])
            over = "reached" if row["psnr_frame_db"] >= goal else "missed"
            found.append(
                f"At most {size:,} bytes: {row['psnr_frame_db']:.1f} dB in the mean ({row['label']}), where {goal:g} "
                f"dB were the "
                f"goal: {over}."
            )
    return found


def _beyond(setting: Setting, outcomes: Outcomes) -> Section:
    return _section(setting, outcomes, [name for name in NAMES if name in setting.data.names()])


def _benchmark(setting: Setting, outcomes: Outcomes) -> Section:
    found = _section(setting, outcomes, setting.data.names())
    others = [
        [
            name,
            f"{each['bytes']:,}" if each["bytes"] else "–",
            f"{each['shared']:,}",
            f"{each['psnr_db']:.2f}",
            each["source"],
        ]
        for name, each in published().items()
    ]
    columns = [
        "published by others, on MERL, by their own definition",
        "bytes",
        "bytes shared by all",
        "PSNR [dB]",
        "source",
    ]
    note = (
        "Zheng et al. render a sphere with the material in three environments and take the PSNR of the image, in the "
        "mean over "
        "MERL's materials, which their network has learnt from. Size, exposure, tone curve and whether the "
        "background counts are "
        "not told. The nearest of ours is “environment”: a sphere in the built-in light, over the frame, against the "
        "stand-in."
    )
    return Section(
        {},
        [found.tables[0], Table("What others publish", columns, others), *found.tables[1:]],
        found.pictures,
        [*found.sentences, note],
    )


BEYOND = Item(
    "Beyond the paper",
    "What else stores a material, on the paper's six: bytes, and how near it is to the source.",
    lambda setting: _plan(setting, [name for name in NAMES if name in setting.data.names()]),
    _beyond,
)
BENCHMARK = Item(
    "Benchmark",
    "Every method on every material of the folder.",
    lambda setting: _plan(setting, setting.data.names()),
    _benchmark,
)
