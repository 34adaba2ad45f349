"""Sheets: the pictures of many materials in one film are those that each has alone."""

import numpy as np
import pytest
from compact import FOLDS
from helpers import must_fail, run, run_json
from histograms import check_same_image

from sommerl import SomManBrdf, save
from sommerl.commands import render as command
from sommerl.compression.atlas import Atlas
from sommerl.compression.palette import GainsAndShapes
from sommerl.compression.smrl.codes import coordinates, gain_codes, gain_values, shape_codes, shape_values
from sommerl.reflectance.nodes import NodeLattice
from sommerl.render import sheet
from sommerl.render.bsdf import make_atlas_bsdf
from sommerl.render.environment import default_environment
from sommerl.render.frame import Image
from sommerl.render.llvm import mitsuba
from sommerl.render.passes import render
from sommerl.render.scenes import sphere, spheres
from sommerl.render.sheet import Frames, frame_number, sheets
from sommerl.system.errors import MaterialError

mitsuba()


def paint(folds, colour):
    """A glossy material of that colour."""
    rows, angles = (0, 20, 60, 120, 180), (0, 60, 180)
    lattice = NodeLattice(rows, (0,) * len(rows), (angles,), ((0,),), **folds)
    gain = np.repeat(np.array([2, 1, 0, 0, 0], np.uint16), len(angles))
    gains = gain_values(gain_codes(np.array([0.6, 0.9, 1.4])))
    shapes = shape_values(shape_codes(coordinates(np.array([colour]))))
    palette = GainsAndShapes(gains, shapes, 0.05, smooth=True)
    return SomManBrdf(palette, np.stack([gain, 0 * gain]), lattice, name="paint")


SIZE, BATCHES = 12, 8
COLOURS = (1.5, 1.0, 0.5), (0.6, 0.9, 1.5), (1.0, 1.0, 1.0)
PAINTS = [paint(FOLDS[name], colour) for name, colour in zip(("both", "neither", "both"), COLOURS, strict=True)]


def check_covers(found, count, size):
    """Each frame is in one sheet; no sheet but the last has more than there are, or more pixels than fit."""
    numbers = [number for each in found for number in range(each.first, each.first + each.count)]
    assert numbers[:count] == list(range(count))
    assert len({each.count for each in found}) == 1
    assert len(numbers) - count < len(found)
    assert found[0].count == 1 or found[0].count * size**2 <= sheet.MOST_PIXELS
    assert found[0].count <= sheet.MOST_FRAMES


@pytest.mark.parametrize(("count", "size"), [(1, 8), (2, 2048), (257, 16), (1000, 128), (1001, 128), (1000, 256)])
def test_sheets_hold_all_frames(count, size):
    check_covers(sheets(count, size), count, size)
    must_fail(check_covers, sheets(count, size)[1:], count, size)
    must_fail(check_covers, [Frames(each.first, each.count + 1) for each in sheets(count, size)], count, size)


def pictures(made):
    """Renders of a sheet, (batches, frames, size, size, 3), and its frames."""
    scene = spheres(make_atlas_bsdf(made, frame_number()), 0, len(made), default_environment(), size=SIZE)
    images = [render(scene, spp=16, seed=seed) for seed in range(BATCHES)]
    frames = [Frames(0, len(made)).cut(image) for image in images]
    return np.array([[frame.pixels for frame in each] for each in frames]), frames[0]


def test_each_frame_is_the_picture_of_its_material_alone():
    """In each pixel, within what noise explains."""
    found, frames = pictures(Atlas(PAINTS))
    for number, material in enumerate(PAINTS):
        scene = sphere(material, default_environment(), size=SIZE)
        alone = [render(scene, spp=16, seed=1000 + seed) for seed in range(BATCHES)]
        seen, pixels = alone[0].mask, np.array([image.pixels for image in alone])
        check_same_image(found[:, number][:, seen], pixels[:, seen], len(PAINTS))
        must_fail(check_same_image, found[:, number - 1][:, seen], pixels[:, seen], len(PAINTS))
        assert np.array_equal(frames[number].mask, seen)


def test_frames_are_cut_in_order():
    image = Image(np.arange(36, dtype=np.float32).reshape(6, 2, 3), np.arange(12).reshape(6, 2) % 2 == 0)
    frames = Frames(0, 3).cut(image)
    assert np.array_equal(np.concatenate([frame.pixels for frame in frames]), image.pixels)
    assert [frame.mask.shape for frame in frames] == [(2, 2)] * 3


# --- the command


@pytest.fixture
def files(tmp_path):
    for k in range(3):
        save(PAINTS[k], tmp_path / f"{k}.smrl")
    return [tmp_path / f"{k}.smrl" for k in range(3)]


def test_a_grid_of_compact_materials_is_rendered_from_an_atlas(capsys, monkeypatch, files, tmp_path):
    """In two sheets, of two frames each."""
    monkeypatch.setattr(sheet, "MOST_FRAMES", 2)
    monkeypatch.setattr(command, "_columns", lambda count: count)
    path = tmp_path / "grid.exr"
    result = run_json(capsys, "render", "--scene", "grid", *files, "-o", path, "--size", SIZE, "--spp", 4)
    assert len(result["materials"]) == 3
    pixels = np.array(mitsuba().Bitmap(str(path)))
    bsdf = make_atlas_bsdf(Atlas(PAINTS), frame_number())
    parts = [spheres(bsdf, first, 2, default_environment(), size=SIZE) for first in (0, 2)]
    frames = [frame.pixels for part in parts for frame in Frames(0, 2).cut(render(part, spp=4))]
    assert np.array_equal(pixels, np.concatenate(frames[:3], axis=1))
    assert not np.array_equal(frames[2], frames[0])
    assert np.allclose(frames[2].mean(), frames[3].mean(), rtol=0.2)  # one too many: the last material again


@pytest.mark.parametrize("others", [["nickel"], ["--sampler", "cosine"], ["--against", "nickel"]])
def test_what_cannot_be_in_one_atlas_is_rendered_one_by_one(capsys, monkeypatch, files, tmp_path, others):
    ways = []

    def instead(way):
        def stop(*_):
            ways.append(way)
            raise MaterialError("far enough")

        return stop

    def check_way(way, *arguments):
        run(capsys, "render", *arguments, "-o", tmp_path / "x.exr")
        assert ways.pop() == way

    monkeypatch.setattr(command, "_rendered", instead("one by one"))
    monkeypatch.setattr(command, "_rendered_together", instead("together"))
    check_way("one by one", "--scene", "grid", *files, *others)
    check_way("together", "--scene", "grid", *files)
    must_fail(check_way, "one by one", "--scene", "grid", *files)
    check_way("one by one", "--scene", "grid", files[0])
    check_way("one by one", "--scene", "still-life", *files)
