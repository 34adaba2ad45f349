"""The command `demo`: from a built-in material to a page with pictures."""

from __future__ import annotations

import base64
import html
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..compression.paper.options import TrainOptions
from ..compression.smrl import file as smrl
from ..formats import merl
from ..formats.load import load_table
from ..render.compare import compare_on_sphere
from ..render.environment import default_environment
from ..render.images import encode, write_image
from ..render.llvm import mitsuba
from ..system.files import atomic_write, check_writable
from ..system.visible import visible
from . import answers, console
from .arguments import WritingArguments, option
from .compress import compression_rows, trained
from .folders import make_folder
from .parser import add_command
from .rows import image_rows

MATERIAL = "blue-metallic-paint"


@dataclass(frozen=True, kw_only=True)
class DemoArguments(WritingArguments):
    """What `demo` is asked for."""

    out: Path = option(default=Path("demo"), metavar="DIR", help="folder for the files (%(default)s)")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Compresses a built-in material, renders reference, result and difference, and shows them on a page."
    add_command(add, "demo", demo, DemoArguments, summary, "sommerl demo --out demo")


def demo(options: DemoArguments) -> dict[str, Any]:
    mitsuba()  # what is missing for rendering is better said before training
    make_folder(options.out)
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
        console.wrote(paths.values())
        console.say(f"Open {paths['page']} in a browser.")
    result = (
        answers.described(MATERIAL, material, written)
        | asdict(report)
        | comparison.metrics
        | {"epochs": TrainOptions().epochs, "seconds_render": seconds}
        | {"output": {key: str(path) for key, path in paths.items()}}
    )
    return answers.of_materials([result])


def write_page(
    path: Path, title: str, pictures: Sequence[tuple[str, NDArray[np.uint8]]], rows: Mapping[str, str], note: str
) -> None:
    """One HTML file, complete in itself: captioned pictures side by side, a table of rows, and a note."""
    figures = "".join(
        f'<figure><img src="data:image/png;base64,{base64.b64encode(encode(pixels)).decode()}" '
        f'alt="{_html(caption)}"><figcaption>{_html(caption)}</figcaption></figure>'
        for caption, pixels in pictures
    )
    cells = "".join(f"<tr><th>{_html(key)}</th><td>{_html(value)}</td></tr>" for key, value in rows.items())
    page = PAGE.format(title=_html(title), figures=figures, cells=cells, note=_html(note))
    with atomic_write(path) as out:
        out.write(page.encode())


def _html(text: str) -> str:
    return html.escape(visible(text))


PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="generator" content="Sommerl">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
  body {{ font: 16px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 62rem; margin: 2rem auto;
    padding: 0 1rem; }}
  @media (prefers-color-scheme: dark) {{ body {{ color: #ddd; background: #181818; }} }}
  .pictures {{ display: flex; flex-wrap: wrap; gap: 1rem; }}
  figure {{ flex: 1 1 16rem; margin: 0; }}
  img {{ width: 100%; display: block; }}
  table {{ border-collapse: collapse; margin: 1.5rem 0; }}
  th {{ text-align: left; font-weight: normal; padding-right: 2rem; }}
  td {{ text-align: right; font-variant-numeric: tabular-nums; }}
</style>
<h1>{title}</h1>
<div class="pictures">{figures}</div>
<table>{cells}</table>
<p>{note}</p>
</html>
"""
