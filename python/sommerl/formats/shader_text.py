"""The texts that `shader` puts together: what differs between languages, and the functions, which are written once.

Words between @ are filled in by `shader.source`.
"""

from __future__ import annotations

from dataclasses import dataclass


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

HEAD = """\
// @TITLE@
// Written by Sommerl: @CONTENTS@
// Source: @SHA@
//
// @CALL@: f_r [1/sr], linear RGB, without the cosine. wi points to the light, wo to the viewer: unit
// vectors in the surface's frame, z along the normal. 0 below the horizon.
//
// The arrays can live in buffers of your own: before this file, define
// @MACROS@.

"""
CELLS_CONTENTS = """\
a palette of reflectances (LUT) and, for each cell of a lattice in half/difference angles, the
// number of its entry."""
NODES_CONTENTS = """\
a palette of gains and shapes (LUT), for each node of a lattice in half/difference angles the
// numbers of its two entries, and where the nodes are. Gain times shape is the cube root of what is blended."""

ENTRY = """
SOMMERL_FUNCTION uint @NAME@_entry(uint i) {
    return (SOMMERL_WORD(i / @PER_WORD@u) >> (@BITS@u * (i % @PER_WORD@u))) & @MASK@u;
}
"""

EVAL = """
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
@LOOKUP@
}
"""
RECIPROCAL = """\
    if (y < real(0) || (y == real(0) && x < real(0))) { x = real(0) - x; y = real(0) - y; }  // reciprocity
    real phi_d = atan2(y, x + real(0));"""
NOT_RECIPROCAL = """\
    real phi_d = atan2(y, x);
    if (phi_d < real(0)) phi_d = phi_d + real(6.283185307179586);"""

CELLS = """
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
"""
BINS = """\
    real h = real(@BINS_H@) * sqrt(theta_h * real(@SHARE_THETA@));
    real d = real(@BINS_D@) * (theta_d * real(@SHARE_THETA@));
    real p = real(@BINS_P@) * (phi_d * real(@SHARE_PHI@));
"""
NEAREST = (
    BINS
    + """\
    return @NAME@_value(@NAME@_cell(h, d, min(p, real(@BINS_P@) - real(1))), real(1));"""
)
TRILINEAR = (
    BINS
    + """\
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
)

NODES = """
// SOMMERL_LATTICE holds, for each step of a fine grid, between which nodes of an axis it lies: in four bytes, the
// lowest first, the numbers of the two nodes and their places. First the @FINE@ steps in theta_h, whose nodes are rows;
// then for each band of rows the steps in theta_d and those in phi_d; then for each row the number of its first node,
// and a word with its band (the lowest byte) and its number of nodes in phi_d.
SOMMERL_FUNCTION uint @NAME@_step(uint axis, real place) {
    return SOMMERL_LATTICE(axis * @FINE@u + uint(min(max(place, real(0)), real(@FINE@ - 1))));
}

SOMMERL_FUNCTION real @NAME@_share(uint between, real place) {
    real a = real((between >> 16u) & 255u), b = real(between >> 24u);
    return min(max((place - a) / (b - a), real(0)), real(1));
}

// Of the two nodes of a step, the first or the second: its number, and its weight.
SOMMERL_FUNCTION uint @NAME@_number(uint between, uint second) { return (between >> (8u * second)) & 255u; }
SOMMERL_FUNCTION real @NAME@_weight(real share, uint second) { return second == 1u ? share : real(1) - share; }

SOMMERL_FUNCTION real3 @NAME@_value(uint node, real weight) {
    uint entry = @NAME@_entry(node), i = 3u * (entry & @SHAPE_MASK@u);
    real r = real(SOMMERL_LUT(i)), g = real(SOMMERL_LUT(i + 1u)), b = real(SOMMERL_LUT(i + 2u));
    real gain = weight * real(SOMMERL_GAIN(entry >> @SHAPE_BITS@u));
    return real3(gain * r, gain * g, gain * b);
}

// f_r of a blend of cube roots. factor: what is left of the scale and the cosines.
SOMMERL_FUNCTION real @NAME@_cube(real blend, real factor) {
    real above = max(blend, real(0));
    return above * above * above * factor;
}
"""
NODES_LOOKUP = """\
    real a = sqrt(theta_h * real(@SHARE_THETA@)), knee = real(@KNEE_AT@);
    real h = a < knee ? a * real(@BELOW@) : real(@KNEE@) + (a - knee) * real(@ABOVE@);
    real d = theta_d * real(@STEPS_THETA@), p = phi_d * real(@STEPS_PHI@);
    if (p >= real(@FINE@)) p = p - real(@FINE@);
    uint rows = @NAME@_step(0u, h);
    real t = @NAME@_share(rows, h);
    real3 sum = real3(real(0), real(0), real(0));
    for (uint i = 0u; i < 2u; ++i) {
        uint row = @ROWS@u + 2u * @NAME@_number(rows, i);
        uint first = SOMMERL_LATTICE(row), band = SOMMERL_LATTICE(row + 1u);
        uint step_d = @NAME@_step(1u + 2u * (band & 255u), d), step_p = @NAME@_step(2u + 2u * (band & 255u), p);
        real u = @NAME@_share(step_d, d), w = @NAME@_share(step_p, p);
        for (uint j = 0u; j < 4u; ++j) {
            uint node = first + (band >> 8u) * @NAME@_number(step_d, j / 2u) + @NAME@_number(step_p, j % 2u);
            real weight = @NAME@_weight(t, i) * @NAME@_weight(u, j / 2u) * @NAME@_weight(w, j % 2u);
            real3 value = @NAME@_value(node, weight);
            sum = real3(sum.x + value.x, sum.y + value.y, sum.z + value.z);
        }
    }
    real least = real(@SMALLEST_COSINE@);  // the cosines divided by
    real factor = real(@SCALE@) / (max(wi.z, least) * max(wo.z, least));
    return real3(@NAME@_cube(sum.x, factor), @NAME@_cube(sum.y, factor), @NAME@_cube(sum.z, factor));"""
