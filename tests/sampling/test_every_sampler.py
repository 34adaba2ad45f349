"""What every sampler promises, for materials of all kinds, from normal to grazing incidence."""

from functools import cache

import numpy as np
import pytest
from helpers import must_fail, random_directions
from histograms import COARSE, FINE, albedo, check_drawn_from, counted, expected, viewer
from sampled import ANGLES, CASES, LOSSLESS, MATERIALS, Broken, Dim, sampler, scaled, uneven, without_jacobian
from scipy.stats import qmc

from sommerl.sampling.named import SAMPLERS

COUNT = 100_000
CHANCE = np.random.default_rng(0).random((COUNT, 3))
EVEN = qmc.Sobol(3, seed=0).random_base2(17)  # numbers so even that a share of them errs by 1e-4
EACH = pytest.mark.parametrize("name", SAMPLERS)
EACH_CASE = pytest.mark.parametrize(("name", "material", "degrees"), CASES)
GRID_ERROR = 1e-3  # of integrals, see `histograms`
NODES_OF = {
    "cosine": COARSE,
    "blinn-phong": COARSE,
}  # whose densities do not jump: their integrals err by 1e-4 with these


def check_drawn(found, bins, degrees):
    """The χ² test of drawn directions."""
    wi, pdf, _ = found.sample(viewer(degrees), CHANCE)
    check_drawn_from(counted(wi[pdf > 0], degrees), bins, len(CASES))


def check_integral(total, kept, name):
    """The density's integral is the share of directions that are drawn above the horizon: 1, if none is lost."""
    assert total == pytest.approx(kept, abs=GRID_ERROR)
    assert kept == 1 or name not in LOSSLESS


@EACH_CASE
def test_directions_are_drawn_from_the_density_and_it_integrates_to_one(name, material, degrees):
    found = sampler(name, material)
    bins = expected(found.pdf, degrees, NODES_OF.get(name, FINE))
    check_drawn(found, bins, degrees)
    must_fail(check_drawn, uneven(found), bins, degrees)
    kept = (found.sample(viewer(degrees), EVEN)[1] > 0).mean()
    check_integral(bins.sum(), kept, name)
    must_fail(check_integral, 1.003 * bins.sum(), kept, name)
    must_fail(check_integral, expected(without_jacobian(found).pdf, degrees, nodes=4).sum(), kept, name)


@EACH
@pytest.mark.parametrize("degrees", [45, 80])
def test_that_check_notices_a_density_without_its_jacobian(name, degrees):
    broken = without_jacobian(sampler(name, "glossy"))
    must_fail(check_drawn, broken, expected(broken.pdf, degrees, COARSE), degrees)


@cache
def light(material, degrees):
    return albedo(MATERIALS[material], degrees)


def check_albedo(found, material, degrees):
    """The mean weight is the albedo, within three standard errors."""
    weight = found.sample(viewer(degrees), CHANCE)[2].mean(axis=-1)
    error = 3 * weight.std() / np.sqrt(COUNT) + GRID_ERROR * light(material, degrees)
    assert abs(weight.mean() - light(material, degrees)) < error


@EACH_CASE
def test_the_mean_weight_is_the_albedo(name, material, degrees):
    check_albedo(sampler(name, material), material, degrees)


@EACH
@pytest.mark.parametrize("degrees", ANGLES)
def test_that_check_notices_a_wrong_density(name, degrees):
    must_fail(check_albedo, scaled(sampler(name, "glossy"), 1.1), "glossy", degrees)
    if degrees <= 45:  # from where its weights vary so much that anything could be their mean
        must_fail(check_albedo, without_jacobian(sampler(name, "glossy")), "glossy", degrees)


def pairs(count=2000):
    """Directions to light and viewer: mirrored but for a little or nothing; either along the normal or close to the
    horizon, the other anywhere; and the same."""
    rng = np.random.default_rng(3)
    wi, wo = random_directions(6 * count, 1), random_directions(6 * count, 2)
    a, b, c, d, e, f = (slice(k * count, (k + 1) * count) for k in range(6))
    wi[a] = wo[a] * [-1, -1, 1] + 10 ** rng.uniform(-7, 0, (count, 1)) * rng.standard_normal((count, 3))
    wi[b] = wo[b] * [-1, -1, 1]
    wi[c][:, :2] *= 1e-6
    wo[d][:, :2] *= 0
    wi[e][:, 2] *= 1e-6
    wo[f][:, 2] *= 1e-6
    wi, wo = np.concatenate([wi, wo[b]]), np.concatenate([wo, wo[b]])
    wi[:, 2] = abs(wi[:, 2])
    return [w / np.linalg.norm(w, axis=-1, keepdims=True) for w in (wi, wo)]


def check_nothing_left_out(found, brdf):
    wi, wo = pairs()
    lit = (brdf.eval(wi, wo) * wi[:, 2:]).max(axis=-1) > 0
    pdf = found.pdf(wi, wo)
    assert lit.any()
    assert np.isfinite(pdf).all()
    assert (pdf[lit] > 0).all()


@EACH
@pytest.mark.parametrize("material", MATERIALS)
def test_every_direction_that_reflects_can_be_drawn(name, material):
    found = sampler(name, material)
    check_nothing_left_out(found, MATERIALS[material])
    holey = Broken(found, factor=lambda wi, wo: wi[:, 2] > 1e-3)
    must_fail(check_nothing_left_out, holey, MATERIALS["chalk"])


