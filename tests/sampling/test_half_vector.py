"""Our sampler: its tables, to the last unit, and where its coordinates come to an end."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import must_fail, random_directions
from sampled import MATERIALS, Dim, sampler

from sommerl.reflectance.brdf import Brdf
from sommerl.sampling.half_vector import (
    CELLS,
    COLUMNS,
    ELEVATIONS,
    LOWEST,
    ROWS,
    SLOTS,
    WHOLE,
    HalfVectorSampler,
    albedo_at,
    albedos,
)
from sommerl.sampling.half_vector import _mirrored as mirrored

EACH_MATERIAL = pytest.mark.parametrize("material", MATERIALS)
BLACK = Dim(2, 2)


def unpacked(found):
    """Units, other cell and slots that it takes, of each cell."""
    return found.table & 0xFFFF, found.table >> 16 & 255, found.table >> 24


def packed(found, units, other, taken):
    return replace(found, table=units | other << 16 | taken << 24)


@EACH_MATERIAL
def test_it_takes_7680_bytes(material):
    found = sampler("half-vector", material)
    assert found.bytes_memory == found.table.nbytes == 4 * ELEVATIONS * CELLS == 7680


def check_tables(found):
    """Every cell has a probability, they add up to 1, and as many slots draw a cell as its probability says."""
    units, other, taken = unpacked(found)
    assert units.min() >= 1
    assert (units.sum(axis=1) == WHOLE).all()
    assert (other < CELLS).all()
    slots = SLOTS - taken.astype(int)
    for node in range(ELEVATIONS):
        slots[node] += np.bincount(other[node], taken[node], minlength=CELLS).astype(int)
    assert np.array_equal(slots, units)


@EACH_MATERIAL
def test_tables_are_what_they_say(material):
    check_tables(sampler("half-vector", material))


def test_that_check_notices_one_slot_too_many_and_a_cell_without_any():
    found = sampler("half-vector", "glossy")
    units, other, taken = unpacked(found)
    node, cell = np.argwhere((taken > 0) & (taken < 255))[0]
    more = taken.copy()
    more[node, cell] += 1
    must_fail(check_tables, packed(found, units, other, more))
    none = units.copy()
    none[node, 0], none[node, 1] = 0, units[node, 0] + units[node, 1]
    must_fail(check_tables, packed(found, none, other, taken))


def counts(found, node):
    """How often each cell is drawn, for every slot once, by a viewer at that elevation of the table."""
    z = (node / (ELEVATIONS - 1)) ** 2
    wo = np.array([np.sqrt(1 - z * z), 0, z])
    # The middles of cells, on one side.
    u = np.stack([(np.arange(WHOLE) + 0.5) / WHOLE, np.full(WHOLE, 0.5), np.full(WHOLE, 0.75)], axis=-1)
    wi = found.sample(wo, u)[0]
    row, column = (index.ravel() for index in np.indices((ROWS, COLUMNS)))
    s, c = (row + 0.5) / ROWS, (column + 0.5) * 2 / COLUMNS
    middles = np.stack(mirrored(s, c, np.ones(CELLS), tuple(np.full(CELLS, x) for x in wo))[0], axis=-1)
    distances = [np.linalg.norm(part[:, None] - middles, axis=-1) for part in np.split(wi, 8)]  # 1e-7 between some
    nearest = np.concatenate([part.argmin(axis=1) for part in distances])
    assert max(part.min(axis=1).max() for part in distances) < 1e-9
    return np.bincount(nearest, minlength=CELLS)


def check_drawn(found, node):
    assert np.array_equal(counts(found, node), unpacked(found)[0][node])


@pytest.mark.parametrize("node", [1, 6, ELEVATIONS - 1])
def test_each_slot_draws_its_cell(node):
    found = sampler("half-vector", "chalk")
    check_drawn(found, node)
    units, other, taken = unpacked(found)
    must_fail(check_drawn, packed(found, units, other, np.roll(taken, 1, axis=1)), node)


def check_turns(found, angle, other):
    """Turning the viewer turns the direction that is drawn, with the same density."""
    wo, u = random_directions(5000, 1), np.random.default_rng(2).random((5000, 3))
    turns = [np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]]) for a in (angle, other)]
    wi, pdf, _ = found.sample(wo, u)
    again, same, _ = found.sample(wo @ turns[0], u)
    assert np.allclose(again, wi @ turns[1], atol=1e-6)
    assert np.allclose(same, pdf, rtol=1e-5)


@EACH_MATERIAL
@pytest.mark.parametrize("angle", [0.3, 2.0, np.pi, -1.0])
def test_draws_turn_with_the_viewer(material, angle):
    check_turns(sampler("half-vector", material), angle, angle)
    must_fail(check_turns, sampler("half-vector", material), angle, angle + 1e-4)


def check_density_at(found, cos_o):
    u = np.random.default_rng(0).random((20_000, 3))
    wo = np.array([np.sqrt(1 - cos_o**2), 0, cos_o])
    wi, pdf, _ = found.sample(wo, u)
    assert (pdf > 0).all()
    assert np.isclose(found.pdf(wi, wo), pdf, rtol=1e-4).mean() > 0.999


@pytest.mark.parametrize("cos_o", [1e-2, LOWEST, 0.9 * LOWEST, 1e-5, 1e-7])
def test_the_density_holds_below_the_lowest_elevation(cos_o):
    check_density_at(sampler("half-vector", "glossy"), cos_o)


def test_that_check_notices_a_viewer_that_is_not_raised():
    class Unraised(HalfVectorSampler):
        def density(self, wi, wo, buffers):
            z = np.maximum(wo[2], LOWEST)
            return super().density(wi, wo, buffers) * (wi[2] + wo[2]) / (wi[2] + z)

    broken = Unraised(BLACK, sampler("half-vector", "glossy").table)
    check_density_at(broken, 1e-2)
    must_fail(check_density_at, broken, 1e-5)


def test_of_a_black_material_it_is_the_cosine_nearly():
    """As far as cells can follow it: the mean of cos θ_i is 2/3 by the cosine's density."""
    found = HalfVectorSampler.fitted(BLACK)
    check_tables(found)
    for cos_o in (1.0, 0.7, 0.3):
        wo = np.array([np.sqrt(1 - cos_o**2), 0, cos_o])
        wi, _, weight = found.sample(wo, np.random.default_rng(0).random((20_000, 3)))
        assert wi[:, 2].mean() == pytest.approx(2 / 3, abs=0.05)
        assert (weight == 0).all()


