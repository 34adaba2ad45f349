"""Pictures of palettes, of how often their entries are used, and of how often cells are hit."""

import numpy as np
import pytest
from compact import material as compact
from helpers import must_fail
from pictures import ODD, drawn, palette_material

from sommerl import MERL, BrdfTable, Lattice, SomManBrdf, plots
from sommerl.plots import lattice_hits
from sommerl.plots.tone import Tone
from sommerl.reflectance.half_diff import half_diff, spherical

# Palettes


def check_palette(ax, lut):
    pixels = ax.get_images()[0].get_array()
    shown = pixels[pixels[..., 3] == 255]
    ordered = lut[np.argsort(lut.sum(1))]
    assert len(shown) == len(lut)
    assert np.array_equal(shown[:, :3], Tone.of(lut).srgb8(ordered))


@pytest.mark.parametrize("entries", [1, 2, 10, 16, 256])
def test_swatches_are_the_luts_entries(entries):
    material = palette_material(entries)
    ax = drawn(plots.palette, material)
    check_palette(ax, material.lut)
    must_fail(check_palette, ax, 1.5 * material.lut[:, ::-1] + 0.1)
    must_fail(check_palette, ax, material.lut[1:])


def check_products(ax, material):
    """Of each pair that a node has, its colour, in the shape's column and the row of the gain; nothing else."""
    pixels = ax.get_images()[0].get_array()
    assert pixels.shape == (len(material.palette.gains), len(material.lut), 4)
    rank = np.argsort(np.argsort(-material.palette.gains, kind="stable"))
    pairs = set(zip(rank[material.index[0]].tolist(), material.index[1].tolist(), strict=True))
    assert pairs == set(zip(*(axis.tolist() for axis in np.nonzero(pixels[..., 3])), strict=True))
    y = material.palette.gains[:, None, None] * material.lut
    f_r = material.palette.scale * np.maximum(y, 0)[np.argsort(rank)] ** 3
    used = pixels[..., 3] == 255
    assert np.array_equal(pixels[used][:, :3], Tone.of(f_r[used]).srgb8(f_r[used]))


def test_a_compact_palette_is_gains_times_shapes():
    material = compact("smooth")
    ax = drawn(plots.palette, material)
    check_products(ax, material)
    must_fail(check_products, ax, compact("smooth", 1))


def bars(ax):
    return [patch.get_data().values for patch in ax.patches]


def check_usage(ax, material):
    (counts,) = bars(ax)
    above = material.lattice.above_horizon
    assert counts.sum() == above.sum()
    order = np.argsort(material.lut.sum(1))
    assert [int(count) for count in counts] == [int((material.index[above] == entry).sum()) for entry in order]


def test_the_uses_of_entries_add_up_to_the_cells():
    material = palette_material()
    ax = drawn(plots.usage, material)
    check_usage(ax, material)
    moved = SomManBrdf(material.lut, np.roll(material.index, 1, axis=1), ODD, name="moved")
    must_fail(check_usage, ax, moved)
    nodes = compact("smooth")
    shapes, gains = bars(drawn(plots.usage, nodes))
    assert shapes.sum() == gains.sum() == nodes.lattice.size
    assert np.array_equal(shapes, np.bincount(nodes.index[1], minlength=len(nodes.lut)))
    assert np.array_equal(gains, np.bincount(nodes.index[0], minlength=len(nodes.palette.gains)))


# The hits of Fig. 2


def check_hits(counts, lattice, thetas, phis):
    """Against all pairs, one by one."""
    theta = (np.arange(thetas) + 0.5) * np.pi / 2 / thetas
    phi = np.arange(phis) * 2 * np.pi / phis
    theta_i, phi_i, theta_o, phi_o = np.meshgrid(theta, phi, theta, phi, indexing="ij")
    cell = lattice.cell(*half_diff(spherical(theta_i, phi_i), spherical(theta_o, phi_o), lattice.reciprocal))
    reference = np.bincount(cell.ravel(), minlength=lattice.size).reshape(lattice.shape)
    assert counts.sum() == reference.sum() == (thetas * phis) ** 2
    # Those on the edge of a cell may fall to either side.
    assert abs(counts - reference).sum() <= 0.05 * reference.sum()


@pytest.mark.parametrize("lattice", [Lattice(7, 7, 11), Lattice(7, 7, 13, reciprocal=False)])
def test_hits_are_of_all_pairs(lattice, monkeypatch):
    monkeypatch.setattr(lattice_hits, "THETA_STEPS", 10)
    monkeypatch.setattr(lattice_hits, "PHI_STEPS", 24)
    counts = plots.hit_counts(lattice)
    check_hits(counts, lattice, 10, 24)
    must_fail(check_hits, np.roll(counts, 1, axis=1), lattice, 10, 24)
    must_fail(check_hits, counts // 24, lattice, 10, 24)


def test_hits_are_the_papers():
    """The share of cells that are hit: 28.4 %, as we know it from another implementation."""
    counts = plots.hit_counts(MERL)
    assert counts.sum() == (90 * 180) ** 2
    assert (counts > 0).mean() == pytest.approx(0.284, abs=0.0005)
    (rows,) = bars(drawn(plots.hits, BrdfTable(np.ones((*MERL.shape, 3)))))
    assert rows.sum() == (90 * 180) ** 2
    assert np.array_equal(rows, counts.sum(axis=2).ravel())
