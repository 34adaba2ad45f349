"""Evaluation in the core against `Brdf.eval`, the same in NumPy."""

import itertools

import numpy as np
import pytest
from helpers import SMALL, lambertian_table, must_fail, random_directions

from sommerl import MERL, Brdf, BrdfTable, Lattice, TrainOptions, _core, builtin_table, train

ONE_WAY = Lattice(8, 8, 24, reciprocal=False)
PAIRS = random_directions(100_003, 1), random_directions(100_003, 2)


def materials():
    values = np.random.default_rng(0).random((*SMALL.shape, 3))
    table = BrdfTable(values, SMALL)
    one_way = BrdfTable(np.random.default_rng(1).random((*ONE_WAY.shape, 3)), ONE_WAY)
    flat = BrdfTable(np.random.default_rng(2).random((1, 1, 1, 3)), Lattice(1, 1, 1))
    eight, _ = train(table, TrainOptions(clusters=200, epochs=1))
    sixteen, _ = train(table, TrainOptions(clusters=400, epochs=1))
    return {"table": table, "not reciprocal": one_way, "one cell": flat, "8 bits": eight, "16 bits": sixteen}


MATERIALS = materials()


def found(brdf, wi, wo, simd, threads):
    index, values = brdf.cells()
    index = None if index is None else index.reshape(-1)
    trilinear = brdf.interpolation == "trilinear"
    shape, reciprocal = brdf.lattice.shape, brdf.lattice.reciprocal
    return _core.lookup(wi, wo, shape, reciprocal, trilinear, values.reshape(-1), index, simd, threads)


def check_agrees(values, brdf, wi, wo):
    assert np.allclose(values, Brdf.eval(brdf, wi, wo), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("simd", _core.simd_paths())
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
@pytest.mark.parametrize("name", MATERIALS)
def test_the_core_agrees_with_numpy(name, interpolation, threads, simd):
    brdf = MATERIALS[name].with_interpolation(interpolation)
    check_agrees(found(brdf, *PAIRS, simd, threads), brdf, *PAIRS)


def test_that_check_notices_the_other_order_and_the_other_interpolation():
    one_way, table = MATERIALS["not reciprocal"], MATERIALS["table"]
    must_fail(check_agrees, one_way.eval(*PAIRS[::-1]), one_way, *PAIRS)
    must_fail(check_agrees, table.with_interpolation("nearest").eval(*PAIRS), table, *PAIRS)


@pytest.mark.parametrize("simd", _core.simd_paths())
def test_every_instruction_set_gives_the_same_bits(simd):
    for brdf, interpolation in itertools.product(MATERIALS.values(), ("nearest", "trilinear")):
        other = brdf.with_interpolation(interpolation)
        assert np.array_equal(found(other, *PAIRS, simd, 2), found(other, *PAIRS, "portable", 1))


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
def test_the_core_is_reciprocal_to_the_last_bit(interpolation):
    for name in ("table", "8 bits", "16 bits"):
        brdf = MATERIALS[name].with_interpolation(interpolation)
        assert np.array_equal(brdf.eval(*PAIRS), brdf.eval(*PAIRS[::-1]))


def test_mirror_retro_grazing_and_polar_directions():
    wo = random_directions(3000, 3)
    wo[1000:2000, 2] *= 1e-9
    wo[2000:] = [0, 0, 1]
    wo /= np.linalg.norm(wo, axis=-1, keepdims=True)
    table = builtin_table("nickel")
    assert table.lattice == MERL
    for wi in (wo, wo * [-1, -1, 1], np.roll(wo, 1, axis=0)):
        check_agrees(table.eval(wi, wo), table, wi, wo)


def test_what_is_no_direction_reads_nothing_outside():
    odd = np.array([[0, 0, 0], [np.nan] * 3, [np.inf, 0, 1], [0, 0, 1e300], [0, 0, 1e-300], [-0.0, 0.0, 1.0]])
    for brdf, interpolation in itertools.product(MATERIALS.values(), ("nearest", "trilinear")):
        brdf.with_interpolation(interpolation).eval(odd[:, None], odd[None])


def test_shapes():
    table = lambertian_table(0.3)
    assert table.eval([0, 0, 1.0], [0, 0, 1.0]).shape == (3,)
    assert table.eval(np.zeros((0, 3)), [0, 0, 1.0]).shape == (0, 3)
    assert table.eval(random_directions(12).reshape(3, 4, 3)[::-1, ::2], [0, 0, 1]).shape == (3, 2, 3)


def test_the_core_refuses_what_does_not_fit():
    wi, values = np.ones((4, 3)), np.ones(3 * 8)
    fits = (wi, wi, (2, 2, 2), True, False, values)
    assert _core.lookup(*fits).shape == (4, 3)
    for position, bad in ((0, wi[:3]), (0, wi[:, :2].copy()), (2, (2, 2, 3)), (2, (0, 2, 2)), (5, values[:-1])):
        arguments = list(fits)
        arguments[position] = bad
        with pytest.raises(ValueError, match="expected"):
            _core.lookup(*arguments)
    with pytest.raises(ValueError, match="simd: expected"):
        _core.lookup(*fits, None, "mmx")
