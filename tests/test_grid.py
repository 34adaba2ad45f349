"""Measurements on a grid of angles: at its angles they are what they were measured as, and linear between them."""

import numpy as np
import pytest
from helpers import complaint, must_fail, random_directions
from kinds import KINDS
from scipy.interpolate import RegularGridInterpolator

from sommerl.reflectance.grid import GridBrdf
from sommerl.reflectance.half_diff import spherical

RNG = np.random.default_rng(3)
THETA_I, THETA_O = np.array([0.1, 0.4, 0.45, 1.3]), np.array([0.0, 0.2, 0.9, 1.5])
HALF, TURN = np.array([0.0, 0.5, 2.0, np.pi]), np.array([0.3, 1.0, 2.5, 4.0, 6.0])


def direction(theta, phi):
    return np.stack(spherical(*np.broadcast_arrays(theta, phi)), axis=-1)


def made(phi, **more):
    values = RNG.normal(size=(len(THETA_I), len(THETA_O), len(phi), 3))
    values[:, 0] = values[:, 0, :1]  # at the normal, φ means nothing
    return GridBrdf(THETA_I, THETA_O, phi, values, **more)


def pairs(grid):
    """Directions at the angles of a grid, turned about the normal, above the horizon alone."""
    i, o, p = np.meshgrid(*grid.axes, indexing="ij")
    around = RNG.uniform(0, 6, i.shape)
    light, viewer = direction(i, around), direction(o, around + p)
    if grid.about_mirror:
        mirror = direction(i, around + np.pi)
        up = np.array([0.0, 0.0, 1.0]) - mirror * mirror[..., 2:]
        up /= np.linalg.norm(up, axis=-1, keepdims=True)
        side = np.cross(mirror, up)
        viewer = np.cos(o)[..., None] * mirror
        viewer = viewer + np.sin(o)[..., None] * (np.cos(p)[..., None] * up + np.sin(p)[..., None] * side)
    return light, viewer


def check_measured(grid, values):
    light, viewer = pairs(grid)
    above = viewer[..., 2] > 1e-9
    assert above.mean() > 0.4
    assert np.allclose(grid.eval(light, viewer)[above], values[above], atol=1e-9)


@pytest.mark.parametrize("about_mirror", [False, True])
@pytest.mark.parametrize("phi", [HALF, TURN], ids=["half", "turn"])
def test_the_angles_of_a_grid_have_its_values(phi, about_mirror):
    grid = made(phi, about_mirror=about_mirror)
    check_measured(grid, grid.values)
    must_fail(check_measured, grid, grid.values[:, :, ::-1])
    assert grid.mirrored == (phi is HALF)
    assert grid.signed
    assert not grid.reciprocal


def check_linear(grid, light, viewer, angles):
    between = RegularGridInterpolator(grid.axes, grid.values)
    assert np.allclose(grid.eval(light, viewer), between(angles), atol=1e-12)


def test_between_angles_it_is_linear():
    grid = made(HALF)
    angles = RNG.uniform([0.1, 0, 0], [1.3, 1.5, np.pi], (500, 3))
    i, o, p = angles.T
    light, viewer = direction(i, 0 * i), direction(o, p)
    check_linear(grid, light, viewer, angles)
    check_linear(grid, light, viewer * [1, -1, 1], angles)
    must_fail(check_linear, grid, viewer, light, angles)


def check_continuous(grid, light, viewer, step):
    """No jump from a direction to one next to it."""
    size = np.abs(grid.values).max()
    apart = np.abs(grid.eval(light, viewer) - grid.eval(light + step, viewer)).max()
    assert apart < 1e-5 * size


def test_at_the_normal_and_across_a_full_turn_it_does_not_jump():
    grid = made(TURN)
    around = np.linspace(0, 6, 40)
    normal, viewer = np.broadcast_to([0.0, 0.0, 1.0], (40, 3)), direction(0.7, around)
    check_continuous(grid, normal, viewer, [1e-9, 0, 0])
    light = direction(0.6, 0 * around)
    check_continuous(grid, light, direction(0.7, 0 * around), [0, 1e-9, 0])
    must_fail(check_continuous, grid, light, viewer, [0, 0.1, 0])
    turned = grid.eval(normal, viewer)
    assert np.allclose(turned, turned[0])


def test_an_axis_may_have_one_angle():
    grid = GridBrdf([0.5], [0.5], [np.pi], [[[[1.0, 2.0, 3.0]]]])
    assert np.allclose(grid.eval(random_directions(50, 1), random_directions(50, 2)), [1, 2, 3])


def test_facts():
    facts = GridBrdf(THETA_I, THETA_O, HALF, np.ones((4, 4, 4, 3)), facts={"seen": 3}).facts
    assert facts == {"grid": "4 × 4 × 4", "asymmetry": pytest.approx(0, abs=1e-9), "energy_negative": 0.0, "seen": 3}
    assert KINDS["grid"].facts["asymmetry"] > 0


@pytest.mark.parametrize(
    ("axes", "values", "said"),
    [
        (([0.0, 0.0], [0.1], [0.0]), np.ones((2, 1, 1, 3)), "theta_i: expected angles that increase"),
        (([0.0, 1.6], [0.1], [0.0]), np.ones((2, 1, 1, 3)), "theta_i: expected angles that increase from 0 to 1.57"),
        (([0.1], [-0.1], [0.0]), np.ones((1, 1, 1, 3)), "theta_o: "),
        (([0.1], [0.1], [0.0, 2 * np.pi]), np.ones((1, 1, 2, 3)), "phi: "),
        (([0.1], [0.1], [0.0]), np.ones((1, 2, 1, 3)), "expected values of shape"),
        (([0.1], [0.1], [0.0]), np.full((1, 1, 1, 3), np.nan), "finite"),
        (([0.1], [0.1], [0.0]), np.full((1, 1, 1, 3), 1e39), "single precision"),
        (([0.1], [0.1], [0.0]), -np.ones((1, 1, 1, 3)), "expected a positive reflectance"),
        (([0.1], [], [0.0]), np.ones((1, 0, 1, 3)), "expected values of shape"),
    ],
)
def test_what_is_no_grid(axes, values, said):
    assert said in str(complaint(GridBrdf, *axes, values))
