"""Reads meshes from files, and makes meshes by formula, so that scenes need no download."""

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
HEADER_BYTES = 2**16  # in which the header of a PLY file has to end
SHORTEST = 1e-3  # a shorter normal in a file counts as missing
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """Triangles with smooth normals, which point outwards: the side that reflects.

    positions, normals: (n, 3), y up. faces: (m, 3), numbers of vertices, anticlockwise seen from outside. found: one
    sentence that says what was missing or wrong in the file and was corrected; "" if nothing was.
    """

    name: str
    positions: NDArray[np.float32]
    faces: NDArray[np.uint32]
    normals: NDArray[np.float32]
    found: str = ""

    def standing(self, size: float = 1.0) -> Mesh:
        """The same mesh, standing on the plane y = 0, with its bounding box centred on the y axis, and scaled so that
        the longest side of the box is `size`."""
        low, high = self.positions.min(axis=0).astype(float), self.positions.max(axis=0).astype(float)
        foot = (low + high) / 2 * [1, 0, 1] + low * [0, 1, 0]
        positions = (self.positions - foot) * (size / (high - low).max())
        return replace(self, positions=positions.astype(np.float32))

    def turned(self, degrees: float) -> Mesh:
        """The same mesh, turned about the y axis, anticlockwise seen from above."""
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
    """Reads a mesh of triangles from a Wavefront OBJ or a PLY file.

    Missing normals are computed, and faces and normals that point inwards are turned (see `Mesh.found`). Raises
    FormatError for other files, and for a mesh without faces, without height, or with coordinates that are not finite.
    """
    with door.opened(path, "a mesh") as file:
        kind = path.suffix.lower().removeprefix(".")
        if kind not in ("obj", "ply"):
            raise FormatError(f"{path}: expected a mesh whose name ends in .obj or .ply, found {path.suffix!r}")
        data = file.read(LARGEST_FILE)
    positions, faces, normals = _read(path, kind, data)
    if not len(faces):
        raise FormatError(f"{path}: the mesh has no triangles")
    if not np.isfinite(positions).all():
        raise FormatError(f"{path}: the mesh has coordinates that are not finite numbers")
    if faces.max() >= len(positions):
        raise FormatError(
            f"{path}: a face has vertex number {faces.max()}, but there are only {len(positions)} vertices"
        )
    if not np.ptp(positions[:, 1]) > 0:
        raise FormatError(f"{path}: the mesh is flat, without any height along y")
    notes: list[str] = []
    computed = normals is None or not (np.abs(normals).max(axis=-1) > SHORTEST).all()  # False for NaN, too
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
    """Positions, faces, and the normals or None, as Mitsuba reads them. kind: "obj" or "ply"."""
    mi = mitsuba()
    if kind == "ply":
        _check_counts(path, data)
    given = _has_normals(data, kind)
    try:
        with door.copied(data, f".{kind}") as copy:
            # Without `face_normals`, Mitsuba would compute missing normals from faces that we have not checked yet.
            mesh = mi.load_dict({"type": kind, "filename": str(copy), "face_normals": not given})
        parameters = mi.traverse(mesh)
        positions = np.array(parameters["vertex_positions"], np.float32).reshape(-1, 3)
        faces = np.array(parameters["faces"], np.uint32).reshape(-1, 3)
        normals = np.array(parameters["vertex_normals"], np.float32).reshape(-1, 3) if given else None
    except FormatError:
        raise
    except Exception as error:  # of many classes, even UnicodeDecodeError if Mitsuba's message quotes the file
        raise FormatError(f"{path}: it is not a mesh of triangles that Mitsuba can read") from error
    return positions, faces, normals if normals is None or normals.shape == positions.shape else None


def _check_counts(path: Path, data: bytes) -> None:
    """Raises FormatError if a PLY file announces more than it can hold: Mitsuba would allocate memory for all of it."""
    if b"end_header" not in data[:HEADER_BYTES]:
        raise FormatError(f"{path}: its first {HEADER_BYTES} bytes hold no complete header of a PLY file")
    for count in re.findall(rb"^\s*element\s+\S+\s+(\S+)", _head(data), re.MULTILINE):
        if not (count.isdigit() and len(count) < 20 and int(count) <= len(data)):
            announced = count[:20].decode("ascii", "replace")
            raise FormatError(f"{path}: its header announces {announced} elements, too many for {len(data)} bytes")


