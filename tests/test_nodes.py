from dataclasses import replace

import numpy as np
import pytest
from compact import FOLDS
from helpers import must_fail, random_directions

from sommerl import BrdfTable, Lattice
from sommerl.compression.compact.fitted_table import FittedTable
from sommerl.reflectance.arrays import split
from sommerl.reflectance.half_diff import directions
from sommerl.reflectance.nodes import FINE, NodeLattice, angles_at, damped, from_cube_root, place
from sommerl.render.bsdf import make_bsdf, upload
from sommerl.render.llvm import mitsuba
from sommerl.system.errors import MaterialError

LATTICE = NodeLattice(
    (0, 3, 40, 90, 180), (0, 0, 1, 1, 1), ((0, 60, 180), (0, 20, 90, 180)), ((0, 50, 90, 140), (0,))
)  # fmt: skip
RNG = np.random.default_rng(0)
MIRRORED = (0, 50, 90, 180), (0,)  # φ_d of the two bands
LATTICES = {
    name: replace(LATTICE, **folds, phi_d=MIRRORED if folds["mirrored"] else LATTICE.phi_d)
    for name, folds in FOLDS.items()
}
IN_EACH = pytest.mark.parametrize("lattice", LATTICES.values(), ids=LATTICES)
A, B = random_directions(5000, 1), random_directions(5000, 2)
X, Y, Z = RNG.random((3, 3000)) * FINE


def table(values=None, lattice=LATTICE):
    values = RNG.random((lattice.size, 3)) if values is None else values
    return FittedTable(lattice, values, 0.3, signed=False, name="made up")


def blended(lattice, values, x, y, z):
    corners = lattice.corners(x, y, z, lattice.buffers())
    return sum(weight[:, None] * values[node] for node, weight in corners)


def by_hand(lattice, values, x, y, z):
    """One place at a time, by NumPy's own interpolation: φ_d, closed where it turns, then θ_d, then θ_h."""
    rows = []
    for row, band in enumerate(lattice.band):
        theta_d, phi_d = lattice.theta_d[band], lattice.phi_d[band]
        part = values[lattice.base[row] : lattice.base[row + 1]].reshape(len(theta_d), len(phi_d))
        if not lattice.mirrored:
            part, phi_d = np.concatenate([part, part[:, :1]], axis=1), (*phi_d, FINE)
        rows.append(np.interp(y, theta_d, [np.interp(z, phi_d, line) for line in part]))
    return np.interp(x, lattice.theta_h, rows)


def check_interpolation(lattice, asked, values):
    found = blended(asked, values, X, Y, Z)
    assert np.allclose(found[:, 0], [by_hand(lattice, values[:, 0], *p) for p in zip(X, Y, Z, strict=True)], rtol=1e-12)


@IN_EACH
def test_interpolation(lattice):
    values = RNG.random((lattice.size, 3))
    check_interpolation(lattice, lattice, values)
    moved = replace(lattice, theta_d=((0, 61, 180), lattice.theta_d[1]))
    must_fail(check_interpolation, lattice, moved, values)


@IN_EACH
def test_nodes_keep_their_values(lattice):
    values = RNG.random((lattice.size, 3))
    for row, band in enumerate(lattice.band):
        grid = np.meshgrid(lattice.theta_d[band], lattice.phi_d[band], indexing="ij")
        y, z = (part.ravel().astype(float) for part in grid)
        found = blended(lattice, values, np.full(len(y), float(lattice.theta_h[row])), y, z)
        assert np.allclose(found, values[lattice.base[row] : lattice.base[row + 1]], rtol=1e-12)


@IN_EACH
def test_weights_add_up_to_1_and_nodes_exist(lattice):
    anywhere = (
        np.concatenate([c, [-1e9, -0.0, 179.99999, 180, 1e9, np.nan]]) for c in lattice.place(split(A), split(B))
    )
    corners = lattice.corners(*anywhere, lattice.buffers())
    assert np.allclose(sum(weight for _, weight in corners)[:-1], 1)
    assert all((node >= 0).all() and (node < lattice.size).all() for node, _ in corners)
    assert all((weight[:-1] >= 0).all() for _, weight in corners)


@IN_EACH
def test_places_and_angles(lattice):
    wi, wo = directions(*angles_at(X, Y, Z, **lattice.folds))
    assert np.allclose(lattice.place(wi, wo), (X, Y, Z), atol=1e-6)
    assert np.array_equal(lattice.place(wi, wo), place(wi, wo, **lattice.folds))


def check_reciprocal(brdf):
    assert np.array_equal(brdf.eval(A, B), brdf.eval(B, A))


def check_mirrored(brdf):
    mirror = [1, -1, 1]
    assert np.array_equal(brdf.eval(A, B), brdf.eval(A * mirror, B * mirror))


@IN_EACH
def test_folded_pairs_give_the_same_to_the_last_bit(lattice):
    for check, folded in ((check_reciprocal, lattice.reciprocal), (check_mirrored, lattice.mirrored)):
        if folded:
            check(table(lattice=lattice))
        else:
            must_fail(check, table(lattice=lattice))


def test_that_check_notices_a_table_that_is_not_reciprocal():
    must_fail(check_reciprocal, BrdfTable(RNG.random((8, 8, 12, 3)), Lattice(8, 8, 12, reciprocal=False)))


def test_values_are_divided_by_the_cosines():
    """With y = 1 everywhere, what is left of the formula."""
    brdf = table(np.full((LATTICE.size, 3), 1.0))
    (x, y), least = (A[:, 2], B[:, 2]), 0.03**2
    assert np.allclose(brdf.eval(A, B), (0.3 / np.sqrt((x * x + least) * (y * y + least)))[:, None])
    assert np.allclose(damped(split(A), split(B)), np.maximum(x, 0.01) * np.maximum(y, 0.01))


@pytest.mark.parametrize("signed", [False, True])
def test_values_below_0(signed):
    y, up = tuple(np.array([[-2.0], [0.0], [2.0]])), (np.zeros(1), np.zeros(1), np.ones(1))
    found = np.concatenate(from_cube_root(y, up, up, 0.3, signed))
    assert np.allclose(found, [-8 * 0.3 if signed else 0, 0, 8 * 0.3])


@IN_EACH
def test_it_renders(lattice):
    mi = mitsuba()
    brdf = table(lattice=lattice)
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


@pytest.mark.parametrize("phi_d", [(), (5, 180), (0, 90), (0, 90, 90, 180), (180,), (0, 181)])
def test_bad_nodes_of_a_mirrored_lattice(phi_d):
    NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),), mirrored=True)
    NodeLattice((0, 180), (0, 0), ((0, 180),), ((0, 180),), mirrored=True)
    with pytest.raises(MaterialError, match="expected axes that increase from 0 to 180"):
        NodeLattice((0, 180), (0, 0), ((0, 180),), (phi_d,), mirrored=True)


def test_bad_values():
    for values in (np.zeros((LATTICE.size, 2)), np.full((LATTICE.size, 3), np.nan)):
        with pytest.raises(MaterialError, match="expected finite values"):
            table(values)