def check_says_its_density(sample, pdf, wo):
    """The density that `sample` gives is the one of `pdf`, but for directions on the edge of two cells."""
    wi, said, weight = sample(wo, CHANCE[: len(wo)])
    drawn = said > 0
    assert np.isclose(pdf(wi, wo)[drawn], said[drawn], rtol=1e-3).mean() > 0.9999
    assert np.allclose(np.linalg.norm(wi, axis=-1), 1, atol=1e-9)
    assert (wi[drawn, 2] > 0).all()
    assert (weight[~drawn] == 0).all()
    return weight


@EACH
@pytest.mark.parametrize("material", MATERIALS)
def test_sample_says_the_density_of_what_it_draws(name, material):
    found, wo = sampler(name, material), random_directions(COUNT, 4)
    check_says_its_density(found.sample, found.pdf, wo)
    must_fail(check_says_its_density, found.sample, scaled(found, 1.01).pdf, wo)
    must_fail(check_says_its_density, found.sample, without_jacobian(found).pdf, wo)


def check_weight(found, brdf, wo):
    wi, pdf, weight = found.sample(wo, CHANCE)
    assert np.allclose(weight * pdf[:, None], brdf.eval(wi, wo) * wi[:, 2:] * (pdf > 0)[:, None], rtol=1e-12)


@EACH
def test_the_weight_is_the_light_over_the_density(name):
    wo = random_directions(COUNT, 4)
    check_weight(sampler(name, "glossy"), MATERIALS["glossy"], wo)
    must_fail(check_weight, sampler(name, "glossy"), MATERIALS["chalk"], wo)


def check_nothing_below(found):
    up, down = random_directions(1000, 5), -random_directions(1000, 6)
    level = up * [1, 1, 0]
    for wi, wo in ((up, down), (down, up), (down, down), (up, level), (level, up), (level, level)):
        assert (found.pdf(wi, wo) == 0).all()
    _, pdf, weight = found.sample(np.concatenate([down, level]), CHANCE[:2000])
    assert (pdf == 0).all()
    assert (weight == 0).all()


@EACH
@pytest.mark.parametrize("material", MATERIALS)
def test_nothing_below_the_horizon(name, material):
    check_nothing_below(sampler(name, material))


@EACH
def test_that_check_notices_light_from_below(name):
    class Seeping(Broken):
        def pdf(self, wi, wo):
            return super().pdf(wi * [1, 1, -1], wo)

    must_fail(check_nothing_below, Seeping(sampler(name, "glossy")))


def turned(w, angle):
    """Directions, turned about the normal."""
    x, y, z = w.T
    return np.stack([x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), z], axis=-1)


def check_turns(found, material_turn, light_turn):
    wi, wo = random_directions(5000, 7), random_directions(5000, 8)
    same = np.isclose(found.pdf(turned(wi, light_turn), turned(wo, material_turn)), found.pdf(wi, wo), rtol=1e-5)
    assert same.mean() > 0.999  # some are on the edge of two cells


@EACH
@pytest.mark.parametrize("angle", [0.5, 2.0, np.pi, -1.0])
def test_no_azimuth_is_special(name, angle):
    check_turns(sampler(name, "glossy"), angle, angle)
    if name != "cosine":
        must_fail(check_turns, sampler(name, "glossy"), angle, 0.0)


@EACH
def test_a_viewer_along_the_normal(name):
    """However its azimuth is written."""
    for wo in ([0, 0, 1], [-0.0, 0, 1], [1e-12, 0, 1], [0, -1e-12, 1], [1e-300, 1e-300, 1]):
        wi, pdf, weight = sampler(name, "glossy").sample(wo, CHANCE[:1000])
        assert (pdf > 0).mean() > 0.9
        assert all(np.isfinite(values).all() for values in (wi, pdf, weight))
        assert (sampler(name, "glossy").pdf(wo, wo) > 0).all()


@EACH
@pytest.mark.parametrize("cosines", [(2, 2), (0.3, 2), (0, 0.5), (0.2, 0.4)])
def test_materials_that_are_black_for_some_viewers_or_all(name, cosines):
    brdf = Dim(*cosines)
    found = SAMPLERS[name].fitted(brdf)
    check_nothing_left_out(found, MATERIALS["chalk"])
    for degrees in ANGLES:
        weight = check_says_its_density(found.sample, found.pdf, np.broadcast_to(viewer(degrees), (COUNT // 2, 3)))
        lit = float(cosines[0] < viewer(degrees)[2] < cosines[1])
        assert weight.mean() == pytest.approx(lit, abs=0.02)


@EACH
def test_shapes(name):
    found = sampler(name, "glossy")
    wo, u = random_directions(12).reshape(3, 4, 3), CHANCE[:12].reshape(3, 4, 3)
    wi, pdf, weight = found.sample(wo, u)
    assert (wi.shape, pdf.shape, weight.shape) == ((3, 4, 3), (3, 4), (3, 4, 3))
    one = found.sample(wo[1, 2], u[1, 2])
    assert all(np.array_equal(a, b[1, 2]) for a, b in zip(one, (wi, pdf, weight), strict=True))
    assert found.sample(wo[:, :1], u[1])[1].shape == found.pdf(wi, wo[0, 0]).shape == (3, 4)
    assert found.pdf(wi, wo).shape == (3, 4)


@EACH
@pytest.mark.parametrize("shapes", [((2,), (3,)), ((3,), (4, 2)), ((), (3,)), ((3, 1), (3,)), ((2, 3), (4, 3))])
def test_other_shapes_are_refused(name, shapes):
    found, (one, other) = sampler(name, "glossy"), (np.ones(shape) for shape in shapes)
    for call in (found.sample, found.pdf):
        with pytest.raises(ValueError, match=r"expected directions of shape \(\.\.\., 3\), found|broadcast"):
            call(one, other)
