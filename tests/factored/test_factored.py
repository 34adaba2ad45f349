"""Factored BRDFs: what they evaluate to, and how a BRDF becomes one."""

import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from factored_brdfs import arrays, made
from helpers import complaint, lambertian_table, must_fail, random_directions
from sampled import MATERIALS, Dim

from sommerl import BrdfTable, Lattice
from sommerl.factored import fit
from sommerl.factored.fit import MOST, FactorOptions, factor
from sommerl.factored.material import FactoredBrdf
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.reflectance.arrays import split
from sommerl.reflectance.half_diff import spherical
from sommerl.reflectance.origin import Source
from sommerl.render.bsdf import upload
from sommerl.render.llvm import mitsuba
from sommerl.sampling.lawrence import LawrenceSampler
from sommerl.system.errors import MaterialError, MissingDependencyError, OptionError

A, B = random_directions(3000, 1), random_directions(3000, 2)
FEW = FactorOptions(4, 2)
GLOSSY = MATERIALS["glossy"]


def by_hand(material, wi, wo):
    """Its definition, term by term, with NumPy's own interpolation."""
    h = wi + wo
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    turned = np.arctan2(h[:, 1], h[:, 0]) - np.arctan2(wo[:, 1], wo[:, 0])
    angles = np.arccos(wo[:, 2]), np.arccos(h[:, 2]), np.arccos(np.cos(turned))
    middles = (
        (np.arange(32) + 0.5) / 32 * np.pi / 2,
        np.sqrt((np.arange(90) + 0.5) ** 2 / 8100),
        (np.arange(48) + 0.5) / 48 * np.pi,
    )
    places = angles[0], np.sqrt(angles[1] / (np.pi / 2)), angles[2]
    result = np.zeros((len(wi), 3))
    for j in range(material.scale.shape[0]):
        for k in range(material.scale.shape[1]):
            u = np.interp(places[1], middles[1], material.rows[:, j, k].astype(float))
            v = np.interp(places[2], middles[2], material.columns[:, j, k].astype(float))
            for channel in range(3):
                f = np.interp(places[0], middles[0], material.lobes[:, j, channel].astype(float))
                result[:, channel] += f * u * v * material.scale[j, k]
    return result / np.maximum(wi[:, 2:], 0.03)


def check_is(material, values):
    assert np.allclose(material.eval(A, B), values, rtol=2e-4, atol=1e-6)


def test_it_is_the_sum_of_products_that_it_says():
    material = made()
    check_is(material, by_hand(material, A, B))
    for part in range(3):
        other = [*arrays(material)]
        other[part] = np.roll(other[part], 1, axis=0)
        must_fail(check_is, FactoredBrdf(*other), by_hand(material, A, B))


def test_mitsuba_s_arrays_give_the_same():
    material = made()
    buffers = {name: upload(buffer) for name, buffer in material.buffers().items()}

    def found(brdf, wi, wo):
        light, viewer = (tuple(mitsuba().Float(x.astype(np.float32)) for x in split(w)) for w in (wi, wo))
        return np.stack([np.array(x) for x in brdf.f_r(light, viewer, buffers)], axis=-1)

    def check(brdf):
        assert np.allclose(found(brdf, A, B), material.eval(A, B), rtol=2e-3)

    check(material)
    must_fail(check, made(3, 2))


def test_only_the_difference_of_azimuths_counts_and_not_its_sign():
    material = made()

    def check(turn):
        assert np.allclose(material.eval(turn(A), turn(B)), material.eval(A, B), rtol=1e-6)

    angle = 0.7
    turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    check(lambda w: w @ turn)
    check(lambda w: w * [1, -1, 1])
    must_fail(check, lambda w: w[:, [1, 0, 2]] * [2, 1, 1])


def relative_error(found, expected):
    return np.linalg.norm(found - expected) / np.linalg.norm(expected)


@cache
def factored(name, options=FEW):
    return factor(MATERIALS[name], options)


