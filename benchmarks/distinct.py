"""What the option `distinct` changes: how many cells a unit remembers, the table's error, and PSNR on the sphere.

    uv run python benchmarks/distinct.py FOLDER

FOLDER holds MERL tables of the paper's six materials; or it is an archive of neural BRDFs with them. Each is compressed
by both rules at the settings of docs/method.md, without and with `distinct`; the reference is the table with nearest
lookup. Prints Markdown: the share of units that store one colour three times, the relative L2 error and the
cosine-weighted error of the logarithm over the table's cells, and the PSNR over the object [dB].
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from sommerl import BrdfTable, TrainOptions, _core, train
from sommerl.reflectance.distance import table_metrics
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import default_environment
from sommerl.reproduction.data import Data

# material, clusters, epochs
CASES = (
    ("yellow-matte-plastic", 64, 10),
    ("blue-metallic-paint", 256, 50),
    ("yellow-matte-plastic", 256, 30),
    ("nickel", 256, 30),
    ("purple-paint", 256, 30),
    ("green-metallic-paint", 256, 30),
    ("beige-fabric", 256, 30),
)
RULES = (("kohonen", 0.02), ("paper", 0.5))


class Watched:
    """The core, whose last learner is kept."""

    Quantiser = _core.Quantiser
    learner: Any

    def Learner(self, *arguments: Any, **options: Any) -> Any:
        self.learner = _core.Learner(*arguments, **options)
        return self.learner


def of_one_colour(table: BrdfTable, stored: Any) -> float:
    """The share of units that won whose stored originals are all of one colour."""
    colours = np.append(table.values[table.lattice.above_horizon], [[np.nan] * 3], axis=0)
    stored = stored[stored[:, 0] != _core.EMPTY]
    held = colours[np.minimum(stored, len(colours) - 1)]
    return float((held == held[:, :1]).all(axis=(1, 2)).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("--spp", type=int, default=256)
    given = parser.parse_args()
    print("| material, M, epochs | rule, α | units of one colour | relative error | log error | PSNR object [dB] |")
    print("|---|---|---|---|---|---|")
    for name, clusters, epochs in CASES:
        table = Data(given.data).table(name).with_interpolation("nearest")
        for rule, alpha in RULES:
            figures: list[tuple[float, float, float]] = []
            found: list[Any] = []
            for distinct in (False, True):
                options = TrainOptions(clusters=clusters, epochs=epochs, rule=rule, alpha=alpha, distinct=distinct)
                watched = Watched()
                found.append(train(table, options, kernels=watched)[0])
                error = table_metrics(table.values, found[-1].values, table.lattice)
                share = of_one_colour(table, watched.learner.stored_cells())
                figures.append((share, error["relative_error"], error["log_error_cosine"]))
            compared = compare_on_sphere(table, found, default_environment(), spp=given.spp)
            shares, relative, logs = zip(*figures, strict=True)
            psnr = [each.metrics["psnr_object_db"] for each in compared]
            print(
                f"| {name}, {clusters}, {epochs} | {rule}, {alpha} | {shares[0]:.0%}, {shares[1]:.0%} | "
                f"{relative[0]:.5f}, {relative[1]:.5f} | {logs[0]:.5f}, {logs[1]:.5f} | "
                f"{psnr[0]:.2f}, {psnr[1]:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
