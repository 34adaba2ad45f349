"""Meshes: from files, and made from formulas, so that every scene renders with no download."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..system import door
from ..system.errors import FormatError
from .llvm import mitsuba

LARGEST_FILE = 2**30  # bytes
HEADER_BYTES = 2**16  # of a PLY file
SHORTEST = 1e-3  # normal that has a direction
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """Triangles with smooth normals, which point outwards: the side that reflects.

    positions, normals: (n, 3), y up. faces: (m, 3), numbers of vertices, anticlockwise from outside. found: what a file
    lacked and was made up for, in one sentence; "" for nothing.
    """

    name: str
    positions: NDArray[np.float32]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float32]
    found: str = ""

    def standing(self, size: float = 1.0) -> Mesh:
        """The same mesh on the plane y = 0, its bounding box about the y axis and scaled so that its longest side,
        which is the height of a statue, is `size`."""
        low, high = self.positions.min(axis=0).astype(float), self.positions.max(axis=0).astype(float)
        foot = (low + high) / 2 * [1, 0, 1] + low * [0, 1, 0]
        positions = (self.positions - foot) * (size / (high - low).max())
        return replace(self, positions=positions.astype(np.float32))

    def turned(self, degrees: float) -> Mesh:
        """The same mesh, turned about the y axis, anticlockwise from above."""
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]], np.float32)
        return replace(self, positions=self.positions @ turn.T, normals=self.normals @ turn.T)

    def moved(self, x: float, y: float, z: float) -> Mesh:
        """The same mesh elsewhere."""
        return replace(self, positions=self.positions + np.array([x, y, z], np.float32))

    def shape(self, bsdf: Any) -> Any:
        """A Mitsuba shape."""
        mi = mitsuba()
        properties = mi.Properties()
        properties["mesh_bsdf"] = bsdf
        sizes = len(self.positions), len(self.faces)
        mesh = mi.Mesh(self.name, *sizes, props=properties, has_vertex_normals=True, has_vertex_texcoords=False)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = self.positions.ravel()
        parameters["vertex_normals"] = self.normals.ravel()
        parameters["faces"] = self.faces.ravel()
        parameters.update()
        return mesh


def load_mesh(path: Path) -> Mesh:
    """The mesh in a Wavefront OBJ or a PLY file, of triangles.

    Normals that are missing are computed, and a mesh that is inside out is turned. Raises FormatError for any other
    file, and for one that has no surface, no height or vertices that are not numbers.
    """
    with door.opened(path, "a mesh") as file:
        kind = path.suffix.lower().removeprefix(".")
        if kind not in ("obj", "ply"):
            raise FormatError(f"{path}: expected a mesh in a file named .obj or .ply, found {path.suffix!r}")
        data = file.read(LARGEST_FILE)
    positions, faces, normals = _read(path, kind, data)
    if not len(faces):
        raise FormatError(f"{path}: expected triangles, found none")
    if not np.isfinite(positions).all():
        raise FormatError(f"{path}: expected finite coordinates, found others")
    if faces.max() >= len(positions):
        raise FormatError(f"{path}: expected faces of {len(positions)} vertices, found vertex number {faces.max()}")
    if not np.ptp(positions[:, 1]) > 0:
        raise FormatError(f"{path}: expected a mesh that has a height along y, found a flat one")
    notes: list[str] = []
    computed = normals is None or not (np.abs(normals).max(axis=-1) > SHORTEST).all()  # nor is NaN, which stays NaN
    if normals is None or computed:
        normals = vertex_normals(positions, faces)
        notes.append("it has no vertex normals: they are computed from its faces")
    if _volume(positions, faces) < 0:
        faces = faces[:, ::-1]
        notes.append("its faces are inside out: they are turned")
    if _agreement(positions, faces, normals) < 0:
        normals = -normals
        if not computed:
            notes.append("its vertex normals point inwards: they are turned")
    found = f"{path}: {', and '.join(notes)}" if notes else ""
    return Mesh("mesh", positions, faces, normals, found)


def _read(
    path: Path, kind: str, data: bytes
) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32] | None]:
    """Positions, faces, and normals if the file has them, by Mitsuba's readers."""
    mi = mitsuba()
    if kind == "ply":
        _check_counts(path, data)
    given = _has_normals(data, kind)
    try:
        with door.copied(data, f".{kind}") as copy:
            # Left to itself, Mitsuba computes normals that are missing before anybody has looked at the faces.
            mesh = mi.load_dict({"type": kind, "filename": str(copy), "face_normals": not given})
        parameters = mi.traverse(mesh)
        positions = np.array(parameters["vertex_positions"], np.float32).reshape(-1, 3)
        faces = np.array(parameters["faces"], np.uint32).reshape(-1, 3)
        normals = np.array(parameters["vertex_normals"], np.float32).reshape(-1, 3) if given else None
    except FormatError:
        raise
    except Exception as error:  # of many kinds, as UnicodeDecodeError where its own sentence quotes the file
        raise FormatError(f"{path}: expected a mesh of triangles, found something unreadable") from error
    return positions, faces, normals if normals is None or normals.shape == positions.shape else None


