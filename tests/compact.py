"""Compact materials that are made up, and files and streams that may be broken on purpose."""

import struct
import zlib
from itertools import pairwise

import numpy as np

from sommerl import SomManBrdf
from sommerl.compression.palette import GainsAndShapes
from sommerl.compression.smrl.codes import coordinates, gain_codes, gain_values, shape_codes, shape_values
from sommerl.compression.smrl.file import MAGIC, VERSIONS, decode, encode
from sommerl.compression.smrl.reference_model import Model
from sommerl.reflectance.nodes import FINE, NodeLattice
from sommerl.reflectance.origin import Source
from sommerl.system.sealed_file import PREFIX

# Bands, inner nodes of an axis at most, gains, shapes, and how the entries come.
CASES = {
    "minimal": (1, 0, 1, 1, "random"),
    "one-gain": (1, 5, 1, 30, "walk"),
    "one-shape": (2, 5, 40, 1, "walk"),
    "grey": (3, 5, 40, 3, "grey"),
    "smooth": (4, 7, 60, 50, "walk"),
    "noise": (6, 6, 30, 30, "random"),
    "big-palettes": (2, 6, 1024, 1024, "random"),
    "late": (2, 12, 64, 64, "late"),  # nothing new for long, and then much
}
# Which folds of φ_d a lattice has.
FOLDS = {
    "reciprocal": {"reciprocal": True, "mirrored": False},
    "mirrored": {"reciprocal": False, "mirrored": True},
    "both": {"reciprocal": True, "mirrored": True},
    "neither": {"reciprocal": False, "mirrored": False},
}


def material(case="smooth", seed=0, *, folds=FOLDS["reciprocal"], signed=False):
    """A material that is made up. signed: its gains have both signs, too. It is smooth if it is mirrored."""
    bands, inner, gains, shapes, manner = CASES[case] if isinstance(case, str) else case
    rng = np.random.default_rng(seed)
    lattice = random_lattice(rng, bands, inner, folds)
    gain_codes = np.sort(rng.choice(8191, gains, replace=False) - 4095 if signed else rng.choice(4096, gains, False))
    shape_codes = rng.integers(-1024, 1025, (shapes, 2)) if manner == "random" else rng.integers(-90, 91, (shapes, 2))
    if manner == "grey":
        shape_codes[:] = 0
    shape_codes = shape_codes[np.lexsort(shape_codes.T[::-1])]
    gain, shape = (_entries(rng, n, lattice.size, manner) for n in (gains, shapes))
    palette = GainsAndShapes(
        gain_values(gain_codes), shape_values(shape_codes), 0.1 + rng.random(), signed, folds["mirrored"]
    )
    return SomManBrdf(palette, np.stack([gain, shape]), lattice, name="made up")


def golden(name):
    """What was written to tests/golden/nodes-2-NAME.smrl: small, but of several bands."""
    made = material(
        (3, 5, 24, 20, "walk"), 19 + list(FOLDS).index(name), folds=FOLDS[name], signed=name != "reciprocal"
    )
    made.name, made.source = f"golden nodes, {name}", Source("0123456789abcdef" * 4)
    made.options, made.metrics = {"seed": 3}, {"rmse": 0.25}
    return made


def random_lattice(rng, bands, inner, folds=FOLDS["reciprocal"]):
    theta_h = (*_axis(rng, max(inner, bands - 2), bands - 2), FINE)
    band = sorted([*range(bands), *rng.integers(0, bands, len(theta_h) - bands).tolist()])
    theta_d, phi_d = ([_axis(rng, inner) for _ in range(bands)] for _ in range(2))
    if folds["mirrored"]:
        phi_d = [(0,) if rng.random() < 0.2 else (*axis, FINE) for axis in phi_d]
    return NodeLattice(theta_h, tuple(band), tuple((*axis, FINE) for axis in theta_d), tuple(phi_d), **folds)


def _axis(rng, most, least=0):
    count = rng.integers(max(least, 0), max(most, 0) + 1)
    return (0, *np.sort(rng.choice(np.arange(1, FINE), count, replace=False)).tolist())


