"""How noisy is a render with each sampler, and what does a sample cost? Ratios from one run.

    uv run python benchmarks/sampling.py FOLDER/nickel.binary ../shared/data/rgl/*.bsdf [--size 128] [--spp 64]
        [--rounds 8] [--json FILE]

Each material is whatever `sommerl.load` reads, and is taken as it is: a MERL table is looked up trilinearly; RGL files
are as they were measured, one-sided and with negative channels. For each material and sampler:

* variance of the estimate of the albedo at five elevations of the viewer, relative to its square, and the largest
  weight of 10⁶ samples relative to their mean, at twelve elevations up to 85° (the mean of the channels);
* mean squared error of a rendered sphere within its outline, from the variance between rounds, which differ in their
  seeds alone. "even": the same light from everywhere, where all noise is the sampler's; "lights": the built-in
  environment, where most of it comes from lights that are smaller than the lobe; both with directions from the sampler
  only. "mis": the built-in environment as `sommerl render` does it, with directions to the light, too. At equal time:
  times the median seconds of a render.

Then geometric means over the materials, of ratios to cosine sampling and of ours to its peers; and the cost of one
sample and one density of our sampler, relative to its peers, of 2²² lanes in a kernel of their own.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import binary_erosion
from timing import interleaved

import sommerl
from sommerl.commands import console
from sommerl.factored.fit import factor
from sommerl.reflectance.brdf import Brdf
from sommerl.render.bsdf import upload
from sommerl.render.environment import default_environment
from sommerl.render.llvm import drjit, mitsuba
from sommerl.render.passes import render
from sommerl.render.scenes import sphere
from sommerl.sampling.lawrence import LawrenceSampler
from sommerl.sampling.named import OURS, SAMPLERS
from sommerl.sampling.sampler import Sampler

VARIANCE_ANGLES = (0, 30, 60, 75, 85)  # degrees
WEIGHT_ANGLES = (0, 15, 30, 45, 55, 65, 70, 75, 80, 82, 84, 85)
DRAWS = 10**6
LANES = 2**22
COST_ROUNDS = 9
LARGE = "lawrence, 16 × 4"  # from the factors that evaluation has, where `lawrence` itself takes 4 × 2


def even_environment() -> Any:
    return np.ones((16, 32, 3), np.float32)


DRAWN = {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1}
KINDS = {
    "even": (even_environment, DRAWN),
    "lights": (default_environment, DRAWN),
    "mis": (default_environment, {"type": "path", "max_depth": 2}),
}
QUANTITIES = ("variance", *(f"{kind}{time}" for kind in KINDS for time in ("", ", equal time")), "cost")


def uploaded(held: Brdf | Sampler) -> dict[str, Any]:
    return {name: upload(buffer) for name, buffer in held.buffers().items()}


def weights(sampler: Sampler, tables: dict[str, Any], values: dict[str, Any], degrees: float) -> Any:
    """Weights of DRAWS samples, the mean of the channels."""
    mi, dr = mitsuba(), drjit()
    rng = mi.PCG32(size=DRAWS)
    u = tuple(rng.next_float32() for _ in range(3))
    angle = np.radians(degrees)
    wo = tuple(dr.opaque(mi.Float, value, DRAWS) for value in (np.sin(angle), 0.0, np.cos(angle)))
    wi, pdf = sampler.draw(wo, u, tables)
    drawn = pdf > 0
    wi = tuple(dr.select(drawn, a, b) for a, b in zip(wi, (0.0, 0.0, 1.0), strict=True))
    r, g, b = sampler.brdf.f_r(wi, wo, values)
    return np.array(dr.select(drawn, (r + g + b) / 3 * wi[2] / dr.select(drawn, pdf, 1.0), 0.0), np.float64)


def statistics_of(sampler: Sampler) -> dict[str, Any]:
    tables, values = uploaded(sampler), uploaded(sampler.brdf)
    drawn = {degrees: weights(sampler, tables, values, degrees) for degrees in {*VARIANCE_ANGLES, *WEIGHT_ANGLES}}
    return {
        "variance": [float(drawn[d].var() / drawn[d].mean() ** 2) for d in VARIANCE_ANGLES],
        "largest weight": max(float(drawn[d].max() / drawn[d].mean()) for d in WEIGHT_ANGLES),
    }


def errors(
    samplers: dict[str, Sampler], environment: Any, plugin: Any, arguments: argparse.Namespace
) -> dict[str, Any]:
    """Of each sampler: mean squared error, and seconds of a render."""
    mi = mitsuba()
    scenes = {name: sphere(one.brdf, environment, sampler=one, size=arguments.size) for name, one in samplers.items()}
    # Pixels of the outline have the noise of what they cover, too.
    mask: Any = binary_erosion(render(next(iter(scenes.values())), spp=1).mask, np.ones((3, 3)))
    integrator = mi.load_dict(plugin)
    images: dict[str, list[Any]] = {name: [] for name in scenes}

    def shoot(name: str) -> None:
        scene, seed = scenes[name].mitsuba, len(images[name])
        pixels = np.array(mi.render(scene, integrator=integrator, spp=arguments.spp, seed=seed))
        images[name].append(pixels[mask].astype(np.float64))

    for name in scenes:
        shoot(name)  # compiles the kernel
    seconds = interleaved({name: lambda name=name: shoot(name) for name in scenes}, arguments.rounds)
    return {
        name: (float(np.var(np.stack(images[name]), axis=0, ddof=1).mean()), statistics.median(seconds[name]))
        for name in scenes
    }


def costs(samplers: dict[str, Sampler]) -> dict[str, float]:
    """Median seconds of a sample and a density, for viewers all over the hemisphere."""
    mi, dr = mitsuba(), drjit()
    rng = mi.PCG32(size=LANES)
    u = tuple(rng.next_float32() for _ in range(3))
    viewer = mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    other = mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    dr.eval(u, viewer, other)
    wo, wi = (viewer.x, viewer.y, viewer.z), (other.x, other.y, other.z)
    tables = {name: uploaded(one) for name, one in samplers.items()}

    def run(name: str) -> None:
        drawn, pdf = samplers[name].draw(wo, u, tables[name])
        dr.eval(*drawn, pdf, samplers[name].density(wi, wo, tables[name]))
        dr.sync_thread()

    for name in samplers:
        run(name)
    seconds = interleaved({name: lambda name=name: run(name) for name in samplers}, COST_ROUNDS)
    return {name: statistics.median(times) for name, times in seconds.items()}


def measured(brdf: Brdf, arguments: argparse.Namespace) -> dict[str, Any]:
    samplers: dict[str, Sampler] = {name: kind.fitted(brdf) for name, kind in SAMPLERS.items()}
    samplers[LARGE] = LawrenceSampler.of(brdf, factor(brdf))
    row = {name: statistics_of(sampler) for name, sampler in samplers.items()}
    for name, seconds in costs(samplers).items():
        row[name]["cost"] = seconds
    for kind, (environment, plugin) in KINDS.items():
        for name, (mse, seconds) in errors(samplers, environment(), plugin, arguments).items():
            row[name][kind] = mse
            row[name][f"{kind}, equal time"] = mse * seconds
    return row


def geometric(values: list[float]) -> float:
    return float(np.exp(np.mean(np.log(values))))


def ratios(rows: dict[str, Any], name: str, peer: str) -> dict[str, float]:
    """Geometric means over materials (and over angles, of variances) of one sampler : another."""
    result: dict[str, float] = {}
    for quantity in QUANTITIES:
        pairs = [(np.atleast_1d(row[name][quantity]), np.atleast_1d(row[peer][quantity])) for row in rows.values()]
        result[quantity] = geometric([float(a / b) for x, y in pairs for a, b in zip(x, y, strict=True) if b > 0])
    return result


def report(rows: dict[str, Any]) -> dict[str, Any]:
    for material, row in rows.items():
        table = [
            [
                name,
                " ".join(f"{value:.3g}" for value in found["variance"]),
                f"{found['largest weight']:.1f}",
                *(f"{found[quantity] / row['cosine'][quantity]:.3g}" for quantity in QUANTITIES[1:]),
            ]
            for name, found in row.items()
        ]
        columns = ["sampler", f"variance at {VARIANCE_ANGLES}°", "largest weight"]
        console.print_table(material, [*columns, *(f"{quantity} : cosine" for quantity in QUANTITIES[1:])], table)
    means = {f"{name} : cosine": ratios(rows, name, "cosine") for name in (*SAMPLERS, LARGE) if name != "cosine"}
    means |= {
        f"{OURS.name} : {name}": ratios(rows, OURS.name, name) for name in (*SAMPLERS, LARGE) if name != OURS.name
    }
    table = [[name, *(f"{value:.3g}" for value in found.values())] for name, found in means.items()]
    console.print_table("geometric means", ["samplers", *QUANTITIES], table)
    return means


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("materials", nargs="+")
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows: dict[str, Any] = {}
    for source in arguments.materials:
        rows[source] = measured(sommerl.load(source), arguments)
    means = report(rows)
    if arguments.json:
        arguments.json.write_text(json.dumps({"materials": rows, "means": means}, indent=2))


if __name__ == "__main__":
    main()
