"""The mean of both orders of the directions, and colours without negative channels."""

import numpy as np
import pytest
from helpers import must_fail, nearest_held, random_directions
from rgl_files import content

from sommerl import builtin, load
from sommerl.formats.rgl import RglBrdf
from sommerl.reflectance import distance
from sommerl.reflectance.brdf import Brdf
from sommerl.reflectance.distance import asymmetry, moved_share, negative_share, sidedness
from sommerl.reflectance.gamut import without_negatives
from sommerl.reflectance.reciprocal import EVEN, reciprocal

ALL = (random_directions(4000, seed) for seed in (3, 4))
A, B = (w[w[:, 2] >= 0.01][:3000] for w in ALL)
ANGLES = np.radians([0.0, 40.0, 70.0, 80.0, 85.0, 88.0, 89.0, 89.5])


class OneSided(Brdf):
    """Divides by the light's cosine alone, as a measurement with noise at grazing light does."""

    name = "one-sided"
    reciprocal = False

    def __init__(self, albedo):
        self._albedo = albedo

    def f_r(self, wi, wo, buffers):
        value = self._albedo / np.pi * (0.5 + 0.25 / np.maximum(wi[2], 0.002))
        return value, 0.5 * value, 0.0 * value


def check_reciprocal(brdf):
    assert np.allclose(brdf.eval(A, B), brdf.eval(B, A), rtol=1e-12)


def test_it_is_reciprocal():
    must_fail(check_reciprocal, OneSided(0.5))
    check_reciprocal(reciprocal(OneSided(0.5)))
    assert reciprocal(OneSided(0.5)).reciprocal
    source = builtin("nickel")
    assert reciprocal(source) is source


def test_it_is_the_mean_away_from_grazing():
    """And near it, each order counts by the cosine of its light."""
    source = OneSided(0.2)
    one, other = source.eval(A, B), source.eval(B, A)
    c_i, c_o = (np.minimum(w[:, 2:], EVEN) for w in (A, B))
    assert (c_i == c_o).mean() > 0.5
    assert np.allclose(reciprocal(source).eval(A, B), (one * c_i + other * c_o) / (c_i + c_o), rtol=1e-12)


def check_albedo(brdf, source):
    assert (brdf.albedo(ANGLES) <= 1.01 * np.maximum(1.0, source.albedo(ANGLES))).all()


@pytest.mark.parametrize("albedo", [0.3, 0.9, 1.0])
def test_it_does_not_reflect_more_than_the_source_or_all(albedo):
    source = OneSided(albedo)
    mean = reciprocal(source)
    check_albedo(mean, source)
    assert mean.facts["darkened"] == pytest.approx(0, abs=1e-9) or albedo > 0.3
    mean._factors = np.full_like(mean._factors, 2.5)
    del mean.sampler
    must_fail(check_albedo, mean, source)


def test_what_it_changes_is_counted(tmp_path):
    (tmp_path / "x.bsdf").write_bytes(content())
    source = load(tmp_path / "x.bsdf")
    assert isinstance(source, RglBrdf)
    mean = reciprocal(source)
    assert 0 < mean.counts.energy_averaged < mean.facts["asymmetry"]
    buffers = mean.buffers()
    assert asymmetry(lambda wi, wo: mean.f_r(wi, wo, buffers)) < 1e-9


def test_sidedness_and_negative_shares():
    """f = 1 + x with x from -1 to 1, where y of the half vector's cross product changes the sign of x: by hand, of a
    BRDF that is 1 on one side and 0 on the other the difference is twice the mean."""

    assert sidedness(lambda wi, wo: (left(wi, wo),) * 3) == pytest.approx(2)
    assert sidedness(lambda wi, wo: (wi[2], wo[2], wi[2])) == pytest.approx(0, abs=1e-12)
    assert negative_share(lambda wi, wo: (0 * wi[2] - 1, 0 * wi[2] + 3, 0 * wi[2])) == pytest.approx(1 / 4)


def left(wi, wo):
    """Whether light comes from the left of the viewer's plane: 1 or 0."""
    return (wi[0] * wo[1] - wi[1] * wo[0] > 0).astype(float)


def check_sides(negative, moved):
    """By hand, of what is -1 on one side and 2 on the other; and of a change from 1 to 1.5 where 2 is on the other."""
    for light in (left, lambda wi, wo: 1 - left(wi, wo)):
        assert negative(lambda wi, wo, light=light: (2 - 3 * light(wi, wo),) * 3) == pytest.approx(1 / 3)

        def before(wi, wo, buffers, light=light):
            return (2 - light(wi, wo),) * 3

        def after(wi, wo, buffers, light=light):
            return (2 - 0.5 * light(wi, wo),) * 3

        assert moved(before, after, {}) == pytest.approx(0.5 / 3)


def test_shares_are_of_both_sides(monkeypatch):
    check_sides(negative_share, moved_share)
    monkeypatch.setattr(distance, "SYMMETRIC", np.inf)  # as if both sides of everything were alike
    must_fail(check_sides, negative_share, moved_share)


@pytest.mark.parametrize("sign", [1, -1])
def test_asymmetry_of_what_is_negative(sign):
    """By hand: ∬ 2 |a − b| a b over ∬ (a + b) a b, of cosines a and b, is 2 / 15 over 1 / 3."""
    assert asymmetry(lambda wi, wo: (sign * 2 * wi[2], 0 * wi[2], 0 * wi[2])) == pytest.approx(0.4, rel=0.02)


def test_colours_without_negatives():
    given = np.array([[0.2, 0.3, 0.4], [-0.1, 0.5, 0.2], [0.1, -0.9, 0.1], [0.0, 0.0, 0.0], [1.0, 0.4, -0.2]])
    found = without_negatives(given)
    assert np.array_equal(found[[0, 3]], given[[0, 3]])
    assert (found >= 0).all()
    assert (found[2] == 0).all()  # of negative luminance
    luminance = np.array([0.2126, 0.7152, 0.0722])
    assert np.allclose(found[[1, 4]] @ luminance, given[[1, 4]] @ luminance)
    assert found[1, 0] == found[4, 2] == 0


def check_nearest(move):
    given = np.random.default_rng(0).normal(0.1, 0.3, (500, 3))
    given = given[(given @ [0.2126, 0.7152, 0.0722] > 1e-3)]
    assert (given.min(axis=-1) < 0).sum() > 100
    assert ((given < 0).sum(axis=-1) == 2).any()
    assert np.allclose(move(given), [nearest_held(colour) for colour in given], atol=1e-12)


def test_the_change_is_the_least():
    check_nearest(without_negatives)
    must_fail(check_nearest, lambda rgb: np.maximum(rgb, 0))
