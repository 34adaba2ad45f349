"""Materials that are drawn, and axes to draw them into."""

import numpy as np
from matplotlib.figure import Figure

from sommerl import Brdf, Lattice, SomManBrdf, builtin

PAINT, NICKEL = builtin("blue-metallic-paint"), builtin("nickel")
ODD = Lattice(9, 9, 11)  # no pixel's centre is on the edge of a cell


def axes(projection=None):
    return Figure().add_subplot(projection=projection)


def drawn(draw, *arguments, projection=None, **options):
    ax = axes(projection)
    draw(ax, *arguments, **options)
    return ax


def palette_material(entries=10, lattice=ODD):
    """Entries in no order, whose channels differ."""
    rng = np.random.default_rng(1)
    lut = rng.random((entries, 3)) * 10.0 ** rng.uniform(-3, 2, (entries, 1))
    return SomManBrdf(lut, rng.integers(0, entries, lattice.shape).astype(np.uint8), lattice, name="palette")


class Tilted(Brdf):
    """Not reciprocal, and not the same on both sides of the normal: tells wi from wo, and left from right."""

    name = "tilted"

    def f_r(self, wi, wo, buffers):
        value = 1 + 0.5 * wi[0] + 0.2 * wo[0] + wi[2]
        return value, 2 * value, 3 * value
