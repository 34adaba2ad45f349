"""The command line: parses, calls, prints. All defaults are the library's."""

from __future__ import annotations

import argparse
import io
import json
import math
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, NoReturn, get_args

from . import __version__, commands, console, convert, demo, own_scenes, plots, rendering, threads
from .factored.fit import FactorOptions
from .files import keeping
from .fitting.options import MOST_LOBES, FitOptions, Loss, Sampling
from .lattice import INTERPOLATIONS
from .materials import NAMES
from .models.multi_lobe import FAMILIES
from .outcome import outcome
from .paper import report
from .render.passes import DEFAULT_SIZE, DEFAULT_SPP
from .render.scenes import STAGES
from .sampling.named import OURS, SAMPLERS
from .som_man.budget import DEFAULT_PSNR, LARGEST_SIZE, SMALLEST_SIZE
from .som_man.options import Order, Rule, Topology, TrainOptions
from .visible import visible

TRAIN_DEFAULTS, FIT_DEFAULTS, FACTOR_DEFAULTS = TrainOptions(), FitOptions(), FactorOptions()

DESCRIPTION = """\
Turns measured reflectance into small material files that render fast and look like the measurement.

A MATERIAL is a file, told by its content, or the name of a built-in one. Files: Sommerl's .smrl and .fbrdf, MERL
.binary, RGL .bsdf (isotropic), Cornell .brdf, tables of samples (.csv .npy .npz, with columns theta_i_deg,
phi_i_deg, theta_o_deg, phi_o_deg, r, g, b), neural BRDFs (.npy .npz .h5; of an archive with several, FILE.npz:NAME),
and fits (.json; of several, FILE.json:MODEL)."""

BUILT_IN = "Built-in materials (SGD stand-ins for measured ones):\n  " + "\n  ".join(
    ", ".join(NAMES[i : i + 5]) for i in range(0, len(NAMES), 5)
)

EXAMPLES = """\
Examples:
  sommerl demo
  sommerl compress blue-metallic-paint.binary -o blue.smrl --clusters 256
  sommerl info blue.smrl
  sommerl compare blue-metallic-paint.binary blue.smrl
  sommerl render --scene sphere blue.smrl -o blue.png
"""


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"error: {visible(message)} (see {self.prog} --help)\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """As argparse does, but that help which cannot be printed is an error."""
        if file is sys.stdout:
            print(message, end="")
        else:
            super()._print_message(message, file)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status: 0, 1 for an error in the input, 2 for one in the options."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # not every terminal has a multiplication sign

    def command() -> None:
        options = _parser().parse_args(arguments)
        if options.threads is not None:
            threads.use(threads.checked(options.threads, threads.OPTION))
        threads.limit()
        with warnings.catch_warnings(), keeping(overwrite=getattr(options, "overwrite", False)):
            warnings.showwarning = _warned
            result = options.run(options)
        if options.json:
            print(json.dumps(_finite(result), indent=2))

    return outcome(command)


def _warned(message: Warning | str, *_: Any, **__: Any) -> None:
    """Tells a warning of Python's without the line of code that it comes from."""
    console.tell(f"warning: {message}")


