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
    prepared = _core.CellLookup(shape, reciprocal, trilinear, values.reshape(-1), index)
    return prepared.eval(wi, wo, simd, threads)


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
    fits = ((2, 2, 2), True, False, values)
    prepared = _core.CellLookup(*fits)
    assert prepared.eval(wi, wi).shape == (4, 3)
    for position, bad in ((0, (2, 2, 3)), (0, (0, 2, 2)), (3, values[:-1]), (3, np.ones(3 * 9)), (3, np.ones(48)[::2])):
        arguments = list(fits)
        arguments[position] = bad
        with pytest.raises(ValueError, match="expected"):
            _core.CellLookup(*arguments)
    for bad in (wi[:3], wi[:, :2].copy(), np.ones((3, 4)).T):
        with pytest.raises(ValueError, match="expected"):
            prepared.eval(bad, wi)
    with pytest.raises(ValueError, match="simd: expected"):
        prepared.eval(wi, wi, "mmx")


def check_sees_changes(prepare):
    """A prepared lookup reads its arrays in each call: what their owner writes into them counts."""
    values, index = np.random.default_rng(0).random(6), np.zeros(8, np.uint8)
    prepared = prepare((2, 2, 2), True, False, values, index)
    up = np.array([[0.0, 0.0, 1.0]])
    assert np.array_equal(prepared.eval(up, up), [values[:3]])
    values[:3] = 7
    assert (prepared.eval(up, up) == 7).all()
    index[:] = 1
    assert np.array_equal(prepared.eval(up, up), [values[3:]])


def test_a_prepared_lookup_sees_changes():
    check_sees_changes(_core.CellLookup)
    must_fail(check_sees_changes, lambda *given: _core.CellLookup(*given[:3], *map(np.copy, given[3:])))


def retyped(array, dtype):
    array.dtype = dtype


# What the owner of the arrays does to them, and what a lookup then gives: an error, or NaN.
CHANGES = {
    "fewer values": (lambda values, _: values.resize(4, refcheck=False), ValueError),
    "fewer entries": (lambda values, _: values.resize(3, refcheck=False), "NaN"),
    "other values": (lambda values, _: retyped(values, np.float32), TypeError),
    "fewer cells": (lambda _, index: index.resize(4, refcheck=False), ValueError),
    "other index": (lambda _, index: retyped(index, np.uint16 if index.dtype == np.uint8 else np.uint8), ValueError),
    "other entries": (lambda _, index: index.fill(200), "NaN"),
}


def check_reads_nothing_outside(change, expected, trilinear, dtype):
    values, index = np.ones(24), np.full(8, 7, dtype)
    prepared = _core.CellLookup((2, 2, 2), True, trilinear, values, index)
    assert np.allclose(prepared.eval(*PAIRS), 1)
    change(values, index)
    try:
        result = "numbers" if np.isfinite(prepared.eval(*PAIRS)).any() else "NaN"
    except (ValueError, TypeError) as error:
        result = type(error)
    assert result == expected


@pytest.mark.filterwarnings("ignore:Setting the dtype:DeprecationWarning")
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("trilinear", [False, True])
@pytest.mark.parametrize("change", CHANGES)
def test_a_prepared_lookup_reads_nothing_outside_of_arrays_that_changed(change, trilinear, dtype):
    check_reads_nothing_outside(*CHANGES[change], trilinear, dtype)


def test_that_check_notices_what_is_read():
    must_fail(check_reads_nothing_outside, lambda values, _: values.fill(2), "NaN", False, np.uint8)
    must_fail(
        check_reads_nothing_outside, lambda values, _: values.resize(3, refcheck=False), ValueError, False, np.uint8
    )
