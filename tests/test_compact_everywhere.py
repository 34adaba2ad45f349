"""A compact material, from its file, in every command, exporter and renderer."""

import subprocess

import numpy as np
import pytest
from helpers import compact_material, must_fail, random_directions, run, run_json, tool

from sommerl import MERL, BrdfTable, load, save
from sommerl.formats import merl, rgl
from sommerl.reflectance.nodes import NodeLattice
from sommerl.render.bsdf import make_bsdf, register, snippet
from sommerl.render.llvm import drjit, mitsuba
from sommerl.system.errors import MaterialError

LATTICE = NodeLattice((0, 60, 120, 180), (0, 0, 1, 1), ((0, 60, 180), (0, 180)), ((0, 90), (0,)))
SMALL_PICTURE = ["--size", "24", "--spp", "4"]
A, B = random_directions(10_000, 1), random_directions(10_000, 2)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("materials") / "tiny.smrl"
    save(compact_material(LATTICE, 5, 4, name="tiny"), path)
    return path


def test_info(capsys, path):
    found = run_json(capsys, "info", path)
    assert (found["kind"], found["name"], found["domain"]) == ("som-man", "tiny", "cube-root")
    assert (found["lattice"], found["nodes"], found["interpolation"]) == ([4, 3, 2], LATTICE.size, "trilinear")
    material = load(path)
    assert (found["clusters"], found["bytes_paper"]) == (9, 4 * LATTICE.size + 24 * 9)
    assert (found["bytes_memory"], found["bytes_disk"]) == (material.bytes_memory, path.stat().st_size)
    status, out, _ = run(capsys, "info", path)
    assert status == 0
    assert "4 × 3 × 2" in out
    assert "cube-root" in out
    assert run_json(capsys, "info", "nickel")["nodes"] is None


def check_metrics(result, first, second):
    assert result["table_relative_error"] == pytest.approx(np.linalg.norm(second - first) / np.linalg.norm(first))


@pytest.mark.parametrize("order", [1, -1])
def test_compare(capsys, path, tmp_path, order):
    names = [path, "nickel"][::order]
    result = run_json(capsys, "compare", *names, *SMALL_PICTURE, "-o", tmp_path / "both.png")
    values = [BrdfTable.sampled(load(name)).values[MERL.above_horizon] for name in names]
    check_metrics(result, *values)
    must_fail(check_metrics, result, *values[::-1])
    assert result["psnr_object_db"] < 60
    assert {result["reference"], result["candidate"]} == {"tiny (trilinear)", "nickel (SGD stand-in) (formula)"}


def test_compare_with_itself_and_with_a_table_of_it(capsys, path, tmp_path):
    assert run_json(capsys, "compare", path, path, *SMALL_PICTURE)["psnr_frame_db"] is None
    run_json(capsys, "convert", path, tmp_path / "x.binary")
    result = run_json(capsys, "compare", path, tmp_path / "x.binary", *SMALL_PICTURE)
    assert result["table_relative_error"] < 1e-9
    assert result["candidate"] == "x (trilinear)"


def test_render(capsys, path, tmp_path):
    for extension in ("png", "exr"):
        output = tmp_path / f"x.{extension}"
        result = run_json(capsys, "render", path, "-o", output, *SMALL_PICTURE)
        assert (result["image"], result["material"]) == (str(output), "tiny (trilinear)")
        assert output.stat().st_size > 0


def check_only_trilinear(status, message):
    assert (status, message.count("\n")) == (1, 1)
    assert "tiny: expected trilinear interpolation between nodes, found nearest" in message


def test_there_is_no_nearest_node(capsys, path, tmp_path):
    with pytest.raises(MaterialError, match="tiny: expected trilinear interpolation between nodes, found nearest"):
        load(path).with_interpolation("nearest")
    for command in (["render", path, "-o", tmp_path / "x.png"], ["compare", path, "nickel"]):
        status, out, message = run(capsys, *command, *SMALL_PICTURE, "--lookup", "nearest")
        check_only_trilinear(status, message)
        assert out == ""
        status, _, message = run(capsys, *command, *SMALL_PICTURE, "--lookup", "trilinear")
        must_fail(check_only_trilinear, status, message)
    assert load(path).with_interpolation("trilinear").lattice == LATTICE


def check_cells(table, brdf):
    expected = BrdfTable.sampled(brdf).values
    above = MERL.above_horizon
    assert np.allclose(table.values[above], expected[above], rtol=1e-14, atol=0)


