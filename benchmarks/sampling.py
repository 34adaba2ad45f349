"""How noisy is a render with each sampler, and what does a sample cost? Ratios from one run.

    uv run python benchmarks/sampling.py MATERIAL... [--size 128] [--spp 64] [--rounds 8] [--json FILE]

For each MATERIAL and sampler:

* variance of the estimate of the albedo at five elevations of the viewer, relative to its square, and the largest
  weight of 10⁶ samples relative to their mean, at twelve elevations up to 85° (the mean of the channels);
* mean squared error of a rendered sphere over the object's pixels, from the variance between rounds, which differ in
  their seeds alone: with directions from the sampler only ("bsdf"), and as `sommerl render` does it, together with
  directions to the light ("mis"). At equal time: times the median seconds of a render.

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
from timing import interleaved

import sommerl
from sommerl import console
from sommerl.brdf import Brdf
from sommerl.render.bsdf import upload
from sommerl.render.environment import default_environment
from sommerl.render.llvm import drjit, mitsuba
from sommerl.render.scenes import _mask, sphere
from sommerl.sampling.named import OURS, SAMPLERS
from sommerl.sampling.sampler import Sampler

VARIANCE_ANGLES = (0, 30, 60, 75, 85)  # degrees
WEIGHT_ANGLES = (0, 15, 30, 45, 55, 65, 70, 75, 80, 82, 84, 85)
DRAWS = 10**6
LANES = 2**22
COST_ROUNDS = 9


def weights(sampler: Sampler, degrees: float) -> Any:
    """Weights of DRAWS samples, the mean of the channels."""
    angle = np.radians(degrees)
    wo = np.array([np.sin(angle), 0.0, np.cos(angle)])
    return sampler.sample(wo, np.random.default_rng(0).random((DRAWS, 3)))[2].mean(axis=-1)


def statistics_of(sampler: Sampler) -> dict[str, Any]:
    drawn = {degrees: weights(sampler, degrees) for degrees in {*VARIANCE_ANGLES, *WEIGHT_ANGLES}}
    return {
        "variance": [float(drawn[d].var() / drawn[d].mean() ** 2) for d in VARIANCE_ANGLES],
        "largest weight": max(float(drawn[d].max() / drawn[d].mean()) for d in WEIGHT_ANGLES),
    }


def errors(samplers: dict[str, Sampler], size: int, spp: int, rounds: int) -> dict[str, Any]:
    """Of each kind of integrator and sampler: mean squared error, and seconds of a render."""
    mi = mitsuba()
    environment = default_environment()
    scenes = {name: sphere(one.brdf, environment, sampler=one, size=size) for name, one in samplers.items()}
    mask = _mask(next(iter(scenes.values())), size, size)
    result: dict[str, Any] = {}
    for kind, plugin in (
        ("bsdf", {"type": "direct", "emitter_samples": 0, "bsdf_samples": 1}),
        ("mis", {"type": "path", "max_depth": 2}),
    ):
        integrator = mi.load_dict(plugin)
        images: dict[str, list[Any]] = {name: [] for name in scenes}

        def shoot(name: str, integrator: Any = integrator, images: Any = images) -> None:
            seed = len(images[name])
            pixels = np.array(mi.render(scenes[name], integrator=integrator, spp=spp, seed=seed))
            images[name].append(pixels[mask].astype(np.float64))

        for name in scenes:
            shoot(name)  # compiles the kernel
        seconds = interleaved({name: lambda name=name: shoot(name) for name in scenes}, rounds)
        result[kind] = {
            name: {
                "mse": float(np.var(np.stack(images[name]), axis=0, ddof=1).mean()),
                "seconds": statistics.median(seconds[name]),
            }
            for name in scenes
        }
    return result


def costs(samplers: dict[str, Sampler]) -> dict[str, float]:
    """Median seconds of a sample and a density, for viewers all over the hemisphere."""
    mi, dr = mitsuba(), drjit()
    rng = mi.PCG32(size=LANES)
    u = tuple(rng.next_float32() for _ in range(3))
    viewer = mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    other = mi.warp.square_to_uniform_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    dr.eval(u, viewer, other)
    wo, wi = (viewer.x, viewer.y, viewer.z), (other.x, other.y, other.z)
    tables = {name: {k: upload(v) for k, v in one.buffers().items()} for name, one in samplers.items()}

    def run(name: str) -> None:
        drawn, pdf = samplers[name].draw(wo, u, tables[name])
        dr.eval(*drawn, pdf, samplers[name].density(wi, wo, tables[name]))
        dr.sync_thread()

    for name in samplers:
        run(name)
    seconds = interleaved({name: lambda name=name: run(name) for name in samplers}, COST_ROUNDS)
    return {name: statistics.median(times) for name, times in seconds.items()}


def measured(brdf: Brdf, arguments: argparse.Namespace) -> dict[str, Any]:
    samplers = {name: kind.fitted(brdf) for name, kind in SAMPLERS.items()}
    row = {name: statistics_of(sampler) for name, sampler in samplers.items()}
    for name, seconds in costs(samplers).items():
        row[name]["cost"] = seconds
    for kind, of_samplers in errors(samplers, arguments.size, arguments.spp, arguments.rounds).items():
        for name, found in of_samplers.items():
            row[name][f"{kind} mse"] = found["mse"]
            row[name][f"{kind} mse at equal time"] = found["mse"] * found["seconds"]
    return row


def geometric(values: list[float]) -> float:
    return float(np.exp(np.mean(np.log(values))))


QUANTITIES = ("variance", "bsdf mse", "bsdf mse at equal time", "mis mse", "mis mse at equal time", "cost")


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
    means = {f"{name} : cosine": ratios(rows, name, "cosine") for name in SAMPLERS if name != "cosine"}
    means |= {f"{OURS.name} : {name}": ratios(rows, OURS.name, name) for name in SAMPLERS if name != OURS.name}
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
