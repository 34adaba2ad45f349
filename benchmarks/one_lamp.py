"""What one small lamp shows: a material, and what is made from it, on a sphere, as one picture.

    uv run --group bench python benchmarks/one_lamp.py MATERIAL -o rings.png [--sizes 1000 2700 8000] [--size 256]

The lamp and the sphere are those of `render.judge`, without noise; the exposure is the material's. Titles say the PSNR.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from representations import compact, merl_table, preset

from sommerl import BrdfTable, SommerlError, load
from sommerl.plots.contact_sheet import captioned
from sommerl.render.compare import Comparison
from sommerl.render.images import write_image
from sommerl.render.judge import Judge, under_one_lamp
from sommerl.render.metrics import psnr


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("material")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--sizes", type=int, nargs="+", default=[1000, 2700, 8000, 32_000], metavar="BYTES")
    parser.add_argument("--size", type=int, default=256, help="of a sphere, in pixels")
    options = parser.parse_args()
    try:
        source = load(options.material)
        table, reference = BrdfTable.of(source), under_one_lamp(source, options.size)
        pictures = {f"{source.name}, as measured": Comparison(reference, reference, {}).exposed()[0]}
        for made in (*compact(source, Judge(source), options.sizes), *preset(table), *merl_table(table)):
            shown, picture = Comparison(reference, under_one_lamp(made.brdf, options.size), {}).exposed()
            pictures[f"{made.label}: {psnr(shown[reference.mask], picture[reference.mask]):.1f} dB"] = picture
        write_image(options.output, captioned(list(pictures.items()), 3))
    except SommerlError as error:
        raise SystemExit(f"error: {error}") from error


if __name__ == "__main__":
    main()
