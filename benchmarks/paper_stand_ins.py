"""Makes the stand-ins that come with `sommerl paper`: the paper's six materials in 100,000 bytes.

    uv run python benchmarks/paper_stand_ins.py FOLDER LICENSE [--size 16400] [-o python/sommerl/reproduction/stand_ins]

FOLDER holds their NP stand-ins as MERL tables (Zheng et al. 2021), LICENSE is that of the NP set, which is copied. Each
becomes a compact file of at most so many bytes. Prints how far each is from its table, as docs/stand_ins.md tells it.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
from pathlib import Path

from sommerl import compress, load_table, save
from sommerl.reproduction.data import NAMES


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("license", type=Path)
    parser.add_argument("--size", type=int, default=16_400, help="bytes of each (%(default)s)")
    parser.add_argument("-o", "--output", type=Path, default=Path("python/sommerl/reproduction/stand_ins"))
    given = parser.parse_args()
    given.output.mkdir(exist_ok=True)
    shutil.copyfile(given.license, given.output / "LICENSE")
    total, soft, lamp = 0, [], []
    print("| material | bytes | soft light [dB] | one lamp [dB] |\n|---|---|---|---|")
    for name in NAMES:
        material, report = compress(load_table(given.folder / f"{name}.binary"), target_size=given.size)
        save(material, given.output / f"{name}.smrl")
        size = (given.output / f"{name}.smrl").stat().st_size
        soft.append(report.metrics["psnr_soft_db"])
        lamp.append(report.metrics["psnr_lamp_db"])
        total += size
        print(f"| {name} | {size:,} | {soft[-1]:.1f} | {lamp[-1]:.1f} |", flush=True)
    print(f"| all, mean | {total:,} | {statistics.fmean(soft):.1f} | {statistics.fmean(lamp):.1f} |")


if __name__ == "__main__":
    main()
