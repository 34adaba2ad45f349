"""What every BRDF offers: sample, pdf, albedo and info; and that lookups prepared in the core follow the material."""

import copy
import pickle
from dataclasses import asdict

import numpy as np
import pytest
from helpers import lambertian_table, must_fail, random_directions
from kinds import KINDS

import sommerl
from sommerl import MERL, BrdfTable, Lattice
from sommerl.system.errors import MaterialError, OptionError

DRAWS = 20_000
ANGLES = np.radians([0.0, 20.0, 50.0, 75.0])


def upright(theta):
    return np.array([np.sin(theta), 0.0, np.cos(theta)])


def check_mean_weight(albedo, brdf, theta):
    """The mean of the weights is the albedo within five standard errors, and 2 %: coarse cells have jumps."""
    u = np.random.default_rng(3).random((DRAWS, 3))
    _, _, weight = brdf.sample(np.broadcast_to(upright(theta), u.shape), u)
    error = weight.std(axis=0) / np.sqrt(DRAWS)
    assert (np.abs(weight.mean(axis=0) - albedo) <= 5 * error + 0.02 * np.abs(albedo)).all()


@pytest.mark.parametrize("theta", ANGLES, ids=lambda theta: f"{np.degrees(theta):.0f}")
@pytest.mark.parametrize("kind", KINDS)
def test_the_albedo_is_the_mean_weight(kind, theta):
    brdf = KINDS[kind]
    albedo = brdf.albedo(theta)
    check_mean_weight(albedo, brdf, theta)
    must_fail(check_mean_weight, 1.1 * albedo + 1e-3, brdf, theta)


def test_the_albedo_of_white_paint():
    """f_r = 0.5 / π reflects half of the light to every viewer."""
    found = lambertian_table(0.5).albedo(ANGLES.reshape(2, 2))
    assert found.shape == (2, 2, 3)
    assert np.allclose(found, 0.5, rtol=2e-3)


def test_a_table_that_is_not_mirror_symmetric_has_light_from_both_sides():
    """f_r is 1 / π where φ_d < π, and 0 elsewhere: half of the light is reflected."""
    lattice = Lattice(12, 12, 24, reciprocal=False)
    values = np.zeros((*lattice.shape, 3))
    values[:, :, :12] = 1 / np.pi
    table = BrdfTable(values, lattice, interpolation="nearest")
    assert np.allclose(table.albedo(np.radians(40)), 0.5, atol=0.02)


def test_angles_that_are_none():
    brdf = lambertian_table(0.5)
    found = brdf.albedo([np.nan, np.inf, 0.3])
    assert np.isnan(found[:2]).all()
    assert np.isfinite(found[2]).all()
    for wrong in (-0.1, 1.6):
        with pytest.raises(ValueError, match="albedo: polar angles have to be from 0 to"):
            brdf.albedo(wrong)


@pytest.mark.parametrize("kind", KINDS)
def test_sample_and_pdf_belong_together(kind):
    brdf = KINDS[kind]
    u = np.random.default_rng(4).random((500, 3))
    wo = np.broadcast_to(upright(0.6), u.shape)
    wi, density, weight = brdf.sample(wo, u)
    drawn = density > 0
    assert drawn.mean() > 0.9
    assert np.allclose(brdf.pdf(wi[drawn], wo[drawn]), density[drawn], rtol=1e-6)
    expected = brdf.eval(wi[drawn], wo[drawn]) * wi[drawn][:, 2:] / density[drawn][:, None]
    assert np.allclose(weight[drawn], expected, rtol=1e-12)


# What `info` says


@pytest.mark.parametrize("kind", KINDS)
def test_info_says_what_a_material_is(kind):
    brdf = KINDS[kind]
    info = asdict(brdf.info())
    assert (info["kind"], info["name"]) == (brdf.kind, brdf.name)
    assert info["bytes_memory"] == sum(array.nbytes for array in brdf.buffers().values())
    assert (info["cells_clamped"], info["energy_clamped"]) == (brdf.counts.cells_clamped, brdf.counts.energy_clamped)
    assert (info["measured_against"] is not None) == brdf.compressed


def test_kinds_have_their_own_facts():
    cells, nodes = KINDS["cells-nearest"].info(), KINDS["nodes"].info()
    assert (cells.kind, cells.domain, cells.nodes, cells.clusters) == ("som-man", "linear", None, 40)
    assert (nodes.kind, nodes.domain, nodes.nodes) == ("som-man", "cube-root", KINDS["nodes"].lattice.size)
    assert KINDS["table-trilinear"].info().kind == "table"
    assert KINDS["factored"].info().terms == list(KINDS["factored"].terms)
    assert KINDS["ggx"].info().lobes == [lobe.as_json() for lobe in KINDS["ggx"].lobes]
    assert KINDS["rgl"].info().kind == "measurement"


def test_values_are_of_cells_and_node_values_of_nodes():
    cells, nodes = KINDS["cells-nearest"], KINDS["nodes"]
    assert cells.values.shape == (*cells.lattice.shape, 3)
    assert nodes.node_values.shape == (nodes.lattice.size, 3)
    with pytest.raises(MaterialError, match="expected values of cells, found nodes"):
        _ = nodes.values
    with pytest.raises(MaterialError, match="expected values of nodes, found cells"):
        _ = cells.node_values


def test_the_lattice_of_a_table_made_of_it():
    assert KINDS["ggx"].table_lattice == KINDS["nodes"].table_lattice == MERL
    assert KINDS["cells-nearest"].table_lattice == KINDS["cells-nearest"].lattice


# Lookups that are prepared in the core

PAIRS = random_directions(300, 1), random_directions(300, 2)
ON_LATTICE = ("table-trilinear", "cells-nearest", "nodes")


def check_same(one, other):
    assert np.array_equal(one.eval(*PAIRS), other.eval(*PAIRS))


@pytest.mark.parametrize("kind", ON_LATTICE)
def test_copies_and_pickles_look_up_the_same(kind):
    brdf = KINDS[kind]
    brdf.pdf(*PAIRS)
    for other in (copy.copy(brdf), copy.deepcopy(brdf), pickle.loads(pickle.dumps(brdf))):
        check_same(brdf, other)


def test_another_interpolation_is_prepared_anew():
    table = KINDS["table-trilinear"]
    table.eval(*PAIRS)
    nearest = table.with_interpolation("nearest")
    must_fail(check_same, table, nearest)
    check_same(table, nearest.with_interpolation("trilinear"))


def test_values_that_change_are_seen():
    table = lambertian_table(0.5)
    before = table.eval(*PAIRS)
    table.values *= 2
    assert np.allclose(table.eval(*PAIRS), 2 * before, rtol=1e-12)


# The preset compact, as users call it


def test_compress_is_public():
    material, report = sommerl.compress(sommerl.builtin("red-fabric"), target_size=500)
    assert material.domain == "cube-root"
    assert report.metrics["psnr_soft_db"] > 30
    assert len(sommerl.compression.smrl.file.encode(material)) <= 500


def test_what_compress_refuses():
    brdf = sommerl.builtin("red-fabric")
    with pytest.raises(OptionError, match="cannot both be asked for"):
        sommerl.compress(brdf, target_size=500, target_psnr=40)
    with pytest.raises(OptionError, match="target_size: expected"):
        sommerl.compress(brdf, target_size=5)
