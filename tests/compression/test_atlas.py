"""Many materials by one formula: each number gives what its material gives alone."""

from dataclasses import replace

import numpy as np
import pytest
from atlases import COUNT, MATERIALS, atlas, turned
from helpers import compact_material, must_fail, random_directions
from histograms import albedo, check_drawn_from, counted, expected, viewer
from sampled import NODES

from sommerl import Lattice, SomManBrdf, builtin
from sommerl.compression.atlas import Atlas, is_compact
from sommerl.reflectance.concatenated import Concatenated
from sommerl.reflectance.grid import GridBrdf
from sommerl.sampling import half_vector
from sommerl.sampling.half_vector import VIEWERS, HalfVectorSampler, albedos
from sommerl.system.errors import MaterialError

A, B = random_directions(4000, 1), random_directions(4000, 2)
NUMBERS = np.random.default_rng(3).integers(0, COUNT, len(A))
U = np.random.default_rng(4).random((100_000, 3))


def of_each(values):
    """Of what each material gives, (materials, n, ...), that of the material of each pair."""
    return np.stack(values)[NUMBERS, np.arange(len(A))]


def check_values(found):
    """Those of the core, within rounding: of cubes of sums whose terms cancel."""
    true = of_each([material.eval(A, B) for material in MATERIALS])
    largest = of_each([np.full(len(A), np.abs(material.eval(A, B)).max()) for material in MATERIALS])
    assert (np.abs(found - true) <= 1e-9 * np.abs(true) + 1e-12 * largest[:, None]).all()


def swapped(one, other):
    """An atlas in which two buffers begin where the other one does."""
    broken = Atlas(MATERIALS)
    starts = broken._parts._starts
    starts[one], starts[other] = starts[other], starts[one]
    return broken


def test_each_number_has_the_values_of_its_material():
    check_values(atlas().eval(A, B, NUMBERS))
    must_fail(check_values, turned().eval(A, B, NUMBERS))
    must_fail(check_values, atlas().eval(A, B, np.minimum(NUMBERS + 1, COUNT - 1)))
    for one, other in (("lut", "gains"), ("index", "row_place"), ("theta_d_below", "theta_d_place")):
        must_fail(check_values, swapped(one, other).eval(A, B, NUMBERS))


def check_directions(found):
    """Bit for bit: it is the same sampler."""
    alone = [HalfVectorSampler.fitted(material).sample(B, U[: len(B)]) for material in MATERIALS]
    for k in range(2):  # directions and densities
        assert np.array_equal(found[k], of_each([each[k] for each in alone]))


def test_directions_and_densities_are_those_of_each_materials_sampler():
    drawn = atlas().sample(B, U[: len(B)], NUMBERS)
    check_directions(drawn)
    must_fail(check_directions, turned().sample(B, U[: len(B)], NUMBERS))
    assert np.array_equal(atlas().pdf(A, B, NUMBERS), of_each([m.pdf(A, B) for m in MATERIALS]))
    value = atlas().eval(drawn[0], B, NUMBERS) * (drawn[0][:, 2] / drawn[1])[:, None]
    assert np.allclose(drawn[2], value, rtol=1e-12)


def check_drawn(drawing, density, number, degrees):
    wi, pdf, _ = drawing.sample(viewer(degrees), U, number)
    bins = expected(lambda wi, wo: density.pdf(wi, wo, number), degrees, nodes=20)
    check_drawn_from(counted(wi[pdf > 0], degrees), bins, 2 * COUNT)


@pytest.mark.parametrize("degrees", [0, 80])
@pytest.mark.parametrize("number", range(COUNT))
def test_directions_are_drawn_from_the_density(number, degrees):
    check_drawn(atlas(), atlas(), number, degrees)
    must_fail(check_drawn, turned(), atlas(), number, degrees)


def check_albedo(found, number, degrees):
    """The mean weight is the albedo, within three standard errors."""
    weight = found.sample(viewer(degrees), U, number)[2].mean(axis=-1)
    true = albedo(MATERIALS[number], degrees)
    assert abs(weight.mean() - true) < 3 * weight.std() / np.sqrt(len(U)) + 2e-3 * abs(true)


@pytest.mark.parametrize("degrees", [0, 80])
@pytest.mark.parametrize("number", range(COUNT))
def test_the_mean_weight_is_the_albedo(number, degrees):
    check_albedo(atlas(), number, degrees)
    must_fail(check_albedo, turned(), number, degrees)


def test_an_atlas_of_one():
    one = Atlas(MATERIALS[:1])
    assert np.allclose(one.eval(A, B, 0), MATERIALS[0].eval(A, B), rtol=1e-9, atol=1e-12)
    assert (len(one), one.names) == (1, (MATERIALS[0].name,))


def test_shapes_broadcast_and_directions_below_the_horizon_give_nothing():
    found = atlas().eval(A[:5, None], B[None, :3], np.arange(COUNT)[:, None, None])
    assert found.shape == (COUNT, 5, 3, 3)
    assert np.array_equal(found[2], atlas().eval(A[:5, None], B[None, :3], 2))
    assert not atlas().eval(-A[:9], B[:9], NUMBERS[:9]).any()
    assert np.isnan(atlas().eval([np.nan, 0, 1], B[0], 1)).all()
    assert not atlas().pdf(A[:9], -B[:9], NUMBERS[:9]).any()