@pytest.mark.parametrize("cosines", [(0.3, 2), (0, 0.5), (0.2, 0.4)])
def test_a_material_may_be_black_for_some_viewers(cosines):
    check_tables(HalfVectorSampler.fitted(Dim(*cosines)))


class ByViewer(Brdf):
    """f_r = cos θ_o · (1, ½, 0) / π, which reflects the share cos θ_o · (1, ½, 0) of even light."""

    name = "by viewer"

    def f_r(self, wi, wo, buffers):
        return wo[2] / np.pi, wo[2] / (2 * np.pi), 0 * wo[2]


def check_albedos(table, theta_o):
    assert np.allclose(table, np.cos(theta_o)[:, None] * [1, 0.5, 0], atol=0.011)


def test_albedos_by_hand():
    """At 0°, 3°, …, 90° to the viewer; the first and the last are taken 0.01 rad from the normal and the horizon."""
    table = albedos(ByViewer())
    check_albedos(table, np.radians(np.arange(0, 91, 3)))
    must_fail(check_albedos, table, np.radians(np.arange(0, 91, 3) - 1))
    between = np.radians(np.array([0.0, 1.5, 40.0, 61.0, 89.0, 90.0]))
    check_albedos(np.stack(albedo_at(np.cos(between), table.reshape(-1)), axis=-1), between)
