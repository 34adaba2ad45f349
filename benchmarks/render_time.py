"""How long does a render take with each representation, and how long to the same error? The paper's Table 2, from one
interleaved run.

    uv run python benchmarks/render_time.py MATERIAL... [--scene sphere] [--size 256] [--spp 64] [--rounds 9]

MATERIAL, as a table on MERL's lattice, is rendered as SOM-MAN material (preset paper, M = 256), as compact material of
8 kB, as raw table of single precision, factored, and as analytic models of two and three lobes fitted to it; and with
Mitsuba's own `roughplastic` and `diffuse`. Every BRDF draws directions from our sampler, fitted to it; Mitsuba's own
from theirs. Each is rendered once to compile its kernel, then once in every round.

Times are ratios to that of the SOM-MAN material, as in the paper: median over rounds, least and most. PSNR is over the
object, against the table, at the table's directions. Two ratios say what is reached in that time, over the object's
pixels:

* noise: time × variance between rounds, which differ in their seeds. What the image converges to does not count, and a
  duller material has less noise.
* error: the time that the SOM-MAN material takes to the mean squared error that the other one has after `--spp`
  samples, relative to the other's time. The error is that to the table's image of REFERENCE_SPP samples a pixel.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path
from typing import Any

import numpy as np
from timing import interleaved, ratio, text

import sommerl
from sommerl import TrainOptions, load_table
from sommerl.commands import console
from sommerl.compression.compact import search
from sommerl.compression.compact.search import CompactOptions
from sommerl.factored.fit import factor
from sommerl.fitting.fit import fit
from sommerl.fitting.options import FitOptions
from sommerl.reflectance.brdf import Brdf
from sommerl.reflectance.metric import decibels
from sommerl.render.frame import Scene
from sommerl.render.llvm import mitsuba
from sommerl.render.metrics import image_metrics
from sommerl.render.passes import render
from sommerl.render.scene_registry import SCENES, make_scene
from sommerl.sampling.named import OURS

OURS_NAME = "som-man, M = 256"
MODELS = (
    *((name, 2) for name in ("blinn-phong", "phong", "cook-torrance", "ward", "ward-duer", "lafortune")),
    *((name, 2) for name in ("torrance-sparrow", "ashikhmin-shirley", "ggx")),
    *((name, 3) for name in ("ward", "cook-torrance")),
)
BUILT_IN = {
    "roughplastic": {"type": "roughplastic", "alpha": 0.1, "distribution": "ggx", "nonlinear": False},
    "diffuse": {"type": "diffuse"},
}
PSNR_SPP = 64
REFERENCE_SPP = 4096


def representations(source: str) -> dict[str, Brdf]:
    """Every way to hold a material, by name; ours first."""
    table = load_table(source).with_interpolation("nearest")
    material, _ = sommerl.train(table, TrainOptions())
    compact, _ = search.compress(table.with_interpolation("trilinear"), CompactOptions(target_size=8000))
    found: dict[str, Brdf] = {
        OURS_NAME: material,
        "raw table": table,
        "compact, 8 kB": compact,
        "factored, 16 × 4": factor(table),
    }
    for model, lobes in MODELS:
        options = FitOptions(lobes=lobes, samples=100_000, starts=6)
        found[f"{model}, {lobes} lobes"] = fit(table.with_interpolation("trilinear"), model, options).brdf
    return found


def scenes(found: dict[str, Brdf], name: str, size: int) -> dict[str, Scene]:
    """The scene with each, in all of its places."""
    mi = mitsuba()
    places = SCENES[name].places
    made = {key: make_scene(name, [brdf] * places, size=size) for key, brdf in found.items()}
    return made | {
        key: make_scene(name, [mi.load_dict(plugin)] * places, size=size) for key, plugin in BUILT_IN.items()
    }


def qualities(found: dict[str, Brdf], name: str, size: int) -> dict[str, float]:
    """PSNR over the object against the table, with the table's directions [dB]."""
    places = SCENES[name].places
    samplers = [OURS.fitted(found["raw table"])] * places
    images = {
        key: render(make_scene(name, [brdf] * places, samplers=samplers, size=size), spp=PSNR_SPP)
        for key, brdf in found.items()
    }
    reference = images["raw table"]
    return {
        key: image_metrics(reference.pixels, image.pixels, reference.mask)["psnr_object_db"]
        for key, image in images.items()
    }


