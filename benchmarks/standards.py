"""How near do the surface models of standards come to measured-like materials, beside two lobes of GGX?

    uv run python benchmarks/stand_in_library.py OUT --count 1
    uv run python benchmarks/standards.py OUT.bases.npz [--samples 20000] [--starts 4] [--first 0] [--every 1]

The first command decodes the 99 stand-ins of Zheng et al.'s neural processes, as tables of 90 × 24 × 36 cells. Each
model is fitted to each of them, on the same samples. Printed are the relative errors (of f_r cos θ_i), and at the end,
for each model, the mean, the mean over that of GGX, and of how many materials it is the better one.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from stand_in_library import material

from sommerl.fitting import FitOptions, fit_models
from sommerl.models.standards import STANDARDS

GGX = "ggx"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bases", type=Path)
    parser.add_argument("--samples", type=int, default=20_000)
    parser.add_argument("--starts", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="the number of the first material")
    parser.add_argument("--every", type=int, default=1, help="only every so many materials")
    given = parser.parse_args()
    models = [GGX, *STANDARDS]
    errors: dict[str, list[float]] = {}
    with np.load(given.bases) as held:
        for name in held.files[given.first :: given.every]:
            brdf = material(name, held[name])
            options = FitOptions(samples=given.samples, starts=given.starts)
            errors[name] = [each.relative_error for each in fit_models(brdf, models, options)]
            print(f"{name:30}", *(f"{error:8.4f}" for error in errors[name]), flush=True)
    found = np.array(list(errors.values()))
    print(f"\n{len(found)} materials, {given.samples} samples, {given.starts} starts; relative error")
    for model, column in zip(models, found.T, strict=True):
        ratios = column / found[:, 0]
        worst = f"worst {ratios.max():.2f} ({list(errors)[int(ratios.argmax())]})"
        mean = f"mean {column.mean():.4f}, {column.mean() / found[:, 0].mean():.3f} of GGX's"
        print(f"{model:12} {mean}; median ratio {np.median(ratios):.3f}; better for {(ratios < 1).sum()}; {worst}")


if __name__ == "__main__":
    main()