def test_merl(capsys, path, tmp_path):
    result = run_json(capsys, "convert", path, tmp_path / "x.binary")
    assert (result["bytes_disk"], result["cells_clamped"]) == (34_992_012, 0)
    table, brdf = merl.read(tmp_path / "x.binary"), load(path)
    check_cells(table, brdf)
    must_fail(check_cells, table, compact_material(LATTICE, 4, 4))


def check_close(found, expected):
    assert np.median(np.abs(found - expected) / (expected + 1e-3)) < 0.02


def test_rgl(capsys, path, tmp_path):
    run_json(capsys, "convert", path, tmp_path / "x.bsdf")
    away = np.minimum(A[:, 2], B[:, 2]) > 0.1
    found, expected = (brdf.eval(A[away], B[away]) for brdf in (rgl.read(tmp_path / "x.bsdf"), load(path)))
    check_close(found, expected)
    must_fail(check_close, found, expected[::-1])


@pytest.mark.parametrize("extension", ["h", "hpp", "glsl", "hlsl", "metal", "wgsl"])
def test_source_code(capsys, path, tmp_path, extension):
    output = tmp_path / f"x.{extension}"
    result = run_json(capsys, "convert", path, output)
    assert result["bytes_disk"] == output.stat().st_size < 52_000
    assert all(f"material_x_{function}(" in output.read_text() for function in ("eval", "sample", "pdf"))


def check_printed(text, brdf):
    assert np.allclose(list(map(float, text.split())), brdf.eval([0.6, 0, 0.8], [0, 0, 1]), rtol=1e-5)


def test_source_code_of_what_was_loaded(capsys, path, tmp_path):
    run_json(capsys, "convert", path, tmp_path / "x.h")
    program = '#include "x.h"\n#include <cstdio>\nint main() { auto f = material_x_eval({0.6, 0, 0.8}, {0, 0, 1}); '
    program += 'std::printf("%.17g %.17g %.17g", f.x, f.y, f.z); }'
    (tmp_path / "main.cpp").write_text(program)
    subprocess.run([tool("g++"), "-std=c++11", "main.cpp", "-o", "main"], cwd=tmp_path, check=True)
    found = subprocess.run(tmp_path / "main", check=True, capture_output=True, text=True).stdout
    check_printed(found, load(path))
    must_fail(check_printed, found, compact_material(LATTICE, 4, 4))


def evaluated(bsdf):
    """f_r of a Mitsuba BSDF at A and B."""
    mi, dr = mitsuba(), drjit()
    si = dr.zeros(mi.SurfaceInteraction3f, len(A))
    si.wi, si.sh_frame = mi.Vector3f(*B.T), mi.Frame3f(mi.Vector3f(0, 0, 1))
    return np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(*A.T))).T / A[:, 2:]


def check_agrees_with_numpy(found, brdf):
    assert np.allclose(found, brdf.eval(A, B), rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("extension", ["json", "xml"])
def test_mitsuba(capsys, path, tmp_path, extension):
    mi = mitsuba()
    register()
    run_json(capsys, "convert", path, tmp_path / f"x.{extension}")
    if extension == "json":
        bsdf = mi.load_dict(snippet(tmp_path / "x.json"))
    else:
        shape = '<shape type="sphere"><ref id="x"/></shape>'
        (tmp_path / "scene.xml").write_text(f'<scene version="3.0.0"><include filename="x.xml"/>{shape}</scene>')
        bsdf = mi.load_file(str(tmp_path / "scene.xml")).shapes()[0].bsdf()
    check_agrees_with_numpy(evaluated(bsdf), load(path))
    must_fail(check_agrees_with_numpy, evaluated(make_bsdf(compact_material(LATTICE, 4, 4))), load(path))


def test_mitsuba_is_told_that_there_is_no_nearest_node(path):
    register()
    with pytest.raises(Exception, match="tiny: expected trilinear interpolation between nodes, found nearest"):
        mitsuba().load_dict({"type": "sommerl", "filename": str(path), "interpolation": "nearest"})


def test_a_compressed_material_is_copied_as_it_is(capsys, path, tmp_path):
    assert run(capsys, "convert", path, tmp_path / "other.smrl")[0] == 0
    assert (tmp_path / "other.smrl").read_bytes() == path.read_bytes()


def test_a_name_cannot_give_orders_to_a_terminal(tmp_path):
    save(compact_material(LATTICE, 5, 4, name="\x1b]0;evil\x07\nx"), tmp_path / "x.smrl")
    assert load(tmp_path / "x.smrl").name == "�]0;evil� x"
