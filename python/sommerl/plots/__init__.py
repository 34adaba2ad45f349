"""Pictures of data, with matplotlib.

One function a picture. Those of a BRDF draw into axes that they are given, `f(ax, brdf, ...)`, so that they go into
figures of your own; `sheet` puts several on one page, and `save` writes it.
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
