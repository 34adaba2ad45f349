"""Which rule and first learning rate? PSNR on the sphere in the paper's cases; quality and size with the defaults.

    uv run python benchmarks/learner_options.py FOLDER                       the defaults
    uv run python benchmarks/learner_options.py FOLDER --grid                every rule and rate
    uv run python benchmarks/learner_options.py FOLDER --survey              the same for every material there is
    uv run python benchmarks/learner_options.py FOLDER --units               where the units end, by rule and rate
    uv run python benchmarks/learner_options.py FOLDER --neighbours          with a neighbourhood
    uv run python benchmarks/learner_options.py FOLDER --envmap probe.exr    in another environment

FOLDER holds MERL tables, among them the paper's six materials. The reference is the table with nearest lookup. Prints
Markdown.
"""

from __future__ import annotations

import argparse
import statistics
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from sommerl import TrainOptions, load_table, train
from sommerl.compression.smrl.file import encode
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import default_environment, load_environment

# material, clusters, epochs, which PSNR
CASES = (
    ("yellow-matte-plastic", 64, 10, "frame"),
    ("blue-metallic-paint", 256, 50, "frame"),
    ("yellow-matte-plastic", 1000, 30, "object"),
    ("nickel", 1000, 30, "object"),
    ("purple-paint", 1000, 30, "object"),
    ("green-metallic-paint", 1000, 30, "object"),
    ("beige-fabric", 1000, 30, "object"),
)
MATERIALS = tuple(dict.fromkeys(case[0] for case in CASES))
GRID = tuple(product(("paper", "kohonen"), (0.5, 0.1, 0.02, 0.004)))
SURVEY = ((64, 10), (256, 30))  # clusters, epochs
PRINTED = ("paper", 0.5)
FEW = {"clusters": 64, "epochs": 10}  # of the next two
UNITS = (("paper", 0.5), ("paper", 0.02), ("kohonen", 0.5), ("kohonen", 0.02), ("kohonen", 0.004))
BODY, HIGHLIGHT = 0.2, 20.0  # 1/sr, as the mean of the channels: the ends of yellow-matte-plastic's
NEIGHBOURS = ((0, "chain"), (0.5, "chain"), (2, "chain"), (8, "chain"), (2, "sheet"))  # radius, topology


def measured(path: Path, chosen: Sequence[dict[str, Any]], environment: Any, spp: int) -> list[tuple[Any, int]]:
    """For each choice of options: how far the material is from its table, and the bytes of its file."""
    table = load_table(path).with_interpolation("nearest")
    materials = [train(table, TrainOptions(**options))[0] for options in chosen]
    comparisons = compare_on_sphere(table, materials, environment, spp=spp)
    return [(each.metrics, len(encode(material))) for each, material in zip(comparisons, materials, strict=True)]


def cases(options: argparse.Namespace, rules: Sequence[tuple[str, float]], environment: Any) -> None:
    """The paper's cases."""
    rows = list(product(rules, options.seeds))
    columns: list[list[str]] = []
    for name, clusters, epochs, over in CASES:
        chosen = [
            {"clusters": clusters, "epochs": epochs, "rule": rule, "alpha": alpha, "seed": seed}
            for (rule, alpha), seed in rows
        ]
        found = measured(options.folder / f"{name}.binary", chosen, environment, options.spp)
        columns.append([f"{metrics[f'psnr_{over}_db']:.1f}" for metrics, _ in found])
    print("| rule | α | seed |" + "".join(f" {name}, {m}, {epochs}, {over} |" for name, m, epochs, over in CASES))
    print("|---|---|---|" + "---|" * len(CASES))
    for ((rule, alpha), seed), values in zip(rows, zip(*columns, strict=True), strict=True):
        print(f"| {rule} | {alpha} | {seed} | " + " | ".join(values) + " |")


def defaults(options: argparse.Namespace, environment: Any) -> None:
    """The paper's materials with the defaults."""
    print(f"\nThe defaults: M = {TrainOptions().clusters}, {TrainOptions().epochs} epochs\n")
    print("| material | PSNR object [dB] | PSNR frame [dB] | file [bytes] |\n|---|---|---|---|")
    sizes: list[int] = []
    for name in MATERIALS:
        ((metrics, size),) = measured(options.folder / f"{name}.binary", [{}], environment, options.spp)
        print(f"| {name} | {metrics['psnr_object_db']:.1f} | {metrics['psnr_frame_db']:.1f} | {size} |", flush=True)
        sizes.append(size)
    print(f"| median | | | {statistics.median(sizes):.0f} |")


