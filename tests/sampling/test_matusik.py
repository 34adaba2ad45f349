"""Matusik's sampler: its tables, and how they are inverted."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import must_fail
from sampled import MATERIALS, Dim, sampler

from sommerl.reflectance.half_diff import spherical
from sommerl.sampling.matusik import COLUMNS, ELEVATIONS, ROWS, MatusikSampler

STEP = np.pi / 180


def check_cumulative(found):
    """From 0 to 1, and no bin that rounding could empty."""
    for cdf in (found.rows, found.columns):
        assert (cdf[..., 0] == 0).all()
        assert (cdf[..., -1] == 1).all()
        assert np.diff(cdf, axis=-1).min() > 2**-20


@pytest.mark.parametrize("material", MATERIALS)
def test_tables_are_distributions(material):
    found = sampler("matusik", material)
    check_cumulative(found)
    assert found.bytes_memory == 4 * ELEVATIONS * (ROWS + 1 + ROWS * (COLUMNS + 1)) == 5_897_160
    holey = found.columns.copy()
    holey[3, 5, 7] = holey[3, 5, 8]
    must_fail(check_cumulative, replace(found, columns=holey))


def test_without_any_light_it_is_the_cosine():
    found = MatusikSampler.fitted(Dim(2, 2))
    check_cumulative(found)
    edges = np.sin(np.arange(ROWS + 1) * STEP) ** 2
    assert np.allclose(found.rows, edges, atol=1e-7)
    assert np.allclose(found.columns, np.arange(COLUMNS + 1) / COLUMNS, atol=1e-7)


def check_follows(found, brdf):
    """By hand, for one elevation: shares of f_r cos θ_i sin θ_i at the centres of cells, but for the floor."""
    theta, phi = np.meshgrid((np.arange(90) + 0.5) * STEP, (np.arange(180) + 0.5) * STEP, indexing="ij")
    light = brdf.eval(np.stack(spherical(theta, phi), axis=-1), spherical(40.5 * STEP, 0.0)).mean(axis=-1)
    light *= np.cos(theta) * np.sin(theta)
    share = np.diff(found.rows[40])[:, None] * np.diff(found.columns[40], axis=-1)
    assert abs(share - light / light.sum()).sum() < 0.05


@pytest.mark.parametrize("material", MATERIALS)
def test_cells_follow_the_light(material):
    check_follows(sampler("matusik", material), MATERIALS[material])
    must_fail(check_follows, sampler("matusik", material), MATERIALS["chalk" if material != "chalk" else "glossy"])


def cells(found, u):
    """Row and column that random numbers draw, for a viewer at 40.5°."""
    wi = found.sample(spherical(40.5 * STEP, 0.0), u)[0]
    x, y, z = np.moveaxis(wi, -1, 0)
    return np.arctan2(np.hypot(x, y), z) // STEP, np.arctan2(abs(y), x) // STEP, y > 0


def check_inverts(found, search):
    u = np.random.default_rng(0).random((20_000, 3))
    row = search(found.rows[40], u[:, 1])
    column = np.array([search(found.columns[40, r], x) for r, x in zip(row, u[:, 2], strict=True)])
    drawn = cells(found, u)
    assert ((drawn[0] == row) & (drawn[1] == column)).mean() > 0.9999  # some are on the edge of two cells
    assert np.array_equal(drawn[2], u[:, 0] >= 0.5)


@pytest.mark.parametrize("material", ["glossy", "mirror"])
def test_the_unrolled_search_is_the_binary_search(material):
    found = sampler("matusik", material)
    check_inverts(found, lambda cdf, u: np.searchsorted(cdf, u, side="right") - 1)
    must_fail(check_inverts, found, lambda cdf, u: np.searchsorted(cdf[:-1], u * 0.999, side="right") - 1)
