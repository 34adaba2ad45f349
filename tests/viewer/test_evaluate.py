"""Evaluation in JavaScript, as the page does it, against Python."""

from pathlib import Path

import compact
import numpy as np
import page_files
import pytest
import rgl_files
from helpers import must_fail, random_directions
from in_node import program
from scipy.ndimage import map_coordinates

from sommerl import BrdfTable, Lattice, SomManBrdf
from sommerl.compression.smrl.file import decode, encode
from sommerl.formats import rgl
from sommerl.reflectance.arrays import split
from sommerl.reflectance.half_diff import half_diff
from sommerl.sampling.half_vector import HalfVectorSampler

GOLDEN = Path(__file__).parents[1] / "golden"
ANSWER = """
import { cellAt, entriesAt, evaluate } from "./evaluate.js";
import { read } from "./readers.js";
import { fitted } from "./sampler.js";
async function answer({ wi, wo, file, ...how }) {
    const material = await read(file, how);
    const all = (give) => wi.map((w, i) => give(material, w, wo[i]));
    const table = how.sampler ? [...fitted(material)] : null;
    return { f: all(evaluate), entries: all(entriesAt), cells: all(cellAt), table };
}
"""
SPECIAL = [[0, 0, 1], [0.6, 0, 0.8], [0, 1, 0], [0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0, 1]]
OTHERS = [[0, 0, 1], [0, 0, 1], [0.6, 0, 0.8], [0.6, 0, 0.8], [0.6, 0, 0.8], [0, -1, 1e-3]]
PAIRS = [np.concatenate([random_directions(1000, seed), more]) for seed, more in ((1, SPECIAL), (2, OTHERS))]


@pytest.fixture(scope="module")
def node(tmp_path_factory):
    """What the page finds in the bytes of a file at PAIRS."""
    run = program(tmp_path_factory.mktemp("js"), ANSWER)
    wi, wo = (w.tolist() for w in PAIRS)

    def ask(data, format, **more):
        return run([({"wi": wi, "wo": wo, "format": format, **more}, data)])[0]

    return ask


def cells(interpolation, lattice):
    rng = np.random.default_rng(lattice.size)
    return SomManBrdf(
        rng.random((40, 3)),
        rng.integers(0, 40, lattice.shape).astype(np.uint8),
        lattice,
        name="made up",
        interpolation=interpolation,
    )


MATERIALS = {
    f"cells {shape}, {interpolation}, {'reciprocal' if reciprocal else 'not reciprocal'}": encode(
        cells(interpolation, Lattice(*shape, reciprocal=reciprocal))
    )
    for interpolation in ("nearest", "trilinear")
    for reciprocal in (True, False)
    for shape in ((9, 7, 12), (9, 2, 5))  # of the latter, some θ_h have no cell above the horizon
}
MATERIALS |= {
    f"nodes, {fold}, {'signed' if signed else 'not signed'}": encode(
        compact.material(folds=compact.FOLDS[fold], signed=signed)
    )
    for fold in compact.FOLDS
    for signed in (True, False)
}
MATERIALS |= {path.name: path.read_bytes() for path in sorted(GOLDEN.glob("*.smrl"))}


def check_agrees(found, wanted, rtol=1e-9):
    assert np.allclose(found, wanted, rtol=rtol, atol=1e-12)


@pytest.mark.parametrize("name", MATERIALS)
def test_it_agrees_with_python(node, name):
    found, material = node(MATERIALS[name], "smrl"), decode(MATERIALS[name])
    check_agrees(found["f"], material.eval(*PAIRS))
    must_fail(check_agrees, np.array(found["f"]) * (1 + 1e-6), material.eval(*PAIRS))
    check_same_entries(found["entries"], material)
    must_fail(check_same_entries, np.roll(found["entries"], 1, axis=0), material)


def check_same_entries(found, material):
    """Entries of the nearest cell; shape and gain of the node with the largest weight, unless there are two such."""
    lattice, (wi, wo) = material.lattice, [split(w) for w in PAIRS]
    angles = lattice.place(wi, wo)
    if lattice.grid:
        wanted = lattice.extended(material.index).reshape(-1)[lattice.cell(*angles)]
        assert np.array_equal(found, np.stack([wanted, np.full_like(wanted, -1, dtype=int)], -1))
        return
    nodes, weights = (
        np.stack(np.broadcast_arrays(*each)).T
        for each in zip(*lattice.corners(*angles, lattice.buffers()), strict=True)
    )
    # A single node in φ_d is there twice.
    of_node = ((nodes[:, :, None] == nodes[:, None]) * weights[:, None]).sum(axis=-1)
    here = nodes[np.arange(len(nodes)), of_node.argmax(axis=1)]
    sure = ((of_node < of_node.max(axis=1)[:, None] - 1e-9) | (nodes == here[:, None])).all(axis=1)
    assert sure.mean() > 0.9
    gain, shape = material.index
    assert np.array_equal(np.array(found)[sure], np.stack([shape[here], gain[here]], -1)[sure])


def table(lattice, interpolation):
    values = np.random.default_rng(5).random((*lattice.shape, 3)) ** 4 * 20
    return BrdfTable(values, lattice, interpolation=interpolation)


