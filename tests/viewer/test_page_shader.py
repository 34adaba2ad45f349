"""What the page's shaders calculate, in single precision and in a browser, against Python."""

from itertools import product
from pathlib import Path

import compact
import numpy as np
import pytest
import rgl_files
import shader_page
from helpers import must_fail, random_directions
from shader_page import INTERPOLATED, check_interpolated, close

from sommerl import BrdfTable, Lattice, SomManBrdf
from sommerl.compression.smrl.file import decode
from sommerl.formats import rgl
from sommerl.reflectance.arrays import split
from sommerl.sampling.half_vector import HalfVectorSampler

GOLDEN = Path(__file__).parents[1] / "golden"
NEAREST = 1e-3  # the relative difference that a shader may have
NEAR_BORDER = 1e-4  # bins: as far from a border of cells, single precision may take the cell behind it
ANGLES = [0, 1e-4, 0.01, 0.5, 1.3, 1.56, 1.5707]  # of directions of special pairs [rad]


def special_pairs():
    """The normal, light and viewer in one place, mirrored, in one plane, close to the horizon."""
    towards = [[np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)] for t in ANGLES for p in (0, 0.4, np.pi)]
    return zip(*product(towards, towards), strict=True)


RANDOM = [random_directions(1000, seed).astype(np.float32) for seed in (1, 2)]
SPECIAL = [np.array(w, np.float32) for w in special_pairs()]


def cells(interpolation, lattice):
    rng = np.random.default_rng(lattice.size)
    lut, index = 0.01 + rng.random((40, 3)), rng.integers(0, 40, lattice.shape).astype(np.uint8)
    return SomManBrdf(lut, index, lattice, name="made up", interpolation=interpolation)


def measured(**changes):
    return rgl.parse(Path("made up"), rgl_files.content(**changes))


def table(interpolation):
    lattice = Lattice(9, 7, 12)
    values = np.random.default_rng(5).random((*lattice.shape, 3)) ** 4
    return BrdfTable(np.cbrt(values).astype("<f2").astype(float) ** 3, lattice, interpolation=interpolation)


MATERIALS = {
    f"cells, {interpolation}, {'reciprocal' if reciprocal else 'not reciprocal'}, {lattice[0]}": cells(
        interpolation, Lattice(*lattice, reciprocal=reciprocal)
    )
    for interpolation in ("nearest", "trilinear")
    for reciprocal, lattice in ((True, (90, 90, 180)), (False, (9, 7, 12)), (True, (9, 2, 5)))
}
MATERIALS |= {
    f"nodes, {fold}, {'signed' if signed else 'not signed'}": compact.material(folds=compact.FOLDS[fold], signed=signed)
    for fold in compact.FOLDS
    for signed in (True, False)
}
MATERIALS |= {path.name: decode(path.read_bytes()) for path in sorted(GOLDEN.glob("*.smrl"))}
MATERIALS |= {
    "rgl": measured(),
    "rgl, not relative to the density": measured(jacobian=np.zeros(1, np.uint8)),
    "table, nearest": table("nearest"),
    "table, trilinear": table("trilinear"),
}
NAMES = list(MATERIALS)
SAMPLED = ("cells.smrl", "nodes-2-both.smrl", "nodes-2-neither.smrl", "rgl")


@pytest.fixture(scope="module")
def shaders(chromium, tmp_path_factory):
    with shader_page.shaders(chromium, tmp_path_factory.mktemp("page"), MATERIALS) as ask:
        yield ask


@pytest.fixture(scope="module")
def webgpu(chromium_with_webgpu, tmp_path_factory):
    with shader_page.shaders(chromium_with_webgpu, tmp_path_factory.mktemp("page"), MATERIALS, "webgpu") as ask:
        yield ask


def check_nearest(found, made, pairs):
    """Pairs have the value of their cell; those at a border, which are few, that of one of those that meet there."""
    lattice, values = made.lattice, made.lattice.extended(values_of(made)).reshape(-1, 3)
    angles = lattice.place(*map(split, pairs))
    places = np.stack(lattice._position(*angles), -1)
    places[:, 2] = np.minimum(places[:, 2], lattice.phi_d - 1e-9)  # φ_d at the end of its range is in the last cell
    at_border = (np.abs(places - np.round(places)) < NEAR_BORDER).any(axis=-1)
    assert np.array_equal(values[number(lattice, places)], made.eval(*pairs))
    assert close(found, made.eval(*pairs), NEAREST)[~at_border].all()
    shifts = np.array(list(product((-NEAR_BORDER, 0, NEAR_BORDER), repeat=3)))
    around = [close(found, values[number(lattice, places + shift)], NEAREST) for shift in shifts]
    assert np.any(around, axis=0).all()
    if pairs is RANDOM64:
        assert at_border.mean() < 0.01


def values_of(made):
    return made.values if isinstance(made, BrdfTable) else made.lut[made.index]


def number(lattice, places):
    """The number of the cell at a place, counted in bins; φ_d turns."""
    i, j, k = (np.floor(places[..., axis]) for axis in range(3))
    i, j = (np.clip(x, 0, bins - 1) for x, bins in zip((i, j), lattice.shape, strict=False))
    return ((i * lattice.theta_d + j) * lattice.phi_d + k % lattice.phi_d).astype(int)


