"""How near a prior comes to materials that it never saw, from few samples.

    uv run python benchmarks/few_samples.py [--data NP_FOLDER] [--cache FILE.npz] [--every 1]

Each of the 99 NP stand-ins is sampled as a table of 90 × 24 × 36 cells, and estimated by a prior of the four fifths of
the stand-ins among which it is not, as they are in the package. Samples are at cells drawn at random, each as likely as
another, as in Zheng et al. 2021 (--every N: of one material in N); at cells drawn by solid angle; or where that prior
plans them. Samples have no noise. PSNR is in soft light, against the table. `inside`: the share of all cells, by solid
angles and cosines, whose logarithm is within one and two standard deviations of the estimate. `errors`: how far off
logarithms are, in standard deviations, the root of the mean square.

The package's file was made from MERL tables of the stand-ins (../shared/tools/np_to_merl.py) by

    sommerl library build FOLDER -o LIBRARY --preset compact --target-size 4.8kB
    sommerl library pack LIBRARY -o python/sommerl/formats/stand_ins/np.smrlib
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np
from stand_in_library import LATTICE, NP, bases, material

from sommerl.formats.prior import DEVIATIONS, SMALL, Prior, sampled, stand_ins
from sommerl.reflectance.half_diff import directions
from sommerl.reflectance.samples import Samples
from sommerl.render.judge import Judge

FOLDS = 5
RUNS = (
    *((16, "planned"), (16, "cells"), (100, "cells"), (1458, "cells")),
    *((16, "solid angle"), (100, "solid angle"), (1458, "solid angle")),
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=NP)
    parser.add_argument("--cache", type=Path, default=Path("few_samples.npz"), help="what was decoded stays there")
    parser.add_argument("--every", type=int, default=1)
    options = parser.parse_args()
    tables = {name: material(name, values) for name, values in bases(options.data, options.cache).items()}
    known = {name: sampled(brdf) for name, brdf in stand_ins().items()}
    names = sorted(tables)
    found: dict[tuple[int, str], dict[str, Any]] = {run: {} for run in RUNS}
    for fold in range(FOLDS):
        prior = Prior(np.stack([known[name] for number, name in enumerate(names) if number % FOLDS != fold]))
        plans = {count: prior.plan(count) for count, how in RUNS if how == "planned"}
        for number in range(fold, len(names), FOLDS * options.every):
            name = names[number]
            judge = Judge(tables[name])
            for count, how in RUNS:
                at = _samples(tables[name], count, how, number, plans)
                estimate = prior.estimate(at)
                found[count, how][name] = judge.metrics(estimate)["psnr_soft_db"], *_off(tables[name], estimate)
            print(f"{sum(map(len, found.values()))} of {len(names) // options.every * len(RUNS)}", file=sys.stderr)
    print("| samples | | mean | worst, and the next | inside 1σ, 2σ | errors |\n|---|---|---|---|---|---|")
    for (count, how), each in found.items():
        psnr = {name: row[0] for name, row in each.items()}
        worst, *others = sorted(psnr, key=lambda name: psnr[name])
        mean, one, two, square = np.mean(list(each.values()), axis=0)
        next_ones = ", ".join(f"{psnr[name]:.1f}" for name in others[:3])
        row = f"{count} | {how} | {mean:.1f} | {psnr[worst]:.1f} ({worst}), {next_ones} | {one:.0%}, {two:.0%}"
        print(f"| {row} | {np.sqrt(square):.2f} |")
    return 0


def _samples(table: Any, count: int, how: str, seed: int, plans: dict[int, Any]) -> Samples:
    if how == "planned":
        there = Samples.at_angles(plans[count], np.zeros((count, 3)))
        return Samples(there.wi, there.wo, table.eval(there.wi, there.wo))
    above = LATTICE.above_horizon
    chance = LATTICE.solid_angles()[above] if how == "solid angle" else np.ones(int(above.sum()))
    rng = np.random.Generator(np.random.PCG64([seed, count]))
    chosen = rng.choice(len(chance), count, replace=False, p=chance / chance.sum())
    wi, wo = (np.stack(w, axis=-1) for w in directions(*(angle[above][chosen] for angle in LATTICE.angles())))
    return Samples(wi, wo, table.eval(wi, wo))


def _off(table: Any, estimate: Any) -> tuple[float, float, float]:
    """Which shares of the cells are within one and two standard deviations; and the mean square, in their squares."""
    above = DEVIATIONS.above_horizon
    wi, wo = (np.stack(w, axis=-1) for w in directions(*(angle[above] for angle in DEVIATIONS.angles())))
    cosines = np.prod(DEVIATIONS.cosines(), axis=0)[above]
    true, said = (np.log(brdf.eval(wi, wo) * cosines[:, None] + SMALL).mean(axis=1) for brdf in (table, estimate))
    off = np.abs(true - said) / estimate.deviation[above]
    weight = DEVIATIONS.solid_angles()[above] * cosines
    one, two, square = (float((weight * each).sum() / weight.sum()) for each in (off < 1, off < 2, off**2))
    return one, two, square


if __name__ == "__main__":
    sys.exit(main())
