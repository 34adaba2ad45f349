"""Random nestings of the plug-in in Mitsuba's own BSDFs, rendered: does anything crash, or give what is no number?

    uv run python benchmarks/nestings.py [--renders 3000] [--seed 0]

Each render shows a shape with a random tree of blends, masks, two-sided BSDFs, bump and normal maps, whose
leaves are ours (every kind of material, every sampler, with a random tint and scale) and Mitsuba's; a random
integrator, lamp and variant. Renders run in child processes of a hundred, so that a crash is counted and the rest goes
on. Exits with 1 if one crashed or was not finite.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

A_CHILD = 100  # renders
# One after the other. Those that compile take ten times as long.
VARIANTS = ("llvm_ad_rgb", *3 * ("scalar_rgb", "scalar_spectral", "scalar_spectral_polarized"))
OTHERS = {10: "llvm_ad_spectral", 20: "llvm_ad_mono"}  # by the number of the batch
INTEGRATORS = ("path", "direct", "volpath", "ptracer", "aov", "prb")  # the last one is not for scalar variants
DEEPEST = 2


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--renders", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--child", type=int, nargs=2, metavar=("FIRST", "COUNT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        return child(options.seed, *options.child)
    started, done, faults = time.perf_counter(), 0, 0
    while done < options.renders:
        count = min(A_CHILD, options.renders - done)
        rendered, fault = batch(options.seed, done, count)
        done += rendered + bool(fault)
        print(f"{done} renders", end="\r", flush=True)
        if fault:
            faults += 1
            print(f"render {done - 1}: {fault}", flush=True)
    print(f"{done} renders, seed {options.seed}: {faults} faults, {time.perf_counter() - started:.0f} s")
    return int(faults > 0)


def batch(seed: int, first: int, count: int) -> tuple[int, str]:
    """How many renders of a child ended well before the first one that did not, and what was wrong with that."""
    command = [sys.executable, __file__, "--seed", str(seed), "--child", str(first), str(count)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    rendered = done.stdout.count("rendered\n")
    if rendered == count and done.returncode == 0:
        return count, ""
    last = (done.stderr.strip().splitlines() or ["nothing on standard error"])[-1]
    return rendered, f"exit status {done.returncode}: {last[:300]}"


def child(seed: int, first: int, count: int) -> int:
    """Renders some of them, in one variant."""
    sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
    from sommerl.render.llvm import mitsuba

    number = first // A_CHILD
    variant = OTHERS.get(number, VARIANTS[number % len(VARIANTS)])
    mi = mitsuba(variant)
    for number in range(first, first + count):
        rng = np.random.default_rng([seed, number])
        scene = mi.load_dict(description(rng))
        size = 3 if variant.startswith("scalar") else 8
        image = np.array(mi.render(scene, spp=2 if size == 3 else 4, seed=number))
        if not np.isfinite(image).all():
            raise FloatingPointError(f"{(~np.isfinite(image)).sum()} numbers of {image.size} are not finite")
        print("rendered", flush=True)
    return 0


def description(rng: np.random.Generator) -> dict[str, object]:
    """A scene as a dictionary."""
    from sommerl.render.llvm import mitsuba

    mi = mitsuba()
    scalar = mi.variant().startswith("scalar")
    size = 3 if scalar else 8
    transform = mi.ScalarTransform4f
    integrator: dict[str, object] = {"type": str(rng.choice(INTEGRATORS[:-1] if scalar else INTEGRATORS))}
    if integrator["type"] == "aov":
        integrator |= {"aovs": "a:albedo,n:sh_normal", "image": {"type": "path", "max_depth": 4}}
    else:
        integrator |= {} if integrator["type"] == "direct" else {"max_depth": int(rng.integers(2, 6))}
    lamps = (
        {"type": "constant"},
        {"type": "point", "position": rng.uniform(-3, 3, 3).tolist(), "intensity": 10.0},
        {
            "type": "rectangle",
            "to_world": transform().look_at([1, 3, 2], [0, 0, 0], [0, 1, 0]),
            "emitter": {"type": "area", "radiance": 5.0},
        },
    )
    eye = rng.standard_normal(3)
    eye = (4 * eye / np.linalg.norm(eye)).tolist()
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    return {
        "type": "scene",
        "integrator": integrator,
        "lamp": lamps[rng.integers(len(lamps))],
        "camera": {
            "type": "perspective",
            "fov": 40,
            "to_world": transform().look_at(eye, [0, 0, 0], [0.1, 1, 0.2]),
            "film": film,
        },
        "thing": {"type": str(rng.choice(["sphere", "cube", "disk", "cylinder"])), "bsdf": tree(rng, DEEPEST)},
    }


def tree(rng: np.random.Generator, deepest: int) -> dict[str, object]:
    """A BSDF; no mask is under a two-sided one, which Mitsuba refuses."""
    kinds = ["leaf", "blendbsdf", "mask", "twosided", "bumpmap", "normalmap"] if deepest else ["leaf"]
    kind = str(rng.choice(kinds, p=[0.2, 0.4, 0.1, 0.1, 0.1, 0.1] if deepest else None))
    if kind == "leaf":
        return leaf(rng)
    if kind == "blendbsdf":
        both: dict[str, object] = {"a": tree(rng, deepest - 1), "b": tree(rng, deepest - 1)}
        return {"type": kind, "weight": bitmap(rng) if rng.random() < 0.5 else float(rng.random())} | both
    if kind == "mask":
        return {"type": kind, "opacity": bitmap(rng) if rng.random() < 0.5 else float(rng.random()), "b": tree(rng, 0)}
    if kind == "twosided":
        return {"type": kind, "b": blend_of_leaves(rng)}
    if kind == "bumpmap":
        return {"type": kind, "t": bitmap(rng), "scale": float(rng.uniform(0, 3)), "b": blend_of_leaves(rng)}
    return {"type": kind, "normalmap": bitmap(rng, 3), "b": blend_of_leaves(rng)}


def blend_of_leaves(rng: np.random.Generator) -> dict[str, object]:
    return {"type": "blendbsdf", "weight": float(rng.choice([0.0, rng.random(), 1.0])), "a": leaf(rng), "b": leaf(rng)}


def bitmap(rng: np.random.Generator, channels: int = 1) -> dict[str, object]:
    """A small raw texture; of normals, if it has three channels."""
    from sommerl.render.llvm import mitsuba

    texels = rng.random((4, 4, channels)).astype(np.float32)
    if channels == 3:
        texels[..., 2] = 0.6 + 0.4 * texels[..., 2]
    return {"type": "bitmap", "bitmap": mitsuba().Bitmap(texels), "raw": True}


def leaf(rng: np.random.Generator) -> dict[str, object]:
    """One of ours, mostly."""
    from kinds import KINDS

    from sommerl.render.bsdf import make_bsdf
    from sommerl.render.llvm import mitsuba
    from sommerl.sampling.named import SAMPLERS, fitted

    if rng.random() < 0.3:
        own = ("diffuse", "roughconductor", "roughplastic", "plastic", "conductor", "principled")
        return {"type": str(rng.choice(own))}
    kind, sampler = str(rng.choice(list(KINDS))), str(rng.choice(list(SAMPLERS)))
    key = (mitsuba().variant(), kind, sampler)
    if key not in MADE:
        MADE[key] = fitted(sampler, KINDS[kind])
    bsdf = make_bsdf(KINDS[kind], MADE[key])
    parameters = mitsuba().traverse(bsdf)
    if "scale" in parameters and rng.random() < 0.3:  # not in scalar variants
        parameters["scale"] = float(rng.uniform(0, 2))
        parameters.update()
    return bsdf


MADE: dict[tuple[str, str, str], object] = {}

if __name__ == "__main__":
    sys.exit(main())
