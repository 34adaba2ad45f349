"""Materials as source code: a C++ header, GLSL or HLSL, with palette, packed indices and an `eval`, and nothing else.

One text serves the three languages; they differ in a few lines before it and in how an array is written.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..brdf import OnLattice
from ..errors import FormatError
from ..files import atomic_write

A_LINE = 10  # numbers
UNDEFINED = "#undef SOMMERL_FUNCTION\n#undef SOMMERL_WORD\n#undef SOMMERL_LUT\n"  # for the next material's file


@dataclass(frozen=True)
class Language:
    """What comes before and after the text, and how an array of constants is declared."""

    before: str
    after: str
    array: str


CPP = Language(
    before="""\
#pragma once
#include <cmath>
#include <cstdint>
#ifndef SOMMERL_REAL
#define SOMMERL_REAL double  // or float, before this file is included
#endif

namespace @NAME@ {

typedef SOMMERL_REAL real;
typedef std::uint32_t uint;
struct real3 {
    real x, y, z;
    real3(real x_, real y_, real z_) : x(x_), y(y_), z(z_) {}
};
inline real min(real a, real b) { return a < b ? a : b; }
inline real max(real a, real b) { return a > b ? a : b; }
inline real atan2(real y, real x) { return std::atan2(y, x); }
inline real sqrt(real x) { return std::sqrt(x); }
inline real floor(real x) { return std::floor(x); }
#define SOMMERL_FUNCTION inline
""",
    after="""
inline real3 eval(real3 wi, real3 wo) { return @NAME@_eval(wi, wo); }

}  // namespace @NAME@
""",
    array="static const {type} {name}[{size}] = {{\n{values}\n}};",
)
GLSL = Language(
    before="""\
#define real float
#define real3 vec3
#define atan2 atan
#define SOMMERL_FUNCTION
""",
    after="#undef real\n#undef real3\n#undef atan2\n",
    array="const {type} {name}[{size}] = {type}[{size}](\n{values}\n);",
)
HLSL = Language(
    before="""\
#define real float
#define real3 float3
#define SOMMERL_FUNCTION
""",
    after="#undef real\n#undef real3\n",
    array="static const {type} {name}[{size}] = {{\n{values}\n}};",
)
LANGUAGES = {".h": CPP, ".hpp": CPP, ".glsl": GLSL, ".hlsl": HLSL}

HEAD = """\
// @TITLE@
// Written by Sommerl: a palette of reflectances (LUT) and, for each cell of a lattice in half/difference angles, the
// number of its entry. Source: @SHA@
//
// @CALL@: f_r [1/sr], linear RGB, without the cosine. wi points to the light, wo to the viewer: unit
// vectors in the surface's frame, z along the normal. 0 below the horizon.
//
// Both arrays can live in buffers of your own: define SOMMERL_WORD(i) and SOMMERL_LUT(i) before this file.

"""

TEXT = """
SOMMERL_FUNCTION uint @NAME@_entry(uint cell) {
    return (SOMMERL_WORD(cell / @PER_WORD@u) >> (@BITS@u * (cell % @PER_WORD@u))) & @MASK@u;
}

// Cell number from the bins in (theta_h, theta_d, phi_d); the bins in phi_d wrap, the others end.
SOMMERL_FUNCTION uint @NAME@_cell(real h, real d, real p) {
    real last_h = real(@LAST_H@), last_d = real(@LAST_D@), bins_p = real(@BINS_P@);
    h = min(max(h, real(0)), last_h);
    d = min(max(d, real(0)), last_d);
    p = p < real(0) ? p + bins_p : (p < bins_p ? p : p - bins_p);
    return uint(p) + @BINS_P@u * (uint(d) + @BINS_D@u * uint(h));
}

SOMMERL_FUNCTION real3 @NAME@_value(uint cell, real weight) {
    uint i = 3u * @NAME@_entry(cell);
    return real3(weight * real(SOMMERL_LUT(i)), weight * real(SOMMERL_LUT(i + 1u)), weight * real(SOMMERL_LUT(i + 2u)));
}

