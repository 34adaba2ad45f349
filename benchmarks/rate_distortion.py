"""How good is a material at how many bytes? Sommerl's files beside their peers, against the source itself.

    uv run --group bench python benchmarks/rate_distortion.py FOLDER [--materials NAME...] [--nbrdf FILE.npz]
        [--reciprocal] [--sizes 1000 2700 ...] [-o curves.png] [--json FILE]

FOLDER holds materials in any format that `sommerl.load` reads. Each is judged as it is, signed and one-sided (an RGL
file is continuous, not a table), against every representation of it, by `render.judge`: no renderer, no noise. "raw →
reciprocal" is the source with both orders of the directions averaged, which is the best that what is reciprocal, as a
MERL table, can hold. With `--reciprocal`, that is the source. Sizes are what would be stored. `--sizes` without a
number leaves the compact files out. Seconds are of encoding, once, on a machine as busy as it was. Prints Markdown.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from representations import representations, short_name

from sommerl import SommerlError, load
from sommerl.formats.registry import by_extension, readable
from sommerl.plots import distortion, save
from sommerl.reflectance.reciprocal import reciprocal
from sommerl.render.judge import Judge

SIZES = (1000, 2700, 8000, 16000, 32000)
# key of a row, heading, format, and which of several is the worst, if that is told
COLUMNS = (
    ("bytes", "bytes", ",.0f", None),
    ("psnr_soft_db", "soft light [dB]", ".1f", min),
    ("psnr_lamp_db", "one lamp [dB]", ".1f", min),
    ("log_error", "log error", ".3f", max),
    ("log_error_grazing", "log error, grazing", ".3f", max),
    ("albedo_ratio", "largest ratio of albedos", ".3f", max),
    ("seconds", "encoding [s]", ".1f", None),
    ("bytes_memory", "bytes in memory", ",.0f", None),
)
Row = dict[str, Any]


def measured(path: Path, options: argparse.Namespace) -> list[Row]:
    """A row for each representation of a material."""
    source = load(path)
    if options.reciprocal:
        source = reciprocal(source)
    judge = Judge(source)
    rows: list[Row] = []
    for made in representations(source, judge, path.stem, options.sizes, options.nbrdf):
        row = {"material": short_name(path.stem), "family": made.family, "label": made.label, "bytes": made.size}
        rows.append(row | judge.metrics(made.brdf) | {"seconds": made.seconds, "bytes_memory": made.bytes_memory})
    return rows


def over(rows: Sequence[Row]) -> list[Row]:
    """Mean and worst of each representation's rows, in the order in which they first appear."""
    result: list[Row] = []
    for label in dict.fromkeys(row["label"] for row in rows):
        group = [row for row in rows if row["label"] == label]
        mean: Row = {"family": group[0]["family"], "label": label, "materials": len(group), "worst": {}}
        for key, _, _, worst in COLUMNS:
            values = [row[key] for row in group if row[key] is not None]
            mean[key] = statistics.fmean(values) if values else None
            if worst and values:
                mean["worst"][key] = worst(values)
        result.append(mean)
    return result


def print_table(title: str, rows: Sequence[Row]) -> None:
    """In Markdown, with the worst where rows have it."""
    print(f"\n{title}\n")
    print("| representation |" + "".join(f" {heading} |" for _, heading, _, _ in COLUMNS))
    print("|---|" + "---|" * len(COLUMNS))
    for row in rows:
        print(
            f"| {row['label']} | " + " | ".join(cell(row, key, form) for key, _, form, _ in COLUMNS) + " |", flush=True
        )


def cell(row: Row, key: str, form: str) -> str:
    found = [row[key], *([row["worst"][key]] if key in row.get("worst", {}) else [])]
    return ", ".join("–" if value is None else f"{value:{form}}" for value in found)


def finite(value: Any) -> Any:
    """With null for the PSNR of identical images, which JSON lacks."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and math.isinf(value) else value


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
    parser.add_argument("--nbrdf", type=Path, help="an archive of neural BRDFs, by the materials' names")
    parser.add_argument("--reciprocal", action="store_true", help="the source is the mean of both orders")
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES, metavar="BYTES", help="of compact files")
    parser.add_argument("-o", "--output", type=Path, help="a PNG of PSNR over bytes")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows: list[Row] = []
    try:
        for path in chosen(options.folder, options.materials):
            of_one = measured(path, options)
            print_table(of_one[0]["material"], of_one)
            rows += of_one
    except SommerlError as error:
        raise SystemExit(f"error: {error}") from error
    averages = over(rows)
    materials = len({row["material"] for row in rows})
    print_table(f"Mean, worst over {materials} materials", averages)
    for row in averages:
        if row["materials"] < materials:
            print(f"\n{row['label']}: over {row['materials']} materials")
    if options.json:
        options.json.write_text(json.dumps(finite({"rows": rows, "means": averages}), indent=2))
    if options.output:
        save(distortion.drawn(finite(rows), finite(averages)), options.output)


if __name__ == "__main__":
    main()
