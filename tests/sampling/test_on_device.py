"""Samplers on Dr.Jit arrays of single precision, against NumPy."""

import numpy as np
import pytest
from helpers import must_fail, random_directions
from sampled import MATERIALS, sampler

from sommerl.reflectance.arrays import split
from sommerl.render.bsdf import upload
from sommerl.render.llvm import mitsuba
from sommerl.sampling.named import SAMPLERS

COUNT = 50_000
# Of directions or random numbers, how many may fall into the cell next door; how far the others may be off.
NEXT_DOOR, ROUNDING = 2e-3, 2e-3
EACH = pytest.mark.parametrize(("name", "material"), [(name, material) for name in SAMPLERS for material in MATERIALS])


def single(values):
    """Numbers that single precision has, so that both calculate with the same ones."""
    return values.astype(np.float32).astype(float)


def on_device(vectors):
    """Vectors (n, 3) as a triple of Dr.Jit's arrays."""
    return tuple(mitsuba().Float(component.astype(np.float32)) for component in split(vectors))


def buffers(found):
    return {name: upload(buffer) for name, buffer in found.buffers().items()}


WO = single(random_directions(COUNT, 2))
U = single(np.random.default_rng(0).random((COUNT, 3)))
# Close to the mirror's direction, at all scales.
NEAR = WO * [-1, -1, 1] + 10 ** np.random.default_rng(1).uniform(-4, 0, (COUNT, 1)) * random_directions(COUNT, 3)
WI = single(NEAR / np.linalg.norm(NEAR, axis=-1, keepdims=True))


def check_same_draws(found, draw):
    wi, pdf, _ = found.sample(WO, U)
    theirs, their_pdf = draw(on_device(WO), on_device(U), buffers(found))
    theirs, their_pdf = np.stack([np.array(x) for x in theirs], axis=-1), np.array(their_pdf)
    drawn = (pdf > 0) & (their_pdf > 0)
    assert (drawn == (pdf > 0)).mean() > 1 - NEXT_DOOR
    assert drawn.mean() > 0.4
    assert (np.linalg.norm(theirs - wi, axis=-1)[drawn] < ROUNDING).mean() > 1 - NEXT_DOOR
    assert np.isclose(their_pdf, pdf, rtol=ROUNDING)[drawn].mean() > 1 - NEXT_DOOR
    assert np.isfinite(their_pdf).all()


@EACH
def test_dr_jit_draws_the_same_directions(name, material):
    found = sampler(name, material)
    check_same_draws(found, found.draw)
    must_fail(check_same_draws, found, lambda wo, u, tables: found.draw(wo, (u[0], u[2], u[1]), tables))
    must_fail(check_same_draws, found, lambda wo, u, tables: (found.draw(wo, u, tables)[0], 1.01 * u[0]))


def check_same_density(found, density):
    expected = found.pdf(WI, WO)
    theirs = np.array(density(on_device(WI), on_device(WO), buffers(found)))
    assert np.isclose(theirs, expected, rtol=ROUNDING).mean() > 1 - NEXT_DOOR
    assert (theirs > 0).all()
    assert np.isfinite(theirs).all()


@EACH
def test_dr_jit_gives_the_same_density(name, material):
    found = sampler(name, material)
    check_same_density(found, found.density)
    must_fail(check_same_density, found, lambda *triples: 1.01 * found.density(*triples))


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def check_sees(found, wi, wo):
    pdf = np.array(found.density(on_device(wi), on_device(wo), buffers(found)))
    assert np.isfinite(pdf).all()
    assert (pdf > 0).all()


@EACH
def test_single_precision_has_no_blind_spot(name, material):
    """The mirror's own direction, the normal, and the last directions above the horizon."""
    found, grazing, normal = sampler(name, material), unit(WO * [1, 1, 1e-6]), np.tile([0.0, 0, 1], (10, 1))
    check_sees(found, WO * [-1, -1, 1], WO)
    check_sees(found, WO, WO)
    check_sees(found, normal, normal)
    check_sees(found, grazing, WO[::-1])
    check_sees(found, WO[::-1], grazing)
    check_sees(found, unit(grazing * [-1, -1, 1] + 1e-5 * WI), grazing)
    must_fail(check_sees, found, grazing * [1, 1, 0], WO)


def check_takes(found, draw, wo, u):
    wi, pdf = draw(on_device(wo), on_device(u), buffers(found))
    wi, pdf = np.stack([np.array(x) for x in wi], axis=-1), np.array(pdf)
    assert np.isfinite(wi).all()
    assert np.isfinite(pdf).all()
    assert (pdf >= 0).all()
    assert np.allclose(np.linalg.norm(wi[pdf > 0], axis=-1), 1, atol=1e-5)
    check_sees(found, wi[pdf > 0], wo[pdf > 0])


@EACH
def test_every_random_number_will_do(name, material):
    """The first and the last that single precision has, for viewers anywhere and along the axes."""
    rng = np.random.default_rng(5)
    ends = rng.choice([0.0, 2**-24, 0.5, 1 - 2**-24], (COUNT, 3))
    u = np.where(rng.random((COUNT, 3)) < 0.7, ends, U)
    cos, phi = 10 ** rng.uniform(-8, 0, COUNT), rng.integers(0, 8, COUNT) * np.pi / 4
    sin = np.sqrt(1 - cos**2)
    wo = np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], axis=-1)
    found = sampler(name, material)
    check_takes(found, found.draw, wo, u)

    def divided(wo, u, tables):
        """Broken on purpose: by a number that may be 0."""
        wi, pdf = found.draw(wo, u, tables)
        return wi, pdf * (u[0] / u[0])

    must_fail(check_takes, found, divided, wo, u)
