"""What does it cost to render a thousand materials, in one atlas and as a thousand BSDFs?

    uv run python benchmarks/atlas.py MATERIAL.smrl... [--count 1000] [--size 256] [--spp 16] [--rounds 9]

The materials, compact ones, stand for a thousand: copies of them in turn, each with gains of its own. All contestants
render the same picture of --count spheres in an environment, at the same pixels and samples, in interleaved rounds
after one that compiles their kernels:

* one: the spheres are one mesh, with one material;
* an atlas: the same mesh, whose faces say which of the materials they have;
* separate BSDFs: each sphere is a mesh of its own, with a BSDF of its own;
* separate meshes: the same meshes, all with the BSDF of one material: what the meshes alone cost.

Throughputs are ratios to that of `one`: median over rounds, least and most. Memory is that of the arrays from which an
atlas looks up and draws.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from timing import interleaved, ratio, text

from sommerl import SomManBrdf, load
from sommerl.commands import console
from sommerl.compression.atlas import Atlas
from sommerl.compression.palette import GainsAndShapes
from sommerl.render.bsdf import make_atlas_bsdf, make_bsdf
from sommerl.render.environment import default_environment
from sommerl.render.llvm import mitsuba
from sommerl.render.meshes import Mesh, lathe

ATTRIBUTE = "face_material"
ONE, ATLAS, SEPARATE, MESHES = "one", "an atlas", "separate BSDFs", "separate meshes"


def materials(sources: list[str], count: int) -> list[SomManBrdf]:
    """Copies of compact materials, with gains of their own."""
    found = [load(source) for source in sources]
    rng = np.random.default_rng(0)
    return [_copy(found[k % len(found)], f"{k}", rng.uniform(0.5, 1.0)) for k in range(count)]


def _copy(material: Any, name: str, factor: float) -> SomManBrdf:
    palette = material.palette
    gains = GainsAndShapes(factor * palette.gains, palette.lut, palette.scale, palette.signed, palette.smooth)
    return SomManBrdf(gains, material.index, material.lattice, name=name)


def ball() -> Mesh:
    turns = np.radians(np.arange(0, 181, 15))
    return lathe("ball", [(math.sin(a), -math.cos(a)) for a in turns], rows=24, columns=32)


def spheres(count: int) -> list[Mesh]:
    """Spheres in rows and columns that fill the square from -1 to 1."""
    one, columns = ball(), math.ceil(math.sqrt(count))
    small = Mesh("sphere", one.positions * np.float32(0.9 / columns), one.faces, one.normals)
    places = [((2 * (k % columns) + 1) / columns - 1, (2 * (k // columns) + 1) / columns - 1) for k in range(count)]
    return [small.moved(x, y, 0) for x, y in places]


def merged(meshes: list[Mesh], bsdf: Any) -> Any:
    """One shape of meshes alike, whose faces have the number of their mesh as an attribute."""
    vertices, faces = len(meshes[0].positions), len(meshes[0].faces)
    whole = Mesh(
        "spheres",
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate([mesh.faces + np.uint32(k * vertices) for k, mesh in enumerate(meshes)]),
        np.concatenate([mesh.normals for mesh in meshes]),
    )
    shape = whole.shape(bsdf)
    shape.add_attribute(ATTRIBUTE, 1, np.repeat(np.arange(len(meshes), dtype=np.float32), faces))
    return shape


def scene(shapes: list[Any], size: int) -> Any:
    mi = mitsuba()
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    look = mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])
    return mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},
            "environment": {"type": "envmap", "bitmap": mi.Bitmap(np.ascontiguousarray(default_environment()))},
            "sensor": {"type": "perspective", "fov": 24, "to_world": look, "film": film},
            **{f"shape {k}": shape for k, shape in enumerate(shapes)},
        }
    )


def contestants(found: list[SomManBrdf], atlas: Atlas, size: int) -> dict[str, Any]:
    mi = mitsuba()
    meshes, one = spheres(len(found)), make_bsdf(found[0])
    several = make_atlas_bsdf(atlas, mi.load_dict({"type": "mesh_attribute", "name": ATTRIBUTE}))
    return {
        ONE: scene([merged(meshes, one)], size),
        ATLAS: scene([merged(meshes, several)], size),
        SEPARATE: scene([mesh.shape(make_bsdf(brdf)) for mesh, brdf in zip(meshes, found, strict=True)], size),
        MESHES: scene([mesh.shape(one) for mesh in meshes], size),
    }


def memory(atlas: Atlas) -> dict[str, int]:
    """Bytes of the arrays of an atlas: of the lookup, and of the sampler with the albedos."""
    drawn = {"table", "albedos"}
    sizes = {name: buffer.nbytes for name, buffer in atlas.buffers().items()}
    sampler = sum(size for name, size in sizes.items() if name in drawn)
    return {"lookup": sum(sizes.values()) - sampler, "sampler": sampler}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("materials", nargs="+", metavar="MATERIAL.smrl")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    mi = mitsuba()
    found = materials(arguments.materials, arguments.count)
    started = time.perf_counter()
    atlas = Atlas(found)
    made = time.perf_counter() - started
    scenes = contestants(found, atlas, arguments.size)

    def shoot(name: str) -> float:
        return float(np.array(mi.render(scenes[name], spp=arguments.spp)).mean())

    brightness = {name: shoot(name) for name in scenes}  # compiles the kernels
    seconds = interleaved({name: lambda name=name: shoot(name) for name in scenes}, arguments.rounds)
    result = {
        "throughput : one": {name: ratio(seconds, ONE, name) for name in scenes if name != ONE},
        "bytes": memory(atlas),
        "seconds to make the atlas": made,
        "mean pixel": brightness,
    }
    rows = {f"throughput, {name} : {ONE}": text(value) for name, value in result["throughput : one"].items()}
    rows |= {f"memory, {name}": console.size(count) for name, count in result["bytes"].items()}
    rows |= {f"mean pixel, {name}": f"{value:.5f}" for name, value in brightness.items()}
    console.print_rows(f"{arguments.count} materials", rows | {"seconds to make the atlas": f"{made:.1f}"})
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
