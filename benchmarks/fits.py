"""How good are the fits of analytic models: against another optimiser, and against searching albedos, too?

    uv run python benchmarks/fits.py [MATERIAL...] [--samples N] [--starts N] [--loss LOSS]

For each material (paths or names; three built-in stand-ins by default) and model, two lobes, on the same samples:

* "SciPy trf": the error of the best of 50 random starts of SciPy's `least_squares` (trust region reflective, bounds,
  differences for derivatives) over all parameters, divided by ours: at least 1 if ours is no worse.
* "searched": the same for our search over albedos and shapes at once, and its time divided by that of the search over
  shapes with the albedos solved for; only where the loss is linear in f_r.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from scipy.optimize import least_squares

from sommerl import load_table
from sommerl.fitting.data import samples_of
from sommerl.fitting.loss import LOG_EPSILON
from sommerl.fitting.options import FitOptions, Loss, families_of
from sommerl.fitting.search import Search
from sommerl.models.family import Family
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.reflectance.samples import Samples

MATERIALS = ("blue-metallic-paint", "yellow-matte-plastic", "beige-fabric")
STARTS = 50
MOST_ALBEDO = 20.0  # a bound for the outside search, that ours has not
MODELS = [name for name, family in FAMILIES.items() if not family.diffuse]


def seen(f_r: np.ndarray, cosine: np.ndarray, loss: str) -> np.ndarray:
    """What a loss compares, once more, apart from the code that is tested."""
    if loss == "l2":
        return f_r
    if loss == "log":
        return np.log1p(f_r * cosine / LOG_EPSILON)
    return f_r * cosine if loss == "cosine-l2" else np.cbrt(f_r * cosine)


def outside(samples: Samples, families: tuple[Family, ...], loss: str, starts: int) -> float:
    """The least error that SciPy's trust region finds."""
    random = np.random.default_rng(0)
    parameters = [p for family in families for p in family.parameters]
    count = 3 * len(families)
    low = np.array([0.0] * count + [p.low for p in parameters])
    high = np.array([MOST_ALBEDO] * count + [p.high for p in parameters])
    cosine = samples.wi[:, 2:]
    target = seen(samples.f_r, cosine, loss)

    def residuals(x: np.ndarray) -> np.ndarray:
        shapes = iter(x[count:])
        lobes = [
            Lobe(family, tuple(albedo), {p.name: next(shapes) for p in family.parameters})
            for family, albedo in zip(families, x[:count].reshape(-1, 3), strict=True)
        ]
        return (seen(MultiLobe("", lobes).eval(samples.wi, samples.wo), cosine, loss) - target).ravel()

    costs: list[float] = []
    for _ in range(starts):
        shapes = [float(p.at(random.uniform(0.02, 0.98))) for p in parameters]
        start = [*random.uniform(0, 1, count), *shapes]
        costs.append(least_squares(residuals, start, bounds=(low, high), method="trf", x_scale="jac").cost)
    return float(np.sqrt(2 * min(costs) / target.size))


def inside(samples: Samples, families: tuple[Family, ...], options: FitOptions, solves: bool) -> tuple[float, float]:
    """Our error, and the seconds that it took, the compilation of kernels apart."""
    search = Search(families, samples, options)
    search.solves = solves
    search.whole.value(np.full(len(search.whole.parameters), 0.5), np.full((len(families), 3), 0.5))
    started = time.perf_counter()
    error = search.run(lambda done: None)[0].error
    return error, time.perf_counter() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("materials", nargs="*", default=MATERIALS)
    parser.add_argument("--samples", type=int, default=3000)
    parser.add_argument("--starts", type=int, default=STARTS, help="of SciPy's search")
    parser.add_argument("--loss", choices=Loss.__args__, default=FitOptions().loss)
    given = parser.parse_args()
    options = FitOptions(samples=given.samples, loss=given.loss)
    print(f"{'':42}     ours   SciPy trf   searched: error, time")
    for material in given.materials:
        samples = samples_of(load_table(material), options)
        for model in MODELS:
            families = families_of(model, 2)
            linear = given.loss in ("l2", "cosine-l2")
            error, seconds = inside(samples, families, options, solves=linear)
            theirs = outside(samples, families, given.loss, given.starts) / error if given.starts else float("nan")
            line = f"{material[-22:]:22} {model:18} {error:10.6f}  {theirs:10.7f}"
            if linear:
                searched, longer = inside(samples, families, options, solves=False)
                line += f"  {searched / error:10.7f} {longer / seconds:6.2f}"
            print(line, flush=True)


if __name__ == "__main__":
    main()