RANDOM64, SPECIAL64 = ([w.astype(float) for w in pairs] for pairs in (RANDOM, SPECIAL))


def check_values(shaders, name):
    made = MATERIALS[name]
    check = check_nearest if made.lookup == "nearest" else check_interpolated
    found = shaders(name, RANDOM)
    check(found, made, RANDOM64)
    wrong = found.copy()
    wrong[7] *= 1 + 2 * INTERPOLATED
    must_fail(check, wrong, made, RANDOM64)
    must_fail(check, np.roll(found, 1, axis=0), made, RANDOM64)


@pytest.mark.parametrize("name", NAMES)
def test_values(shaders, name):
    check_values(shaders, name)


@pytest.mark.parametrize("name", NAMES)
def test_values_by_webgpu(webgpu, name):
    check_values(webgpu, name)


@pytest.mark.parametrize("name", NAMES)
def test_special_directions(shaders, name):
    """All is finite. What is interpolated is near what Python finds there, or within the rounding of directions."""
    made, found = MATERIALS[name], shaders(name, SPECIAL)
    assert np.isfinite(found).all()
    if made.lookup == "nearest":
        check_nearest(found, made, SPECIAL64)
        return
    near = close(found, made.eval(*SPECIAL64), INTERPOLATED)
    # Where half vector and normal nearly coincide, that decides about φ_d.
    for seed in range(40):
        noise = [w + np.random.default_rng(seed).normal(0, 1e-7, w.shape) for w in SPECIAL64]
        near |= close(found, made.eval(*noise), INTERPOLATED)
    assert near.mean() > 0.99


@pytest.mark.parametrize("below", [[0, 0, -1], [0.6, 0, -0.8], [1, 0, 0], [0, 0, 0]])
def test_nothing_is_reflected_below_the_horizon(shaders, below):
    for name in ("cells.smrl", "nodes.smrl", "rgl", "table, nearest"):
        pairs = [np.array([below, [0, 0.6, 0.8]], np.float32), np.array([[0, 0.6, 0.8], below], np.float32)]
        assert (shaders(name, pairs) == 0).all()


def check_same_entries(found, wanted):
    """But for pairs at a border, where single precision may take the neighbour."""
    assert (found[:, :2] == wanted).all(axis=-1).mean() > 0.995
    assert set(np.unique(found[:, :2])) <= set(np.unique(wanted))


@pytest.mark.parametrize("name", ["cells, nearest, reciprocal, 90", "cells.smrl", "nodes.smrl", "nodes-2-both.smrl"])
def test_entries(shaders, name):
    made, found = MATERIALS[name], shaders(name, RANDOM, "entries")
    angles = made.lattice.place(*map(split, RANDOM64))
    if made.grid:
        wanted = made.lattice.extended(made.index).reshape(-1)[made.lattice.cell(*angles)]
        wanted = np.stack([wanted, np.full(len(wanted), -1)], -1)
    else:
        corners = zip(*made.lattice.corners(*angles, made.lattice.buffers()), strict=True)
        nodes, weights = (np.stack(np.broadcast_arrays(*each)).T for each in corners)
        total = ((nodes[:, :, None] == nodes[:, None]) * weights[:, None]).sum(axis=-1)
        gain, shape = made.index[:, nodes[np.arange(len(nodes)), total.argmax(axis=1)]]
        wanted = np.stack([shape, gain], -1)
    check_same_entries(found, wanted)
    must_fail(check_same_entries, np.roll(found, 1, axis=0), wanted)
    assert (shaders("rgl", RANDOM, "entries")[:, :2] == -1).all()


def check_drawn(found, wanted):
    """Single precision may take another cell of the sampler's table for a few."""
    assert np.isfinite(found).all()
    assert np.isclose(found, wanted, rtol=1e-3, atol=1e-4).all(axis=-1).mean() > 0.995


@pytest.mark.parametrize("name", SAMPLED)
def test_sampling(shaders, name):
    """The shader draws, from the table that the worker has fitted, what Python's sampler draws."""
    sampler = HalfVectorSampler.fitted(MATERIALS[name])
    numbers = np.random.default_rng(5).random((1000, 3)).astype(np.float32)
    found = shaders(name, [numbers, RANDOM[1]], "sample")
    wanted, _, _ = sampler.sample(RANDOM64[1], numbers.astype(float))
    check_drawn(found, wanted)
    must_fail(check_drawn, np.roll(found, 1, axis=0), wanted)
    density, wanted = shaders(name, RANDOM, "pdf")[:, :1], sampler.pdf(*RANDOM64)[:, None]
    check_drawn(density, wanted)
    must_fail(check_drawn, density * 1.01, wanted)
    for pairs in (SPECIAL, [w[::-1] for w in SPECIAL]):
        assert np.isfinite(shaders(name, pairs, "pdf")).all()
        assert np.isfinite(shaders(name, [np.abs(pairs[0]), pairs[1]], "sample")).all()
