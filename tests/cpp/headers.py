"""include/sommerl.hpp, compiled and asked: what the tests of it share."""

import io
import struct
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import compact
import numpy as np
from compact import FOLDS
from factored_brdfs import made
from helpers import random_directions, tool
from library_files import entry

import sommerl
from sommerl import Lattice, SomManBrdf
from sommerl.compression.palette import GainsAndShapes
from sommerl.compression.smrl import file, library_file, node_parts
from sommerl.compression.smrl.codes import gain_values, shape_values
from sommerl.compression.smrl.shared import Shared
from sommerl.factored import file as factored_file
from sommerl.reflectance.nodes import FINE, NodeLattice

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent
GOLDEN = ROOT / "tests" / "golden"
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror")
CHECKED = ("-O1", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
ANSWERS = ["r", "g", "b", "x", "y", "z", "pdf", "pdf again"]  # what the probe writes for each row
# The errors of the header, in its order.
ERRORS = (
    *("none", "not_loaded", "file", "memory", "kind", "version", "checksum", "truncated"),
    *("name", "notes", "contents", "stream", "missing"),
)


def compiled(source, *options, include=ROOT / "include", folder=None):
    """A program of a C++ source. Warnings are errors."""
    program = Path(folder or mkdtemp()) / source.stem
    command = [tool("g++"), "-std=c++17", *WARNINGS, *options, f"-I{include}", str(source), "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return program


@cache
def probe(*options):
    """The program that tests ask; it stops at what is undefined."""
    return compiled(HERE / "probe.cpp", *(options or CHECKED))


def output(program, *arguments, given=b"", status=0):
    done = subprocess.run([program, *arguments], input=given, capture_output=True)
    assert done.returncode == status, done.stderr.decode()[-3000:] + done.stdout.decode("utf-8", "replace")[-300:]
    return done.stdout


def asked(program, path, real, call, a, b, name=""):
    """What the header gives for pairs of vectors: rows of ANSWERS."""
    rows = np.concatenate([a, b], axis=1).tobytes()
    found = output(program, "call", path, name, real, call, given=rows)
    return np.frombuffer(found).reshape(len(a), len(ANSWERS))


def codes(program, files):
    """The error of each of some files' bytes, by name."""
    given = b"".join(struct.pack("<Q", len(data)) + data for data in files)
    return [ERRORS[code] for code in output(program, "codes", given=given)]


def cells(lattice, entries, interpolation):
    rng = np.random.default_rng(entries)
    index = rng.integers(0, entries, lattice.shape).astype(np.uint8 if entries <= 256 else np.uint16)
    return SomManBrdf(rng.random((entries, 3)) ** 4, index, lattice, name="cells", interpolation=interpolation)


def even_material():
    """MERL's lattice, and entries that lie together, so that the file is small."""
    index = (np.arange(sommerl.Lattice().size) // 5003 % 200).astype(np.uint8).reshape(Lattice().shape)
    lut = np.random.default_rng(5).random((200, 3))
    return SomManBrdf(lut, index, Lattice(), name="MERL's lattice", interpolation="nearest")


def nodes(folds, signed, smooth):
    """Several bands, of which one has a single node in φ_d; some gains are negative if signed."""
    rng = np.random.default_rng(3)
    lattice = NodeLattice(
        (0, 1, 5, 88, 92, 120, 180),
        (0, 0, 1, 1, 2, 2, 2),
        tuple(tuple(sorted({0, FINE, *range(b + 1, FINE, 7 * b + 9)})) for b in range(3)),
        ((0, FINE), (0, 40, 90, 170, FINE), (0,)) if folds["mirrored"] else ((0, 7, 100), (0, 40, 90, 170), (0,)),
        **folds,
    )
    gains = gain_values(np.linspace(-500 if signed else 0, 900, 40).astype(int))
    shapes = shape_values(np.sort(rng.integers(-120, 121, (30, 2)), axis=0))
    index = np.stack([rng.integers(0, count, lattice.size).astype(np.uint16) for count in (40, 30)])
    return SomManBrdf(GainsAndShapes(gains, shapes, 0.04, signed, smooth), index, lattice, name="nodes")


KINDS = {
    "cells, nearest": lambda: cells(Lattice(30, 30, 60), 200, "nearest"),
    "cells, two bytes": lambda: cells(Lattice(30, 30, 60), 300, "nearest"),
    "cells, trilinear": lambda: cells(Lattice(9, 7, 11), 60, "trilinear"),
    "cells, not reciprocal": lambda: cells(Lattice(12, 10, 30, reciprocal=False), 60, "trilinear"),
    "cells, not reciprocal, nearest": lambda: cells(Lattice(12, 10, 30, reciprocal=False), 300, "nearest"),
    "cells, one": lambda: cells(Lattice(1, 1, 1), 1, "trilinear"),
    "cells, MERL's": even_material,
    **{
        f"nodes, {name}, {'signed' if signed else 'smooth'}": lambda folds=folds, signed=signed: nodes(
            folds, signed, not signed
        )
        for name, folds in FOLDS.items()
        for signed in (False, True)
    },
    "nodes, large palettes": lambda: compact.material("big-palettes"),
    "factored": made,
}


def written(material, folder):
    """A file of a material, of either kind."""
    path = folder / ("x.smrl" if isinstance(material, SomManBrdf) else "x.fbrdf")
    if isinstance(material, SomManBrdf):
        file.save(material, path)
    else:
        factored_file.save(material, path)
    return path


def sharing():
    """The bytes of a library whose materials share lattices, but for one; and its materials, by name."""
    materials = {f"nodes/{name}": compact.golden(name) for name in FOLDS} | {"cells": file.load(GOLDEN / "cells.smrl")}
    of_nodes = [material for material in materials.values() if material.grid is None]
    weights, levels = node_parts.coded(of_nodes[0]).learnt(*of_nodes[0].index)
    prior = np.float32(weights).tolist(), np.float32(levels).tolist()
    common = Shared(tuple(material.lattice for material in of_nodes), prior)
    out, data = io.BytesIO(), {name: file.encode(material) for name, material in materials.items()}
    library_file.write(out, [entry(name, number) for number, name in enumerate(data)], data.__getitem__, common)
    return out.getvalue(), materials


def pairs(count, seed=1):
    """Directions of all elevations, some next to the horizon, along the normal, mirror images, or below the surface."""
    a, b = random_directions(count, seed), random_directions(count, seed + 1)
    a[: count // 20] *= [1, 1, -1]
    b[-(count // 20) :, :2] = 0
    b[-(count // 20) :, 2] = 1
    some = slice(count // 20, count // 10)
    b[some] = a[some] * [-1, -1, 1]
    low = slice(count // 10, count // 5)
    a[low, 2] = 10 ** np.random.default_rng(seed).uniform(-6, -1, count // 10)
    a[low] /= np.linalg.norm(a[low], axis=1)[:, None]
    return a, b
