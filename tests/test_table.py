import numpy as np
import pytest
from helpers import SMALL, lambertian_table, must_fail, nearest_held, random_directions

from sommerl import BrdfTable
from sommerl.system.errors import MaterialError


def test_lambertian_is_the_same_everywhere():
    wi, wo = random_directions(1000, 1), random_directions(1000, 2)
    for interpolation in ("nearest", "trilinear"):
        f_r = lambertian_table(0.3).with_interpolation(interpolation).eval(wi, wo)
        assert f_r.shape == (1000, 3)
        assert np.allclose(f_r, 0.3 / np.pi)


def check_reciprocity(brdf):
    wi, wo = random_directions(20_000, 3), random_directions(20_000, 4)
    assert np.array_equal(brdf.eval(wi, wo), brdf.eval(wo, wi))


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
def test_reciprocal_to_the_last_bit(small_table, interpolation):
    check_reciprocity(small_table.with_interpolation(interpolation))


def test_that_check_notices_a_table_that_is_not_reciprocal(small_table):
    lattice = type(SMALL)(8, 8, 24, reciprocal=False)
    values = np.random.default_rng(1).random((*lattice.shape, 3))
    must_fail(check_reciprocity, BrdfTable(values, lattice))


def test_zero_below_the_horizon(small_table):
    up, down = [0.0, 0.6, 0.8], [0.0, 0.6, -0.8]
    assert (small_table.eval(up, up) > 0).all()
    for wi, wo in ((up, down), (down, up), (down, down), ([1.0, 0, 0], up)):
        assert (small_table.eval(wi, wo) == 0).all()


def test_directions_broadcast_and_other_shapes_are_refused(small_table):
    assert small_table.eval(np.array([[[0, 0, 1.0]]]), random_directions(5)).shape == (1, 5, 3)
    with pytest.raises(ValueError, match=r"shape \(\.\.\., 3\)"):
        small_table.eval([0.0, 1.0], [0, 0, 1.0])


def test_values_that_no_measurement_has_are_clamped_and_counted():
    values = np.ones((*SMALL.shape, 3))
    values[0, 0, :3] = [-1.0, 1.0, 1.0], [np.nan, np.inf, 1.0], [1.0, 1.0, 1.0]
    values[~SMALL.above_horizon] = -1
    table = BrdfTable(values, SMALL)
    assert table.counts.cells_clamped == 2
    assert np.allclose(table.values[0, 0, :3], [nearest_held([-1, 1, 1]), [0, 0, 1], [1, 1, 1]], rtol=1e-12)
    assert (table.values >= 0).all()


def held_by_hand(colour):
    """A colour as a table holds it."""
    finite = [x if abs(x) <= np.finfo(np.float32).max else 0.0 for x in colour]
    return nearest_held(finite) if min(finite) < 0 else finite


def share_by_hand(values, lattice):
    """The sums of `distance.energy_share`, cell by cell."""
    moved = all_ = 0.0
    theta_h, theta_d, _ = lattice.angles()
    cos_i, cos_o = lattice.cosines()
    for at in np.ndindex(*lattice.shape):
        if min(cos_i[at], cos_o[at]) > 1e-12:
            solid = np.sin(theta_h[at]) * np.sqrt(theta_h[at]) * np.sin(theta_d[at]) * np.cos(theta_d[at])
            for before, after in zip(values[at], held_by_hand(values[at]), strict=True):
                if np.isfinite(before):
                    all_ += solid * cos_i[at] * cos_o[at] * abs(before)
                    moved += solid * cos_i[at] * cos_o[at] * abs(before - after)
    return moved / all_


def check_energy(values, lattice, by_hand):
    assert BrdfTable(values, lattice).counts.energy_clamped == pytest.approx(by_hand, rel=1e-9)


@pytest.mark.parametrize("scale", [1.0, 1e30, 1e307])
def test_what_is_clamped_is_counted_by_its_share_of_the_energy(scale):
    values = np.random.default_rng(0).normal(size=(*SMALL.shape, 3)) * min(scale, 1e30)
    values[3, 2, 1] = np.nan, np.inf, -np.inf
    values[2, 2, 2, 0] = scale
    by_hand = share_by_hand(values, SMALL)
    check_energy(values, SMALL, by_hand)
    must_fail(check_energy, values, SMALL, 0.99 * by_hand)
    assert BrdfTable(np.abs(np.nan_to_num(values, posinf=0, neginf=0)) / scale, SMALL).counts.energy_clamped == 0


def test_nothing_positive_is_refused():
    for bad in (-1.0, 0.0, np.nan):
        with pytest.raises(MaterialError, match="expected a positive, finite reflectance above the horizon"):
            BrdfTable(np.full((*SMALL.shape, 3), bad), SMALL, name="dark")


def test_an_unknown_interpolation_is_refused(small_table):
    with pytest.raises(MaterialError, match="small: expected nearest or trilinear interpolation, found linear"):
        small_table.with_interpolation("linear")
    with pytest.raises(MaterialError, match="table: expected nearest or trilinear interpolation, found linear"):
        BrdfTable(small_table.values, SMALL, interpolation="linear")


def test_another_shape_is_refused():
    with pytest.raises(MaterialError, match=r"expected values of shape \(8, 8, 12, 3\), found \(2, 3\)"):
        BrdfTable(np.ones((2, 3)), SMALL)


def test_sampling_a_table_gives_it_back(small_table):
    again = BrdfTable.sampled(small_table.with_interpolation("nearest"), SMALL)
    assert np.array_equal(again.values, small_table.values)
    assert np.allclose(BrdfTable.sampled(small_table, SMALL).values, small_table.values)


def test_grazing_directions_see_the_last_cell_above_the_horizon():
    """Without that, pairs just above the horizon would look up cells that hold nothing."""
    values = np.where(SMALL.above_horizon[..., None], 1.0, -1.0)
    table = BrdfTable(np.broadcast_to(values, (*SMALL.shape, 3)), SMALL)
    wi, wo = random_directions(20_000, 5), random_directions(20_000, 6)
    wo[:, 2] *= 1e-3
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    for interpolation in ("nearest", "trilinear"):
        assert np.allclose(table.with_interpolation(interpolation).eval(wi, wo), 1)
