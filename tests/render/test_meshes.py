from dataclasses import replace

import numpy as np
import pytest
from helpers import check_sentence, complaint, must_fail

from sommerl.render import scenes
from sommerl.render.meshes import knot, lathe, load_mesh, vertex_normals
from sommerl.system.errors import FormatError

MADE = {
    "finial": scenes.finial,
    "ball": scenes.material_ball,
    "bowl": scenes.bowl,
    "vase": scenes.vase,
    "knot": lambda: knot("knot"),
}
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
OUTWARD = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
NORMALS = np.array([[-1, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) / np.array([[3**0.5], [1], [1], [1]])
HEADER = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"


def obj(faces, normals=None):
    lines = [f"v {x} {y} {z}" for x, y, z in TETRAHEDRON]
    if normals is not None:
        lines += [f"vn {x} {y} {z}" for x, y, z in normals]
    corner = "{0}" if normals is None else "{0}//{0}"
    lines += ["f " + " ".join(corner.format(i + 1) for i in face) for face in faces]
    return "\n".join(lines) + "\n"


def ply(faces, normals=None):
    columns = "".join(f"property float {name}\n" for name in ("nx", "ny", "nz")) if normals is not None else ""
    rows = TETRAHEDRON if normals is None else np.hstack([TETRAHEDRON, normals])
    head = HEADER.replace("vertex 3", "vertex 4") + columns
    head += "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    return head + "".join(" ".join(map(str, row)) + "\n" for row in [*rows, *(["3", *face] for face in faces)])


def check_closed_and_outward(positions, faces, normals):
    """Every edge has two faces, which run along it in opposite directions; normals agree with the faces."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    forwards, backwards = edges @ [len(positions), 1], edges[:, ::-1] @ [len(positions), 1]
    assert np.array_equal(np.sort(forwards), np.sort(backwards))
    assert len(np.unique(forwards)) == len(forwards)
    a, b, c = (positions[faces[:, k]].astype(float) for k in range(3))
    normal = np.cross(b - a, c - a)
    assert np.einsum("ij,ij->", a, normal) > 0
    assert np.allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-5)
    assert (np.einsum("ij,ij->i", normal, normals[faces[:, 0]].astype(float)) > 0).mean() > 0.995


def check_is_the_tetrahedron(mesh):
    """Its vertices, in whatever order, with its normals."""
    order = np.lexsort(mesh.positions.T[::-1])[[0, 3, 2, 1]]
    assert np.allclose(mesh.positions[order], TETRAHEDRON)
    assert np.allclose(mesh.normals[order], NORMALS)


@pytest.mark.parametrize("name", MADE)
def test_made_ones_are_closed_smooth_and_outward(name):
    mesh = MADE[name]()
    assert 20_000 <= len(mesh.faces) <= 100_000
    check_closed_and_outward(mesh.positions, mesh.faces, mesh.normals)
    must_fail(check_closed_and_outward, mesh.positions, mesh.faces[1:], mesh.normals)
    must_fail(check_closed_and_outward, mesh.positions, mesh.faces[:, ::-1], mesh.normals)
    must_fail(check_closed_and_outward, mesh.positions, mesh.faces, -mesh.normals)


def test_a_turned_ball_is_a_ball():
    angle = np.linspace(0, np.pi, 60)
    mesh = lathe("ball", list(zip(np.sin(angle), -np.cos(angle), strict=True)), rows=100, columns=100)
    assert np.allclose(np.linalg.norm(mesh.positions, axis=-1), 1, atol=2e-3)
    assert np.allclose(mesh.normals, mesh.positions, atol=0.03)


def test_standing_turning_and_moving():
    mesh = knot("knot").moved(3, -7, 2).standing(2.0)
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    assert np.allclose([low[1], high[1]], [0, 2], atol=1e-5)
    assert np.allclose((low + high)[[0, 2]], 0, atol=1e-5)
    turned = mesh.turned(90)
    assert np.allclose(turned.positions, mesh.positions[:, [2, 1, 0]] * [1, 1, -1], atol=1e-5)
    check_closed_and_outward(turned.positions, turned.faces, turned.normals)


@pytest.mark.parametrize(("extension", "text"), [("obj", obj), ("ply", ply)])
def test_meshes_from_files(tmp_path, extension, text):
    path = tmp_path / f"mesh.{extension}"
    path.write_text(text(OUTWARD, NORMALS))
    given = load_mesh(path)
    assert given.found == ""
    check_is_the_tetrahedron(given)
    path.write_text(text(OUTWARD))
    computed = load_mesh(path)
    assert "no vertex normals" in computed.found
    check_sentence(computed.found, str(path))
    check_closed_and_outward(computed.positions, computed.faces, computed.normals)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("zero.ply", ply(OUTWARD, 0 * NORMALS)),
        ("no_face.obj", obj(OUTWARD) + "vn 0 0 1\n"),
        ("some_faces.obj", obj(OUTWARD[:2], NORMALS) + obj(OUTWARD[2:]).partition("v 0.0 0.0 1.0\n")[2]),
    ],
)
def test_normals_that_are_none_are_computed(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    mesh = load_mesh(path)
    assert "no vertex normals" in mesh.found
    assert np.allclose(np.linalg.norm(mesh.normals, axis=-1), 1, atol=1e-5)
    assert (mesh.normals * (mesh.positions - 0.25)).sum(axis=-1).min() > 0


def test_inside_out_is_turned(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_text(obj(OUTWARD[:, ::-1], -NORMALS))
    mesh = load_mesh(path)
    assert "inside out" in mesh.found
    check_is_the_tetrahedron(mesh)
    check_closed_and_outward(mesh.positions, mesh.faces, mesh.normals)


def test_normals_on_the_wrong_side_are_turned(tmp_path):
    """Whether it is they or the faces that are on the wrong side."""
    path = tmp_path / "mesh.obj"
    for faces, normals, sentence in (
        (OUTWARD[:, ::-1], NORMALS, "its faces are inside out: they are turned"),
        (OUTWARD, -NORMALS, "its vertex normals point inwards: they are turned"),
    ):
        path.write_text(obj(faces, normals))
        mesh = load_mesh(path)
        assert mesh.found == f"{path}: {sentence}"
        check_is_the_tetrahedron(mesh)
        check_closed_and_outward(mesh.positions, mesh.faces, mesh.normals)


def test_a_seam_of_texture_coordinates_is_smooth():
    mesh = knot("knot", rows=60, columns=20)
    n = len(mesh.positions)
    twice = np.concatenate([mesh.positions, mesh.positions])
    faces = mesh.faces.copy()
    faces[::2] += n  # half of the faces have vertices of their own, at the same places
    found = vertex_normals(twice, faces)
    assert np.allclose(found[:n], mesh.normals, atol=1e-6)
    assert np.allclose(found[n:], mesh.normals, atol=1e-6)


def test_words_may_be_apart_by_tabs(tmp_path):
    path = tmp_path / "mesh.obj"
    path.write_text(obj(OUTWARD, NORMALS).replace("f ", "f\t"))
    assert load_mesh(path).found == ""


def test_wide_and_deep_ones_fit_too():
    for longest in range(3):
        scale = np.array([0.3, 0.3, 0.3], np.float32)
        scale[longest] = 3
        made = knot("knot")
        mesh = replace(made, positions=made.positions * scale).standing()
        size = np.ptp(mesh.positions, axis=0)
        assert size.max() == pytest.approx(1, abs=1e-5)
        assert size.argmax() == longest
        assert mesh.positions[:, 1].min() == pytest.approx(0, abs=1e-6)


BROKEN = {
    "binary.ply": bytes(range(256)) * 9,
    "empty.obj": "",
    "text.obj": "f_r = 0.5\n",
    "no_faces.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "number.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
    "zero.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
    "nan.obj": "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "flat.obj": "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n",
    "empty.ply": "",
    "text.ply": "f_r = 0.5\n",
    "number.ply": HEADER + FACES + "3 0 1 900000000\n",
    "short.ply": HEADER + FACES,
    "quad.ply": HEADER + FACES + "4 0 1 2 0\n",
    "mesh.stl": "solid\n",
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_ones_are_refused_by_one_sentence(tmp_path, name):
    path = tmp_path / name
    content = BROKEN[name]
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    message = complaint(load_mesh, path)
    assert message is not None
    check_sentence(message, str(path))
    must_fail(check_sentence, message + "\n", str(path))


def test_missing_ones_too(tmp_path):
    with pytest.raises(FormatError, match="there is no such file"):
        load_mesh(tmp_path / "none.obj")
    with pytest.raises(FormatError, match="found a directory"):
        load_mesh(tmp_path)
