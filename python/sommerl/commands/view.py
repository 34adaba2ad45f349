"""The command `view`: a page on which materials are looked at, served to a browser here or written to a file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Thread
from typing import Any

from ..formats.load import load
from ..system.errors import OptionError
from ..system.files import atomic_write
from ..system.first_few import first_few
from ..system.interrupt import hold_interrupts
from ..viewer.held import Held, held_mbsdf
from ..viewer.page import page, policy
from ..viewer.versions import Source, Version, asked
from . import answers, console
from .arguments import Material, WritingArguments, byte_count, named_as_typed, option, positional, several, whole_number
from .checks import check_output, check_range
from .inputs import expanded, labels, read_all, stem
from .outcome import print_answer
from .parser import add_command

LARGEST_PAGE = 2**28  # bytes: browsers do not take much longer ones
EXTENSION = ".html"
HIGHEST_PORT = 2**16 - 1

SERVED = """Page:
  It needs a browser with WebGPU or WebGL2 and nothing else: it asks for nothing from any network. Files that are
  dropped on it stay in it. Without -o, it is served at 127.0.0.1, to this machine, until Ctrl-C."""


@dataclass(frozen=True, kw_only=True)
class ViewArguments(WritingArguments):
    """What `view` is asked for."""

    materials: tuple[Material, ...] = positional(
        "MATERIAL", help="a file, a built-in name, a folder of materials, or a pattern in quotes"
    )
    output: Path | None = option(
        "-o",
        default=None,
        metavar="PAGE",
        help="write the page to a file, which needs nothing else, and do not serve it",
    )
    sizes: tuple[int, ...] | None = option(
        default=None,
        metavar="BYTES,...",
        read=several(byte_count),
        help="beside each material, also its compact files of at most these sizes, like 1000,2.7kB,8kB",
    )
    clusters: tuple[int, ...] | None = option(
        default=None,
        metavar="M,...",
        read=several(whole_number),
        help="beside each material, also what the preset paper makes of it with these numbers of entries",
    )
    port: int = option(default=0, metavar="N", help="of this machine, where the page is served (any free one)")
    no_open: bool = option(default=False, help="do not open a browser")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Shows materials on a page in a browser: in the light, compared, and how they are stored."
    example = """sommerl view nickel.binary nickel.smrl
  sommerl view chrome -o chrome.html --sizes 1000,2.7kB,8kB --clusters 16,256
  sommerl view compressed/ -o all.html"""
    add_command(add, "view", view, ViewArguments, summary, example, explained=[SERVED])


def view(options: ViewArguments) -> dict[str, Any] | None:
    versions = _versions(options)
    names, references = _references(options)
    shown = [[one, *_compressed(one, versions)] for one in references]
    made = page([one for steps in shown for one in steps]).encode()
    if len(made) > LARGEST_PAGE:
        raise OptionError(
            f"MATERIAL: expected materials for a page of at most {console.size(LARGEST_PAGE)}, found "
            f"{console.size(len(made))}"
        )
    said = [_said(name, steps) for name, steps in zip(names, shown, strict=True)]
    answer = answers.of_materials(said, bytes_page=len(made))
    called = first_few([one.label for one in references])
    if options.output:
        with atomic_write(options.output) as out:
            out.write(made)
        if not options.json:
            console.say(f"{called} → {options.output} ({console.size(len(made))})")
        return answer | {"output": str(options.output), "url": None}
    _serve(made, called, answer, options)
    return None


def _versions(options: ViewArguments) -> list[Version]:
    """The versions that are asked for. Raises OptionError for options that are out of range, or of no use together."""
    check_range("--port", options.port, 0, HIGHEST_PORT)
    if options.output and (options.port or options.no_open):
        given = "--port" if options.port else "--no-open"
        raise OptionError(f"{given}: expected no -o beside it, which writes the page and does not serve it, found one")
    with named_as_typed():
        return asked(options.sizes or (), options.clusters or ())


def _references(options: ViewArguments) -> tuple[list[str], list[Held]]:
    """The names of the materials, and what the page holds of each, without its versions.

    Each is read once, before any is compressed, and only what the page holds is kept.
    """
    found = expanded(options.materials)
    if options.output:
        check_output(options.output, (EXTENSION,), *found)
    again = next((source for source in found if found.count(source) > 1), None)
    if again:
        raise OptionError(f"MATERIAL: expected different ones, found {again} twice")
    kept = read_all(found, options.materials, _reference)
    names = [one.label for one in kept]
    made = labels([one.name for one in kept], names)
    return names, [replace(one, label=label, group=label) for one, label in zip(kept, made, strict=True)]


def _reference(source: str) -> Held:
    """A material as the page holds it, called by its own name."""
    as_it_is = held_mbsdf(Path(source)) if os.path.isfile(source) else None
    if as_it_is:
        return as_it_is
    brdf = load(source)
    return Source(brdf, brdf.name, source).held()


def _compressed(reference: Held, versions: Sequence[Version]) -> list[Held]:
    """The versions of a material, which is read again: kept in memory, a hundred tables would take gigabytes."""
    if not versions:
        return []
    source = Source(load(reference.name), reference.label, reference.name, stem(reference.name))
    return list(source.compressed(versions, console.progress))


def _said(name: str, steps: Sequence[Held]) -> dict[str, Any]:
    """What is said of a material. steps: the material and its versions."""
    versions = [{"step": one.step, "bytes": one.size} for one in steps]
    return {"input": steps[0].name, "name": name, "label": steps[0].label, "versions": versions}


def _serve(made: bytes, called: str, answer: dict[str, Any], options: ViewArguments) -> None:
    """Serves the page until an interruption."""
    with hold_interrupts():
        from ..viewer.server import Server
    with named_as_typed():
        server = Server(made, policy(), options.port)
    with server:
        if options.json:
            print_answer(answer | {"output": None, "url": server.url})
        else:
            console.say(f"{called} → {server.url} (Ctrl-C ends)")
        if not options.no_open:
            Thread(target=_opened, args=(server.url,), daemon=True).start()
        server.serve_forever()


def _opened(url: str) -> bool:
    """Whether a browser was opened. One that runs in the terminal is not: it would take that from the command."""
    import webbrowser

    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return False
    return type(browser) is not webbrowser.GenericBrowser and browser.open(url)
