import numpy as np
import pytest
from helpers import must_fail, random_directions

from sommerl.arrays import split
from sommerl.half_diff import spherical
from sommerl.models import ggx
from sommerl.models.ggx import Ggx
from sommerl.render.bsdf import upload
from sommerl.render.llvm import mitsuba

A, B = random_directions(2000, 1), random_directions(2000, 2)
ROUGHNESSES = (0.02, 0.1, 0.3, 1.0)
ELEVATIONS = np.radians([0, 30, 60, 80, 87])


def material(alpha=0.2):
    return Ggx("x", (0.4, 0.2, 0.1), (0.04, 0.3, 0.9), alpha)


def mirror(alpha):
    """Reflects all that its microfacets do not hide from each other."""
    return Ggx("mirror", (0, 0, 0), (1, 1, 1), alpha)


def by_hand(wi, wo, alpha=0.2):
    """As printed, from vectors and tangents: Walter's D, Heitz's Λ, Schlick's F; the green channel."""
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    tan2_h = 1 / h[:, 2] ** 2 - 1
    d = alpha**2 / (np.pi * h[:, 2] ** 4 * (alpha**2 + tan2_h) ** 2)
    lambdas = [(np.sqrt(1 + alpha**2 * (1 / w[:, 2] ** 2 - 1)) - 1) / 2 for w in (wi, wo)]
    f = 0.3 + 0.7 * (1 - (h * wi).sum(axis=-1)) ** 5
    return 0.2 / np.pi + d * f / (1 + lambdas[0] + lambdas[1]) / (4 * wi[:, 2] * wo[:, 2])


def check_formula(brdf):
    assert np.allclose(brdf.eval(A, B)[:, 1], by_hand(A, B), rtol=1e-9)


def test_formula():
    check_formula(material())
    must_fail(check_formula, material(0.21))


class OneSided(Ggx):
    """Broken on purpose: masks towards the viewer alone."""

    def f_r(self, wi, wo, buffers):
        masked = ggx.visibility(self._alpha, wo[2], wo[2]) / ggx.visibility(self._alpha, wi[2], wo[2])
        return tuple(channel * masked for channel in super().f_r(wi, wo, buffers))


def check_reciprocal(brdf):
    assert np.allclose(brdf.eval(A, B), brdf.eval(B, A), rtol=1e-12)


def test_it_is_reciprocal():
    check_reciprocal(material())
    must_fail(check_reciprocal, OneSided("x", (0, 0, 0), (1, 1, 1), 0.2))


def half_vectors(alpha, rows=800, columns=160):
    """Elevations, azimuths and solid angles of the midpoints of a grid over the hemisphere, dense in the highlight."""
    edges = np.linspace(0, np.arctan(np.sqrt(np.pi / 2 / alpha)), rows + 1)
    edges = alpha * np.tan(edges) ** 2
    theta, step = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    phi = (np.arange(columns) + 0.5) / columns * 2 * np.pi
    theta, phi = np.meshgrid(theta, phi, indexing="ij")
    return theta, phi, np.sin(theta) * step[:, None] * (2 * np.pi / columns)


def check_normalised(distribution, alpha):
    theta, _, solid_angle = half_vectors(alpha)
    assert (distribution(alpha, theta) * np.cos(theta) * solid_angle).sum() == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("alpha", ROUGHNESSES)
def test_the_microfacets_cover_the_surface(alpha):
    check_normalised(ggx.distribution, alpha)
    must_fail(check_normalised, lambda a, theta: 1.01 * ggx.distribution(a, theta), alpha)


def albedos(brdf, alpha):
    """By quadrature over half vectors, for each of ELEVATIONS."""
    theta, phi, solid_angle = half_vectors(alpha)
    h = np.stack(spherical(theta, phi), -1)
    found = []
    for elevation in ELEVATIONS:
        wo = np.array(spherical(elevation, 0.0))
        cosine = (h @ wo)[..., None]
        wi = 2 * cosine * h - wo
        weight = np.where(cosine[..., 0] > 0, 4 * cosine[..., 0] * wi[..., 2] * solid_angle, 0)  # dω_i = 4 cos θ_d dω_h
        found.append((brdf.eval(wi, wo) * weight[..., None]).sum(axis=(0, 1)))
    return np.array(found)


def check_keeps_energy(brdf, alpha):
    found = albedos(brdf, alpha)
    assert (found <= 1 + 1e-3).all()
    assert (found > 0.3).all()


class NotMasked(Ggx):
    """Broken on purpose: no microfacet hides another."""

    def f_r(self, wi, wo, buffers):
        masking = 4 * wi[2] * wo[2] * ggx.visibility(self._alpha, wi[2], wo[2])
        return tuple(channel / masking for channel in super().f_r(wi, wo, buffers))


@pytest.mark.parametrize("alpha", ROUGHNESSES)
def test_it_does_not_reflect_more_than_comes_in(alpha):
    check_keeps_energy(mirror(alpha), alpha)
    must_fail(check_keeps_energy, NotMasked("x", (0, 0, 0), (1, 1, 1), alpha), alpha)


def check_roughest(brdf):
    """By hand: for α = 1 and wo along the normal, D = 1/π and G = 2 cos θ_i / (1 + cos θ_i)."""
    assert albedos(brdf, 1.0)[0] == pytest.approx(1 - np.log(2), abs=1e-4)


def test_the_albedo_of_the_roughest_mirror():
    check_roughest(mirror(1.0))
    must_fail(check_roughest, mirror(0.99))


def test_the_base_is_lambertian():
    base = Ggx("base", (0.9, 0.5, 0.1), (0, 0, 0), 1e-4)
    wi, wo = np.array(spherical(0.2, 0.0)), np.array(spherical(0.3, 2.0))
    assert np.allclose(base.eval(wi, wo), np.array([0.9, 0.5, 0.1]) / np.pi, rtol=1e-4)


def check_renders(brdf, expected):
    mi = mitsuba()
    wi, wo = (tuple(mi.Float(c.astype(np.float32)) for c in split(w)) for w in (A, B))
    found = brdf.f_r(wi, wo, {name: upload(buffer) for name, buffer in brdf.buffers().items()})
    assert np.allclose(np.stack([np.array(c) for c in found], -1), expected, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("alpha", ROUGHNESSES)
def test_it_renders(alpha):
    check_renders(material(alpha), material(alpha).eval(A, B))
    must_fail(check_renders, material(1.02 * alpha), material(alpha).eval(A, B))