def _check_counts(path: Path, data: bytes) -> None:
    """Raises FormatError if a PLY file says that it holds more than it can: Mitsuba would make room for all of it."""
    if b"end_header" not in data[:HEADER_BYTES]:
        raise FormatError(f"{path}: expected a PLY file's head within {HEADER_BYTES} bytes, found none")
    for count in re.findall(rb"^\s*element\s+\S+\s+(\S+)", _head(data), re.MULTILINE):
        if not (count.isdigit() and len(count) < 20 and int(count) <= len(data)):
            found = f"{count[:20].decode('ascii', 'replace')} in {len(data)} bytes"
            raise FormatError(f"{path}: expected a mesh with as many elements as it says, found {found}")


def _has_normals(data: bytes, kind: str) -> bool:
    """Whether all faces name normals (OBJ), or all vertices have some (PLY). Others, Mitsuba would leave undefined."""
    if kind == "obj":
        words = (line.split(None, 2) for line in io.BytesIO(data))
        corners = [found[1] for found in words if found[:1] == [b"f"] and len(found) > 1]
        return bool(corners) and all(len(corner.split(b"/")) == 3 for corner in corners)
    return b" nx\n" in _head(data).replace(b"\r", b"")


def _head(data: bytes) -> bytes:
    """The lines of a PLY file before its data."""
    return data[:HEADER_BYTES].partition(b"end_header")[0]