SOMMERL_FUNCTION real3 @NAME@_eval(real3 wi, real3 wo) {
    if (!(wi.z > real(0) && wo.z > real(0))) return real3(real(0), real(0), real(0));
    // s = wi + wo and v = wi - wo are perpendicular: |v| / |s| = tan(theta_d).
    real sx = wi.x + wo.x, sy = wi.y + wo.y, sz = wi.z + wo.z;
    real vx = wi.x - wo.x, vy = wi.y - wo.y, vz = wi.z - wo.z;
    real s = sqrt(sx * sx + sy * sy + sz * sz), v = sqrt(vx * vx + vy * vy + vz * vz);
    real theta_h = atan2(sqrt(sx * sx + sy * sy), sz);
    real theta_d = atan2(v, s);
    real x = real(0) - vz * s, y = (vy * sx - vx * sy) + real(0);
@FOLD@
    real h = real(@BINS_H@) * sqrt(theta_h * real(@SHARE_THETA@));
    real d = real(@BINS_D@) * (theta_d * real(@SHARE_THETA@));
    real p = real(@BINS_P@) * (phi_d * real(@SHARE_PHI@));
@LOOKUP@
}
"""
RECIPROCAL = """\
    if (y < real(0) || (y == real(0) && x < real(0))) { x = real(0) - x; y = real(0) - y; }  // reciprocity
    real phi_d = atan2(y, x + real(0));"""
NOT_RECIPROCAL = """\
    real phi_d = atan2(y, x);
    if (phi_d < real(0)) phi_d = phi_d + real(6.283185307179586);"""
NEAREST = """\
    return @NAME@_value(@NAME@_cell(h, d, min(p, real(@BINS_P@) - real(1))), real(1));"""
TRILINEAR = """\
    h = min(max(h - real(0.5), real(0)), real(@LAST_H@));
    d = min(max(d - real(0.5), real(0)), real(@LAST_D@));
    p = p - real(0.5);
    real h0 = floor(h), d0 = floor(d), p0 = floor(p);
    real a = h - h0, b = d - d0, c = p - p0;
    real3 sum = real3(real(0), real(0), real(0));
    for (uint i = 0u; i < 8u; ++i) {
        real i_h = real(i / 4u), i_d = real((i / 2u) % 2u), i_p = real(i % 2u);
        real weight = (i_h > real(0) ? a : real(1) - a) * (i_d > real(0) ? b : real(1) - b)
            * (i_p > real(0) ? c : real(1) - c);
        real3 value = @NAME@_value(@NAME@_cell(h0 + i_h, d0 + i_d, p0 + i_p), weight);
        sum = real3(sum.x + value.x, sum.y + value.y, sum.z + value.z);
    }
    return sum;"""


def write(material: OnLattice, path: str | Path) -> None:
    """Writes a compressed material as source code in the language that the path's extension names, of LANGUAGES.

    Raises FormatError for a table that is not compressed.
    """
    path = Path(path)
    with atomic_write(path) as out:
        out.write(source(material, LANGUAGES[path.suffix.lower()], identifier(path.stem)).encode())


def identifier(name: str) -> str:
    """A name that all three languages take; if letters had to go, with a number in their place."""
    plain = re.sub(r"[^0-9A-Za-z]+", "_", name).strip("_")
    lost = not name.isascii()
    return "_".join(part for part in ("material", plain, f"{zlib.crc32(name.encode()):08x}" if lost else "") if part)


def source(material: OnLattice, language: Language, name: str) -> str:
    """The source code. name: of the namespace in C++, and before the names of functions in the others."""
    index, lut = material.cells()
    if index is None:
        raise FormatError(f"{material.name}: expected a compressed material, with a palette, found a table")
    words, bits = _packed(index)
    arrays = [
        _guarded("SOMMERL_WORD", "@NAME@_words", language, "uint", len(words), (f"{word:#x}u" for word in words)),
        _guarded("SOMMERL_LUT", "@NAME@_palette", language, "real", lut.size, _numbers(lut)),
    ]
    lattice = material.lattice
    text = TEXT.replace("@FOLD@", RECIPROCAL if lattice.reciprocal else NOT_RECIPROCAL)
    text = text.replace("@LOOKUP@", NEAREST if material.interpolation == "nearest" else TRILINEAR)
    title = re.sub(r"\s+", " ", "".join(c if c.isprintable() and c != "\\" else " " for c in material.name))
    call = "@NAME@::eval(wi, wo)" if language is CPP else "@NAME@_eval(wi, wo)"
    head = HEAD.replace("@CALL@", call) + language.before
    whole = head + "\n" + "\n".join(arrays) + text + language.after + UNDEFINED
    values = {
        "TITLE": title,
        "SHA": material.source_sha256 or "unknown",
        "NAME": name,
        "PER_WORD": str(32 // bits),
        "BITS": str(bits),
        "MASK": str(2**bits - 1),
        "BINS_H": str(lattice.theta_h),
        "BINS_D": str(lattice.theta_d),
        "BINS_P": str(lattice.phi_d),
        "LAST_H": str(lattice.theta_h - 1),
        "LAST_D": str(lattice.theta_d - 1),
        "SHARE_THETA": repr(2 / np.pi),
        "SHARE_PHI": repr(1 / lattice.phi_d_range),
    }
    # In one pass, so that a name with such a mark in it stays what it is.
    return re.sub(r"@([A-Z_]+)@", lambda mark: values.get(mark[1], mark[0]), whole)


def _packed(index: NDArray[Any]) -> tuple[NDArray[np.uint32], int]:
    """The indices of all cells in words of 32 bits, the first cell in the lowest bits, and the bits of each."""
    flat, bits = index.reshape(-1), 8 * index.dtype.itemsize
    padded = np.append(flat, np.zeros(-len(flat) % (32 // bits), flat.dtype))
    return padded.astype(padded.dtype.newbyteorder("<")).view("<u4"), bits


def _guarded(macro: str, name: str, language: Language, kind: str, size: int, values: Iterable[str]) -> str:
    numbers = list(values)
    lines = ("    " + ", ".join(numbers[i : i + A_LINE]) for i in range(0, size, A_LINE))
    array = language.array.format(type=kind, name=name, size=size, values=",\n".join(lines))
    return f"#ifndef {macro}\n{array}\n#define {macro}(i) {name}[i]\n#endif\n"


def _numbers(values: NDArray[np.float64]) -> list[str]:
    """Literals that all three languages take for real numbers, exact in single precision."""
    texts = [f"{value:.9g}" for value in values.reshape(-1)]
    return [text if "." in text or "e" in text else f"{text}.0" for text in texts]
