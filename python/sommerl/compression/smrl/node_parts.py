"""Between a compact material and the core's streams of lattice, palette and indices."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...reflectance.nodes import NodeLattice
from ...system.errors import FormatError
from ..material import SomManBrdf
from ..palette import GainsAndShapes
from .codes import coordinates, gain_codes, gain_values, shape_codes, shape_values

Prior = tuple[list[list[float]], list[float]]  #: weights (3, 10) and usual errors (3,), as `_core.NodePalette` takes it
Indices = tuple[NDArray[np.uint16], NDArray[np.uint16]]
Domain = tuple[float, bool, bool]  #: scale, signed, smooth: see `palette.GainsAndShapes`


def coded(material: SomManBrdf, prior: Prior | None = None) -> _core.NodePalette:
    """The core's object for a compact material, which writes its stream.

    Raises FormatError for values that have no code, ValueError and OverflowError for what no stream can hold.
    """
    entries, lattice = material.palette, material.lattice
    assert isinstance(entries, GainsAndShapes)
    assert isinstance(lattice, NodeLattice)
    gains, shapes = gain_codes(entries.gains), shape_codes(coordinates(entries.lut))
    if not (np.array_equal(gain_values(gains), entries.gains) and np.array_equal(shape_values(shapes), entries.lut)):
        raise FormatError(f"{material.name}: expected a palette whose values have codes, found others")
    return _core.NodePalette(*lattice.axes(), gains.tolist(), shapes.tolist(), **lattice.folds, prior=prior)


def check_scale(scale: float) -> None:
    """Raises FormatError for a scale that is none."""
    if not 0 < scale < np.inf:
        raise FormatError("expected a positive scale that is finite, found another")


def lattice_of(palette: _core.NodePalette) -> NodeLattice:
    """The lattice of what a stream held."""
    theta_d, phi_d = (tuple(map(tuple, axes)) for axes in (palette.theta_d, palette.phi_d))
    folds = palette.reciprocal, palette.mirrored
    return NodeLattice(tuple(palette.theta_h), tuple(palette.band), theta_d, phi_d, *folds)


def material(
    palette: _core.NodePalette, indices: Indices, lattice: NodeLattice, domain: Domain, known: dict[str, Any]
) -> SomManBrdf:
    """The material of what a stream held. known: other arguments of `SomManBrdf`."""
    shapes, gains = shape_values(np.array(palette.shapes)), gain_values(np.array(palette.gains))
    return SomManBrdf(GainsAndShapes(gains, shapes, *domain), np.stack(indices), lattice, **known)
