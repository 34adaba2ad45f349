"""Rusinkiewicz's half/difference coordinates of isotropic BRDFs, both ways (Rusinkiewicz 1998).

θ_h is the angle between the surface normal and the half vector; θ_d and φ_d are the polar coordinates of
the light's direction about the half vector. All formulas run on NumPy and on Dr.Jit arrays.
"""

from __future__ import annotations

from .arrays import Array, Triple, ops


def half_diff(wi: Triple, wo: Triple, reciprocal: bool = True, mirrored: bool = False) -> Triple:
    """Half/difference angles of pairs of unit directions in the surface frame.

    wi, wo: components (x, y, z) to the light and to the viewer, arrays of any one shape.
    reciprocal: swapping wi and wo adds π to φ_d; when true, φ_d is folded to half of its range, and the result is
        the same, bit for bit, for both orders.
    mirrored: a reflection of both in a plane through the normal changes the sign of φ_d; when true, φ_d is folded to
        half of its range, and the result is the same, bit for bit, for y of both negated.

    φ_d lies in [0, 2π), or in [0, `phi_d_range`] if folded.

    Returns (theta_h, theta_d, phi_d) [rad]; θ_h and θ_d lie in [0, π/2]. φ_d is 0 where θ_h is.

    With s = wi + wo and v = wi - wo, of which s ⟂ v: |v| / |s| = tan θ_d exactly, and v's components along
    n × s and along the tangent towards the normal are, up to a common factor, those in `atan2` below. No
    angle is taken by arccosine, which loses half of the digits near the highlight.
    """
    f = ops(wi[0])
    sx, sy, sz = wi[0] + wo[0], wi[1] + wo[1], wi[2] + wo[2]
    vx, vy, vz = wi[0] - wo[0], wi[1] - wo[1], wi[2] - wo[2]
    s = f.sqrt((sx * sx + sy * sy) + sz * sz)
    v = f.sqrt((vx * vx + vy * vy) + vz * vz)
    theta_h = f.atan2(f.sqrt(sx * sx + sy * sy), sz)
    theta_d = f.atan2(v, s)
    x = 0.0 - vz * s  # the zero turns -0 into 0, whose atan2 would be π
    y = (vy * sx - vx * sy) + 0.0
    if mirrored:
        phi_d = f.atan2(abs(y), abs(x) if reciprocal else x)
    elif reciprocal:
        other = (y < 0.0) | ((y == 0.0) & (x < 0.0))
        phi_d = f.atan2(f.where(other, -y, y), f.where(other, -x, x) + 0.0)
    else:
        phi_d = f.atan2(y, x)
        phi_d = f.where(phi_d < 0.0, phi_d + TWO_PI, phi_d)
    return theta_h, theta_d, phi_d


def phi_d_range(reciprocal: bool, mirrored: bool = False) -> float:
    """The range of φ_d [rad] that `half_diff` leaves of 2π."""
    return TWO_PI / (2 if reciprocal else 1) / (2 if mirrored else 1)


def directions(theta_h: Array, theta_d: Array, phi_d: Array) -> tuple[Triple, Triple]:
    """The pair of unit directions (wi, wo) with the given half/difference angles and φ_h = 0.

    Angles in radians, arrays of any one shape. A direction may lie below the horizon.
    """
    f = ops(theta_h)
    sin_h, cos_h = f.sin(theta_h), f.cos(theta_h)
    sin_d, cos_d = f.sin(theta_d), f.cos(theta_d)
    along, across = sin_d * f.cos(phi_d), sin_d * f.sin(phi_d)
    wi = (cos_d * sin_h + along * cos_h, across, cos_d * cos_h - along * sin_h)
    wo = (cos_d * sin_h - along * cos_h, -across, cos_d * cos_h + along * sin_h)
    return wi, wo


def spherical(theta: Array, phi: Array) -> Triple:
    """The unit direction at polar angle θ from the normal and azimuth φ [rad]."""
    f = ops(theta)
    return f.sin(theta) * f.cos(phi), f.sin(theta) * f.sin(phi), f.cos(theta)


TWO_PI = 6.283185307179586
