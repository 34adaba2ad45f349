"""What one small lamp shows: a material, and what is made from it, on a sphere, as one picture.

    uv run --group bench python benchmarks/one_lamp.py MATERIAL -o rings.png [--sizes 1000 2700 8000] [--size 256]

The lamp and the sphere are those of `render.judge`, without noise; the exposure is the material's. Titles say the PSNR.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from sommerl import Brdf, BrdfTable, SommerlError, TrainOptions, compress, load, train
from sommerl.plots.contact_sheet import captioned
from sommerl.render.images import write_image
from sommerl.render.judge import under_one_lamp
from sommerl.render.metrics import exposure, psnr, to_srgb8


def made_from(source: Brdf, sizes: list[int]) -> dict[str, Brdf]:
    """Compact files, the paper's representation, and the table that this is made from."""
    found = {f"compact, {size:,} B": compress(source, target_size=size)[0] for size in sizes}
    table = BrdfTable.of(source)
    paper = train(table, TrainOptions())[0]
    found |= {f"paper, M = 256, {how}": paper.with_interpolation(how) for how in ("nearest", "trilinear")}
    return found | {"MERL table, trilinear": table.with_interpolation("trilinear")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("material")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--sizes", type=int, nargs="+", default=[1000, 2700, 8000, 32_000], metavar="BYTES")
    parser.add_argument("--size", type=int, default=256, help="of a sphere, in pixels")
    options = parser.parse_args()
    try:
        source = load(options.material)
        reference = under_one_lamp(source, options.size).astype(np.float32)
        inside = np.hypot(*np.meshgrid(*[(np.arange(options.size) + 0.5) / options.size * 2 - 1] * 2)) < 1
        scale = exposure(reference, inside)
        shown = to_srgb8(reference * scale)
        pictures = {f"{source.name}, as measured": shown}
        for name, brdf in made_from(source, options.sizes).items():
            picture = to_srgb8(under_one_lamp(brdf, options.size).astype(np.float32) * scale)
            pictures[f"{name}: {psnr(shown[inside], picture[inside]):.1f} dB"] = picture
        write_image(options.output, captioned(list(pictures.items()), 4))
    except SommerlError as error:
        raise SystemExit(f"error: {error}") from error


if __name__ == "__main__":
    main()
