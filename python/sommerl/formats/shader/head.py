"""What the head of a source code says of where it comes from."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ... import __version__
from ...compression.material import SomManBrdf
from ...system.visible import visible

LONGEST_LINE = 300


def comment(text: str) -> str:
    """A text that is safe within a comment of one line: without line breaks, without backslashes and C's trigraphs
    ("??/" was one for a backslash), which would join the next line to it, and without "*/"."""
    return re.sub(r"\s+", " ", re.sub(r"\\|\?(?=\?)|\*(?=/)", " ", visible(text, LONGEST_LINE)))


def head_values(materials: Sequence[SomManBrdf], command: str, *, numbered: bool) -> dict[str, str]:
    """What stands for the words between @ in the templates of the head. numbered: whether it lists materials."""
    digests = [comment(each.source.sha256) or "unknown" for each in materials]
    qualities = [quality(each) for each in materials]
    listed = zip(materials, digests, qualities, strict=True)
    return {
        "TITLE": f"{len(materials)} materials" if numbered else comment(materials[0].name),
        "VERSION": __version__,
        "SHA": "of each material, below" if numbered else f"SHA-256 {digests[0]}",
        "QUALITY": "of each material, below" if numbered else qualities[0],
        "COMMAND": comment(command) or "none",
        "NAMES": "\n".join(f"//   {k}: {comment(one.name)} ({sha}; {how})" for k, (one, sha, how) in enumerate(listed)),
    }


def quality(material: SomManBrdf) -> str:
    """How far a material is from its source: the figures of its file, with their keys in JSON."""
    figures = {key: value for key, value in material.metrics.items() if isinstance(value, int | float)}
    return comment(", ".join(f"{key} {value:.4g}" for key, value in figures.items())) or "unknown"