@pytest.mark.parametrize("interpolation", ["nearest", "trilinear"])
@pytest.mark.parametrize("lattice", [Lattice(9, 7, 12), Lattice(9, 2, 5, reciprocal=False)], ids=str)
def test_tables(node, lattice, interpolation):
    made = table(lattice, interpolation)
    above = np.where(lattice.above_horizon[..., None], made.values, 0)
    found = node(page_files.table(above, lattice, interpolation == "trilinear"), "table")["f"]
    stored = np.cbrt(made.values).astype("<f2").astype(float) ** 3
    wanted = BrdfTable(stored, lattice, interpolation=interpolation).eval(*PAIRS)
    check_agrees(found, wanted, 1e-6)
    must_fail(check_agrees, found, made.eval(*PAIRS), 1e-6)
    check_agrees(found, made.eval(*PAIRS), 2e-3)


def on_grid(values, wi, wo):
    """f_r of values at the centres of bins of θ_in, θ_out and φ, linear between them, constant beyond them."""
    n, _, m, _ = values.shape
    phi = np.arccos(np.clip((wi[:, :2] * wo[:, :2]).sum(1) / _length(wi) / _length(wo), -1, 1))
    at = np.arccos(wi[:, 2]) * n * 2 / np.pi - 0.5, np.arccos(wo[:, 2]) * n * 2 / np.pi - 0.5, phi * m / np.pi - 0.5
    return np.stack([map_coordinates(values[..., c], at, order=1, mode="nearest") for c in range(3)], -1)


def _length(w):
    return np.hypot(w[:, 0], w[:, 1])


def test_grids(node):
    values = np.random.default_rng(7).random((5, 5, 8, 3)).astype("f4").astype(float)
    found = np.array(node(page_files.mbsdf(values), "mbsdf")["f"])
    # Not at the normal, which has no azimuth.
    check_agrees(found[:1000], on_grid(values, *(w[:1000] for w in PAIRS)), 1e-6)
    must_fail(check_agrees, found[:1000], on_grid(values.swapaxes(0, 1), *(w[:1000] for w in PAIRS)), 1e-6)
    assert np.isfinite(found).all()
    grey = np.array(node(page_files.mbsdf(values[..., 1], 0), "mbsdf")["f"])
    check_agrees(grey, found[:, [1, 1, 1]])


RNG = np.random.default_rng(11)
WAVELENGTHS = np.array([300, 420, 500, 555, 610, 700, 900], np.float32)
RGL = {
    "rgb": {},
    "not relative to the density": {"jacobian": np.zeros(1, np.uint8)},
    "negative": {"rgb": (RNG.random((1, 4, 3, 5, 5)) - 0.3).astype(np.float32)},
    "one angle": {
        "theta_i": np.array([0.3], np.float32),
        "vndf": (0.2 + RNG.random((1, 1, 8, 9))).astype(np.float32),
        "rgb": RNG.random((1, 1, 3, 5, 6)).astype(np.float32),
    },
    "spectra": {
        "rgb": None,
        "wavelengths": WAVELENGTHS,
        "spectra": RNG.random((1, 4, len(WAVELENGTHS), 5, 5)).astype(np.float32),
    },
    "both ends of a period": {
        "phi_i": np.array([0, 6.28], np.float32),
        **{name: np.concatenate([rgl_files.fields()[name]] * 2) for name in ("vndf", "rgb")},
    },
}


@pytest.mark.parametrize("name", RGL)
def test_rgl(node, name):
    data = rgl_files.content(**RGL[name])
    found, wanted = node(data, "bsdf")["f"], rgl.parse(Path("made up"), data).eval(*PAIRS)
    check_agrees(found, wanted)
    must_fail(check_agrees, found, rgl.parse(Path("made up"), data).eval(*PAIRS[::-1]))


def check_angles(found, wanted):
    assert np.allclose([[c[name] for name in ("thetaH", "thetaD", "phiD")] for c in found], np.stack(wanted, -1))


def test_the_cell_under_the_pointer(node):
    material = decode(MATERIALS["cells.smrl"])
    found, angles = node(MATERIALS["cells.smrl"], "smrl")["cells"], half_diff(*map(split, PAIRS))
    check_angles(found, angles)
    must_fail(check_angles, found, half_diff(*map(split, PAIRS), reciprocal=False))
    _, theta_d, phi_d = material.lattice.shape
    bins = np.array([c["bins"] for c in found])
    assert np.array_equal(bins @ [theta_d * phi_d, phi_d, 1], material.lattice.cell(*angles))
    assert node(MATERIALS["nodes.smrl"], "smrl")["cells"][0]["bins"] is None


def check_same_table(found, material):
    assert np.array_equal(np.array(found, np.uint32).reshape(12, -1), HalfVectorSampler.fitted(material).table)


@pytest.mark.parametrize("name", ["cells.smrl", "nodes-2-both.smrl", "nodes-2-neither.smrl"])
def test_the_table_of_the_sampler(node, name):
    found = node(MATERIALS[name], "smrl", sampler=True)["table"]
    check_same_table(found, decode(MATERIALS[name]))
    must_fail(check_same_table, found, decode(MATERIALS["nodes.smrl"]))