def _has_normals(data: bytes, kind: str) -> bool:
    """Whether all faces (OBJ) or vertices (PLY) have normals. If only some have, Mitsuba leaves others undefined."""
    if kind == "obj":
        words = (line.split(None, 2) for line in io.BytesIO(data))
        corners = [found[1] for found in words if found[:1] == [b"f"] and len(found) > 1]
        return bool(corners) and all(len(corner.split(b"/")) == 3 for corner in corners)
    return b" nx\n" in _head(data).replace(b"\r", b"")


def _head(data: bytes) -> bytes:
    """The header of a PLY file."""
    return data[:HEADER_BYTES].partition(b"end_header")[0]


def vertex_normals(positions: NDArray[np.float32], faces: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Unit normals (n, 3) of vertices: the mean of the normals of their faces, weighted by area.

    Vertices at the same position, as at a seam of texture coordinates, get the same normal. Vertices without a face, or
    with faces of no area, get (0, 1, 0).
    """
    _, place = np.unique(positions, axis=0, return_inverse=True)
    place = place.reshape(-1)
    corners, of_faces, count = place[faces], _face_normals(positions, faces), int(place.max()) + 1
    sums = [sum(np.bincount(corners[:, k], of_faces[:, j], count) for k in range(3)) for j in range(3)]
    normals = np.stack(sums, axis=-1)[place]
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.where(length > 0, normals / np.where(length > 0, length, 1), [0.0, 1.0, 0.0]).astype(np.float32)


def _face_normals(positions: NDArray[np.float32], faces: NDArray[np.uint32]) -> Floats:
    """The normals of faces, each as long as twice the area of its face."""
    a, b, c = (positions[faces[:, k]].astype(np.float64) for k in range(3))
    return np.cross(b - a, c - a)


def _agreement(positions: NDArray[np.float32], faces: NDArray[np.uint32], normals: NDArray[np.float32]) -> float:
    """Positive if most vertex normals point to the side from which their faces are anticlockwise, else negative."""
    of_corners = normals[faces].astype(np.float64).sum(axis=1)
    return float((_face_normals(positions, faces) * of_corners).sum())


def _volume(positions: NDArray[np.float32], faces: NDArray[np.uint32]) -> float:
    """The signed volume: positive if faces are anticlockwise seen from outside."""
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
    repeating a point makes a sharper edge. rows, columns: of the grid of vertices. relief: a function of heights y and
    azimuths φ [rad] that gives how far the surface is moved along its normal.
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
    """An upright trefoil knot of a rope of five strands, about 2 high. It is smooth, and reflects itself."""
    t = (np.arange(rows) / rows * 2 * np.pi)[:, None]
    theta = np.arange(columns) / columns * 2 * np.pi

    def along(t: Floats) -> Floats:
        r = 0.62 + 0.27 * np.cos(3 * t)
        return np.concatenate([r * np.cos(2 * t), r * np.sin(2 * t), 0.3 * np.sin(3 * t)], axis=-1)

    centre, tangent = along(t), along(t + 1e-5) - along(t - 1e-5)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    # A frame from the normal of the torus that the knot winds around: a frame that is transported along the curve would
    # not meet itself at the end.
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
    """The triangles of a grid of vertices that is periodic in its columns and, if `closed`, in its rows."""
    if closed:
        number = np.concatenate([number, number[:1]])
    a, b = number[:-1], number[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    return [np.stack([a, c, d], axis=-1), np.stack([a, d, b], axis=-1)]


def _mesh(name: str, positions: Floats, faces: list[NDArray[np.int64]]) -> Mesh:
    """A mesh from positions (n, 3) and groups of triangles, with normals computed from its faces."""
    points = positions.astype(np.float32)
    triangles = np.concatenate([face.reshape(-1, 3) for face in faces]).astype(np.uint32)
    return Mesh(name, points, triangles, vertex_normals(points, triangles))


def _rounded(points: Floats, times: int = 5) -> Floats:
    """Smooths a polygon by cutting its corners repeatedly (Chaikin 1974); its ends stay."""
    for _ in range(times):
        a, b = points[:-1], points[1:]
        cut = np.stack([0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b], axis=1).reshape(-1, 2)
        points = np.concatenate([points[:1], cut[1:-1], points[-1:]])
    return points


def _resampled(points: Floats, count: int) -> Floats:
    """Points at equal distances along a polygon."""
    length = np.append(0, np.linalg.norm(np.diff(points, axis=0), axis=-1).cumsum())
    at = np.linspace(0, float(length[-1]), count)
    return np.stack([np.interp(at, length, points[:, k]) for k in range(2)], axis=-1)
