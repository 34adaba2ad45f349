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
inline real abs(real x) { return std::fabs(x); }
#define SOMMERL_FUNCTION inline
#define SOMMERL_OUT(type) type&
""",
    after="""
inline real3 eval(real3 wi, real3 wo) { return @NAME@_eval(wi, wo); }
inline real3 sample(real3 wo, real3 u, real& pdf) { return @NAME@_sample(wo, u, pdf); }
inline real pdf(real3 wi, real3 wo) { return @NAME@_pdf(wi, wo); }

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
#define SOMMERL_OUT(type) out type
""",
    after="#undef real\n#undef real3\n#undef atan2\n",
    array="const {type} {name}[{size}] = {type}[{size}](\n{values}\n);",
)
HLSL = Language(
    before="""\
#define real float
#define real3 float3
#define SOMMERL_FUNCTION
#define SOMMERL_OUT(type) out type
""",
    after="#undef real\n#undef real3\n",
    array="static const {type} {name}[{size}] = {{\n{values}\n}};",
)

HEAD = """\
// @TITLE@
// Written by Sommerl: @CONTENTS@
// Source: @SHA@
//
// @CALL@eval(wi, wo): f_r [1/sr], linear RGB, without the cosine. wi points to the light, wo to the viewer: unit
// vectors in the surface's frame, z along the normal. 0 below the horizon.
// @CALL@sample(wo, u, pdf): a direction wi about as f_r times cosine is distributed, from three uniform random
// numbers u in [0, 1). It sets pdf to the density [1/sr] of wi: 0 if nothing was drawn.
// @CALL@pdf(wi, wo): the density [1/sr] of drawing wi for wo. 0 below the horizon.
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

// The whole part of x, at least 0 and at most `last`, whatever x is.
SOMMERL_FUNCTION uint @NAME@_bin(real x, real last) { return uint(min(max(x, real(0)), last)); }
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

