"""Which rule and first learning rate? PSNR on the sphere in the paper's cases; quality and size with the defaults.

    uv run python benchmarks/learner_options.py FOLDER                       the defaults
    uv run python benchmarks/learner_options.py FOLDER --grid                every rule and rate
    uv run python benchmarks/learner_options.py FOLDER --envmap probe.exr    in another environment

FOLDER holds MERL tables of the paper's six materials. The reference is the table with nearest lookup. Prints Markdown.
"""

from __future__ import annotations

import argparse
import statistics
from pathlib import Path
from typing import Any

from sommerl import TrainOptions, load_table, train
from sommerl.compression.smrl.file import encode
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import default_environment, load_environment

# material, clusters, epochs, which PSNR
CASES = (
    ("yellow-matte-plastic", 64, 10, "frame"),
    ("blue-metallic-paint", 256, 50, "frame"),
    ("yellow-matte-plastic", 1000, 30, "object"),
    ("nickel", 1000, 30, "object"),
    ("purple-paint", 1000, 30, "object"),
    ("green-metallic-paint", 1000, 30, "object"),
    ("beige-fabric", 1000, 30, "object"),
)
MATERIALS = tuple(dict.fromkeys(case[0] for case in CASES))
GRID = [(rule, alpha) for rule in ("paper", "kohonen") for alpha in (0.5, 0.1, 0.02, 0.004)]


def measured(path: Path, environment: Any, spp: int, **options: Any) -> tuple[dict[str, float], int]:
    """How far a material is from its table, and the bytes of its file."""
    table = load_table(path).with_interpolation("nearest")
    material, _ = train(table, TrainOptions(**options))
    return compare_on_sphere(table, [material], environment, spp=spp)[0].metrics, len(encode(material))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--grid", action="store_true")
    parser.add_argument("--envmap", type=Path)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    options = parser.parse_args()
    default = TrainOptions()
    environment = load_environment(options.envmap) if options.envmap else default_environment()
    print("| rule | α | seed |" + "".join(f" {name}, {m}, {epochs}, {over} |" for name, m, epochs, over in CASES))
    print("|---|---|---|" + "---|" * len(CASES))
    for rule, alpha in GRID if options.grid else [(default.rule, default.alpha)]:
        for seed in options.seeds:
            row: list[str] = []
            for name, clusters, epochs, over in CASES:
                chosen = {"clusters": clusters, "epochs": epochs, "rule": rule, "alpha": alpha, "seed": seed}
                metrics, _ = measured(options.folder / f"{name}.binary", environment, options.spp, **chosen)
                row.append(f"{metrics['psnr_frame_db'] if over == 'frame' else metrics['psnr_object_db']:.1f}")
            print(f"| {rule} | {alpha} | {seed} | " + " | ".join(row) + " |", flush=True)
    print(f"\nThe defaults: M = {default.clusters}, {default.epochs} epochs\n")
    print("| material | PSNR object [dB] | PSNR frame [dB] | file [bytes] |\n|---|---|---|---|")
    sizes: list[int] = []
    for name in MATERIALS:
        metrics, size = measured(options.folder / f"{name}.binary", environment, options.spp)
        print(f"| {name} | {metrics['psnr_object_db']:.1f} | {metrics['psnr_frame_db']:.1f} | {size} |", flush=True)
        sizes.append(size)
    print(f"| median | | | {statistics.median(sizes):.0f} |")


if __name__ == "__main__":
    main()