def vertex_normals(positions: NDArray[np.float32], faces: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Unit normals (n, 3) of vertices: the mean of their faces', by the faces' areas. (0, 1, 0) where there is none.

    Vertices at one place, as where texture coordinates have a seam, get the same.
    """
    _, place = np.unique(positions, axis=0, return_inverse=True)
    place = place.reshape(-1)
    corners, of_faces, count = place[faces], _face_normals(positions, faces), int(place.max()) + 1
    sums = [sum(np.bincount(corners[:, k], of_faces[:, j], count) for k in range(3)) for j in range(3)]
    normals = np.stack(sums, axis=-1)[place]
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.where(length > 0, normals / np.where(length > 0, length, 1), [0.0, 1.0, 0.0]).astype(np.float32)


def _face_normals(positions: NDArray[np.float32], faces: NDArray[np.uint32]) -> Floats:
    """Of each face, twice its area long."""
    a, b, c = (positions[faces[:, k]].astype(np.float64) for k in range(3))
    return np.cross(b - a, c - a)


def _agreement(positions: NDArray[np.float32], faces: NDArray[np.uint32], normals: NDArray[np.float32]) -> float:
    """How far normals are on the side that faces are anticlockwise from: negative if most are on the other."""
    of_corners = normals[faces].astype(np.float64).sum(axis=1)
    return float((_face_normals(positions, faces) * of_corners).sum())


def _volume(positions: NDArray[np.float32], faces: NDArray[np.uint32]) -> float:
    """The signed volume: positive if faces are anticlockwise from outside."""
    corners = positions[faces[:, 0]].astype(np.float64) - positions.mean(axis=0)
    return float((corners * _face_normals(positions, faces)).sum() / 6)


def lathe(
    name: str,
    outline: list[tuple[float, float]],
    *,
    rows: int,
    columns: int,
    relief: Callable[[Floats, Floats], Floats] | None = None,
) -> Mesh:
    """A closed surface of revolution about the y axis.

    outline: control points (radius, height) of a quadratic B-spline, from the lower end of the axis to the upper one;
    a point given twice makes a sharper edge. relief: how far the surface is moved along its normal, at heights y and
    azimuths φ [rad].
    """
    curve = _resampled(_rounded(np.array(outline, float)), rows + 1)
    tangent = np.gradient(curve, axis=0)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    phi = np.arange(columns) / columns * 2 * np.pi
    rim = curve[1:-1, None] + np.zeros((1, columns, 1))
    if relief:
        outward = np.stack([tangent[1:-1, 1], -tangent[1:-1, 0]], axis=-1)[:, None]
        rim = rim + outward * relief(rim[..., 1], phi[None, :])[..., None]
    around = np.stack([rim[..., 0] * np.cos(phi), rim[..., 1], -rim[..., 0] * np.sin(phi)], axis=-1)
    poles = [[0, curve[0, 1], 0]], [[0, curve[-1, 1], 0]]
    positions = np.concatenate([poles[0], around.reshape(-1, 3), poles[1]])
    number = 1 + np.arange((rows - 1) * columns).reshape(rows - 1, columns)
    low, high = number[:1], number[-1:]
    fans = [np.stack([0 * low, np.roll(low, -1, 1), low], -1), np.stack([high, np.roll(high, -1, 1), 0 * high], -1)]
    fans[1][..., 2] = len(positions) - 1
    return _mesh(name, positions, [*_quads(number, closed=False), *fans])


def knot(name: str, *, rows: int = 800, columns: int = 60) -> Mesh:
    """A trefoil of a rope of five strands, upright, about 2 high: smooth, curved all ways, and it reflects itself."""
    t = (np.arange(rows) / rows * 2 * np.pi)[:, None]
    theta = np.arange(columns) / columns * 2 * np.pi

    def along(t: Floats) -> Floats:
        r = 0.62 + 0.27 * np.cos(3 * t)
        return np.concatenate([r * np.cos(2 * t), r * np.sin(2 * t), 0.3 * np.sin(3 * t)], axis=-1)

    centre, tangent = along(t), along(t + 1e-5) - along(t - 1e-5)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    # The normal of the torus that the knot winds about: unlike a frame carried along, it closes.
    ring = 0.62 * np.concatenate([np.cos(2 * t), np.sin(2 * t), 0 * t], axis=-1)
    normal = centre - ring
    normal -= (normal * tangent).sum(axis=-1, keepdims=True) * tangent
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    side = np.cross(tangent, normal)
    radius = 0.15 * (1 + 0.13 * np.cos(5 * theta + 22 * t))[..., None]
    spokes = np.cos(theta)[:, None] * normal[:, None] + np.sin(theta)[:, None] * side[:, None]
    positions = (centre[:, None] + radius * spokes).reshape(-1, 3)
    return _mesh(name, positions, _quads(np.arange(rows * columns).reshape(rows, columns), closed=True))


def _quads(number: NDArray[np.int64], *, closed: bool) -> list[NDArray[np.int64]]:
    """Triangles of a grid of vertices that is closed in its columns, and maybe in its rows."""
    if closed:
        number = np.concatenate([number, number[:1]])
    a, b = number[:-1], number[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    return [np.stack([a, c, d], axis=-1), np.stack([a, d, b], axis=-1)]


def _mesh(name: str, positions: Floats, faces: list[NDArray[np.int64]]) -> Mesh:
    points = positions.astype(np.float32)
    triangles = np.concatenate([face.reshape(-1, 3) for face in faces]).astype(np.uint32)
    return Mesh(name, points, triangles, vertex_normals(points, triangles))


def _rounded(points: Floats, times: int = 5) -> Floats:
    """The curve that cutting corners off a polygon leads to (Chaikin 1974), its ends kept."""
    for _ in range(times):
        a, b = points[:-1], points[1:]
        cut = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1).reshape(-1, 2)
        points = np.concatenate([points[:1], cut[1:-1], points[-1:]])
    return points


def _resampled(points: Floats, count: int) -> Floats:
    """So many points at equal steps along a polygon."""
    length = np.append(0, np.linalg.norm(np.diff(points, axis=0), axis=-1).cumsum())
    at = np.linspace(0, float(length[-1]), count)
    return np.stack([np.interp(at, length, points[:, k]) for k in range(2)], axis=-1)
