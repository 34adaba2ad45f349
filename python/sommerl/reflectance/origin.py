"""What a material was made from, and that from what: its direct source, and a chain back to the first one known."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from ..system.errors import FormatError
from ..system.visible import visible

if TYPE_CHECKING:
    from .brdf import Brdf

Link = Mapping[str, str]  #: "kind", "name" and "sha256" of a source

FIRST = "source"  # the kind of one that says no more: a measurement, or a formula
KINDS = ("som-man", "factored", FIRST)
LONGEST_NAME = 255
MOST_LINKS = 8  # of a longer chain, those before the first source are left out


@dataclass(frozen=True)
class Source:
    """Where a material's data comes from.

    sha256: of the file that it was read or made from, in hexadecimal digits; of the values where there is no file; ""
        if nothing is known.
    made_from: where that file was a compressed material itself, the chain back to the first source: each link's "kind"
        and "name", and the "sha256" of all but the first link, which is `sha256`.
    """

    sha256: str = ""
    made_from: tuple[Link, ...] = ()

    def chain(self) -> tuple[Link, ...]:
        """The links of `made_from`, each with its SHA-256."""
        if not self.made_from:
            return ()
        return {**self.made_from[0], "sha256": self.sha256}, *self.made_from[1:]


def source_of(brdf: Brdf) -> Source:
    """What is to be kept of `brdf` in a material that is made from it.

    Of a compressed material, the SHA-256 of its file ("" if it was never read from one), and the chain: its own kind
    and name, what it was made from, and so on. Of anything else, its own source.
    """
    if not brdf.compressed:
        return brdf.source
    before = brdf.source.chain() or ({"kind": FIRST, "name": brdf.name[:LONGEST_NAME], "sha256": brdf.source.sha256},)
    chain = ({"kind": brdf.kind, "name": brdf.name[:LONGEST_NAME]}, *before)
    return Source(brdf.file_sha256, chain if len(chain) <= MOST_LINKS else (*chain[: MOST_LINKS - 1], chain[-1]))


def measured_against(brdf: Brdf) -> dict[str, str] | None:
    """What the figures in a compressed material are against: what it was directly made from. None of any other."""
    if not brdf.compressed:
        return None
    source = {"kind": FIRST, "name": brdf.name, "sha256": brdf.source.sha256}
    return dict(next(iter(brdf.source.chain()), source))


def check_chain(value: Any) -> tuple[Link, ...]:
    """A chain from a file. Raises FormatError if it is none."""
    links = cast("list[Any]", value) if isinstance(value, list) else []
    if not 1 <= len(links) <= MOST_LINKS or not all(_is_link(link, first=not at) for at, link in enumerate(links)):
        raise FormatError(f"made_from: expected a list of 1 to {MOST_LINKS} sources, found something else")
    return tuple({**link, "name": visible(link["name"])} for link in links)


def _is_link(value: Any, *, first: bool) -> bool:
    link = cast("dict[str, Any]", value) if isinstance(value, dict) else {}
    keys = {"kind", "name"} if first else {"kind", "name", "sha256"}
    if link.keys() != keys or not all(isinstance(text, str) for text in link.values()):
        return False
    known = link["kind"] in KINDS and len(link["name"]) <= LONGEST_NAME
    return known and re.fullmatch("([0-9a-f]{64})?", link.get("sha256", "")) is not None