def _finite(value: Any) -> Any:
    """The same, with null for the numbers that JSON lacks (the PSNR of identical images)."""
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}  # pyright: ignore[reportUnknownVariableType]
    if isinstance(value, list):
        return [_finite(item) for item in value]  # pyright: ignore[reportUnknownVariableType]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _parser() -> Parser:
    parser = Parser(
        prog="sommerl",
        description=DESCRIPTION,
        epilog=f"{BUILT_IN}\n\n{EXAMPLES}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"sommerl {__version__}")
    add = parser.add_subparsers(metavar="COMMAND", required=True, dest="command").add_parser
    for build in (_demo, _compress, _info, _convert, _compare, _fit, _factor, _render, _plot, _paper):
        build(add)
    return parser


def _command(add: Any, name: str, run: Any, summary: str, example: str) -> Any:
    command = add(
        name,
        help=summary[0].lower() + summary[1:].rstrip("."),
        description=summary,
        epilog=f"Example:\n  {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    if run is not commands.info:
        command.add_argument(
            "--overwrite", action="store_true", help="replace files that Sommerl did not write, and measurements, too"
        )
    command.add_argument(
        threads.OPTION,
        metavar="N",
        help=f"the most that work at once ({threads.VARIABLE}; if not set, as many as there are processors)",
    )
    command.set_defaults(run=run)
    return command


def _demo(add: Any) -> None:
    summary = "Compresses a built-in material, renders reference, result and difference, and shows them on a page."
    command = _command(add, "demo", demo.demo, summary, "sommerl demo --out demo")
    command.add_argument(
        "--out", type=Path, default=Path("demo"), metavar="DIR", help="folder for the files (%(default)s)"
    )


def _compress(add: Any) -> None:
    summary = "Compresses materials by the paper's method (SOM-MAN) into .smrl files."
    example = """sommerl compress nickel.binary -o nickel.smrl --clusters 1000
  sommerl compress measured.bsdf -o measured.smrl --preset compact --target-size 2700
  sommerl compress *.bsdf -o materials/ --preset compact --target-psnr 50"""
    command = _command(add, "compress", commands.compress, summary, example)
    command.add_argument("inputs", nargs="+", metavar="IN", help="a material: path or built-in name")
    command.add_argument(
        "-o", "--output", type=Path, required=True, help="a .smrl file; for several inputs, a folder that exists"
    )
    command.add_argument(
        "--preset",
        choices=["paper", "compact"],
        help="paper: MERL's lattice, nearest lookup; compact: a lattice fitted to the material, interpolated, in a "
        "file of some kilobytes (paper; compact if there is a target)",
    )
    target = command.add_mutually_exclusive_group()
    target.add_argument(
        "--target-size",
        type=int,
        metavar="BYTES",
        help=f"compact: the best file of at most that size ({SMALLEST_SIZE} to {LARGEST_SIZE})",
    )
    target.add_argument(
        "--target-psnr",
        type=float,
        metavar="DB",
        help=f"compact: the smallest file of at least that quality on a rendered sphere ({DEFAULT_PSNR:g})",
    )
    helps = {
        "clusters": "paper: M, the number of entries in the palette",
        "epochs": "paper: how often the table is presented",
        "seed": "of directions, first weights and order",
        "rule": "paper: Eq. 2 as printed (paper), or without its factor x (kohonen)",
        "alpha": "paper: first learning rate, above 0, at most 1",
        "order": "paper: of presentation",
        "radius": "paper: of the neighbourhood in the first epoch, in units; 0: the winner learns alone",
        "topology": "paper: how the units are arranged for that",
    }
    allowed = {"rule": get_args(Rule), "order": get_args(Order), "topology": get_args(Topology)}
    for field in fields(TrainOptions):
        default = getattr(TRAIN_DEFAULTS, field.name)
        command.add_argument(
            f"--{field.name}",
            type=type(default),
            default=default,
            choices=allowed.get(field.name),
            metavar=None if field.name in allowed else field.name[0].upper(),
            help=f"{helps[field.name]} (%(default)s)",
        )


def _info(add: Any) -> None:
    summary = "Says what a material is: its lattice, its sizes, how it was made and how good it is."
    command = _command(add, "info", commands.info, summary, "sommerl info nickel.smrl")
    command.add_argument("material", metavar="MATERIAL")


def _convert(add: Any) -> None:
    summary = "Converts a material into the format that the output's extension names."
    example = "sommerl convert samples.csv samples.binary\n  sommerl convert nickel.smrl nickel.h"
    command = _command(add, "convert", convert.convert, summary, example)
    command.epilog = f"{_listed(convert.EXTENSIONS)}\n\n{command.epilog}"
    command.add_argument("input", metavar="IN", help="a material: path or built-in name")
    command.add_argument("output", type=Path, metavar="OUT", help="a name with one of the extensions below")
    command.add_argument(
        "--spectral", action="store_true", help=".bsdf: spectra for pbrt-v4 and Mitsuba's spectral variants, not RGB"
    )
    command.add_argument(
        "--noise", type=int, metavar="SEED", help="add the measurement error of MERL's data to a built-in material"
    )


def _listed(extensions: Mapping[str, str]) -> str:
    """Extensions, and what is written for each; those with one meaning together."""
    meanings = {text: " ".join(key for key in extensions if extensions[key] == text) for text in extensions.values()}
    return "Extensions of OUT:\n" + "\n".join(f"  {keys:24}{text}" for text, keys in meanings.items())


def _compare(add: Any) -> None:
    summary = "Renders two materials on a sphere and says how far they are apart, there and cell by cell."
    example = "sommerl compare nickel.binary nickel.smrl -o both.png"
    command = _command(add, "compare", commands.compare, summary, example)
    command.add_argument("reference", metavar="A")
    command.add_argument("candidate", metavar="B")
    command.add_argument("-o", "--output", type=Path, help="a .png with A, B and their difference (×8) side by side")
    command.add_argument(
        "--lookup",
        choices=INTERPOLATIONS,
        help="how both are looked up; if not given: a compressed material as it is, a table as the compressed one on "
        "its lattice, so that the figures measure the compression alone, else trilinear",
    )
    _rendering(command)


def _render(add: Any) -> None:
    summary = "Renders materials in a scene, or a scene of your own. PNG is exposed for the objects; EXR is linear."
    example = """sommerl render nickel.smrl -o nickel.exr
  sommerl render kitchen.xml -o kitchen.exr --spp 1024 -D wall=nickel.smrl
  sommerl render --scene statue --mesh buddha.obj blue.smrl --against blue.binary -o blue.png
  sommerl render --scene grid FOLDER --size 128 -o sheet.png"""
    command = _command(add, "render", rendering.render, summary, example)
    command.epilog = f"{rendering.SCENES}\n\n{rendering.FILES}\n\n{own_scenes.FILES}\n\n{command.epilog}"
    command.add_argument(
        "materials",
        nargs="*",
        metavar="MATERIAL",
        help="as many as the scene takes, the rest are the scene's own; or SCENE.xml, a scene of your own",
    )
    default = rendering.DEFAULTS["scene"]
    command.add_argument("--scene", choices=[*STAGES, rendering.GRID], help=f"({default})")
    command.add_argument("-o", "--output", type=Path, required=True, help="a .png or .exr file")
    command.add_argument(
        "--against",
        action="append",
        default=[],
        metavar="REFERENCE",
        help="render the scene with this material in place of the first MATERIAL, too, and say how far the two are "
        "apart; given again: in place of the second one, and so on",
    )
    command.add_argument(
        "--mesh", type=Path, metavar="FILE", help="statue: a mesh of triangles, .obj or .ply, y up (a built-in one)"
    )
    command.add_argument(
        "--lookup",
        choices=INTERPOLATIONS,
        help="how materials are looked up (tables: trilinear; with --against: as `compare` does)",
    )
    command.add_argument(
        "--sampler",
        choices=[*SAMPLERS],
        help=f"how directions to the light are drawn; all give the same image, with more or less noise ({OURS.name})",
    )
    command.add_argument(
        "--variant", metavar="NAME", help="SCENE.xml: of Mitsuba, like scalar_rgb (the fastest there is)"
    )
    command.add_argument(
        "-D", dest="define", action="append", default=[], metavar="NAME=VALUE",
        help="SCENE.xml: a value for its parameter $NAME; given again: for another one",
    )  # fmt: skip
    _rendering(command)
    command.set_defaults(spp=None, size=None)  # so that it is known which are given


def _plot(add: Any) -> None:
    summary = "Draws what a material is: lobes, slices, palette."
    example = """sommerl plot nickel.binary -o nickel.png
  sommerl plot nickel.binary nickel.smrl nickel.json:ggx --kind theta-h -o three.pdf"""
    command = _command(add, "plot", commands.plot, summary, example)
    kinds = "\n".join(f"  {name:10}{kind.shows}" for name, kind in plots.KINDS.items())
    command.epilog = f"Kinds:\n{kinds}\n\n{command.epilog}"
    command.add_argument(
        "materials", nargs="+", metavar="MATERIAL", help=f"up to {plots.MOST_MATERIALS}; curves are drawn together"
    )
    command.add_argument(
        "-o", "--output", type=Path, required=True, help=f"a name that ends in {' '.join(plots.FORMATS)}"
    )
    command.add_argument(
        "--kind",
        choices=[*plots.KINDS, "all"],
        default="all",
        help="one of those below, or all that apply (%(default)s)",
    )


def _fit(add: Any) -> None:
    summary = "Fits analytic models to a material, and says how far each is from it: would a formula do?"
    example = """sommerl fit nickel.binary --model ward --lobes 3
  sommerl fit nickel.binary -o nickel.json --picture nickel.png
  sommerl render nickel.json:ggx -o ggx.png"""
    command = _command(add, "fit", commands.fit, summary, example)
    command.epilog = f"Models:\n{_families()}\n\n{command.epilog}"
    command.add_argument("material", metavar="MATERIAL")
    command.add_argument("--model", default="all", metavar="NAME", help="one of the models below, or all (%(default)s)")
    command.add_argument(
        "--lobes",
        type=int,
        metavar="N",
        help=f"of a model, with its Lambertian base: 2 to {MOST_LOBES} (2; 1 of models that are a base themselves)",
    )
    for name, allowed, text in (
        ("loss", Loss, "what the error is of: f_r; f_r cos θ_i; the logarithm of that, or its cube root"),
        ("sampling", Sampling, "directions that a rendered sphere sees, or the centres of the lattice's cells"),
    ):
        default = getattr(FIT_DEFAULTS, name)
        command.add_argument(f"--{name}", choices=get_args(allowed), default=default, help=f"{text} (%(default)s)")
    for name, text in (
        ("samples", "pairs of directions, for --sampling sphere"),
        ("starts", "of the search, of each model"),
        ("seed", "of directions and starts"),
    ):
        default = getattr(FIT_DEFAULTS, name)
        command.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"{text} (%(default)s)")
    command.add_argument(
        "--conserve-energy",
        action="store_true",
        help="let the albedos of each channel sum to 1 at most (which binds oren-nayar, ward and ward-duer loosely)",
    )
    command.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="a .json with everything; FILE.json:MODEL is a material"
    )
    command.add_argument(
        "--picture", type=Path, metavar="FILE", help="a .png of the material, its fits and differences"
    )