def check_lambertian(material, albedo):
    """Within a percent on average, within a tenth almost anywhere but at grazing angles, where f_r is a quotient."""
    found, cosine = material.eval(A, B), A[:, 2:]
    assert (found * cosine).sum() / cosine.sum() / 3 == pytest.approx(albedo / np.pi, rel=0.01)
    assert np.isclose(found[A[:, 2] > 0.3], albedo / np.pi, rtol=0.1).mean() > 0.95


def test_chalk_stays_chalk():
    material = factor(lambertian_table(0.5), FactorOptions())
    check_lambertian(material, 0.5)
    must_fail(check_lambertian, material, 0.51)


def check_approximates(material, brdf, error):
    cosine = A[:, 2:]
    assert relative_error(material.eval(A, B) * cosine, brdf.eval(A, B) * cosine) < error


def test_more_terms_are_closer():
    check_approximates(factored("glossy"), GLOSSY, 0.15)
    check_approximates(factored("glossy", FactorOptions()), GLOSSY, 0.05)
    must_fail(check_approximates, factored("glossy"), GLOSSY, 0.05)


def test_one_lobe_of_one_term():
    assert factored("glossy", FactorOptions(1, 1)).terms == (1, 1)


def test_too_many_terms():
    with pytest.raises(OptionError, match="terms: expected at most 256 for all lobes together, found 1024"):
        FactorOptions(32, 32)
    with pytest.raises(MaterialError, match="256 terms"):
        made(32, 9)


def check_same_on_both_sides(table):
    a, b = table.eval(A, B), table.eval(A * [1, -1, 1], B * [1, -1, 1])
    assert relative_error(a, b) < 1e-3


def test_a_table_of_it_is_the_mean_of_both_orders():
    """A reciprocal lattice would else hold one order on one side of the viewer's plane, and the other on the other."""
    check_same_on_both_sides(BrdfTable.sampled(made(), Lattice(20, 20, 40)))

    class OneOrder(FactoredBrdf):
        reciprocal = True

    must_fail(check_same_on_both_sides, BrdfTable.sampled(OneOrder(*arrays(made())), Lattice(20, 20, 40)))


def check_follows(sampler):
    """Where it draws half vectors, it does so by the light of the terms: the density, but for the cosine's share, is
    that of Σ F u v, the mean of the channels, in the middles of intervals of half vectors."""
    material = sampler.brdf
    t = 12
    h, c = np.meshgrid((np.arange(90) + 0.5) ** 2 / 8100 * np.pi / 2, (np.arange(48) + 0.5) / 48 * np.pi, indexing="ij")
    half, wo = np.stack(spherical(h, c), -1), np.array(spherical((t + 0.5) / 32 * np.pi / 2, 0.0))
    cosine = half @ wo
    wi = 2 * cosine[..., None] * half - wo
    light = np.einsum(
        "j,rjk,cjk,jk->rc", material.lobes[t].mean(-1, dtype=float), *map(np.float64, arrays(material)[1:])
    )
    above = wi[..., 2] > 1e-3
    density = (sampler.pdf(wi, wo) - 0.01 * wi[..., 2] / np.pi) * 4 * cosine
    ratio = (density / light)[above]
    assert np.allclose(ratio, ratio.mean(), rtol=0.02)


def test_its_sampler_follows_its_own_factors():
    sampler = LawrenceSampler.fitted(made())
    check_follows(sampler)
    must_fail(check_follows, replace(sampler, mass=np.ones_like(sampler.mass)))
    must_fail(check_follows, replace(sampler, share=sampler.share[:, ::-1]))
    must_fail(check_follows, replace(sampler, rows=np.linspace(0, 1, 91) + np.zeros_like(sampler.rows)))


def test_the_last_iterations_are_worth_it(monkeypatch):
    monkeypatch.setattr(fit, "ITERATIONS", 0)
    before = factor(GLOSSY, FEW)
    must_fail(check_approximates, before, GLOSSY, 0.15)