def _entries(rng, entries, nodes, manner):
    if manner in ("walk", "grey"):
        return np.clip(np.cumsum(rng.integers(-1, 2, nodes)) + entries // 2, 0, entries - 1).astype(np.uint16)
    found = rng.integers(0, entries, nodes).astype(np.uint16)
    if manner == "late":
        found[: nodes * 9 // 10] = entries // 2
    return found


def sealed(body, version=None):
    """A file with a checksum that fits; of the version in which its kind is written if None."""
    version = VERSIONS.get(body[0] if body else 0, 1) if version is None else version
    return PREFIX.pack(MAGIC, version, zlib.crc32(body)) + body


def broken(body):
    """Every way to cut it off, and to change one byte."""
    cut = [body[:length] for length in range(len(body))]
    return cut + [
        body[:at] + bytes([body[at] ^ bits]) + body[at + 1 :]
        for at in range(len(body))
        for bits in (1, 0x41, 0x80, 0xFF)
    ]


def same_numbers(one, other):
    """Whether two materials look up the same, bit for bit."""
    same = one.lattice == other.lattice and one.interpolation == other.interpolation
    same = same and (scale(one), how(one)) == (scale(other), how(other))
    return same and all(a.tobytes() == b.tobytes() for a, b in zip(arrays(one), arrays(other), strict=True))


def arrays(material):
    """LUT, indices, gains and their indices."""
    if material.grid:
        return material.lut, material.index, np.zeros(0), np.zeros(0, np.uint16)
    gain, shape = material.index
    return material.lut, shape, material.palette.gains, gain


def scale(material):
    """Of the cube-root domain; 1 for a material of cells."""
    return 1.0 if material.grid else material.palette.scale


def how(material):
    """How blended values become reflectances: signed, smooth."""
    return [not material.grid and getattr(material.palette, name) for name in ("signed", "smooth")]


def stream(file):
    """The stream of nodes in a file, and what comes before it."""
    assert not decode(file).grid
    name = file[11]
    digest = file[12 + name]
    (notes,) = struct.unpack_from("<H", file, 13 + name + digest)
    at = 15 + name + digest + notes + 4 + (file[4] > 1)
    return file[at:], file[PREFIX.size : at]


class Writer:
    """The writer's side of the range coder, in whole numbers of any size: for streams that nobody else writes."""

    def __init__(self):
        self._low, self._range, self._bytes = 0, 2**32 - 1, 4

    def pick(self, symbol, weights):
        share = self._range // sum(weights)
        self._low += share * sum(weights[:symbol])
        self._range = share * weights[symbol]
        while self._range < 2**24:
            self._low, self._range, self._bytes = self._low * 256, self._range * 256, self._bytes + 1

    def bit(self, context, i, bit):
        one = context[i]
        self.pick(bit, (4096 - one, one))
        context[i] = one + (4096 - one) // 16 if bit else one - one // 16

    def number(self, value, context):
        bits = f"{value + 1:b}"[1:]
        for i in range(min(len(bits) + 1, 20)):
            self.bit(context, i, int(i < len(bits)))
        for i, bit in zip(reversed(range(len(bits))), bits, strict=True):
            if i + 1 == len(bits) and i < 4:
                self.bit(context, 20 + i, int(bit))
            else:
                self.pick(int(bit), (2048, 2048))

    def finish(self):
        last = self._low + self._range - 1
        roundest = next(last >> k << k for k in reversed(range(33)) if last >> k << k >= self._low)
        return roundest.to_bytes(self._bytes, "big").rstrip(b"\0")

    def so_far(self):
        """What is followed by zeros: of all that can be picked, always the first."""
        return self._low.to_bytes(self._bytes, "big").rstrip(b"\0")


def written(bands=1, theta_h=(0,), rows=(), axes=((0,), (0,)), gains=1, shapes=1, palette=()):
    """A stream that starts with such numbers: bands; inner nodes and steps of θ_h; rows of bands; inner nodes and steps
    of θ_d and φ_d; numbers of gains and shapes; codes, with numbers of contexts."""
    return _head(bands, theta_h, rows, axes, gains, shapes, palette).finish()


def _head(bands, theta_h, rows, axes, gains, shapes, palette):
    writer = Writer()
    counts, *steps = ([2048] * 24 for _ in range(4))
    writer.number(bands - 1, counts)
    for number in (axis := iter(theta_h)):
        writer.number(number, counts)
        for step in axis:
            writer.number(step, steps[0])
    for number in rows:
        writer.number(number - 1, counts)
    for i, (inner, *places) in enumerate(axes):
        writer.number(inner, counts)
        for step in places:
            writer.number(step, steps[1 + i % 2])
    counts, *steps = ([2048] * 24 for _ in range(4))
    writer.number(gains - 1, counts)
    writer.number(shapes - 1, counts)
    for number, context in palette:
        writer.number(number, steps[context])
    return writer


def whole(made, version=2):
    """The stream of a material, by this writer and the model in plain Python."""
    theta_h, band, theta_d, phi_d = axes = made.lattice.axes()
    mirrored = made.lattice.mirrored
    gains, shapes = gain_codes(made.palette.gains).tolist(), shape_codes(coordinates(made.lut)).tolist()
    turns = [_inner(axis[:-1] if mirrored and len(axis) > 1 else axis, len(axis) - 1) for axis in phi_d]
    closed = [_inner(axis[:-1], len(axis) - 2) for axis in (theta_h, *theta_d)]
    rows = [band.count(b) for b in range(len(theta_d) - 1)]
    steps = [each for pair in zip(closed[1:], turns, strict=True) for each in pair]
    codes = [(_folded(gains[0]) if version > 1 else gains[0], 0), *((b - a - 1, 0) for a, b in pairwise(gains))]
    for before, after in pairwise([(-1024, 0), *shapes]):
        codes += [(after[0] - before[0], 1), (_folded(after[1] - before[1]), 2)]
    writer = _head(len(theta_d), closed[0], rows, steps, len(gains), len(shapes), codes)
    model, entries = Model(axes, mirrored, gains, shapes), zip(*made.index.tolist(), strict=True)
    for row, b in enumerate(band):
        model.begin(row)
        for d in range(len(theta_d[b])):
            for p in range(len(phi_d[b])):
                model.expect(d, p)
                gain, shape = next(entries)
                writer.pick(gain, model.gain_weights())
                writer.pick(shape, model.shape_weights())
                model.learn(d, p, gain, shape)
    return writer.finish()


def _inner(places, count):
    return [count, *(b - a - 1 for a, b in pairwise(places))]


def _folded(number):
    """0, −1, 1, −2, … as 0, 1, 2, 3, …"""
    return 2 * number if number >= 0 else -2 * number - 1


def in_version_1(made):
    """The file of format 1 of a material, which nobody writes any more."""
    _, head = stream(encode(made))
    return sealed(head[:-1] + whole(made, 1), 1)


FULL = [64, *[0] * 64]
GOOD = [(4095, 0), (0, 1), (0, 2)]


def bomb():
    """A few bytes that mean as many nodes and entries as there can be: all entries are alike, and all nodes have the
    first ones."""
    axes = ([62, *[0] * 62], [63, *[0] * 63])
    palette = [*[(0, 0)] * 1024, *[(0, 1), (0, 2)] * 1024]
    return _head(1, [30, *[0] * 30], (), axes, 1024, 1024, palette).so_far()


HOSTILE_STREAMS = {
    "bands": {"bands": 17},
    "bands-2": {"bands": 2**21 - 1},
    "axis": {"theta_h": [1, 179]},
    "axis-2": {"theta_h": [180, *[0] * 180]},
    "axis-3": {"theta_h": [2**21 - 2, *[0] * 180]},
    "axis-4": {"theta_h": [1, 2**21 - 2]},
    "band": {"bands": 2, "rows": [3]},
    "band-2": {"bands": 2, "rows": [2]},
    "band-3": {"bands": 3, "rows": [2]},
    "nodes": {"theta_h": [62, *[0] * 62], "axes": (FULL, FULL)},
    "gains": {"gains": 1025},
    "shapes": {"shapes": 1025},
    "shape": {"palette": [(4095, 0), (2049, 1)]},
    "shape-2": {"palette": [(4095, 0), (0, 1), (2049, 2)]},
    "shape-3": {"palette": [(4095, 0), (0, 1), (2050, 2)]},
}
# By version: the first one is a number in version 1, and has a sign in version 2.
HOSTILE_GAINS = {
    1: {"gain": {"palette": [(4096, 0)]}, "gain-2": {"gains": 2, "palette": [(4095, 0), (0, 0)]}},
    2: {
        "gain": {"palette": [(8192, 0)]},
        "gain-2": {"gains": 2, "palette": [(8190, 0), (0, 0)]},
        "gain-3": {"palette": [(8191, 0)]},
        "gain-4": {"gains": 2, "palette": [(8189, 0), (8191, 0)]},
    },
}
HOSTILE_FOLDED = {"axis-5": {"axes": ([0], [2, 179])}, "axis-6": {"axes": ([0], [182, *[0] * 181])}}


def hostile_streams(version=2, mirrored=False):
    """Streams that hold a number beyond its bounds, by its name in messages."""
    numbers = HOSTILE_STREAMS | HOSTILE_GAINS[version] | (HOSTILE_FOLDED if mirrored else {})
    return {name: written(**each) for name, each in numbers.items()}
