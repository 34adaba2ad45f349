import numpy as np
import pytest
from helpers import must_fail, random_directions

from sommerl import BrdfTable, Lattice
from sommerl.compression.compact.fitted_table import FittedTable
from sommerl.reflectance.arrays import split
from sommerl.reflectance.half_diff import directions
from sommerl.reflectance.nodes import FINE, NodeLattice, angles_at, damped, place
from sommerl.render.bsdf import make_bsdf, upload
from sommerl.render.llvm import mitsuba
from sommerl.system.errors import MaterialError

LATTICE = NodeLattice(
    (0, 3, 40, 90, 180), (0, 0, 1, 1, 1), ((0, 60, 180), (0, 20, 90, 180)), ((0, 50, 90, 140), (0,))
)  # fmt: skip
RNG = np.random.default_rng(0)
A, B = random_directions(5000, 1), random_directions(5000, 2)
X, Y, Z = RNG.random((3, 3000)) * FINE


def table(values=None):
    values = RNG.random((LATTICE.size, 3)) if values is None else values
    return FittedTable(LATTICE, values, 0.3, name="made up")


def blended(lattice, values, x, y, z):
    corners = lattice.corners(x, y, z, lattice.buffers())
    return sum(weight[:, None] * values[node] for node, weight in corners)


def by_hand(lattice, values, x, y, z):
    """One place at a time, by NumPy's own interpolation: φ_d, whose period is closed, then θ_d, then θ_h."""
    rows = []
    for row, band in enumerate(lattice.band):
        theta_d, phi_d = lattice.theta_d[band], lattice.phi_d[band]
        part = values[lattice.base[row] : lattice.base[row + 1]].reshape(len(theta_d), len(phi_d))
        closed = np.concatenate([part, part[:, :1]], axis=1)
        rows.append(np.interp(y, theta_d, [np.interp(z, (*phi_d, FINE), line) for line in closed]))
    return np.interp(x, lattice.theta_h, rows)


def check_interpolation(lattice, values):
    found = blended(lattice, values, X, Y, Z)
    assert np.allclose(found[:, 0], [by_hand(LATTICE, values[:, 0], *p) for p in zip(X, Y, Z, strict=True)], rtol=1e-12)


def test_interpolation():
    values = RNG.random((LATTICE.size, 3))
    check_interpolation(LATTICE, values)
    moved = NodeLattice(LATTICE.theta_h, LATTICE.band, ((0, 61, 180), LATTICE.theta_d[1]), LATTICE.phi_d)
    must_fail(check_interpolation, moved, values)


def test_nodes_keep_their_values():
    values = RNG.random((LATTICE.size, 3))
    for row, band in enumerate(LATTICE.band):
        grid = np.meshgrid(LATTICE.theta_d[band], LATTICE.phi_d[band], indexing="ij")
        y, z = (part.ravel().astype(float) for part in grid)
        found = blended(LATTICE, values, np.full(len(y), float(LATTICE.theta_h[row])), y, z)
        assert np.allclose(found, values[LATTICE.base[row] : LATTICE.base[row + 1]], rtol=1e-12)


def test_weights_add_up_to_1_and_nodes_exist():
    corners = LATTICE.corners(*place(split(A), split(B)), LATTICE.buffers())
    assert np.allclose(sum(weight for _, weight in corners), 1)
    assert all((node >= 0).all() and (node < LATTICE.size).all() and (weight >= 0).all() for node, weight in corners)


def test_places_and_angles():
    wi, wo = directions(*angles_at(X, Y, Z))
    assert np.allclose(place(wi, wo), (X, Y, Z), atol=1e-6)


def check_reciprocal(brdf):
    assert np.array_equal(brdf.eval(A, B), brdf.eval(B, A))


def test_reciprocity():
    check_reciprocal(table())
    must_fail(check_reciprocal, BrdfTable(RNG.random((8, 8, 12, 3)), Lattice(8, 8, 12, reciprocal=False)))


def test_values_are_divided_by_the_cosines():
    """With y = 1 everywhere, what is left of the formula."""
    brdf = table(np.full((LATTICE.size, 3), 1.0))
    assert np.allclose(brdf.eval(A, B), (0.3 / damped(split(A), split(B)))[:, None])


def test_it_renders():
    mi = mitsuba()
    brdf = table()
    buffers = {name: upload(buffer) for name, buffer in brdf.buffers().items()}
    wi, wo = (tuple(mi.Float(c.astype(np.float32)) for c in w.T) for w in (A, B))
    found = np.stack([np.array(c) for c in brdf.f_r(wi, wo, buffers)], axis=-1)
    assert np.allclose(found, brdf.eval(A, B), rtol=2e-3, atol=1e-4)
    assert "made up" in str(make_bsdf(brdf))


@pytest.mark.parametrize(
    "axes",
    [
        ((0, 90), (0, 0), ((0, 180),), ((0,),)),  # does not reach the end
        ((0, 90, 90, 180), (0, 0, 0, 0), ((0, 180),), ((0,),)),
        ((0, 180), (0,), ((0, 180),), ((0,),)),
        ((0, 180), (0, 2), ((0, 180), (0, 180)), ((0,), (0,))),
        ((0, 180), (0, 0), ((5, 180),), ((0,),)),
        ((0, 180), (0, 0), ((0, 180),), ((0, 180),)),
        ((0, 180), (0, 0), ((0, 180),), ((),)),
    ],
)
def test_bad_nodes(axes):
    with pytest.raises(MaterialError, match="expected axes that increase from 0 to 180"):
        NodeLattice(*axes)


def test_bad_values():
    for values in (np.zeros((LATTICE.size, 2)), np.full((LATTICE.size, 3), np.nan)):
        with pytest.raises(MaterialError, match="expected finite values"):
            table(values)
