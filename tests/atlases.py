"""Compact materials of all kinds, and atlases of them."""

from functools import cache

from compact import FOLDS, material
from helpers import compact_material
from sampled import NODES

from sommerl.compression.atlas import Atlas

# Each differs from the next in its number of nodes, bands, entries, its folds, or its signs.
MATERIALS = [
    compact_material(NODES),
    *(material(case, 30 + k, folds=FOLDS[folds]) for k, (case, folds) in enumerate(
        [("smooth", "both"), ("grey", "reciprocal"), ("one-shape", "mirrored"), ("noise", "neither")]
    )),
    material("smooth", 40, folds=FOLDS["both"], signed=True),
    material("minimal", 41),
]  # fmt: skip
COUNT = len(MATERIALS)


@cache
def atlas():
    return Atlas(MATERIALS)


@cache
def turned():
    """Each material under the number before its own: what an atlas gives whose numbers are one off."""
    return Atlas([*MATERIALS[1:], MATERIALS[0]])
