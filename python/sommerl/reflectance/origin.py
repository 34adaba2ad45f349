"""What a material was made from, and that from what: its direct source, and a chain back to the first one known."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, cast

from ..system.errors import FormatError
from ..system.visible import visible
from .brdf import Brdf

Link = Mapping[str, str]  #: "kind", "name" and "sha256" of a source

FIRST = "source"  # the kind of one that says no more: a measurement, or a formula
KINDS = ("som-man", "factored", FIRST)
LONGEST_NAME = 255
MOST_LINKS = 8  # of a longer chain, those before the first source are left out


def source_of(brdf: Brdf) -> tuple[str, tuple[Link, ...]]:
    """What is to be kept of `brdf` in a material that is made from it: a SHA-256, and a chain.

    Of a compressed material, the SHA-256 of its file ("" if it was never read from one), and the chain: its own kind
    and name, what it was made from, and so on. Of anything else, what is known of its source, and mostly no chain.
    """
    if not brdf.compressed_as:
        return getattr(brdf, "source_sha256", None) or "", brdf.made_from
    before = full_chain(brdf) or (
        {"kind": FIRST, "name": brdf.name[:LONGEST_NAME], "sha256": getattr(brdf, "source_sha256", "")},
    )
    chain = ({"kind": brdf.compressed_as, "name": brdf.name[:LONGEST_NAME]}, *before)
    return brdf.file_sha256, chain if len(chain) <= MOST_LINKS else (*chain[: MOST_LINKS - 1], chain[-1])


def full_chain(brdf: Brdf) -> tuple[Link, ...]:
    """The chain, with the SHA-256 of its first link, which a material keeps as `source_sha256` alone."""
    if not brdf.made_from:
        return ()
    return {**brdf.made_from[0], "sha256": getattr(brdf, "source_sha256", "")}, *brdf.made_from[1:]


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
