"""Source code that draws directions to the light."""

import numpy as np
import pytest
from helpers import must_fail
from shader_programs import CASES, compact, material, run

from sommerl import builtin
from sommerl.formats.shader import source as shader
from sommerl.formats.shader.language import CPP
from sommerl.sampling.half_vector import LOWEST, HalfVectorSampler


def viewers(count):
    """Directions that single precision holds: from all over the sphere, along the normal, and at all grazing angles."""
    rng = np.random.default_rng(3)
    wo = rng.standard_normal((count, 3)) * [1, 1, 0.7]
    wo[: count // 10, :2] = 0
    wo[count // 10 : count // 2, 2] = 10 ** rng.uniform(-7, -1, count // 2 - count // 10)
    return np.float32(wo / np.linalg.norm(wo, axis=1)[:, None]).astype(np.float64)


WO = viewers(10_000)
WI = np.roll(viewers(11_111), 1, axis=0)[:10_000]
U = np.random.default_rng(4).random((10_000, 3), np.float32).astype(np.float64)
SAMPLED = {"cells": lambda: material(*CASES[2]), "nodes": lambda: compact("several bands")}
BOTH_KINDS = pytest.mark.parametrize("kind", SAMPLED)
BOTH_PRECISIONS = pytest.mark.parametrize("real", ["float", "double"])


def epsilon(real):
    return np.finfo({"float": np.float32, "double": np.float64}[real]).eps


def check_draws_like_python(sampler, real, found):
    """Errors of rounding grow with the powers of s, up to the eighth, and at grazing angles, where cosines are small
    differences. In single precision, the place in the alias table (of 40,960 slots) is known to some hundredths of a
    slot, and two slots of the 256 of a cell have other neighbours: some of 10,000 samples go to another cell."""
    wi, pdf, _ = sampler.sample(WO, U)
    assert ((found[:, 3] > 0) == (pdf > 0)).mean() > 0.999
    assert (found[WO[:, 2] <= 0, 3] == 0).all()
    same = np.abs(found[:, :3] - wi).max(axis=1) <= 64 * epsilon(real)
    assert (same & (np.abs(found[:, 3] - pdf) <= 1024 * epsilon(real) * pdf)).mean() > 0.999


def check_density_like_python(sampler, real, found):
    """A pair at the edge of a cell may fall into the next one."""
    pdf = sampler.pdf(WI, WO)
    assert ((found == 0) == (pdf == 0)).all()
    assert (np.abs(found - pdf) <= 64 * epsilon(real) * pdf).mean() > 0.999


def check_density_of_samples(real, found):
    """A direction is rounded, and next to the horizon the viewer is taken to be at LOWEST. That moves the density as
    (sin θ_h)^-7/4 towards the normal, and where rows of cells are as narrow as sin θ_h < 10⁻⁴, some go to the next."""
    found, wo = found[found[:, 3] > 0], WO[found[:, 3] > 0]
    h = found[:, :3] + wo
    rounding = np.where(wo[:, 2] < LOWEST, LOWEST, epsilon(real))
    rounding *= 1 + 1 / np.hypot(h[:, 0], h[:, 1]).clip(1e-9) + 1 / h[:, 2]
    assert (np.abs(found[:, 4] - found[:, 3]) <= 16 * rounding * found[:, 3]).mean() > 0.995


@BOTH_PRECISIONS
@BOTH_KINDS
def test_samples_and_densities_are_those_of_python(tmp_path, kind, real):
    brdf = SAMPLED[kind]()
    sampler = HalfVectorSampler.fitted(brdf)
    shader.write(brdf, tmp_path / "x.h")
    drawn, pdf = run(tmp_path, real, "sample", WO, U), run(tmp_path, real, "pdf", WI, WO)[:, 0]
    check_draws_like_python(sampler, real, drawn)
    check_density_like_python(sampler, real, pdf)
    check_density_of_samples(real, drawn)
    other = HalfVectorSampler.fitted(builtin("nickel"))
    must_fail(check_draws_like_python, other, real, drawn)
    must_fail(check_density_like_python, other, real, pdf)
    text = (tmp_path / "x.h").read_text()
    (tmp_path / "x.h").write_text(text.replace("s_ * hz_", "(s_ * s_) * hz_"))
    must_fail(check_density_of_samples, real, run(tmp_path, real, "sample", WO, U))


def check_defined(folder, text, real):
    """With anything for an argument, nothing undefined is done; a density is finite, if the arguments are."""
    (folder / "x.h").write_text(text)
    values = np.array([-1, -1e-9, 0, 1e-9, 0.6, 1, np.nan])
    a, b = np.split(np.stack(np.meshgrid(*[values] * 6), -1).reshape(-1, 6)[::3], 2, axis=1)
    finite = np.isfinite(a + b).all(axis=1)
    for call, density in ("sample", [3, 4]), ("pdf", [0]):
        found = run(folder, real, call, a, b)[finite]
        assert (np.isfinite(found[:, density]) & (found[:, density] >= 0)).all()


@BOTH_PRECISIONS
def test_nothing_is_undefined(tmp_path, real):
    text = shader.source(compact("one node in phi_d"), CPP, "material_x")
    check_defined(tmp_path, text, real)
    must_fail(check_defined, tmp_path, text.replace("material_x_max(x_, sommerl_real(0.0))", "x_"), real)
    must_fail(
        check_defined,
        tmp_path,
        text.replace("material_x_max(std::fabs(along_) + std::fabs(across_), least_)", "(along_ + across_)"),
        real,
    )


def albedo(brdf, wo, n=500):
    """By quadrature over half vectors h, dense about the normal: dω_i = 4 (h·ω_o) dω_h."""
    x, phi = ((np.arange(n) + 0.5) / n * end for end in (1, 2 * np.pi))
    theta_h = x[:, None] ** 2 * np.pi / 2
    sin, cos = np.sin(theta_h), np.cos(theta_h)
    h = np.stack(np.broadcast_arrays(sin * np.cos(phi), sin * np.sin(phi), cos), axis=-1)
    dot = h @ wo
    wi = 2 * dot[..., None] * h - wo
    return (brdf.eval(wi, wo).mean(-1) * wi[..., 2] * 4 * dot * sin * x[:, None]).sum() * 2 * (np.pi / n) ** 2


def check_albedo(brdf, wo, found):
    """The mean weight of samples is the albedo, within three standard errors."""
    drawn = found[:, 3] > 0
    weight = np.zeros(len(found))
    weight[drawn] = brdf.eval(found[drawn, :3], wo[drawn]).mean(-1) * found[drawn, 2] / found[drawn, 3]
    assert abs(weight.mean() - albedo(brdf, wo[0])) < 3 * weight.std() / np.sqrt(len(weight))


@pytest.mark.parametrize("degrees", [0, 45, 85])
def test_the_mean_weight_is_the_albedo(tmp_path, degrees):
    brdf, theta = material(*CASES[2]), np.radians(degrees)
    u = np.random.default_rng(5).random((100_000, 3))
    wo = np.broadcast_to([np.sin(theta), 0, np.cos(theta)], u.shape)
    shader.write(brdf, tmp_path / "x.h")
    found = run(tmp_path, "float", "sample", wo, u)
    check_albedo(brdf, wo, found)
    must_fail(check_albedo, brdf, wo, found * [1, 1, 1, 1.02, 1])