def test_nothing_is_reflected_where_nothing_was():
    assert not factor(Dim(2, 2), FEW).eval(A, B).any()
    # A viewer for whom all is black, among others.
    half = factor(Dim(0.5, 2), FEW)
    wi = np.array(spherical(0.3, 1.0))
    assert half.eval(wi, spherical(1.4, 0.0)) == pytest.approx(0, abs=1e-3)
    assert half.eval(wi, spherical(0.4, 0.0)) == pytest.approx(1 / np.pi, rel=0.05)


def check_reciprocal(material, most):
    assert material.facts["asymmetry"] < most


def test_how_far_from_reciprocal_is_measured():
    check_reciprocal(factored("glossy", FactorOptions()), 0.1)
    must_fail(check_reciprocal, made(), 0.1)
    assert made().facts["asymmetry"] == pytest.approx(asymmetry_by_chance(made()), rel=0.05)


def asymmetry_by_chance(material):
    """The same integrals by a million directions, drawn evenly."""
    wi, wo = random_directions(10**6, 3), random_directions(10**6, 4)
    weight = (wi[:, 2] * wo[:, 2])[:, None]
    one, other = material.eval(wi, wo), material.eval(wo, wi)
    return (weight * abs((one - other).sum(1, keepdims=True))).sum() / (weight * (one + other) / 2).sum()


def test_the_same_every_time():
    again = factor(GLOSSY, FEW)
    assert all(np.array_equal(a, b) for a, b in zip(arrays(again), arrays(factored("glossy")), strict=True))


def test_a_name_and_a_source_stay():
    table = lambertian_table(0.5)
    table.source = Source("ab" * 32)
    material = factor(table, FEW)
    assert (material.name, material.source.sha256) == (table.name, "ab" * 32)


@pytest.mark.parametrize("name", ["lobes", "terms"])
@pytest.mark.parametrize("value", [0, -1, MOST + 1])
def test_bad_options(name, value):
    with pytest.raises(OptionError, match=f"{name}: expected 1 to {MOST}, found {value}"):
        replace(FEW, **{name: value})


@pytest.mark.parametrize("name", ["lobes", "terms"])
def test_options_are_whole_numbers(name):
    with pytest.raises(OptionError, match=f"{name}: expected a whole number, found 1.5"):
        replace(FEW, **{name: 1.5})
    assert type(getattr(replace(FEW, **{name: np.int64(2)}), name)) is int


def test_bad_factors():
    lobes, rows, columns, scale = arrays(made())
    bad = {
        "shapes do not fit": [(lobes[1:], rows, columns, scale), (lobes, rows[:, :1], columns, scale)],
        "from 0 to 1": [(-lobes, rows, columns, scale), (lobes, rows + np.float16(np.nan), columns, scale)],
        "from 0 to 1e\\+30": [(lobes, rows, columns, -scale), (lobes, rows, columns, scale + np.inf)],
    }
    bad["shapes do not fit"] += [
        (lobes, rows, columns, scale[0]),
        (lobes[:, :0], rows[:, :0], columns[:, :0], scale[:0]),
    ]
    for message, cases in bad.items():
        for case in cases:
            with pytest.raises(MaterialError, match=message):
                FactoredBrdf(*case)


def test_without_scikit_learn(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.decomposition", None)
    with pytest.raises(
        MissingDependencyError, match=r"scikit-learn is needed and not installed: pip install 'sommerl\[fit\]'"
    ):
        factor(GLOSSY, FEW)
    assert complaint(lambda: made().eval(A, B)) is None


def test_a_mirror_s_colour():
    """Colours belong to the right channels."""
    lobes = [Lobe(FAMILIES["lambertian"], (0.1, 0.2, 0.4), {})]
    material = factor(MultiLobe("tinted", lobes), FEW)
    ratio = material.eval(A, B)[A[:, 2] > 0.1]
    assert np.allclose(ratio[:, 1] / ratio[:, 0], 2, rtol=0.02)
    assert np.allclose(ratio[:, 2] / ratio[:, 0], 4, rtol=0.02)