SAMPLING = """
// The sampler: Sommerl's sampling/half_vector.py, with the same names. A unit square is stretched over the half vectors
// whose light is above the horizon: one side is s, with sin(theta_h) = s^4 sin(theta_max), the other c, the place of
// phi_h on the rim of a diamond. SOMMERL_SAMPLER holds @ROWS@ x @COLUMNS@ cells of that square for each of @ELEVATIONS@
// elevations of the viewer; of a cell, from the lowest bits, its probability in units of 1/@WHOLE@ (16 bits), another
// cell (8), and how many of its own @SLOTS@ slots that one takes (8).

// Of two neighbouring elevations, where the first one's cells begin, and in t the second one's share.
SOMMERL_FUNCTION uint @NAME@_elevation(real cos_o, SOMMERL_OUT(real) t) {
    real x = sqrt(cos_o) * real(@ELEVATIONS@ - 1);
    uint node = @NAME@_bin(x, real(@ELEVATIONS@ - 2));
    t = x - real(node);
    return @CELLS@u * node;
}

// The density in a cell of the unit square.
SOMMERL_FUNCTION real @NAME@_share(uint first, real t, uint cell) {
    real here = real(SOMMERL_SAMPLER(first + cell) & 65535u);
    real next = real(SOMMERL_SAMPLER(first + @CELLS@u + cell) & 65535u);
    return (here + t * (next - here)) / real(@SLOTS@);
}

// sin^2 theta_max of half vectors in a plane through the normal, in which the viewer's direction has the components
// `along` the surface and `upright`, whose square is given, in any one unit.
SOMMERL_FUNCTION real @NAME@_extent(real along, real upright2) {
    real r = sqrt(along * along + upright2);
    real a = r + abs(along);
    return (along < real(0) ? upright2 : a * a) / (real(2) * r * a);
}

// The direction to the light at a place of the unit square, and the solid angle of the whole square at its scale.
SOMMERL_FUNCTION real3 @NAME@_mirrored(real s, real c, real side, real3 wo, SOMMERL_OUT(real) solid_angle) {
    real x = real(1) - c;
    real y = real(1) - abs(x);
    y = side < real(0) ? -y : y;
    real round_ = x * x + y * y;
    real wx = wo.x + real(@TINY@), wy = wo.y, wz = max(wo.z, real(@LOWEST@));
    real across = wx * wx + wy * wy;
    real scale = real(1) / sqrt(round_ * across);
    real tilt = x * across * scale;
    real extent = @NAME@_extent(tilt, wz * wz);
    real s2 = s * s;
    real s6 = s2 * s2 * s2;
    real sin2 = s6 * s2 * extent;
    real sin = sqrt(sin2), cos = sqrt(max(real(1) - sin2, real(0)));
    real dot = sin * tilt + cos * wz;
    real planar = real(2) * dot * sin * scale;
    solid_angle = real(64) * (s6 * s) * extent * dot / (cos * round_);
    return real3(planar * (x * wx - y * wy) - wx, planar * (x * wy + y * wx) - wy, real(2) * dot * cos - wz);
}

SOMMERL_FUNCTION real3 @NAME@_sample(real3 wo, real3 u, SOMMERL_OUT(real) pdf) {
    pdf = real(0);
    if (!(wo.z > real(0))) return real3(real(0), real(0), real(1));
    real t;
    uint first = @NAME@_elevation(wo.z, t);
    bool second = u.x < t;
    real again = second ? u.x / t : (u.x - t) / (real(1) - t);
    uint slot = @NAME@_bin(again * real(@WHOLE@), real(@WHOLE@ - 1));
    uint cell = slot >> @SLOT_BITS@u;
    uint word = SOMMERL_SAMPLER(cell + (second ? first + @CELLS@u : first));
    if ((slot & (@SLOTS@u - 1u)) < (word >> 24u)) cell = (word >> 16u) & 255u;
    real side = real(2) * u.z - real(1);
    real s = (real(cell / @COLUMNS@u) + u.y) / real(@ROWS@);
    real c = (real(cell % @COLUMNS@u) + abs(side)) * (real(2) / real(@COLUMNS@));
    real solid_angle;
    real3 wi = @NAME@_mirrored(s, c, side, wo, solid_angle);
    // Half vectors next to the normal have densities beyond single precision, and weigh nothing.
    if (!(wi.z > real(0) && solid_angle > real(@SMALLEST@))) return real3(real(0), real(0), real(1));
    pdf = @NAME@_share(first, t, cell) / solid_angle;
    return wi;
}

SOMMERL_FUNCTION real @NAME@_pdf(real3 wi, real3 wo) {
    if (!(wi.z > real(0) && wo.z > real(0))) return real(0);
    // The viewer, raised as in _mirrored, and the half vector. Their lengths along the surface need not be known.
    real x = wo.x + real(@TINY@), y = wo.y, z = max(wo.z, real(@LOWEST@));
    real hx = (wi.x + wo.x) + real(@TINY@), hy = wi.y + wo.y, hz = wi.z + z;
    real along = hx * x + hy * y, across = hx * y - hy * x;
    real least = real(@TINY@) * real(@TINY@);  // in single precision, these lengths can be 0
    real flat2 = max(hx * hx + hy * hy, least);
    real extent = @NAME@_extent(along, z * z * flat2);
    real s = sqrt(sqrt(sqrt(min(flat2 / ((flat2 + hz * hz) * extent), real(1)))));
    real rim = real(1) / max(abs(along) + abs(across), least);
    real c = real(1) - along * rim;
    uint row = @NAME@_bin(s * real(@ROWS@), real(@ROWS@ - 1));
    uint column = @NAME@_bin(c * (real(@COLUMNS@) / real(2)), real(@COLUMNS@ - 1));
    real t;
    uint first = @NAME@_elevation(wo.z, t);
    real share = @NAME@_share(first, t, column + @COLUMNS@u * row);
    return share * (s * hz) * ((x * x + y * y) * (rim * rim) / real(32));
}
"""

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
    return SOMMERL_LATTICE(axis * @FINE@u + @NAME@_bin(place, real(@FINE@ - 1)));
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
        uint row = @FIRST_ROW@u + 2u * @NAME@_number(rows, i);
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
