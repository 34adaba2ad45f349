"""How near to real MERL are stand-ins, and what is made from them? PSNR on the one plane of the tables that we have.

    uv run python benchmarks/real_plane.py PLANES.npz MATERIAL... [--sizes [BYTES...]] [--stand-ins-alone] [--json FILE]

PLANES.npz is shared/data/merl_plane/merl_phi90_srgb8.npz: the cells of φ_d bin 90 of MERL's tables, 8-bit sRGB, which
is f_r, clipped to [0, 1], on sRGB's curve, times 255, rounded down. A MATERIAL is a file that `sommerl.load` reads,
named as in the database, or FILE.npz:NAME; of an archive, all of it that is in PLANES.npz. Each is evaluated at the
centres of these cells and brought to 8 bits in the same way. There are two PSNRs: over the cells whose centre is above
the horizon (8,023 of 8,100), and over those away from grazing, where both cosines are above 0.1 (6,984); all channels
alike, and all cells, however little light they stand for. Highlights above 1/sr are clipped in both, so they are not
compared. Rows are of the stand-in and of what is made from it. At the centre of a cell, trilinear lookup gives that
cell alone, so what it gives here is what the nearest cell does. `--sizes` without a number leaves the compact files
out. Prints Markdown.
"""

from __future__ import annotations

import argparse
import json
import statistics
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sommerl import Brdf, BrdfTable, SommerlError, TrainOptions, compress, load, train
from sommerl.formats.names import split_member
from sommerl.reflectance.cells import MERL
from sommerl.reflectance.half_diff import directions
from sommerl.render.metrics import psnr, to_srgb
from sommerl.reproduction.data import RULES

PHI_D = 90  # the bin
ABOVE = MERL.above_horizon[:, :, PHI_D]
AWAY = ABOVE & (np.minimum(*MERL.cosines())[:, :, PHI_D] > 0.1)
SIZES = (1000, 2700, 8000)
CLUSTERS, EPOCHS = 256, 30
ROUNDING = 1e-6  # so that 1/sr is 255: in floating point, sRGB's curve ends just below 1
Plane = NDArray[np.uint8]


def plane(brdf: Brdf) -> Plane:
    """A BRDF's values at the centres of the plane's cells, as 8-bit sRGB of shape (θ_h, θ_d, 3); 0 below the
    horizon."""
    wi, wo = directions(*(angle[:, :, PHI_D][ABOVE] for angle in MERL.angles()))
    found = np.zeros((*ABOVE.shape, 3), np.uint8)
    found[ABOVE] = np.floor(255 * to_srgb(brdf.eval(np.stack(wi, -1), np.stack(wo, -1))) + ROUNDING)
    return found


def distance(found: Plane, real: Plane) -> tuple[float, float]:
    """PSNR [dB] over the cells above the horizon, and over those away from grazing."""
    return psnr(found[ABOVE], real[ABOVE]), psnr(found[AWAY], real[AWAY])


def representations(source: Brdf, sizes: Sequence[int]) -> Iterator[tuple[str, Brdf]]:
    """What is made from a material, each with what it is called. sizes: of compact files, in bytes."""
    table = BrdfTable.of(source)
    for title, rule in RULES.items():
        material = train(table, TrainOptions(clusters=CLUSTERS, epochs=EPOCHS, **rule))[0]
        for interpolation in ("nearest", "trilinear"):
            yield f"paper, {title}, {interpolation}", material.with_interpolation(interpolation)
    for size in sizes:
        yield f"compact, at most {size:,} B", compress(source, target_size=size)[0]


def named(materials: Sequence[str], known: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Each material and its name in the database; all known ones of an archive."""
    for material in materials:
        path, member = split_member(material)
        if zipfile.is_zipfile(path) and not member:
            held = [name.removesuffix(".npy") for name in zipfile.ZipFile(path).namelist()]
            yield from ((f"{path}:{name}", name) for name in held if name in known)
        elif (name := member or path.stem) in known:
            yield material, name
        else:
            raise SystemExit(f"error: {material}: expected a material of the planes, found {name}")


def print_row(name: str, values: Sequence[tuple[float, float]]) -> None:
    print(f"| {name} | " + " | ".join(f"{all_:.1f}, {away:.1f}" for all_, away in values) + " |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("planes", type=Path)
    parser.add_argument("materials", nargs="+", metavar="MATERIAL")
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES, metavar="BYTES", help="of compact files")
    parser.add_argument("--stand-ins-alone", action="store_true", help="without what is made from them")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with np.load(options.planes) as archive:
        real = dict(zip(archive["names"].tolist(), archive["srgb8"], strict=True))
    rows: list[dict[str, Any]] = []
    try:
        for material, name in named(options.materials, list(real)):
            source = load(material)
            made = [] if options.stand_ins_alone else representations(source, options.sizes)
            row = {"stand-in": distance(plane(source), real[name])}
            row |= {title: distance(plane(brdf), real[name]) for title, brdf in made}
            if not rows:
                print("| material | " + " | ".join(row) + " |\n|---|" + "---|" * len(row))
            print_row(name, list(row.values()))
            rows.append({"material": name, "psnr_db": row})
    except SommerlError as error:
        raise SystemExit(f"error: {error}") from error
    for title, over in (("mean", statistics.fmean), ("worst", min)):
        columns = [[row["psnr_db"][key] for row in rows] for key in rows[0]["psnr_db"]]
        print_row(title, [(over(a for a, _ in column), over(b for _, b in column)) for column in columns])
    print(f"\n{len(rows)} materials")
    if options.json:
        options.json.write_text(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
