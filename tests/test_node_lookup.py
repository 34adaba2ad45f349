"""Evaluation on a lattice of nodes in the core against `SomManBrdf.f_r`, the same in NumPy."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from compact import FOLDS
from helpers import must_fail, random_directions

from sommerl import Brdf, BrdfTable, Lattice, SomManBrdf, _core
from sommerl.compression.palette import GainsAndShapes
from sommerl.reflectance.nodes import FINE, NodeLattice
from sommerl.render.bsdf import upload
from sommerl.render.llvm import mitsuba

WIDE = tuple(range(0, FINE + 1, 4))
SIX = [sorted({0, 180, *range(b + 1, 180, 7 * b + 9)}) for b in range(6)]
LATTICES = {
    "minimal": NodeLattice((0, 180), (0, 0), ((0, 180),), ((0,),)),
    "one band": NodeLattice((0, 3, 40, 90, 180), (0,) * 5, ((0, 60, 180),), ((0, 50, 90, 140),)),
    "six bands": NodeLattice(
        (0, 1, 5, 30, 88, 92, 120, 179, 180), (0, 0, 1, 2, 2, 3, 4, 5, 5), tuple(map(tuple, SIX)),
        tuple(tuple(axis[: b - 6]) for b, axis in enumerate(SIX)),
    ),
    "wide": NodeLattice(WIDE, (0,) * 20 + (1,) * 26, (WIDE, (*WIDE[::2], 180)), (WIDE[:-1], (0, 1, 2, 179))),
    "finest": NodeLattice((0, 180), (0, 1), (tuple(range(181)),) * 2, (tuple(range(180)), (0,))),
}  # fmt: skip


def folded(lattice, folds):
    """The same lattice with other folds."""
    phi_d = lattice.phi_d
    if folds["mirrored"]:
        phi_d = tuple(axis if len(axis) == 1 else (*axis[1:-1], FINE) for axis in phi_d)
        phi_d = tuple(axis if axis[0] == 0 else (0, *axis) for axis in phi_d)
    return replace(lattice, phi_d=phi_d, **folds)


FOLDED = {  # and whether blended values keep their sign
    f"{name}, {fold}{', signed' if signed else ''}": (folded(LATTICES[name], folds), signed)
    for name in ("one band", "six bands", "wide", "finest")
    for fold, folds in FOLDS.items()
    for signed in (False, True)
}
# As a file holds it.
SCALE = float(np.float32(0.3))
PAIRS = random_directions(100_003, 1), random_directions(100_003, 2)
FEW = PAIRS[0][:17], PAIRS[1][:17]  # for which the core does not multiply all gains with all shapes


def factors(lattice):
    rng = np.random.default_rng(lattice.size)
    gains, shapes = rng.random(200) * 2 - 0.2, rng.random((150, 3)) - 0.1
    index = (rng.integers(0, count, lattice.size).astype(np.uint16) for count in (200, 150))
    return gains, shapes, *index


def arguments(lattice):
    nested = ([list(axis) for axis in axes] for axes in (lattice.theta_d, lattice.phi_d))
    return list(lattice.theta_h), list(lattice.band), *nested, *factors(lattice), SCALE


def in_numpy(lattice, signed=False):
    gains, shapes, gain, shape = factors(lattice)
    return SomManBrdf(
        GainsAndShapes(gains, shapes, SCALE, signed, lattice.mirrored), np.stack([gain, shape]), lattice, name="made up"
    )


def lookup(lattice, signed=False, smooth=None):
    smooth = lattice.mirrored if smooth is None else smooth
    return _core.NodeLookup(*arguments(lattice), **lattice.folds, signed=signed, smooth=smooth)


def found(name, wi, wo, simd=None, threads=None):
    return lookup(LATTICES[name]).eval(wi, wo, simd, threads)


EXPECTED = {name: Brdf.eval(in_numpy(lattice), *PAIRS) for name, lattice in LATTICES.items()}


def check_agrees(values, expected):
    assert np.allclose(values, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("simd", _core.simd_paths())
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("name", LATTICES)
def test_the_core_agrees_with_numpy(name, threads, simd):
    check_agrees(found(name, *PAIRS, simd, threads), EXPECTED[name])
    check_agrees(found(name, *FEW, simd, threads), EXPECTED[name][:17])


@pytest.mark.parametrize("simd", _core.simd_paths())
@pytest.mark.parametrize("name", FOLDED)
def test_the_core_agrees_with_numpy_with_all_folds(name, simd):
    lattice, signed = FOLDED[name]
    wi, wo = PAIRS[0][:20_000], PAIRS[1][:20_000]
    made = in_numpy(lattice, signed)
    expected = Brdf.eval(made, wi, wo)
    assert (expected < 0).any() == signed
    values = lookup(lattice, signed).eval(wi, wo, simd)
    check_agrees(values, expected)
    check_agrees(lookup(lattice, signed).eval(*FEW, simd), expected[:17])
    assert np.array_equal(made.eval(wi, wo), lookup(lattice, signed).eval(wi, wo))
    must_fail(check_agrees, lookup(lattice, not signed).eval(wi, wo, simd), expected)
    other = replace(lattice, reciprocal=not lattice.reciprocal)
    must_fail(check_agrees, lookup(other, signed).eval(wi, wo, simd), expected)


def check_same_of_mirror_images(evaluate):
    mirror = [1, -1, 1]
    check_same_bits(evaluate(*PAIRS), evaluate(PAIRS[0] * mirror, PAIRS[1] * mirror))


@pytest.mark.parametrize("name", FOLDED)
def test_folded_pairs_give_the_same_to_the_last_bit(name):
    lattice, signed = FOLDED[name]
    evaluate = lookup(lattice, signed).eval
    for check, same in ((check_reciprocal, lattice.reciprocal), (check_same_of_mirror_images, lattice.mirrored)):
        if same:
            check(evaluate)
        else:
            must_fail(check, evaluate)


def in_drjit(made):
    """f_r by Dr.Jit, in single precision."""
    mi, buffers = mitsuba(), {name: upload(buffer) for name, buffer in made.buffers().items()}

    def evaluate(*pair):
        wi, wo = (tuple(mi.Float(c.astype(np.float32)) for c in w.T) for w in pair)
        return np.stack([np.array(c) for c in made.f_r(wi, wo, buffers)], axis=-1)

    return evaluate


def check_close(values, expected):
    assert (np.abs(values - expected) <= 1e-3 * np.abs(expected) + 1e-4).all(axis=-1).mean() > 0.999


@pytest.mark.parametrize("name", [name for name in FOLDED if name.startswith("six bands")])
def test_drjit_agrees_with_all_folds(name):
    lattice, signed = FOLDED[name]
    evaluate, expected = in_drjit(in_numpy(lattice, signed)), lookup(lattice, signed).eval(*PAIRS)
    values = evaluate(*PAIRS)
    check_close(values, expected)
    assert (values < 0).any() == signed
    other = replace(lattice, reciprocal=not lattice.reciprocal)
    must_fail(check_close, in_drjit(in_numpy(other, signed))(*PAIRS), expected)
    for check, same in ((check_reciprocal, lattice.reciprocal), (check_same_of_mirror_images, lattice.mirrored)):
        if same:
            check(evaluate)
        else:
            must_fail(check, evaluate)


@pytest.mark.parametrize("fold", ["mirrored", "both"])
def test_one_node_in_phi_d_means_the_same_with_all_folds(fold):
    minimal = LATTICES["minimal"]
    check_agrees(lookup(replace(minimal, **FOLDS[fold]), smooth=False).eval(*PAIRS), lookup(minimal).eval(*PAIRS))


def test_that_check_notices_another_node_another_shape_and_another_order():
    lattice = LATTICES["one band"]
    theta_h, band, theta_d, phi_d, gains, shapes, gain, shape, scale = arguments(lattice)
    for other in (
        (theta_h, band, [[0, 61, 180]], phi_d, gains, shapes, gain, shape, scale),
        (theta_h, band, theta_d, phi_d, gains, shapes, gain, np.roll(shape, 1), scale),
    ):
        must_fail(check_agrees, _core.NodeLookup(*other).eval(*PAIRS), EXPECTED["one band"])
    must_fail(check_agrees, found("one band", *PAIRS)[:, ::-1], EXPECTED["one band"])


def check_same_bits(values, others):
    assert np.array_equal(values, others)


@pytest.mark.parametrize("simd", _core.simd_paths())
@pytest.mark.parametrize("name", LATTICES)
def test_every_instruction_set_and_number_of_threads_gives_the_same_bits(name, simd):
    one = found(name, *PAIRS, "portable", 1)
    for threads in (1, 3):
        check_same_bits(found(name, *PAIRS, simd, threads), one)
        check_same_bits(found(name, *FEW, simd, threads), one[:17])
    must_fail(check_same_bits, np.nextafter(one, 9), one)


def check_reciprocal(evaluate):
    check_same_bits(evaluate(*PAIRS), evaluate(*PAIRS[::-1]))


@pytest.mark.parametrize("name", LATTICES)
def test_the_core_is_reciprocal_to_the_last_bit(name):
    check_reciprocal(lambda wi, wo: found(name, wi, wo))


def test_that_check_notices_what_is_not():
    values = np.random.default_rng(0).random((8, 8, 24, 3))
    must_fail(check_reciprocal, BrdfTable(values, Lattice(8, 8, 24, reciprocal=False)).eval)


def test_mirror_retro_grazing_and_polar_directions():
    wo = random_directions(3000, 3)
    wo[1000:2000, 2] *= 1e-9
    wo[2000:] = [0, 0, 1]
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    for lattice, signed in (*((lattice, False) for lattice in LATTICES.values()), *FOLDED.values()):
        for wi in (wo, wo * [-1, -1, 1], np.roll(wo, 1, axis=0)):
            check_agrees(lookup(lattice, signed).eval(wi, wo), Brdf.eval(in_numpy(lattice, signed), wi, wo))


def check_dark(values):
    assert not values.any()


def test_zero_below_the_horizon():
    wi, wo = PAIRS
    below = wi * [1, 1, -1]
    for pairs in ((below, wo), (wo, below), (below, below), (wi * [1, 1, 0], wo)):
        check_dark(found("six bands", *pairs))
    must_fail(check_dark, found("six bands", wi, wo))


@pytest.mark.parametrize("simd", _core.simd_paths())
def test_what_is_no_direction_reads_nothing_outside(simd):
    odd = [[0, 0, 0], [np.nan] * 3, [np.inf, 0, 1], [0, 0, 1e300], [0, 0, 1e-300], [-0.0, 0.0, 1.0], [np.nan, 0, 1]]
    wi, wo = np.repeat(odd, len(odd), axis=0), np.tile(odd, (len(odd), 1))
    made = (*((lattice, False) for lattice in LATTICES.values()), *FOLDED.values())
    for (lattice, signed), times in itertools.product(made, (1, 2000)):
        values = lookup(lattice, signed).eval(np.tile(wi, (times, 1)), np.tile(wo, (times, 1)), simd)
        assert values.shape == (times * len(wi), 3)
        known = np.isfinite(np.tile(wi + wo, (times, 1))).all(axis=-1)
        assert np.array_equal(np.isfinite(values).all(axis=-1), known)
        check_dark(values[: len(odd)][known[: len(odd)]])


def test_shapes():
    assert found("wide", np.zeros((0, 3)), np.zeros((0, 3))).shape == (0, 3)
    assert found("wide", PAIRS[0][:1], PAIRS[1][:1]).shape == (1, 3)


def refused(wi, wo, *rest):
    *prepared, simd = rest
    with pytest.raises(ValueError, match="expected"):
        _core.NodeLookup(*prepared).eval(wi, wo, simd)


FITS = (np.ones((4, 3)), np.ones((4, 3)), *arguments(LATTICES["one band"]))
INDEX = FITS[8]


@pytest.mark.parametrize(
    ("position", "bad"),
    [
        (0, FITS[0][:3]),
        (0, FITS[0][:, :2].copy()),
        (0, np.ones((3, 4)).T),
        (2, [0, 3, 40, 90]),
        (2, [0, 3, 40, 90, 179]),
        (2, [0, 40, 3, 90, 180]),
        (2, [0, 3, 3, 90, 180]),
        (2, [1, 3, 40, 90, 180]),
        (2, [0, 3, 40, 90, 300]),
        (2, [0, 3, 40, 90, 181]),
        (2, [-1, 3, 40, 90, 180]),
        (2, [0, 3.5, 40, 90, 180]),
        (2, [0, 3, 40, 90, 2**70]),
        (2, []),
        (3, [0] * 4),
        (3, [0, 0, 0, 0, 1]),
        (3, [0, 0, 0, 0, 255]),
        (4, []),
        (4, [[]]),
        (4, [[0]]),
        (4, [[0, 60, 180]] * 2),
        (4, [[0, 180]]),
        (5, [[]]),
        (5, [[50, 90]]),
        (5, [[0, 50, 90, 180]]),
        (5, [[0, 50, 90, 140, 150]]),
        (5, []),
        (6, FITS[6][: INDEX.max()]),
        (6, np.full(200, np.nan)),
        (6, np.repeat(FITS[6], 2)[::2]),
        (7, FITS[7][: FITS[9].max()]),
        (7, np.ones((150, 4))),
        (8, INDEX[:-1]),
        (8, np.append(INDEX, INDEX[:1])),
        (8, np.full_like(INDEX, 200)),
        (9, np.full_like(INDEX, 150)),
        (9, np.zeros(0, np.uint16)),
        (11, "mmx"),
    ],
)
def test_the_core_refuses_what_does_not_fit(position, bad):
    broken = [*FITS, None]
    broken[position] = bad
    refused(*broken)


def test_that_check_notices_what_fits():
    with pytest.raises(pytest.fail.Exception):
        refused(*FITS, None)


def check_sees_changes(prepare):
    """A prepared lookup reads its arrays in each call: what their owner writes into them counts."""
    lattice = LATTICES["one band"]
    *axes, gains, shapes, gain, shape, scale = arguments(lattice)
    prepared = prepare(*axes, gains, shapes, gain, shape, scale)
    for changed in (gains, shapes, gain, shape):
        changed[:] = np.roll(changed, 1, axis=0)
        made = SomManBrdf(GainsAndShapes(gains, shapes, SCALE), np.stack([gain, shape]), lattice, name="made up")
        check_agrees(prepared.eval(*PAIRS), Brdf.eval(made, *PAIRS))
        check_agrees(prepared.eval(*FEW), Brdf.eval(made, *FEW))


def test_a_prepared_lookup_sees_changes():
    check_sees_changes(_core.NodeLookup)

    def copies(*given):
        return _core.NodeLookup(*given[:4], *map(np.copy, given[4:8]), given[8])

    must_fail(check_sees_changes, copies)


@pytest.mark.parametrize("position", [4, 5, 6, 7])
@pytest.mark.parametrize("pairs", [PAIRS, FEW])
def test_a_prepared_lookup_reads_nothing_outside_of_arrays_that_changed(pairs, position):
    fits = [np.copy(each) if 4 <= at < 8 else each for at, each in enumerate(arguments(LATTICES["one band"]))]
    changed, prepared = fits[position], _core.NodeLookup(*fits)
    must_fail(check_dark, prepared.eval(*pairs))
    if position > 5:
        changed.fill(2**16 - 1)
        check_dark(prepared.eval(*pairs))
    changed.resize((0, *changed.shape[1:]), refcheck=False)
    check_dark(prepared.eval(*pairs))
