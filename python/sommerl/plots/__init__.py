"""Pictures of materials and of data about them, drawn with matplotlib.

There is one function for each kind of picture. Those that show a BRDF draw into matplotlib axes that they are given,
`f(ax, brdf, ...)`, so they can be part of your own figures. `sheet` puts several on one page, and `save` writes it.
"""

from .curves import lobes, theta_h_slices
from .image_slice import slices
from .lattice_hits import hit_counts, hits
from .page import FORMATS, MOST_MATERIALS, save
from .palettes import palette, usage
from .scattered import coverage
from .sheets import KINDS, sheet
from .spheres import fits

__all__ = [
    "FORMATS",
    "KINDS",
    "MOST_MATERIALS",
    "coverage",
    "fits",
    "hit_counts",
    "hits",
    "lobes",
    "palette",
    "save",
    "sheet",
    "slices",
    "theta_h_slices",
    "usage",
]
