"""How good is a material at how many bytes? Sommerl's files beside their peers, against the source itself.

    uv run --group bench python benchmarks/rate_distortion.py FOLDER [--materials NAME...] [--nbrdf FILE.npz]
        [--envmap probe.exr] [--size 256] [--spp 256] [--sizes 1000 2700 ...] [-o curves.png] [--json FILE]

FOLDER holds materials in any format that `sommerl.load` reads. Each is rendered on the sphere as it is (an RGL file is
continuous, not a table) and with every representation of it, with the same sample directions. The log error is of
tables at MERL's cell centres, weighted by solid angle and cosines; the MERL table itself has none there. Sizes are what
would be stored. `--sizes` without a number leaves the compact files out. Seconds are of encoding, once, on a machine as
busy as it was. Prints Markdown.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import curves
from representations import representations, short_name

from sommerl import Brdf, BrdfTable, SommerlError, load
from sommerl.formats.registry import by_extension, readable
from sommerl.reflectance.distance import table_metrics
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import default_environment, load_environment

SIZES = (1000, 2700, 8000, 16000, 32000)
# key of a row, heading, format
COLUMNS = (
    ("bytes", "bytes", ",.0f"),
    ("psnr_object_db", "PSNR [dB]", ".1f"),
    ("psnr_unrounded_db", "unrounded [dB]", ".1f"),
    ("delta_e_itp", "ΔE_ITP", ".2f"),
    ("flip", "FLIP", ".4f"),
    ("table_log_error_cosine", "log error", ".4f"),
    ("seconds", "encoding [s]", ".1f"),
    ("bytes_memory", "bytes in memory", ",.0f"),
)
Row = dict[str, Any]


def measured(path: Path, options: argparse.Namespace, environment: Any) -> list[Row]:
    """A row for each representation of a material."""
    source = load(path)
    found = representations(source, path.stem, options.sizes, options.nbrdf)
    candidates = [representation.brdf for representation in found]
    comparisons = compare_on_sphere(source, candidates, environment, size=options.size, spp=options.spp)
    reference = BrdfTable.sampled(source)
    rows: list[Row] = []
    for representation, comparison in zip(found, comparisons, strict=True):
        row = {"material": short_name(path.stem), "family": representation.family, "label": representation.label}
        row |= {"bytes": representation.size, **comparison.metrics}
        row |= {"table_log_error_cosine": log_error(reference, representation.brdf)}
        rows.append(row | {"seconds": representation.seconds, "bytes_memory": representation.bytes_memory})
    return rows


def log_error(reference: BrdfTable, brdf: Brdf) -> float:
    """Of a representation at the reference's cell centres."""
    sampled = BrdfTable.sampled(brdf, reference.lattice)
    return table_metrics(reference.values, sampled.values, reference.lattice)["log_error_cosine"]


def means(rows: Sequence[Row]) -> list[Row]:
    """The mean of each representation's rows, in the order in which they first appear."""
    result: list[Row] = []
    for label in dict.fromkeys(row["label"] for row in rows):
        group = [row for row in rows if row["label"] == label]
        mean: Row = {"family": group[0]["family"], "label": label, "materials": len(group)}
        for key, _, _ in COLUMNS:
            values = [row[key] for row in group if row[key] is not None]
            mean[key] = statistics.fmean(values) if values else None
        result.append(mean)
    return result


def print_table(title: str, rows: Sequence[Row]) -> None:
    """In Markdown."""
    print(f"\n{title}\n")
    print("| representation |" + "".join(f" {heading} |" for _, heading, _ in COLUMNS))
    print("|---|" + "---|" * len(COLUMNS))
    for row in rows:
        cells = ("–" if row[key] is None else f"{row[key]:{form}}" for key, _, form in COLUMNS)
        print(f"| {row['label']} | " + " | ".join(cells) + " |", flush=True)


def finite(rows: Sequence[Row]) -> list[Row]:
    """With null for the PSNR of identical images, which JSON lacks."""
    return [
        {key: None if isinstance(value, float) and math.isinf(value) else value for key, value in row.items()}
        for row in rows
    ]


def chosen(folder: Path, names: Sequence[str] | None) -> list[Path]:
    """The files of materials in a folder: all, or those named, with RGL's _rgb or without."""
    paths = sorted(path for path in folder.iterdir() if by_extension(readable(), path))
    known = {name for path in paths for name in (path.stem, short_name(path.stem))}
    missing = [name for name in names or () if name not in known]
    if missing or not paths:
        raise SystemExit(f"error: {folder}: expected {missing[0] if missing else 'materials'} in it, found none")
    return [path for path in paths if not names or {path.stem, short_name(path.stem)} & set(names)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--materials", nargs="+", metavar="NAME")
    parser.add_argument("--envmap", type=Path)
    parser.add_argument("--nbrdf", type=Path, help="an archive of neural BRDFs, by the materials' names")
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES, metavar="BYTES", help="of compact files")
    parser.add_argument("-o", "--output", type=Path, help="a PNG of PSNR over bytes")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows: list[Row] = []
    try:
        environment = load_environment(options.envmap) if options.envmap else default_environment()
        for path in chosen(options.folder, options.materials):
            of_one = measured(path, options, environment)
            print_table(of_one[0]["material"], of_one)
            rows += of_one
    except SommerlError as error:
        raise SystemExit(f"error: {error}") from error
    averages = means(rows)
    materials = len({row["material"] for row in rows})
    print_table(f"Means over {materials} materials", averages)
    for row in averages:
        if row["materials"] < materials:
            print(f"\n{row['label']}: over {row['materials']} materials")
    if options.json:
        options.json.write_text(json.dumps({"rows": finite(rows), "means": finite(averages)}, indent=2))
    if options.output:
        curves.draw(rows, averages, options.output)


if __name__ == "__main__":
    main()