def survey(options: argparse.Namespace, environment: Any) -> None:
    """Every rule and rate on every table of the folder, over the object."""
    paths = sorted(options.folder.glob("*.binary"))
    heading = " | ".join(f"{rule}, {alpha}" for rule, alpha in GRID)
    for clusters, epochs in SURVEY:
        print(f"\nM = {clusters}, {epochs} epochs\n\n| material | {heading} |\n|---|" + "---|" * len(GRID))
        chosen = [{"clusters": clusters, "epochs": epochs, "rule": rule, "alpha": alpha} for rule, alpha in GRID]
        rows: list[list[float]] = []
        for path in paths:
            found = measured(path, chosen, environment, options.spp)
            rows.append([metrics["psnr_object_db"] for metrics, _ in found])
            print(f"| {path.stem} | " + " | ".join(f"{value:.1f}" for value in rows[-1]) + " |", flush=True)
        columns = list(zip(*rows, strict=True))
        printed = columns[GRID.index(PRINTED)]
        ahead = [sum(a > b for a, b in zip(column, printed, strict=True)) for column in columns]
        for title, values in (
            ("mean", [f"{statistics.fmean(column):.1f}" for column in columns]),
            ("worst", [f"{min(column):.1f}" for column in columns]),
            (f"better than {PRINTED[0]}, {PRINTED[1]}", [f"{count} of {len(paths)}" for count in ahead]),
        ):
            print(f"| {title} | " + " | ".join(values) + " |", flush=True)


def units(folder: Path) -> None:
    """How the palette of yellow-matte-plastic is spread over its values, and what that costs."""
    table = load_table(folder / "yellow-matte-plastic.binary").with_interpolation("nearest")
    f_r = table.values[table.lattice.above_horizon]
    body = f_r.mean(axis=-1) < BODY
    print(f"| rule | α | below {BODY} | to {HIGHLIGHT} | above | median relative error below {BODY} | RMSE |")
    print("|---|---|---|---|---|---|---|")
    for rule, alpha in UNITS:
        material, _ = train(table, TrainOptions(rule=rule, alpha=alpha, **FEW))
        low, middle, high = np.histogram(material.lut.mean(axis=-1), (0, BODY, HIGHLIGHT, np.inf))[0]
        error = material.values[table.lattice.above_horizon] - f_r
        relative = np.median(np.abs(error[body]).sum(axis=-1) / f_r[body].sum(axis=-1))
        rmse = np.sqrt(np.mean(error**2))
        print(f"| {rule} | {alpha} | {low} | {middle} | {high} | {relative:.1%} | {rmse:.1f} |", flush=True)


def neighbours(options: argparse.Namespace, environment: Any) -> None:
    """What a neighbourhood costs, over the object."""
    names = ("yellow-matte-plastic", "blue-metallic-paint", "nickel")
    chosen = [{"radius": radius, "topology": topology, **FEW} for radius, topology in NEIGHBOURS]
    columns = [measured(options.folder / f"{name}.binary", chosen, environment, options.spp) for name in names]
    print("| radius, topology | " + " | ".join(names) + " |\n|---|" + "---|" * len(names))
    for (radius, topology), found in zip(NEIGHBOURS, zip(*columns, strict=True), strict=True):
        values = " | ".join(f"{metrics['psnr_object_db']:.1f}" for metrics, _ in found)
        print(f"| {radius}, {topology} | {values} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--grid", action="store_true")
    parser.add_argument("--survey", action="store_true")
    parser.add_argument("--units", action="store_true")
    parser.add_argument("--neighbours", action="store_true")
    parser.add_argument("--envmap", type=Path)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    options = parser.parse_args()
    environment = load_environment(options.envmap) if options.envmap else default_environment()
    if options.units:
        units(options.folder)
    elif options.survey:
        survey(options, environment)
    elif options.neighbours:
        neighbours(options, environment)
    else:
        cases(options, GRID if options.grid else [(TrainOptions().rule, TrainOptions().alpha)], environment)
        defaults(options, environment)


if __name__ == "__main__":
    main()
