import numpy as np
import pytest
from helpers import lambertian_table, must_fail, random_directions
from histograms import COARSE, albedo, grid, in_pieces, viewer

from sommerl import NAMES, builtin
from sommerl.models.multi_lobe import FAMILIES, Lobe, MultiLobe
from sommerl.sampling.blinn_phong import BlinnPhongSampler

ANGLES = (0, 45, 80)
CHALK = lambertian_table(0.7)
SHARP = BlinnPhongSampler(CHALK, 50.0, 0.7)


def drawn(sampler, wo, count=400_000, seed=0):
    wi, pdf, _ = sampler.sample(wo, np.random.default_rng(seed).random((count, 3)))
    return wi, pdf


def check_density(sampler, degrees):
    """The share of samples above the horizon, and their mean direction, are what the density says."""
    directions, solid_angle = grid(degrees, COARSE)
    density = in_pieces(sampler.pdf, directions, viewer(degrees)) * solid_angle
    wi, pdf = drawn(sampler, viewer(degrees))
    kept = pdf > 0
    error = 4 / np.sqrt(len(wi))
    assert density.sum() == pytest.approx(kept.mean(), abs=error)
    for axis in range(3):
        assert (density * directions[..., axis]).sum() == pytest.approx((wi[:, axis] * kept).mean(), abs=error)


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("sampler", [SHARP, BlinnPhongSampler(CHALK, 1.0, 0.5), BlinnPhongSampler(CHALK, 2000.0, 0.9)])
def test_density_is_that_of_the_samples(sampler, degrees):
    check_density(sampler, degrees)


def test_that_check_notices_a_forgotten_jacobian_and_another_lobe():
    class Forgotten(BlinnPhongSampler):
        def pdf(self, wi, wo):
            h = wi + wo
            h /= np.linalg.norm(h, axis=-1, keepdims=True)
            cos_d = (h * wo).sum(-1)
            return super().pdf(wi, wo) * 4 * cos_d

    class Other(BlinnPhongSampler):
        def pdf(self, wi, wo):
            return BlinnPhongSampler(CHALK, 40.0, 0.7).pdf(wi, wo)

    must_fail(check_density, Forgotten(CHALK, 50.0, 0.7), 45)
    must_fail(check_density, Other(CHALK, 50.0, 0.7), 45)


def weights(brdf, sampler, wo):
    wi, pdf = drawn(sampler, wo)
    kept = pdf > 0
    weight = np.zeros(len(wi))
    weight[kept] = brdf.eval(wi[kept], wo).mean(-1) * wi[kept, 2] / pdf[kept]
    return weight


def check_albedo(light, weight):
    """The mean weight of samples is the albedo, within three standard errors."""
    assert abs(weight.mean() - light) < 3 * weight.std() / np.sqrt(len(weight))


@pytest.mark.parametrize("degrees", ANGLES)
@pytest.mark.parametrize("name", ["blue-metallic-paint", "nickel", "beige-fabric"])
def test_mean_weight_is_the_albedo(name, degrees):
    brdf = builtin(name)
    light, weight = albedo(brdf, degrees), weights(brdf, BlinnPhongSampler.fitted(brdf), viewer(degrees))
    check_albedo(light, weight)
    must_fail(check_albedo, 1.01 * light, weight)


@pytest.mark.parametrize("name", [name for name, family in FAMILIES.items() if family.exponent])
def test_directions_for_a_model_by_the_exponent_that_it_names(name):
    lobe = Lobe(FAMILIES[name], (0.5, 0.5, 0.5), {p.name: p.start for p in FAMILIES[name].parameters})
    sampler = BlinnPhongSampler(CHALK, lobe.exponent, 0.7)
    for degrees in ANGLES:
        check_density(sampler, degrees)
    model = MultiLobe(name, [lobe])
    light, weight = albedo(model, 45), weights(model, sampler, viewer(45))
    check_albedo(light, weight)
    must_fail(check_albedo, 1.1 * light, weight)


def test_lambertian_weights_are_the_albedo_itself():
    cosine = BlinnPhongSampler(CHALK, 10.0, 0.0)
    wi, pdf = drawn(cosine, viewer(30), 1000)
    assert np.allclose(lambertian_table(0.7).eval(wi, viewer(30))[:, 0] * wi[:, 2] / pdf, 0.7)


def test_no_direction_that_reflects_is_left_out():
    for name in NAMES:
        sampler = BlinnPhongSampler.fitted(builtin(name))
        wi, wo = random_directions(2000, 1), random_directions(2000, 2)
        assert (sampler.pdf(wi, wo) > 0).all()


def test_shinier_materials_get_sharper_lobes():
    exponents = [
        BlinnPhongSampler.fitted(builtin(name)).exponent
        for name in ("beige-fabric", "blue-metallic-paint", "nickel", "chrome")
    ]
    assert exponents == sorted(exponents)
    assert exponents[0] < 10 < 100 < exponents[2]


def test_without_a_highlight_there_is_no_needle():
    for interpolation in ("nearest", "trilinear"):
        sampler = BlinnPhongSampler.fitted(lambertian_table(0.7).with_interpolation(interpolation))
        assert sampler.exponent < 2


def test_nothing_below_the_horizon():
    wo = np.array([[0.0, 0.6, 0.8], [0.0, 0.6, -0.8], [0.0, 0.6, 0.8]])
    wi = np.array([[0.0, 0.6, -0.8], [0.0, 0.6, 0.8], [0.0, -0.6, 0.8]])
    pdf = SHARP.pdf(wi, wo)
    assert pdf[0] == pdf[1] == 0 < pdf[2]
