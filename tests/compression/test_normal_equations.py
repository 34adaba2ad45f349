"""The core's normal equations against dense matrices in NumPy, from `NodeLattice.corners`."""

import numpy as np
import pytest
from helpers import must_fail

from sommerl import _core
from sommerl.reflectance.nodes import FINE, NodeLattice

RNG = np.random.default_rng(0)
AXES = (0, 20, 90, 180), (0, 0, 1, 1), ((0, 30, 180), (0, 70, 100, 180))
LATTICES = {
    "turning": NodeLattice(*AXES, ((0, 40, 110), (0, 90)), reciprocal=True, mirrored=False),
    "mirrored": NodeLattice(*AXES, ((0, 40, 180), (0,)), reciprocal=False, mirrored=True),
}
PLACES = RNG.random((4000, 3)) * FINE
PLACES[:30] = RNG.integers(0, FINE + 1, (30, 3))  # on nodes, and at the ends
PLACES = PLACES[np.argsort(PLACES[:, 0], kind="stable")]
WEIGHTS, TARGETS = RNG.random(4000), RNG.standard_normal((4000, 3))


@pytest.fixture(params=LATTICES)
def lattice(request):
    return LATTICES[request.param]


def made(lattice, threads=None):
    return _core.NormalEquations.of(*lattice.axes(), PLACES, WEIGHTS, TARGETS, **lattice.folds, threads=threads)


def matrix_of(equations, nodes):
    """H, by its products with the columns of the identity."""
    columns = np.zeros((nodes, -(-nodes // 3) * 3))
    columns[:, :nodes] = np.eye(nodes)
    blocks = np.split(columns, columns.shape[1] // 3, axis=1)
    return np.concatenate([equations.product(np.ascontiguousarray(each)) for each in blocks], axis=1)[:, :nodes]


def by_hand(lattice):
    """The shares of all nodes in the value at each place, (places, nodes)."""
    shares = np.zeros((len(PLACES), lattice.size))
    for node, share in lattice.corners(*PLACES.T, lattice.buffers()):
        np.add.at(shares, (np.arange(len(PLACES)), np.asarray(node, int)), share)
    return shares


def check_equations(equations, lattice, weights=WEIGHTS):
    shares = by_hand(lattice)
    assert np.allclose(matrix_of(equations, lattice.size), shares.T @ (weights[:, None] * shares), atol=1e-9)
    assert np.allclose(equations.right, shares.T @ (weights[:, None] * TARGETS), atol=1e-9)
    assert equations.squares == pytest.approx((weights[:, None] * TARGETS**2).sum())
    assert np.array_equal(equations.diagonal(), np.diag(matrix_of(equations, lattice.size)))


def test_equations(lattice):
    check_equations(made(lattice), lattice)
    must_fail(check_equations, made(lattice), lattice, WEIGHTS[::-1])


def test_errors_of_values(lattice):
    equations, z = made(lattice), RNG.standard_normal((lattice.size, 3))
    error = float((z * (equations.product(z) - 2 * equations.right)).sum()) + equations.squares
    assert error == pytest.approx((WEIGHTS[:, None] * (by_hand(lattice) @ z - TARGETS) ** 2).sum())


def check_solution(equations, z, lattice, ridge, values):
    dense = matrix_of(equations, lattice.size) + ridge * np.eye(lattice.size)
    assert np.allclose(z, np.linalg.solve(dense, equations.right + ridge * values), atol=1e-6)


def test_solutions(lattice):
    equations, values = made(lattice), RNG.standard_normal((lattice.size, 3))
    held = equations.held(values, 0.7)
    z = held.solved(values, 1e-9, 200)
    check_solution(equations, z, lattice, 0.7, values)
    must_fail(check_solution, equations, held.solved(values, 1e-9, 2), lattice, 0.7, values)
    must_fail(check_solution, equations, z, lattice, 0.8, values)
    other = equations.with_right(equations.right * 2)
    assert np.array_equal(other.right, equations.right * 2)
    assert np.array_equal(other.product(values), equations.product(values))


def check_entries(found, equations, lattice, index, factors):
    used = np.zeros((factors.shape[1], lattice.size, 5))
    for k, column in enumerate(factors.T):
        used[k, np.arange(lattice.size), index] = column
    h = matrix_of(equations, lattice.size)
    assert np.allclose(found, sum(each.T @ h @ each for each in used))


@pytest.mark.parametrize("width", [1, 3])
def test_equations_of_shared_entries(lattice, width):
    equations, index = made(lattice), RNG.integers(0, 5, lattice.size).astype(np.uint16)
    factors = RNG.standard_normal((lattice.size, width))
    found = equations.between_entries(index, factors, 5)
    check_entries(found, equations, lattice, index, factors)
    must_fail(check_entries, found, equations, lattice, index, -factors[::-1])


def test_threads_and_instruction_sets_change_no_bit(lattice):
    one, two = (made(lattice, threads) for threads in (1, 2))
    assert np.array_equal(one.right, two.right)
    assert np.array_equal(matrix_of(one, lattice.size), matrix_of(two, lattice.size))
    y, weight = RNG.random((20 * 150, 3)), RNG.random(20 * 150)
    expected = _core.line_errors(20, y, weight, "portable", 1)
    for simd in _core.simd_paths():
        assert np.array_equal(_core.line_errors(20, y, weight, simd, 2), expected)
