"""The command `blend`: a material between two others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..compression.compact.search import CompactOptions
from ..formats import smrl
from ..formats.load import load
from ..reflectance.blend import blend as blended
from ..system.errors import OptionError
from . import answers
from .arguments import Material, WritingArguments, byte_count, option, positional
from .checks import check_apart
from .compress import compact_one
from .convert import ConvertArguments, checked, converted, typed
from .parser import add_command


@dataclass(frozen=True, kw_only=True)
class BlendArguments(WritingArguments):
    """What `blend` is asked for."""

    first: Material = positional("A", help="a file or a built-in name")
    second: Material = positional("B", help="a file or a built-in name")
    weight: float = positional("WEIGHT", help="of B, from 0, which is A, to 1")
    output: Path = option("-o", metavar="OUT", help="a name with an extension that `convert` writes, but for snippets")
    target_size: int | None = option(
        default=None,
        metavar="BYTES",
        read=byte_count,
        help="compress by the preset compact, into at most that size as .smrl, like 8kB",
    )
    reciprocal: bool = option(
        default=False, help="the mean of both orders of the directions, as tables hold it in any case"
    )


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Blends two materials in the cube-root domain, so that steps of the weight look even."
    example = (
        "sommerl blend nickel chrome 0.3 -o between.smrl --target-size 2.7kB\n  sommerl blend a.smrl b.smrl 0.5 -o c.h"
    )
    add_command(add, "blend", blend, BlendArguments, summary, example)


def blend(options: BlendArguments) -> dict[str, Any]:
    if not 0 <= options.weight <= 1:
        raise OptionError(f"WEIGHT: expected 0 to 1, found {options.weight:g}")
    called = f"{options.first} + {options.second}"
    asked = {name: getattr(options, name) for name in ("output", "target_size", "reciprocal", "json", "overwrite")}
    conversion = ConvertArguments(inputs=(called,), **asked)  # pyright: ignore[reportArgumentType] # a NewType of str
    kind = checked(conversion)
    if kind.names_source:
        raise OptionError(f"{options.output}: expected an output that holds the material, found a scene snippet")
    check_apart(options.output, options.first, options.second)
    brdf = blended(load(options.first), load(options.second), options.weight)
    sources = {"blended": [options.first, options.second], "weight": options.weight}
    if kind is not smrl.FORMAT or options.target_size is not None:
        words = ["blend", options.first, options.second, str(options.weight), "-o", str(options.output)]
        return converted(brdf, kind, conversion, typed(words, conversion)) | sources
    found = compact_one(called, brdf, options.output, CompactOptions(), options.json, reciprocal=options.reciprocal)
    return answers.of_materials([found]) | sources
