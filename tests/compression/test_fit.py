from itertools import combinations, pairwise

import numpy as np
import pytest
from helpers import lambertian_table, must_fail, random_directions

from sommerl import MERL, BrdfTable, builtin
from sommerl.compression.compact import lattice_fit as fit
from sommerl.compression.compact.lattice_fit import Fitter, best_nodes, line_errors
from sommerl.reflectance.distance import table_metrics
from sommerl.system.errors import MaterialError, MissingDependencyError

RNG = np.random.default_rng(0)
A, B = random_directions(3000, 1), random_directions(3000, 2)


def by_hand(y, weight, i, j):
    """Straight lines from place i to place j, one after the other."""
    error = 0.0
    for k in range(i + 1, j):
        t = (k - i) / (j - i)
        error += (weight[k][..., None] * ((1 - t) * y[i] + t * y[j] - y[k]) ** 2).sum()
    return error


def check_errors(errors, y, weight):
    n = len(y)
    expected = [[by_hand(y, weight, i, j) if i < j else np.inf for j in range(n)] for i in range(n)]
    assert np.allclose(errors, expected, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_errors_of_lines(axis):
    y, weight = RNG.random((7, 8, 9, 3)), RNG.random((7, 8, 9))
    errors = line_errors(y, weight, axis, np.random.default_rng(0))
    moved = np.moveaxis(y, axis, 0), np.moveaxis(weight, axis, 0)
    check_errors(errors, *moved)
    must_fail(check_errors, errors, moved[0], moved[1][::-1])


def check_best(found, errors):
    n = len(errors)
    for count, (nodes, error) in found.items():
        choices = [(0, *middle, n - 1) for middle in combinations(range(1, n - 1), count - 2)]
        least = min(sum(errors[a, b] for a, b in pairwise(c)) for c in choices)
        assert error == pytest.approx(least)
        assert sum(errors[a, b] for a, b in pairwise(nodes)) == pytest.approx(least)


def test_no_other_nodes_are_better():
    errors = np.where(np.triu(np.ones((9, 9)), 1) > 0, RNG.random((9, 9)), np.inf)
    found = best_nodes(errors, 9)
    assert list(found) == list(range(2, 10))
    check_best(found, errors)
    must_fail(check_best, found, errors.T[::-1, ::-1] * RNG.random((9, 9)))


def test_knots_are_found():
    x = np.arange(50.0)
    y = np.interp(x, [0, 7, 23, 30, 49], RNG.random(5))[:, None, None, None] * RNG.random((1, 6, 5, 3))
    nodes, error = best_nodes(line_errors(y, np.ones((50, 6, 5)), 0, np.random.default_rng(0)), 8)[5]
    assert nodes == [0, 7, 23, 30, 49]
    assert error < 1e-9


@pytest.fixture(scope="module")
def paint():
    return Fitter(builtin("purple-paint"))


def error_of(brdf):
    source = BrdfTable.sample(builtin("purple-paint"))
    return table_metrics(source.values, BrdfTable.sample(brdf).values, MERL)["log_error_cosine"]


def test_more_nodes_are_better(paint):
    fitted = [paint.fit(nodes) for nodes in (300, 1500, 6000)]
    for nodes, brdf in zip((300, 1500, 6000), fitted, strict=True):
        assert 0.8 * nodes <= brdf.nodes.size <= nodes
    errors = [error_of(brdf) for brdf in fitted]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.025


def test_least_squares_are_better_than_samples(paint, monkeypatch):
    fitted = paint.fit(1500)
    monkeypatch.setattr(fit, "RIDGE", 1e9)  # draws every node to the source's own value
    sampled = paint.fit(1500)
    assert sampled.nodes == fitted.nodes
    assert error_of(fitted) < 0.8 * error_of(sampled)


def check_lambertian(brdf, albedo):
    inner = np.minimum(A[:, 2], B[:, 2]) > 0.3
    assert np.allclose(brdf.eval(A, B)[inner], albedo / np.pi, rtol=0.03)


def test_a_lambertian_comes_back():
    fitted = Fitter(lambertian_table(0.5)).fit(2000)
    check_lambertian(fitted, 0.5)
    must_fail(check_lambertian, fitted, 0.54)


def test_the_same_seed_gives_the_same_lattice():
    one, other = (Fitter(builtin("nickel"), seed=3).fit(800) for _ in range(2))
    assert one.nodes == other.nodes
    assert np.array_equal(one.values, other.values)


@pytest.mark.parametrize("nodes", [0, 99, 100_001])
def test_numbers_of_nodes_out_of_range(paint, nodes):
    with pytest.raises(MaterialError, match="nodes: expected 100 to 100000"):
        paint.fit(nodes)


def test_scipy_is_asked_for_by_a_sentence(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr("sommerl.system.optional.importlib.import_module", missing)
    with pytest.raises(MissingDependencyError, match=r"install sommerl\[formats\]"):
        Fitter(builtin("nickel"))
