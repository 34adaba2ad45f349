"""Materials as source code, compiled and run: what the tests of it share."""

import re
import subprocess
from dataclasses import replace
from hashlib import sha256

import numpy as np
from compact import FOLDS
from helpers import compact_material, random_directions, tool

from sommerl import BrdfTable, Lattice, SomManBrdf, TrainOptions, builtin, train
from sommerl.compression.palette import GainsAndShapes
from sommerl.reflectance.nodes import FINE, NodeLattice

A, B = random_directions(10_000, 1), random_directions(10_000, 2)
A[:5], B[:5] = A[:5] * [1, 1, -1], B[:5]  # below the horizon
A[5], B[5:7], A[6] = [0.6, 0, 0.8], [-0.6, 0, 0.8], [0, 0, 1]  # mirror directions
# What a program may have defined before it includes a file, and what some do.
HOSTILE = """
#define min(a, b) ((a) < (b) ? (a) : (b))
#define max
#define real half
#define real3 half3
#define saturate(x) x
#define PI 3
#define eval 4
#define pdf 5
#define near
#define far
#define wi 1
"""
STRICT = ["-std=c++11", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
MAIN = """
#include "x.h"
#include <cstdio>
typedef SOMMERL_REAL number;
int main() {
    double in[6];
    while (std::fread(in, sizeof(double), 6, stdin) == 6) {
        const sommerl_real3 a{number(in[0]), number(in[1]), number(in[2])};
        const sommerl_real3 b{number(in[3]), number(in[4]), number(in[5])};
        CALL
        std::fwrite(out, sizeof(double), sizeof(out) / sizeof(double), stdout);
    }
}
"""
CALLS = {
    "eval": "const auto f = material_x_eval(a, b); const double out[] = {f.x, f.y, f.z};",
    "sample": """number density;
        const auto w = material_x_sample(a, b, density);
        const double out[] = {w.x, w.y, w.z, density, material_x_pdf(w, a)};""",
    "pdf": "const double out[] = {material_x_pdf(a, b)};",
}


def material(lattice, clusters, interpolation):
    table = BrdfTable.sampled(builtin("purple-paint"), lattice)
    return train(table, TrainOptions(clusters=clusters, epochs=2))[0].with_interpolation(interpolation)


CASES = [
    (Lattice(30, 30, 60), 200, "nearest"),
    (Lattice(30, 30, 60), 300, "nearest"),  # two bytes an index
    (Lattice(30, 30, 60), 300, "trilinear"),
    (Lattice(9, 7, 11), 60, "trilinear"),  # a number of cells that does not fill the last word
    (Lattice(12, 10, 30, reciprocal=False), 60, "trilinear"),
    (Lattice(12, 10, 30, reciprocal=False), 60, "nearest"),
    (Lattice(1, 1, 1), 1, "trilinear"),
]

BANDS = [tuple(sorted({0, FINE, *range(b + 1, FINE, 7 * b + 9)})) for b in range(3)]
ROWS = tuple(range(0, FINE + 1, 4))
SEVERAL = NodeLattice((0, 1, 5, 88, 92, 120, 180), (0, 0, 1, 1, 2, 2, 2), tuple(BANDS), tuple(b[:-1] for b in BANDS))
COMPACT = {
    "several bands": (SEVERAL, (20, 15)),
    "one node in phi_d": (NodeLattice((0, 40, 90, 180), (0,) * 4, ((0, 60, 180),), ((0,),)), (7, 5)),
    "one gain and one shape": (NodeLattice((0, 180), (0, 1), ((0, 180),) * 2, ((0,), (0, 90, 179))), (1, 1)),
    "finest": (NodeLattice((0, 180), (0, 0), (tuple(range(FINE + 1)),), (tuple(range(FINE)),)), (300, 300)),
    "big": (NodeLattice(ROWS, (0,) * 20 + (1,) * 26, (BANDS[0], ROWS), (ROWS[:-1], BANDS[2][:-1])), (256, 256)),
}


MIRRORED_BANDS = ((0, FINE), BANDS[1], (0,))
FOLDED = {  # and whether blended values keep their sign
    f"{name}{', signed' if signed else ''}": (
        replace(SEVERAL, **folds, phi_d=MIRRORED_BANDS if folds["mirrored"] else SEVERAL.phi_d),
        signed,
    )
    for name, folds in FOLDS.items()
    for signed in (False, True)
}


def compact(case):
    lattice, palette = COMPACT[case]
    return compact_material(lattice, *palette)


def folded(case):
    """A material with such folds, half of whose gains are negative."""
    lattice, signed = FOLDED[case]
    made = compact_material(lattice, 20, 15)
    gains = np.sort(np.concatenate([made.palette.gains[::2], -made.palette.gains[1::2]]))
    return SomManBrdf(
        GainsAndShapes(gains, made.lut, 0.04, signed, lattice.mirrored), made.index, lattice, name="folded"
    )


def run(folder, real, call="eval", a=A, b=B):
    """What the header in the folder gives for pairs of vectors, row by row. Behaviour that is undefined stops it."""
    text = f"#define SOMMERL_REAL {real}\n" + MAIN.replace("CALL", CALLS[call])
    program = folder / sha256((text + (folder / "x.h").read_text()).encode()).hexdigest()
    if not program.exists():  # to compile takes longer than to run
        (folder / "main.cpp").write_text(text)
        options = [*STRICT, "-I.", "-o", program.name]
        defined = ["-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
        subprocess.run([tool("g++"), *options, *defined, "main.cpp"], cwd=folder, check=True)
    done = subprocess.run(program, input=np.concatenate([a, b], 1).tobytes(), capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
    return np.frombuffer(done.stdout).reshape(len(a), -1)


def validate(folder, text, *options):
    """Compiles a fragment shader that may include files of the folder, whatever the language says of that."""
    included = re.sub(r'#include "(.+)"', lambda name: (folder / name[1]).read_text(), text)
    (folder / "main.frag").write_text(included)
    command = [tool("glslangValidator"), *options, "main.frag"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def validate_wgsl(path):
    """Reads and validates a file of WGSL by naga, which Firefox and wgpu have."""
    done = subprocess.run([tool("naga"), path], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
