"""The command `factor`: a material as products of small tables."""

from __future__ import annotations

import time
from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..factored import file as fbrdf
from ..factored.fit import FactorOptions
from ..factored.fit import factor as factored
from ..formats.load import load
from . import console
from .checks import check_output
from .parser import command
from .rows import describe, fact_rows, origin_rows, text

DEFAULTS = FactorOptions()


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Factors a material into products of small tables, the representation of Lawrence et al. 2004."
    parser = command(add, "factor", factor, summary, "sommerl factor nickel.binary -o nickel.fbrdf")
    parser.add_argument("material", metavar="MATERIAL")
    parser.add_argument("-o", "--output", type=Path, required=True, help="a .fbrdf file")
    for name, meaning in (("lobes", "J: products of the viewer's elevation and a lobe"), ("terms", "K: of each lobe")):
        default = getattr(DEFAULTS, name)
        parser.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"{meaning} (%(default)s)")


def factor(options: Namespace) -> dict[str, Any]:
    chosen = FactorOptions(options.lobes, options.terms)
    check_output(options.output, (".fbrdf",), options.material)
    brdf = load(options.material)
    started = time.perf_counter()
    with console.progress(f"factoring {brdf.name}") as advance:
        material = factored(brdf, chosen, progress=advance)
    seconds = time.perf_counter() - started
    written = fbrdf.save(material, options.output)
    known = describe(material, written) | asdict(brdf.counts)
    if not options.json:
        rows = {
            "lobes × terms": text(known["terms"]),
            "size in memory": console.size(material.bytes_memory),
            "size on disk": console.size(written),
            **fact_rows(known["facts"]),
            **origin_rows(material),
            **(fact_rows(asdict(brdf.counts)) if known["cells_clamped"] else {}),
            "time": f"{seconds:.1f} s",
        }
        console.print_rows(f"{material.name} → {options.output}", rows)
    return known | {"seconds": seconds, "output": str(options.output)}
