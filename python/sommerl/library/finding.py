"""Finds materials of a library by name, colour, gloss and metalness, or by how much they look like another one."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..reflectance.brdf import Brdf
from ..reflectance.half_diff import directions
from ..system.errors import OptionError
from ..system.near import did_you_mean
from ..system.optional import optional
from .record import Record

HEX = re.compile(r"#?([0-9a-f]{3}|[0-9a-f]{6})", re.IGNORECASE)
# Linear RGB to the responses of cones, and their cube roots to lightness and two opponent colours (Ottosson's Oklab).
CONES = np.array([
    [0.4122214708, 0.5363325363, 0.0514459929],
    [0.2119034982, 0.6806995451, 0.1073969566],
    [0.0883024619, 0.2817188376, 0.6299787005],
])  # fmt: skip
OPPONENT = np.array([
    [0.2104542553, 0.7936177850, -0.0040720468],
    [1.9779984951, -2.4285922050, 0.4505937099],
    [0.0259040371, 0.7827717662, -0.8086757660],
])  # fmt: skip
LIGHTNESS = 0.5  # how much a difference of lightness counts: "red" means the hue, and paints are darker than screens
GREY = 0.02  # chroma below which a colour has no hue
LOOKS = (16, 5, 4)  # θ_h, θ_d, φ_d of the pairs of directions at which looks are compared
DARK = 0.01  # [1/sr] added to f_r before its logarithm: what is darker looks alike
QUALITY = "psnr_soft_db"


@dataclass(frozen=True)
class Wanted:
    """What a material has to be. name: a pattern with * and ?, or a part of the name, in any case of letters. gloss,
    metalness: the lowest and the highest."""

    name: str = ""
    gloss: tuple[float, float] = (0.0, 1.0)
    metalness: tuple[float, float] = (0.0, 1.0)

    def __contains__(self, record: Record) -> bool:
        pattern, name = self.name.lower(), record.name.lower()
        named = fnmatchcase(name, pattern) if re.search("[*?[]", pattern) else pattern in name
        ranges = ((record.gloss, self.gloss), (record.metalness, self.metalness))
        return named and all(low <= value <= high for value, (low, high) in ranges)


def nearest(
    records: Iterable[Record], distance: Callable[[Record], float], most: int | None = None
) -> list[tuple[Record, float]]:
    """Records and their distances, the nearest first, and of equal ones by name; at most `most`."""
    found = sorted(((distance(record), record.name, record) for record in records), key=lambda each: each[:2])
    return [(record, far) for far, _, record in found[:most]]


def colour_distance(a: ArrayLike, b: ArrayLike) -> float:
    """How far two linear RGB colours are apart in Oklab, where differences of lightness count half."""
    difference = (oklab(a) - oklab(b)) * (LIGHTNESS, 1, 1)
    return float(np.sqrt(np.square(difference).sum()))


def oklab(colour: ArrayLike) -> NDArray[np.float64]:
    """Lightness, and the two opponent colours, of linear RGB (3,)."""
    return OPPONENT @ np.cbrt(CONES @ np.asarray(colour, np.float64))


def hue(colour: ArrayLike) -> tuple[float, float]:
    """What colours are sorted by: the hue, red first; greys come last, from dark to bright."""
    lightness, a, b = oklab(colour).tolist()
    grey = np.hypot(a, b) < GREY
    return (10.0, lightness) if grey else (float(np.arctan2(b, a) % (2 * np.pi)), lightness)


def colour_named(text: str, option: str = "colour") -> tuple[float, float, float]:
    """A CSS colour's name, or a colour in hexadecimal digits, like gold, #fc0 or #ffcc00, as linear RGB.

    Raises OptionError, which names the `option`, for others.
    """
    found = HEX.fullmatch(text.strip())
    digits = found[1] if found else _css(text.strip().lower(), option)
    if len(digits) == 3:
        digits = "".join(2 * digit for digit in digits)
    red, green, blue = (_linear(int(digits[at : at + 2], 16) / 255) for at in (0, 2, 4))
    return red, green, blue


def _css(name: str, option: str) -> str:
    names: dict[str, str] = optional("matplotlib.colors", "matplotlib", option, "lab").CSS4_COLORS
    if name not in names:
        hint = did_you_mean(name, names)
        raise OptionError(f"{option}: expected a CSS colour's name, or digits like #ffcc00, found {name}{hint}")
    return names[name].removeprefix("#")


def _linear(value: float) -> float:
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


def digits(colour: ArrayLike) -> str:
    """A linear RGB colour as sRGB in hexadecimal digits, like #ffcc00."""
    c = np.clip(np.asarray(colour, np.float64), 0.0, 1.0)
    srgb = np.where(c <= 0.0031308, c * 12.92, 1.055 * np.power(c, 1 / 2.4) - 0.055)
    return "#" + "".join(f"{round(float(value) * 255):02x}" for value in srgb)


# What a list can be sorted by, and the keys.
SORTED_BY: dict[str, Callable[[Record], tuple[float | str, ...]]] = {
    "name": lambda record: (record.name,),
    "size": lambda record: (record.bytes, record.name),
    "quality": lambda record: (record.metrics.get(QUALITY, np.inf), record.name),
    "colour": lambda record: (*hue(record.colour), record.name),
    "gloss": lambda record: (record.gloss, record.name),
    "metalness": lambda record: (record.metalness, record.name),
}


def in_order(records: Iterable[Record], by: str, *, reverse: bool = False) -> list[Record]:
    """Records sorted by a key of SORTED_BY."""
    return sorted(records, key=SORTED_BY[by], reverse=reverse)


def looks(brdf: Brdf) -> NDArray[np.float64]:
    """What of a BRDF is compared to say how alike two look: log(f_r + 0.01) at 320 pairs of directions, (320, 3), even
    in √θ_h, θ_d and φ_d, so that the mirror's lobe counts as much as the rest."""
    f_r = brdf.eval(*_pairs())
    return np.log(np.maximum(f_r, 0.0) + DARK)


def unlikeness(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """How unlike two are: the root of the mean squared difference of their `looks`."""
    return float(np.sqrt(np.mean(np.square(a - b))))


@cache
def _pairs() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    counts = zip(LOOKS, (np.pi / 2, np.pi / 2, 2 * np.pi), strict=True)
    axes = [(np.arange(count) + 0.5) / count * (1 if at == 0 else span) for at, (count, span) in enumerate(counts)]
    theta_h, theta_d, phi_d = (axis.reshape(-1) for axis in np.meshgrid(*axes, indexing="ij"))
    light, viewer = (np.stack(w, axis=-1) for w in directions(theta_h**2 * np.pi / 2, theta_d, phi_d))
    return light, viewer
