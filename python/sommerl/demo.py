"""The command `demo`: from a built-in material to a page with pictures."""

from __future__ import annotations

import time
from argparse import Namespace
from dataclasses import asdict
from typing import Any

from . import __version__, console
from .describe import compression_rows, describe, image_rows, trained
from .files import check_writable
from .formats import merl
from .load import load_table
from .render.compare import compare_on_sphere
from .render.environment import default_environment
from .render.images import write_image, write_page
from .render.llvm import mitsuba
from .som_man import file as smrl
from .som_man.options import TrainOptions

MATERIAL = "blue-metallic-paint"


def demo(options: Namespace) -> dict[str, Any]:
    mitsuba()  # what is missing for rendering is better said before training
    options.out.mkdir(parents=True, exist_ok=True)
    paths = {
        key: options.out / name
        for key, name in {
            "material": f"{MATERIAL}.smrl",
            "reference": "reference.png",
            "candidate": "sommerl.png",
            "difference": "difference.png",
            "page": "index.html",
        }.items()
    }
    for path in paths.values():
        check_writable(path)
    table = load_table(MATERIAL).with_interpolation("nearest")
    material, report = trained(table, TrainOptions())
    written = smrl.save(material, paths["material"])
    started = time.perf_counter()
    with console.progress("rendering") as advance:
        comparison = compare_on_sphere(table, [material], default_environment(), progress=advance)[0]
    seconds = time.perf_counter() - started
    captions = ("Reference: the full table", f"Sommerl: {console.size(written)}", "Difference, eight times enlarged")
    pictures = list(zip(captions, comparison.pictures(), strict=True))
    for key, (_, pixels) in zip(("reference", "candidate", "difference"), pictures, strict=True):
        write_image(paths[key], pixels)
    full = merl.bytes_on_disk(table.lattice)
    rows = image_rows(comparison.metrics) | {"size of the full table": console.size(full)}
    rows |= compression_rows(material, written, report) | {"rendering": f"{seconds:.1f} s"}
    note = (
        "The reference is an SGD stand-in: the published analytic fit (Bagher et al. 2012) of a measured material, "
        f"evaluated to a MERL table. The file is {full / written:.0f} times smaller. Both are looked up by the nearest "
        "cell, and rendered with the same sample directions. Options: "
        + ", ".join(f"{key} {value}" for key, value in material.options.items())
        + f". Made by sommerl {__version__}: sommerl demo."
    )
    write_page(paths["page"], f"Sommerl: {material.name}", pictures, rows, note)
    if not options.json:
        console.print_rows(material.name, rows)
        console.say("Wrote " + ", ".join(map(str, paths.values())))
        console.say(f"Open {paths['page']} in a browser.")
    return (
        describe(material, written)
        | asdict(report)
        | asdict(comparison.metrics)
        | {"epochs": TrainOptions().epochs, "seconds_render": seconds}
        | {"output": {key: str(path) for key, path in paths.items()}}
    )
