"""The command `factor`: a material as products of small tables."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..factored import file as fbrdf
from ..factored.fit import FactorOptions
from ..factored.fit import factor as factored
from ..formats.load import load
from . import answers, console
from .arguments import Material, WritingArguments, library_options, option, positional
from .checks import check_output
from .parser import add_command
from .rows import changed_rows, fact_rows, origin_rows, text

DEFAULTS = FactorOptions()


@dataclass(frozen=True, kw_only=True)
class FactorArguments(WritingArguments):
    """What `factor` is asked for."""

    material: Material = positional("MATERIAL", help="the material to factor: a file or a built-in name")
    output: Path = option("-o", metavar="FILE", help="a .fbrdf file")
    lobes: int = option(
        default=DEFAULTS.lobes, metavar="N", help="J: products of the viewer's elevation and a lobe (%(default)s)"
    )
    terms: int = option(default=DEFAULTS.terms, metavar="N", help="K: of each lobe (%(default)s)")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Factors a material into products of small tables, the representation of Lawrence et al. 2004."
    example = "sommerl factor nickel.binary -o nickel.fbrdf"
    add_command(add, "factor", factor, FactorArguments, summary, example)


def factor(options: FactorArguments) -> dict[str, Any]:
    chosen = library_options(FactorOptions, options)
    check_output(options.output, (".fbrdf",), options.material)
    brdf = load(options.material)
    started = time.perf_counter()
    with console.progress(f"factoring {brdf.name}") as advance:
        material = factored(brdf, chosen, progress=advance)
    seconds = time.perf_counter() - started
    written = fbrdf.save(material, options.output)
    known = answers.described(options.material, material, written)
    if not options.json:
        rows = {
            "lobes × terms": text(known["terms"]),
            "size in memory": console.size(material.bytes_memory),
            "size on disk": console.size(written),
            **fact_rows(known["facts"]),
            **origin_rows(material),
            **changed_rows(material.counts),
            "time": f"{seconds:.1f} s",
        }
        console.print_rows(f"{material.name} → {options.output}", rows)
    return answers.of_materials([known | {"seconds": seconds, "output": str(options.output)}])
