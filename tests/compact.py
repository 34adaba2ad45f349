"""Compact materials that are made up, and files and streams that may be broken on purpose."""

import struct
import zlib

import numpy as np

from sommerl import SomManBrdf
from sommerl.container import PREFIX
from sommerl.nodes import FINE, NodeLattice
from sommerl.som_man.codes import gain_values, shape_values
from sommerl.som_man.file import MAGIC, VERSION, decode

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


def material(case="smooth", seed=0):
    bands, inner, gains, shapes, manner = CASES[case] if isinstance(case, str) else case
    rng = np.random.default_rng(seed)
    lattice = random_lattice(rng, bands, inner)
    gain_codes = np.sort(rng.choice(4096, gains, replace=False))
    shape_codes = rng.integers(-1024, 1025, (shapes, 2)) if manner == "random" else rng.integers(-90, 91, (shapes, 2))
    if manner == "grey":
        shape_codes[:] = 0
    shape_codes = shape_codes[np.lexsort(shape_codes.T[::-1])]
    gain, shape = (_entries(rng, n, lattice.size, manner) for n in (gains, shapes))
    values = {"gains": gain_values(gain_codes), "gain_index": gain, "scale": float(np.float32(0.1 + rng.random()))}
    return SomManBrdf(shape_values(shape_codes), shape, lattice, name="made up", **values)


def random_lattice(rng, bands, inner):
    theta_h = (*_axis(rng, max(inner, bands - 2), bands - 2), FINE)
    band = sorted([*range(bands), *rng.integers(0, bands, len(theta_h) - bands).tolist()])
    theta_d, phi_d = ([_axis(rng, inner) for _ in range(bands)] for _ in range(2))
    return NodeLattice(theta_h, tuple(band), tuple((*axis, FINE) for axis in theta_d), tuple(phi_d))


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


def sealed(body, version=VERSION):
    """A file with a checksum that fits."""
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
    same = (one.lattice, one.interpolation, one.scale) == (other.lattice, other.interpolation, other.scale)
    return same and all(a.tobytes() == b.tobytes() for a, b in zip(arrays(one), arrays(other), strict=True))


def arrays(material):
    """LUT, indices, gains and their indices."""
    gain_index = getattr(material, "gain_index", np.zeros(0, np.uint16))
    return material.lut, material.index, material.gains, gain_index


def stream(file):
    """The stream of nodes in a file, and what comes before it."""
    assert not decode(file).grid
    name = file[11]
    digest = file[12 + name]
    (notes,) = struct.unpack_from("<H", file, 13 + name + digest)
    at = 15 + name + digest + notes + 4
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