def _factor(add: Any) -> None:
    summary = "Factors a material into products of small tables, the representation of Lawrence et al. 2004."
    command = _command(add, "factor", commands.factor, summary, "sommerl factor nickel.binary -o nickel.fbrdf")
    command.add_argument("material", metavar="MATERIAL")
    command.add_argument("-o", "--output", type=Path, required=True, help="a .fbrdf file")
    for name, text in (("lobes", "J: products of the viewer's elevation and a lobe"), ("terms", "K: of each lobe")):
        default = getattr(FACTOR_DEFAULTS, name)
        command.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"{text} (%(default)s)")


def _paper(add: Any) -> None:
    summary = "Makes the paper's tables and figures again, beside the figures that it prints."
    command = _command(add, "paper", report.paper, summary, "sommerl paper table1 --data MERL -o paper")
    listed = "\n".join(f"  {name:8}{title}" for name, (title, _) in report.ITEMS.items())
    command.epilog = f"Items:\n{listed}\n\n{command.epilog}"
    command.add_argument("item", choices=[*report.ITEMS, "all"], nargs="?", default="all", help="(%(default)s)")
    command.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        help="a folder with a file for each material, like purple-paint.binary, or an .npz archive of neural BRDFs; "
        "if not given, the built-in stand-ins",
    )
    command.add_argument(
        "-o",
        "--out",
        type=Path,
        default=Path("paper"),
        metavar="DIR",
        help="folder for tables and pictures (%(default)s)",
    )
    for name, text in (
        ("samples", "pairs of directions that models are fitted to"),
        ("seed", "of directions and starts"),
    ):
        default = getattr(FIT_DEFAULTS, name)
        command.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"{text} (%(default)s)")


def _families() -> str:
    """All models, with their parameters and bounds."""
    lines: list[str] = []
    for name, family in FAMILIES.items():
        shape = ", ".join(f"{p.name} {p.low:g} to {p.high:g}" for p in family.parameters)
        lines.append(f"  {name:20}{shape}".rstrip())
    return "\n".join(lines)


def _rendering(command: Any) -> None:
    for name, default, text in (
        ("spp", DEFAULT_SPP, "samples a pixel"),
        ("size", DEFAULT_SIZE, "width and height in pixels"),
        ("seed", 0, "of the random numbers"),
    ):
        command.add_argument(f"--{name}", type=int, default=default, metavar="N", help=f"{text} ({default})")
    command.add_argument(
        "--envmap", type=Path, metavar="FILE", help="a latitude-longitude image that lights the scene (a built-in one)"
    )