def measured(made: dict[str, Scene], arguments: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Of each scene: the seconds of every round, the variance between rounds and the mean squared error to the table's
    image, over the object's pixels."""
    mi = mitsuba()
    reference = render(made["raw table"], spp=REFERENCE_SPP, seed=1)
    images: dict[str, list[Any]] = {name: [] for name in made}

    def shoot(name: str) -> None:
        pixels = np.array(mi.render(made[name].mitsuba, spp=arguments.spp, seed=len(images[name])))
        images[name].append(pixels[reference.mask].astype(np.float64))

    for name in made:
        shoot(name)  # compiles the kernel
    seconds = interleaved({name: lambda name=name: shoot(name) for name in made}, arguments.rounds)
    result: dict[str, dict[str, Any]] = {}
    for name in made:
        every = np.stack(images[name])
        variance = float(np.var(every, axis=0, ddof=1).mean())
        error = float(np.square(every - reference.pixels[reference.mask]).mean())
        result[name] = {"seconds": seconds[name], "variance": variance, "error": error}
    return result


def report(found: dict[str, dict[str, Any]], quality: dict[str, float]) -> dict[str, Any]:
    ours = found[OURS_NAME]
    seconds = {name: one["seconds"] for name, one in found.items()}
    result: dict[str, Any] = {}
    for name, one in found.items():
        relative = ratio(seconds, name, OURS_NAME)
        noise = ours["variance"] / one["variance"] / relative["median"]
        # Of our own error, what more samples do not take away.
        bias = max(ours["error"] - ours["variance"], 0.0)
        error = ours["variance"] / (one["error"] - bias) / relative["median"] if one["error"] > bias else float("inf")
        result[name] = {"time": relative, "noise": noise, "error": error, "psnr_object_db": quality.get(name)}
    two_lobes = [result[f"{model}, {lobes} lobes"]["time"]["median"] for model, lobes in MODELS if lobes == 2]
    rivals = [
        result[f"{model}, {lobes} lobes"]
        for model, lobes in MODELS
        if quality[f"{model}, {lobes} lobes"] <= quality[OURS_NAME]
    ]
    best = max(rivals, key=lambda one: one["error"], default=None)
    return {
        "representations": result,
        "som-man : raw table": ratio(seconds, OURS_NAME, "raw table"),
        "som-man : median two-lobe model": 1 / statistics.median(two_lobes),
        "time to equal error, som-man : best model of equal or worse PSNR": best and best["error"],
        "time to equal noise, som-man : that model": best and best["noise"],
        "models of better PSNR": len(MODELS) - len(rivals),
        "som-man : roughplastic": ratio(seconds, OURS_NAME, "roughplastic"),
    }


def show(source: str, result: dict[str, Any]) -> None:
    rows = [
        [
            name,
            text(one["time"]),
            f"{one['noise']:.2f}",
            f"{one['error']:.3f}",
            "" if one["psnr_object_db"] is None else decibels(one["psnr_object_db"]),
        ]
        for name, one in result["representations"].items()
    ]
    columns = ["", "time : som-man", "som-man : it, to equal noise", "som-man : it, to equal error", "PSNR"]
    console.print_table(source, columns, rows)
    summary = {key: value for key, value in result.items() if key != "representations"}
    shown = {
        key: text(value) if isinstance(value, dict) else "none" if value is None else f"{value:.3g}"
        for key, value in summary.items()
    }
    console.print_rows("summary", shown)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("materials", nargs="+", metavar="MATERIAL")
    parser.add_argument("--scene", choices=[*SCENES], default="sphere")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--spp", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    results: dict[str, Any] = {}
    for source in arguments.materials:
        found = representations(source)
        made = scenes(found, arguments.scene, arguments.size)
        results[source] = report(measured(made, arguments), qualities(found, arguments.scene, arguments.size))
        show(source, results[source])
        if arguments.json:  # after each, so that nothing is lost
            arguments.json.write_text(json.dumps(results, indent=2))


if __name__ == "__main__":
    main()
