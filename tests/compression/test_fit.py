from itertools import combinations, pairwise

import numpy as np
import pytest
from helpers import lambertian_table, must_fail, random_directions

from sommerl import MERL, BrdfTable, builtin
from sommerl.compression.compact import effort as efforts
from sommerl.compression.compact import source
from sommerl.compression.compact.lattice_choice import best_nodes, line_errors
from sommerl.compression.compact.lattice_fit import Fitter
from sommerl.reflectance.distance import table_metrics
from sommerl.system.errors import MaterialError

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


@pytest.mark.parametrize("lines", [1, 64, 130])
def test_errors_of_lines(lines):
    y, weight = RNG.random((7, lines, 3)), RNG.random((7, lines))
    errors = line_errors(y, weight)
    check_errors(errors, y, weight)
    must_fail(check_errors, errors, y, weight[::-1])


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
    y = np.interp(x, [0, 7, 23, 30, 49], RNG.random(5))[:, None, None] * RNG.random((1, 30, 3))
    nodes, error = best_nodes(line_errors(y, np.ones((50, 30))), 8)[5]
    assert nodes == [0, 7, 23, 30, 49]
    assert error < 1e-9


@pytest.fixture(scope="module")
def paint():
    return Fitter(builtin("purple-paint"))


def error_of(brdf):
    source = BrdfTable.sampled(builtin("purple-paint"))
    return table_metrics(source.values, BrdfTable.sampled(brdf).values, MERL)["log_error_cosine"]


def test_more_nodes_are_better(paint):
    fitted = [paint.fit(nodes) for nodes in (300, 1500, 6000)]
    for nodes, brdf in zip((300, 1500, 6000), fitted, strict=True):
        assert 0.8 * nodes <= brdf.lattice.size <= nodes
    errors = [error_of(brdf) for brdf in fitted]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 0.025


def test_least_squares_are_better_than_samples(paint, monkeypatch):
    fitted = paint.fit(1500)
    monkeypatch.setattr(source, "RIDGE", 1e9)  # draws every node to the source's own value
    sampled = paint.fit(1500)
    assert sampled.lattice == fitted.lattice
    assert error_of(fitted) < 0.8 * error_of(sampled)


def check_measure(measure):
    """Ratios of s^0.75 d^0.25, s being sin θ_h √θ_h · sin θ_d cos θ_d · (the width of a step), and d the root of
    (cos² θ_i + 0.0009) (cos² θ_o + 0.0009), by hand."""

    def at(theta_h, theta_d, cos_i, cos_o):
        a = np.sqrt(theta_h / 90)
        x = 360 * a if a < 0.25 else 90 + 120 * (a - 0.25)
        wi, wo = ((0.0, 0.0, np.array(cosine)) for cosine in (cos_i, cos_o))
        return float(measure(np.array(x), np.array(2.0 * theta_d), np.array(0.0), wi, wo))

    here = at(30, 30, 0.75, 0.75)
    # In the plane of incidence, light at 60° and viewer at 0°; and the other way round: 0.2509 · 1.0009 for 0.5634².
    assert at(30, 30, 0.5, 1.0) / here == pytest.approx(0.971141, rel=1e-5)
    assert at(30, 30, 1.0, 0.5) / here == pytest.approx(0.971141, rel=1e-5)
    # sin 15° cos 15° = 0.25 for sin 30° cos 30° = 0.433013.
    assert at(30, 15, 0.75, 0.75) / here == pytest.approx(0.57735**0.75, rel=1e-5)
    # θ_h = 1.40625°, where √(θ_h / 90°) = 1/8, below the knee: 0.0245412 · 1.185854 / 360 for 0.5 · 5.477226 / 120.
    assert at(1.40625, 30, 0.75, 0.75) / here == pytest.approx(0.00354222**0.75, rel=1e-5)


def test_the_measure_of_the_fit():
    check_measure(source._weight)
    for k in (0, 1):  # without a cosine
        must_fail(check_measure, lambda x, y, z, *w, k=k: source._weight(x, y, z, w[k], w[k]))
    must_fail(check_measure, lambda *place: 4 * source._weight(*place) ** 0.5)


