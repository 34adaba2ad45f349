"""The paper's claim that its representation's data is more proper for fits than measured, noisy data.

    uv run python benchmarks/noisy_fits.py [--seed N] [--samples N]

Built-in stand-ins of the paper's four materials of Table 1, with the measurement noise that it quotes
(`builtin_table(noise=...)`). Two-lobe models are fitted to the noisy table, to its compressed form (M = 1000), and to
the table without noise; each fit is judged against the table without noise. Ratios below 1: the compressed form's fit
is closer to the truth than the noisy table's. Prints Markdown.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from sommerl import Brdf, builtin_table
from sommerl.fitting import FitOptions, fit_models
from sommerl.fitting.data import samples_of
from sommerl.reflectance.samples import Samples
from sommerl.reproduction.data import compressed, expected


def error(fitted: Brdf, truth: Samples) -> float:
    """Of f_r cos θ_i, as the loss `cosine-l2`."""
    differences = (fitted.eval(truth.wi, truth.wo) - truth.f_r) * truth.wi[:, 2:]
    return float(np.sqrt((differences**2).mean()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1, help="of the noise")
    parser.add_argument("--samples", type=int, default=300_000)
    given = parser.parse_args()
    options = replace(FitOptions(), samples=given.samples)
    print("| material | model | to the truth | to the noisy table | to its compressed form | ratio |")
    print("|---|---|---|---|---|---|")
    ratios: list[float] = []
    for name, models in expected("table1").items():
        clean, noisy = builtin_table(name), builtin_table(name, noise=given.seed)
        ours = compressed(noisy, 1000).with_interpolation("trilinear")
        truth = samples_of(clean, options)
        fits = [fit_models(brdf, list(models), options) for brdf in (clean, noisy, ours)]
        for to_clean, to_noisy, to_ours in zip(*fits, strict=True):
            errors = [error(fit.brdf, truth) for fit in (to_clean, to_noisy, to_ours)]
            ratios.append(errors[2] / errors[1])
            figures = " | ".join(f"{value:.5f}" for value in errors)
            print(f"| {name} | {to_clean.model} | {figures} | {ratios[-1]:.4f} |", flush=True)
    below = sum(ratio < 1 for ratio in ratios)
    print(f"\n{below} of {len(ratios)} below 1; geometric mean {np.exp(np.mean(np.log(ratios))):.4f}")


if __name__ == "__main__":
    main()