@pytest.mark.parametrize("number", [-1, COUNT, 0.5, [0, COUNT], "0"])
def test_numbers_out_of_range_are_refused(number):
    for call in (atlas().eval, atlas().sample, atlas().pdf):
        with pytest.raises(ValueError, match=f"expected whole numbers of materials from 0 to {COUNT - 1}"):
            call([0, 0, 1], [0, 0, 1], number)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"eval: expected shapes that broadcast, found \(4000, 3\) and \(7,\)"):
        atlas().eval(A, B, np.arange(7))


def check_in_range(parts):
    """Whatever a renderer passes for a number, each lane has the part of a material."""
    numbers = np.array([-1e30, -3.0, -0.4, 1.4, COUNT, 1e30, np.nan])
    starts = parts.of(numbers, parts.buffers())["table"].start / HalfVectorSampler.fitted(MATERIALS[0]).table.size
    assert starts.tolist() == [0, 0, 0, 1, COUNT - 1, COUNT - 1, 0]


def test_numbers_of_lanes_that_hold_anything_are_in_range(monkeypatch):
    check_in_range(atlas())
    monkeypatch.setattr(Atlas, "__len__", lambda self: COUNT + 1)
    must_fail(check_in_range, atlas())


@pytest.mark.parametrize(
    ("materials", "sentence"),
    [
        ([], "atlas: expected materials, found none"),
        ([MATERIALS[0], builtin("nickel")], "nickel .*: expected a compact material for an atlas, found a model"),
        (
            [SomManBrdf(np.ones((1, 3)), np.zeros((2, 2, 2), np.uint8), Lattice(2, 2, 2), name="cells")],
            "cells: expected a compact material for an atlas, found one of cells, of the preset paper",
        ),
    ],
)
def test_what_cannot_be_in_an_atlas(materials, sentence):
    with pytest.raises(MaterialError, match=sentence):
        Atlas(materials)
    assert not all(map(is_compact, materials)) or not materials


def test_samplers_can_be_given():
    samplers = [HalfVectorSampler.fitted(builtin("nickel")) for _ in MATERIALS]
    made = Atlas(MATERIALS, samplers)
    assert np.array_equal(made.pdf(A, B, NUMBERS), samplers[0].pdf(A, B))
    with pytest.raises(MaterialError, match=f"atlas: expected {COUNT} samplers, one a material, found 1"):
        Atlas(MATERIALS, samplers[:1])


def test_buffers_longer_than_a_device_can_address_are_refused(monkeypatch):
    monkeypatch.setattr("sommerl.reflectance.concatenated.LONGEST", 1000)
    with pytest.raises(MaterialError, match=r"7 materials: expected at most 1000 entries of \w+, found more"):
        Atlas(MATERIALS)


def check_small(buffers):
    """Of a thousand of them, 100 MB."""
    assert sum(buffer.nbytes for buffer in buffers.values()) <= 100_000 * 3


def test_a_material_of_some_kilobytes_takes_little_memory():
    """4,200 nodes in six bands: as many as 2.7 kB hold."""
    axis = (*range(0, 180, 10), 180)
    lattice = replace(NODES, theta_h=axis, band=(0, 1, 2, 3, 4, *[5] * 14), theta_d=(axis,) * 6, phi_d=(axis[:-7],) * 6)
    made = Atlas([compact_material(lattice, 200, 100)] * 3)
    assert lattice.size > 4200
    assert made.bytes_memory == sum(buffer.nbytes for buffer in made.buffers().values())
    check_small(made.buffers())
    must_fail(check_small, {name: buffer.astype(np.float64) for name, buffer in made.buffers().items()})


def test_parts_of_equal_length_begin_where_their_number_says():
    parts = Concatenated([{"x": np.arange(3.0), "y": np.zeros(k + 1), "z": np.zeros(k + 1)} for k in range(4)])
    found = parts.of(np.array([0, 3]), parts.buffers)
    assert found["x"].start.tolist() == [0, 9]
    assert found["y"].start.tolist() == [0, 6]
    assert {name for name in parts.buffers if "starts" in name} == {"starts of y"}


def uneven():
    """Nine times as bright on one side of the viewer's plane as on the other; its albedo is 0.5."""
    theta, phi = np.radians(np.arange(0, 86, 5.0)), np.radians(np.arange(0, 360, 15.0))
    values = 0.5 / np.pi * (1 + 0.8 * np.sin(phi))
    return GridBrdf(theta, theta, phi, np.broadcast_to(values[:, None], (len(theta), len(theta), len(phi), 3)))


def check_even(found):
    """Within the coarse quadrature's error."""
    assert found.shape == (VIEWERS, 3)
    assert np.allclose(found, 0.5, rtol=0.03)


def test_tabulated_albedos_are_of_light_from_both_sides():
    check_even(albedos(uneven()))
    theta = np.linspace(0.01, np.pi / 2 - 0.01, VIEWERS)
    must_fail(check_even, half_vector._light(uneven(), np.cos(theta), 2)[0].mean(axis=(1, 2, 3)))
