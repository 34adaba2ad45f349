"""Decodes the stream of a compact material in plain Python, as docs/format.md, *Kind 1*, specifies it.

This is for reading, and for comparison with the fast decoder in the core, which tests hold to the same results.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate

from ...system.errors import FormatError
from .reference_model import Model

BOTTOM = 2**24  # the decoder reads more bytes while `range` is below this
EVEN, FULL = 2**11, 2**12  # probabilities that a bit is 1, as whole numbers: one half, and 1
RATE = 4  # a probability moves by 2^-RATE of the way towards the bit that came
LONGEST, CONTEXT = 20, 24  # bits of a number after its first one; probabilities in a context
FINE = 180  # steps of the fine grid on each axis
MOST_BANDS, MOST_NODES, MOST_ENTRIES = 16, 2**17, 2**10
HIGHEST_GAIN, WIDEST_SHAPE = 2**12 - 1, 2**10
MOST_REACHED, REACHED_BY_ANY, REACHED_A_BYTE = 2**26, 2**22, 2**11

Axis = list[int]
Context = list[int]
Shape = tuple[int, int]
Lattice = tuple[Axis, list[int], list[Axis], list[Axis]]


def decode(
    data: bytes, mirrored: bool = False, version: int = 2
) -> tuple[Axis, list[int], list[Axis], list[Axis], list[int], list[Shape], list[int], list[int]]:
    """Decodes a whole stream: theta_h, band, theta_d, phi_d, gain_codes, shape_codes, gain_index, shape_index.

    The first four are as in `NodeLattice`, the indices are by node. mirrored: of the lattice. version: 1 or 2. Raises
    FormatError for a stream that is not valid.
    """
    coder = Decoder(data)
    lattice = _lattice(coder, mirrored)
    return *lattice, *_rest(coder, len(data), lattice, mirrored, version, None)


def decode_part(
    data: bytes, lattice: Lattice, mirrored: bool, prior: tuple[list[list[float]], list[float]]
) -> tuple[list[int], list[Shape], list[int], list[int]]:
    """Decodes a part, whose lattice is shared: gain_codes, shape_codes, gain_index, shape_index; see *Shared parts*.

    lattice: theta_h, band, theta_d, phi_d. prior: weights (3, 10), and usual errors (3). Raises FormatError as `decode`
    does.
    """
    return _rest(Decoder(data), len(data), lattice, mirrored, 2, prior)


def _rest(
    coder: Decoder,
    length: int,
    lattice: Lattice,
    mirrored: bool,
    version: int,
    prior: tuple[list[list[float]], list[float]] | None,
) -> tuple[list[int], list[Shape], list[int], list[int]]:
    """What a stream of `length` bytes holds after the lattice."""
    _, band, theta_d, phi_d = lattice
    gains, shapes = _palette(coder, version)
    model = Model(lattice, mirrored, gains, shapes, prior)
    most = min(MOST_REACHED, REACHED_BY_ANY + REACHED_A_BYTE * length)
    gain_index: list[int] = []
    shape_index: list[int] = []
    for row, b in enumerate(band):
        model.begin(row)
        for d in range(len(theta_d[b])):
            for p in range(len(phi_d[b])):
                model.expect(d, p)
                gain = coder.pick(model.gain_weights())
                shape = coder.pick(model.shape_weights())
                if model.reached > most:
                    raise FormatError(f"entries within reach: expected at most {most}, found more")
                model.learn(d, p, gain, shape)
                gain_index.append(gain)
                shape_index.append(shape)
    coder.check_end()
    return gains, shapes, gain_index, shape_index


class Decoder:
    """The range decoder, and the numbers that are coded with it: docs/format.md, *The range decoder* and *Bits*."""

    def __init__(self, data: bytes) -> None:
        self._data, self._read = data, 4
        self._range, self._code = 2**32 - 1, int.from_bytes(data[:4].ljust(4, b"\0"), "big")

    def pick(self, weights: Sequence[int]) -> int:
        """Decodes the number of a symbol. weights: of all symbols, whole numbers of at least 1."""
        upto = list(accumulate(weights))
        share = self._range // upto[-1]
        at = self._code // share
        if at >= upto[-1]:
            raise FormatError("stream: expected symbols of the range coder, found a code beyond all of them")
        symbol = bisect_right(upto, at)
        self._code -= share * (upto[symbol] - weights[symbol])
        self._range = share * weights[symbol]
        while self._range < BOTTOM:
            self._range *= 256
            self._code = 256 * self._code + (self._data[self._read] if self._read < len(self._data) else 0)
            self._read += 1
        return symbol

    def bit(self, context: Context, i: int) -> int:
        """Decodes a bit by probability number i of a context, which adapts to the bit."""
        one = context[i]
        bit = self.pick((FULL - one, one))
        context[i] = one + (FULL - one >> RATE) if bit else one - (one >> RATE)
        return bit

    def number(self, context: Context) -> int:
        """Decodes a whole number x: the number of bits of x + 1 after its leading 1, in unary, and then these bits."""
        n = 0
        while n < LONGEST and self.bit(context, n):
            n += 1
        x = 1
        for i in reversed(range(n)):
            x = 2 * x + (self.bit(context, LONGEST + i) if i == n - 1 and i < 4 else self.pick((EVEN, EVEN)))
        return x - 1

    def signed(self, context: Context) -> int:
        """Decodes a whole number with a sign: 0, −1, 1, −2, … are coded as 0, 1, 2, 3, …"""
        x = self.number(context)
        return -(x + 1) // 2 if x % 2 else x // 2

    def check_end(self) -> None:
        """Raises FormatError unless this is the only stream that a writer gives for the decoded symbols."""
        window = int.from_bytes(self._data.ljust(self._read, b"\0")[self._read - 4 : self._read], "big")
        low = (window - self._code) % 2**32
        last = low + self._range - 1
        roundest = next(cut for k in reversed(range(33)) if (cut := last >> k << k) >= low)
        if roundest % 2**32 != window or len(self._data) > self._read or self._data[-1:] == b"\0":
            raise FormatError("expected a stream of nodes that ends with the file, found another")


def _bounded(what: str, value: int, least: int, most: int) -> int:
    """The value. Raises FormatError if it is not from `least` to `most`."""
    if not least <= value <= most:
        raise FormatError(f"{what}: expected {least} to {most}, found {value}")
    return value


def _contexts() -> list[Context]:
    return [[EVEN] * CONTEXT for _ in range(4)]


def _lattice(coder: Decoder, mirrored: bool) -> Lattice:
    counts, *steps = _contexts()
    bands = _bounded("bands", 1 + coder.number(counts), 1, MOST_BANDS)
    theta_h = _closed(coder, counts, steps[0])
    band: list[int] = []
    for b in range(bands):
        left = len(theta_h) - len(band)
        rows = left if b + 1 == bands else 1 + coder.number(counts)
        band += [b] * _bounded("rows of a band", rows, 1, left)
    theta_d: list[Axis] = []
    phi_d: list[Axis] = []
    for _ in range(bands):
        theta_d.append(_closed(coder, counts, steps[1]))
        phi_d.append((_folded if mirrored else _open)(coder, counts, steps[2]))
    _bounded("nodes", sum(len(theta_d[b]) * len(phi_d[b]) for b in band), 1, MOST_NODES)
    return theta_h, band, theta_d, phi_d


def _closed(coder: Decoder, counts: Context, steps: Context) -> Axis:
    return [*_open(coder, counts, steps), FINE]


def _open(coder: Decoder, counts: Context, steps: Context) -> Axis:
    return _places(coder, coder.number(counts), steps)


def _folded(coder: Decoder, counts: Context, steps: Context) -> Axis:
    count = coder.number(counts)
    return [*_places(coder, count - 1, steps), FINE] if count else [0]


def _places(coder: Decoder, inner: int, steps: Context) -> Axis:
    places = [0]
    for _ in range(inner):
        places.append(_bounded("axis", places[-1] + 1 + coder.number(steps), 1, FINE - 1))
    return places


def _palette(coder: Decoder, version: int) -> tuple[list[int], list[Shape]]:
    counts, *steps = _contexts()
    gains = _bounded("gains", 1 + coder.number(counts), 1, MOST_ENTRIES)
    shapes = _bounded("shapes", 1 + coder.number(counts), 1, MOST_ENTRIES)
    gain_codes: list[int] = []
    lowest = 0 if version == 1 else -HIGHEST_GAIN
    for i in range(gains):
        if i:
            code = gain_codes[-1] + 1 + coder.number(steps[0])
        else:
            code = coder.number(steps[0]) if version == 1 else coder.signed(steps[0])
        gain_codes.append(_bounded("gain", code, lowest, HIGHEST_GAIN))
    shape_codes: list[Shape] = []
    first, second = -WIDEST_SHAPE, 0
    for _ in range(shapes):
        first = _bounded("shape", first + coder.number(steps[1]), -WIDEST_SHAPE, WIDEST_SHAPE)
        second = _bounded("shape", second + coder.signed(steps[2]), -WIDEST_SHAPE, WIDEST_SHAPE)
        shape_codes.append((first, second))
    return gain_codes, shape_codes