def grid_by_hand(brdf, scale, rows, y_step, z_step):
    """∛(f_r √((cos² θ_i + 0.0009) (cos² θ_o + 0.0009)) / scale) of lines through the fine grid of a material that is
    reciprocal and mirrored, and the weights; see `Fitter`."""
    x, y, z = np.meshgrid(rows, np.arange(0, 181, y_step), np.arange(0, 181, z_step), indexing="ij")
    theta_h = np.where(x < 90, x / 360, 0.25 + (x - 90) / 120) ** 2 * np.pi / 2
    theta_d, phi_d = y * np.pi / 360, z * np.pi / 360
    up, tilt = np.cos(theta_h) * np.cos(theta_d), np.sin(theta_h) * np.sin(theta_d) * np.cos(phi_d)
    cos_i, cos_o = up - tilt, up + tilt
    seen = np.minimum(cos_i, cos_o) > 0.01
    damped = np.sqrt((cos_i**2 + 0.0009) * (cos_o**2 + 0.0009))
    along, across = np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d)
    wi, wo = (
        np.stack(
            [
                np.cos(theta_d) * np.sin(theta_h) + s * along * np.cos(theta_h),
                s * across,
                np.cos(theta_d) * np.cos(theta_h) - s * along * np.sin(theta_h),
            ],
            -1,
        )
        for s in (1, -1)
    )
    values = np.zeros((*x.shape, 3))
    values[seen] = np.cbrt(brdf.eval(wi[seen], wo[seen]) * damped[seen][:, None] / scale)
    for j in range(1, values.shape[1]):  # below the horizon, as above it
        values[:, j] = np.where(seen[:, j, :, None], values[:, j], values[:, j - 1])
    solid = np.sin(theta_h) * np.sqrt(theta_h) * np.sin(theta_d) * np.cos(theta_d) / np.where(x < 90, 360, 120)
    return values, np.where(seen, solid**0.75 * damped**0.25, 0.0)


def of_straight_lines(values, weight, axis):
    """The weighted squared error, over all lines along an axis, of a straight line between their ends."""
    values, weight = np.moveaxis(values, axis, 0), np.moveaxis(weight, axis, 0)
    t = np.linspace(0, 1, len(values))[:, None, None, None]
    return float((weight[..., None] * ((1 - t) * values[0] + t * values[-1] - values) ** 2).sum())


def check_shares(errors, by_hand):
    """A few hundred lines of ten rows stand for all of them, hence the tolerance."""
    assert np.allclose(errors, by_hand, rtol=0.3)


def test_errors_of_bands_and_of_rows_are_of_one_scale(paint):
    """With two nodes to an axis, over the whole fine grid: shares of the error of two rows."""
    brdf, choice = builtin("purple-paint"), paint._choice
    rows = of_straight_lines(*grid_by_hand(brdf, paint.scale, np.arange(181), 3, 4), 0)
    found, by_hand = [], []
    for band in (3, 5):
        inside = np.arange(choice._edges[band], min(choice._edges[band + 1], 180) + 1)
        values, weight = grid_by_hand(brdf, paint.scale, inside, 1, 9)
        found.append(choice._theta_d[band][2][1] / choice._rows[2][1])
        by_hand.append(of_straight_lines(values, weight, 1) * 9 / 12 / rows)
        values, weight = grid_by_hand(brdf, paint.scale, inside, 6, 1)
        found.append(choice._phi_d[band][2][1] / choice._rows[2][1])
        by_hand.append(of_straight_lines(values, weight, 2) * 6 / 12 / rows)
    check_shares(found, by_hand)
    must_fail(check_shares, np.array(found) * 4, by_hand)


def check_lambertian(brdf, albedo):
    inner = np.minimum(A[:, 2], B[:, 2]) > 0.3
    assert np.allclose(brdf.eval(A, B)[inner], albedo / np.pi, rtol=0.03)


def test_a_lambertian_comes_back():
    fitted = Fitter(lambertian_table(0.5)).fit(2000)
    check_lambertian(fitted, 0.5)
    must_fail(check_lambertian, fitted, 0.54)


def test_the_same_seed_gives_the_same_lattice():
    one, other = (Fitter(builtin("nickel"), seed=3, effort=efforts.of(1)).fit(800) for _ in range(2))
    assert one.lattice == other.lattice
    assert np.array_equal(one.node_values, other.node_values)


@pytest.mark.parametrize("nodes", [0, 99, 100_001])
def test_numbers_of_nodes_out_of_range(paint, nodes):
    with pytest.raises(MaterialError, match="nodes: expected 100 to 100000"):
        paint.fit(nodes)
