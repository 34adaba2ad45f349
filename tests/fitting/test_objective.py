import numpy as np
import pytest
from helpers import must_fail

from sommerl import builtin
from sommerl.fitting import FitOptions
from sommerl.fitting.data import DIAMETER, lattice, samples_of, sphere
from sommerl.fitting.loss import LOG_EPSILON
from sommerl.fitting.objective import Objective, least_squares
from sommerl.fitting.options import families_of
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.reflectance.cells import MERL

LOSSES = ("l2", "cosine-l2", "log", "cube-root")
SAMPLES = samples_of(builtin("purple-paint"), FitOptions(samples=3000))
STEP = 1e-6


def objective(model="cook-torrance", loss="l2", lobes=3):
    return Objective(families_of(model, lobes), SAMPLES, loss)


def point(made, seed=0):
    """Places of shapes well inside, and albedos, that fit badly."""
    random = np.random.default_rng(seed)
    return random.uniform(0.3, 0.7, len(made.parameters)), random.uniform(0.1, 0.5, (len(made.families), 3))


def mapped(f_r, cosine, loss):
    """By hand: what a loss compares."""
    return {
        "l2": f_r,
        "cosine-l2": f_r * cosine,
        "log": np.log(1 + f_r * cosine / LOG_EPSILON),
        "cube-root": np.cbrt(f_r * cosine),
    }[loss]


def check_error(made, loss):
    """Against a sum over a MultiLobe of the same numbers."""
    places, albedos = point(made)
    shapes = iter([p.at(place) for p, place in zip(made.parameters, places, strict=True)])
    lobes = [
        Lobe(family, tuple(albedo), {p.name: float(next(shapes)) for p in family.parameters})
        for family, albedo in zip(made.families, albedos, strict=True)
    ]
    f_r, cosine = MultiLobe("by hand", lobes).eval(SAMPLES.wi, SAMPLES.wo), SAMPLES.wi[:, 2:]
    target = mapped(SAMPLES.f_r, cosine, loss)
    differences = mapped(f_r, cosine, loss) - target
    assert made.error(places, albedos) == pytest.approx(np.sqrt((differences**2).mean()), rel=1e-9)
    distance = (differences**2).sum() / (target**2).sum()
    assert made.value(places, albedos).distance == pytest.approx(distance, rel=1e-9)
    assert made.scale == pytest.approx(np.sqrt((target**2).mean()), rel=1e-9)


@pytest.mark.parametrize("loss", LOSSES)
def test_the_error_is_that_of_a_sum_of_lobes(loss):
    check_error(objective(loss=loss), loss)
    must_fail(check_error, objective(loss=loss), LOSSES[LOSSES.index(loss) - 1])


def check_derivatives(made, scale=1.0):
    """Against central differences."""
    places, albedos = point(made)
    found = made.value(places, albedos)
    numbers = np.append(places, albedos)
    exact = scale * np.append(found.by_places, found.by_albedos)

    def distance(x):
        return made.value(x[: len(places)], x[len(places) :].reshape(albedos.shape)).distance

    for k, unit in enumerate(np.eye(len(numbers))):
        difference = (distance(numbers + STEP * unit) - distance(numbers - STEP * unit)) / (2 * STEP)
        assert exact[k] == pytest.approx(difference, rel=1e-5, abs=1e-6 * np.abs(exact).max())


@pytest.mark.parametrize("loss", LOSSES)
def test_derivatives(loss):
    check_derivatives(objective(loss=loss))
    must_fail(check_derivatives, objective(loss=loss), 1.001)


@pytest.mark.parametrize("model", [name for name, family in FAMILIES.items() if family.parameters])
def test_derivatives_of_every_model(model):
    check_derivatives(objective(model, lobes=None))


def check_solved(made, move=0.0):
    """Nothing near the solved albedos is better, and the derivative is that with the albedos following."""
    places, _ = point(made)
    albedos, found = made.solved(places)
    albedos = albedos + move
    best = made.value(places, albedos).distance
    for k in range(albedos.size):
        for step in (-1e-3, 1e-3):
            other = albedos.copy()
            other.flat[k] = max(other.flat[k] + step, 0)
            assert made.value(places, other).distance >= best
    for k, unit in enumerate(np.eye(len(places))):
        ahead, behind = (made.solved(places + step * unit)[1].distance for step in (STEP, -STEP))
        assert found.by_places[k] == pytest.approx((ahead - behind) / (2 * STEP), rel=1e-4, abs=1e-7)


@pytest.mark.parametrize("loss", ["l2", "cosine-l2"])
def test_solved_albedos_are_the_best(loss):
    check_solved(objective(loss=loss))
    must_fail(check_solved, objective(loss=loss), 0.01)


def test_least_squares_with_bounds():
    random = np.random.default_rng(1)
    a, b = random.random((50, 3)), random.standard_normal((50, 2))
    b[:, 0] += a @ [2.0, 0.0, 1.0]
    found = least_squares(a.T @ a, a.T @ b, None)
    assert (found >= 0).all()
    slope = a.T @ (a @ found - b)
    assert np.allclose(slope[found > 0], 0, atol=1e-9)
    assert (slope[found == 0] >= -1e-9).all()
    bounded = least_squares(a.T @ a, a.T @ b, 1.0)
    assert bounded.sum(axis=0) == pytest.approx(np.minimum(found.sum(axis=0), 1), abs=1e-9)
    # Along the bound, no exchange between two albedos is better.
    slope = (a.T @ (a @ bounded - b))[:, 0]
    assert np.ptp(slope[bounded[:, 0] > 0]) < 1e-6
    # A lobe that no sample sees, and two that are the same.
    a[:, 2] = 1e-20
    assert least_squares(a.T @ a, a.T @ b, None)[2] == pytest.approx([0, 0])
    a[:, 2] = a[:, 0]
    twice = least_squares(a.T @ a, a.T @ b, None)
    assert np.isfinite(twice).all()
    assert a @ twice == pytest.approx(a[:, :2] @ least_squares(a[:, :2].T @ a[:, :2], a[:, :2].T @ b, None), abs=1e-6)


def check_seen_by_a_sphere(wi, wo):
    """Even over a disk that ends half a pixel before the edge; by the cosine, with even azimuths."""
    radius = 1 - 1 / DIAMETER
    for w, mean in ((wi, 0.5), (wo, 1 - radius**2 / 2)):
        assert np.allclose(np.linalg.norm(w, axis=1), 1)
        assert (w[:, 2] ** 2).mean() == pytest.approx(mean, abs=0.003)
    assert wi[:, 2].min() > 0
    assert np.hypot(wo[:, 0], wo[:, 1]).max() == pytest.approx(radius, abs=0.002)
    assert wi[:, :2].mean(axis=0) == pytest.approx([0, 0], abs=0.01)


def test_directions_of_a_sphere():
    check_seen_by_a_sphere(*sphere(100_000, 0))
    wi, wo = sphere(100_000, 0)
    must_fail(check_seen_by_a_sphere, wi, np.abs(wo[:, [2, 1, 0]]) ** 2)
    assert not np.array_equal(sphere(100, 0)[0], sphere(100, 1)[0])


def test_directions_of_a_lattice():
    wi, wo = lattice(builtin("nickel"))
    assert len(wi) == MERL.above_horizon.sum()
    assert wi[:, 2].min() > 0
    assert wo[:, 2].min() > 0
    # Any part of them is spread over all.
    assert wi[:1000].mean(axis=0) == pytest.approx(wi.mean(axis=0), abs=0.05)
