"""The page's scripts as one text each: plain modules, put into one another's order.

A module imports by `import { a, b } from "./x.js";` alone, on a line, and exports functions, classes and constants by
name where they are defined. In a bundle, each is a function of its own that returns what it exports, so that no name of
one meets a name of another.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import cache
from importlib.resources import files

PLACES = ("viewer/page", "compression/smrl/javascript")  # in which modules are looked for
MAIN, WORKER = "main.js", "worker.js"
HEAD = '"use strict";\nconst modules = {};\n'  # of a bundle
SHADERS = "shaders.js"  # the module that is made of all GLSL
IMPORT = re.compile(r'^import \{ (\w+(?:, \w+)*) \} from "\./([\w.]+)";\n', re.MULTILINE)
EXPORT = re.compile(r"^export (?=(?:async function|function\*?|class|const) (\w+))", re.MULTILINE)
COMMENT = re.compile(r"^[ \t]*(?://[^\n]*|/\*.*?\*/[ \t]*)\n", re.MULTILINE | re.DOTALL)  # of whole lines
INDENT = re.compile(r"^[ \t]+", re.MULTILINE)
OTHER = re.compile(r"^(import|export)\b.*", re.MULTILINE)  # what neither of these two has taken

Read = Callable[[str], str]  #: the text of a module, by its name


def module(name: str) -> str:
    """The text of one of the page's modules."""
    if name == SHADERS:
        return f"export const SHADERS = {json.dumps(shaders())};\n"
    found = [files("sommerl") / place / name for place in PLACES]
    return next(path for path in found if path.is_file()).read_text("utf-8")


def shaders() -> dict[str, str]:
    """GLSL, by the names of its files."""
    folder = files("sommerl") / PLACES[0]
    found = sorted((path for path in folder.iterdir() if path.name.endswith(".glsl")), key=lambda path: path.name)
    return {path.name.removesuffix(".glsl"): bare(path.read_text("utf-8")) for path in found}


def bare(text: str) -> str:
    """A script without the comments that are whole lines, and without indentation: a page is to be mailed."""
    return INDENT.sub("", COMMENT.sub("", text))


def order(entry: str, read: Read = module) -> list[str]:
    """The modules that one needs, each after those that it imports. Raises ValueError if they import in a circle."""
    found: list[str] = []

    def visit(name: str, above: tuple[str, ...]) -> None:
        if name in above:
            raise ValueError(f"{name}: expected modules that import each other in no circle, found {' → '.join(above)}")
        if name not in found:
            for imported in IMPORT.finditer(read(name)):
                visit(imported[2], (*above, name))
            found.append(name)

    visit(entry, ())
    return found


def bundled(entry: str, read: Read = module) -> str:
    """A module and all that it needs, as one script. Raises ValueError for imports and exports of other forms."""
    return HEAD + "".join(function(name, read(name)) for name in order(entry, read))


def function(name: str, text: str) -> str:
    """A module as it is in a bundle."""
    if not any(line.count("`") % 2 for line in text.splitlines()):  # or a template goes on over lines, with its spaces
        text = bare(text)
    names = [found[1] for found in EXPORT.finditer(text)]
    text = IMPORT.sub(lambda found: f'const {{ {found[1]} }} = modules["{found[2]}"];\n', text)
    text = EXPORT.sub("", text)
    if other := OTHER.search(text):
        raise ValueError(f"{name}: expected imports and exports by name, found {other[0]}")
    return f'modules["{name}"] = (() => {{\n{text.rstrip()}\nreturn {{ {", ".join(names)} }};\n}})();\n'


@cache
def script() -> str:
    """The page's script."""
    return bundled(MAIN)


@cache
def packed() -> str:
    """Both scripts in parts, as JSON, from which boot.js puts them together: what both need is there once."""
    orders = {"script": order(MAIN), "worker": order(WORKER)}
    parts = {name: function(name, module(name)) for names in orders.values() for name in names}
    return json.dumps({"head": HEAD, "parts": parts, **orders}, ensure_ascii=False)
