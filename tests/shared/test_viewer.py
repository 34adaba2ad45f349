"""The viewer's readers and shaders on measured data, and on cases of hostile files."""

from pathlib import Path

import numpy as np
import pytest
import shader_page
from helpers import must_fail, random_directions
from in_node import program
from scipy.ndimage import map_coordinates
from shader_page import check_interpolated

from sommerl.formats import rgl
from sommerl.render.llvm import mitsuba

SHARED = Path(__file__).resolve().parents[3] / "shared"
RGL = sorted((SHARED / "data" / "rgl").glob("*.bsdf"))
PAINTS = sorted((SHARED / "data" / "mdl").glob("*.mbsdf"))
A, B = (random_directions(1000, seed) for seed in (1, 2))
ANSWER = """
import { evaluate } from "./evaluate.js";
import { readEnvironment } from "./images.js";
import { read, sentence } from "./readers.js";
async function answer({ wi, wo, file, environment, ...how }) {
    const start = performance.now();
    const seconds = () => (performance.now() - start) / 1000;
    try {
        if (environment) {
            const { width, height, pixels } = await readEnvironment(file);
            return { width, height, pixels: Array.from(pixels), seconds: seconds() };
        }
        const material = await read(file, how);
        return { kind: material.kind, f: wi.map((w, i) => evaluate(material, w, wo[i])) };
    } catch (error) {
        return { error: sentence(error), seconds: seconds() };
    }
}
"""


@pytest.fixture(scope="module")
def node(tmp_path_factory):
    run = program(tmp_path_factory.mktemp("js"), ANSWER)
    return lambda path, **how: run([({"wi": A.tolist(), "wo": B.tolist(), **how}, path.read_bytes())])[0]


def check_close(found, wanted, most):
    assert np.abs(found - wanted).max() <= most * np.abs(wanted).max()


@pytest.mark.parametrize("path", RGL, ids=lambda path: path.stem)
def test_rgl(node, path):
    found, wanted = np.array(node(path)["f"]), rgl.read(path).eval(A, B)
    check_close(found, wanted, 1e-9)
    must_fail(check_close, found, rgl.read(path).eval(B, A), 1e-9)


def test_shaders(chromium, tmp_path):
    pairs = [w.astype(np.float32) for w in (A, B)]
    materials = {path.stem: rgl.read(path) for path in RGL}
    with shader_page.shaders(chromium, tmp_path, materials) as shaders:
        for name, made in materials.items():
            found, given = shaders(name, pairs), [w.astype(float) for w in pairs]
            check_interpolated(found, made, given)
            must_fail(check_interpolated, np.roll(found, 1, axis=0), made, given)


@pytest.mark.parametrize("path", PAINTS, ids=lambda path: path.stem)
def test_mbsdf(node, path):
    data = path.read_bytes()
    n, m = 45, 90
    values = np.frombuffer(data[-4 * 3 * n * n * m :], "<f4").reshape(n, n, m, 3)
    theta = [np.arccos(w[:, 2]) * n * 2 / np.pi - 0.5 for w in (A, B)]
    turn = np.abs((np.arctan2(A[:, 1], A[:, 0]) - np.arctan2(B[:, 1], B[:, 0]) + np.pi) % (2 * np.pi) - np.pi)
    at = *theta, turn * m / np.pi - 0.5
    wanted = np.stack(
        [map_coordinates(values[..., c].astype(float), at, order=1, mode="nearest") for c in range(3)], -1
    )
    found = np.array(node(path)["f"])
    check_close(found, wanted, 1e-6)
    must_fail(check_close, found[::-1], wanted, 1e-6)


def test_the_light_probe(node, probe):
    mi, found = mitsuba(), node(probe, environment=True)
    wanted = np.array(mi.Bitmap(str(probe)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    pixels = np.reshape(found["pixels"], (found["height"], found["width"], 3))
    check_close(pixels, wanted, 1e-6)
    must_fail(check_close, pixels[::-1], wanted, 1e-6)


def check_refused(found):
    assert found.get("error")
    assert "damaged or too large" not in found["error"]
    assert found["seconds"] < 1


def test_hostile_files(node):
    check_refused(node(SHARED / "cases" / "hostile" / "bomb-0.smrl", name="x.smrl"))
    check_refused(node(SHARED / "cases" / "hostile" / "envx10.exr", environment=True))
    check_refused(node(RGL[0], format="merl"))
    must_fail(check_refused, node(RGL[0]))
