"""How close is the factored representation (Lawrence et al. 2004), how large, and how far from reciprocal?

    uv run python benchmarks/factored.py MATERIAL... [--json FILE]

For each MATERIAL, the bytes of the tables in memory and of the file, the PSNR over the object on the scene `sphere`
against the material itself, for the default numbers of lobes and terms and for few; and the asymmetry,
∬ |f(a, b) − f(b, a)| cos cos dω dω over the same integral of the mean, of the source and of its factored form.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import sommerl
from sommerl.commands import console
from sommerl.factored import file
from sommerl.factored.fit import FactorOptions, factor
from sommerl.reflectance.brdf import Brdf
from sommerl.reflectance.distance import asymmetry
from sommerl.render.compare import compare_on_sphere
from sommerl.render.environment import default_environment

OPTIONS = FactorOptions(), FactorOptions(8, 4), FactorOptions(4, 2)


def measured(brdf: Brdf) -> dict[str, Any]:
    buffers = brdf.buffers()
    row: dict[str, Any] = {"asymmetry of the source": asymmetry(lambda wi, wo: brdf.f_r(wi, wo, buffers))}
    materials = [factor(brdf, options) for options in OPTIONS]
    comparisons = compare_on_sphere(brdf, materials, default_environment())
    for options, material, comparison in zip(OPTIONS, materials, comparisons, strict=True):
        row[f"{options.lobes} × {options.terms}"] = {
            "psnr_object_db": comparison.metrics["psnr_object_db"],
            "bytes_memory": material.bytes_memory,
            "bytes_disk": len(file.encode(material)),
            **material.facts,
        }
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("materials", nargs="+")
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    rows = {source: measured(sommerl.load(source)) for source in arguments.materials}
    columns = ["material", "asymmetry of the source"]
    names = [f"{options.lobes} × {options.terms}" for options in OPTIONS]
    for name in names:
        columns += [f"{name}: PSNR [dB]", "memory", "file", "asymmetry"]
    table: list[list[str]] = []
    for source, row in rows.items():
        cells = [source, f"{row['asymmetry of the source']:.3f}"]
        for name in names:
            found = row[name]
            sizes = [console.size(found["bytes_memory"]), console.size(found["bytes_disk"])]
            cells += [f"{found['psnr_object_db']:.1f}", *sizes, f"{found['asymmetry']:.3f}"]
        table.append(cells)
    console.print_table("factored", columns, table)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
