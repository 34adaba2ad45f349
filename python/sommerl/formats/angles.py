"""The angles of samples as people measure them: in degrees or radians, signed in a plane, with the azimuth of the
viewer or that between both."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..system.errors import FormatError

QUARTER, HALF, TURN = np.pi / 2, np.pi, 2 * np.pi
LITTLE = 1.001  # of an angle's range, for rounding
FEWEST_DEGREES = 1.6  # θ in degrees that are all below are taken for radians

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Given:
    """A column of angles: its name in the file, its unit if that is stated ("deg", "rad" or ""), and its numbers."""

    name: str
    unit: str
    numbers: Values


def in_radians(
    given: Mapping[str, Given], where: Callable[[int], str], header: str = ""
) -> tuple[dict[str, Values], str]:
    """Columns of angles, by their roles, in radians; and how their unit was found, for people.

    where: names a row in messages, of its number. header: names the line with the names, for messages. A column that
    states its unit has it; the others are in degrees if one of them holds an angle that radians do not reach, else in
    the unit of those that state one, else in radians. NaN stays. Raises FormatError for angles that cannot be.
    """
    stated = {each.unit for each in given.values() if each.unit}
    silent = {role: each for role, each in given.items() if not each.unit}
    beyond = any(
        _largest(each) > (HALF if role.startswith("theta") else TURN) * LITTLE for role, each in silent.items()
    )
    unit = "deg" if beyond else stated.pop() if len(stated) == 1 else "rad"
    found: dict[str, Values] = {}
    for role, each in given.items():
        degrees = (each.unit or unit) == "deg"
        _check(role, each, degrees, where)
        found[role] = np.radians(each.numbers) if degrees else each.numbers
    thetas = [each for role, each in given.items() if role.startswith("theta")]
    turned = any(_largest(each) > TURN * LITTLE for role, each in given.items() if not role.startswith("theta"))
    if thetas and all(each.unit == "deg" for each in thetas) and not turned:
        largest = max(map(_largest, thetas))
        if 0 < largest <= FEWEST_DEGREES:
            names = ", ".join(each.name for each in thetas)
            raise FormatError(f"{names}: expected degrees, found nothing above {largest:.3g}{header} (radians?)")
    words = {"deg": "degrees", "rad": "radians"}
    units = {each.unit or unit for each in given.values()}
    how = "from their range" if silent else "as their columns say"
    return found, f"{' and '.join(sorted(words[each] for each in units))}, {how}"


def directions(angles: Mapping[str, Values]) -> tuple[Values, str]:
    """θ_i, φ_i, θ_o, φ_o [rad], (n, 4), of the columns that there are; and what was taken for granted, "" if nothing.

    A negative θ is the same θ at φ + π. Without any azimuth, all lies in one plane: where θ_i is never negative, light
    and viewer are on opposite sides if θ_o is positive; where it never is positive, both count from one side.
    Raises FormatError if θ_i or θ_o is missing, or if that cannot be told.
    """
    theta_i, theta_o = angles["theta_i"].copy(), angles["theta_o"].copy()
    zero = np.zeros_like(theta_i)
    told = ""
    if "dphi" in angles:
        phi_i, phi_o = zero.copy(), angles["dphi"].copy()
    elif "phi_o" in angles or "phi_i" in angles:
        phi_i, phi_o = (angles.get(name, zero).copy() for name in ("phi_i", "phi_o"))
        missing = next((name for name in ("phi_i", "phi_o") if name not in angles), None)
        told = f"no column {missing}: taken for 0" if missing else ""
    else:
        known = np.isfinite(theta_i)
        if (theta_i[known] < 0).any() and (theta_i[known] > 0).any():
            raise FormatError(
                "theta_i: expected one sign, or a column of azimuths that says where the viewer is, found both signs"
            )
        opposite = not (theta_i[known] < 0).any()
        phi_i, phi_o = zero.copy(), zero + (HALF if opposite else 0.0)
        told = "one plane: positive θ_o is on the mirror's side" if opposite else "one plane: all θ count from one side"
    for theta, phi in ((theta_i, phi_i), (theta_o, phi_o)):
        phi[theta < 0] += HALF
        np.abs(theta, out=theta)
    return np.stack([theta_i, phi_i, theta_o, phi_o], axis=-1), told


def _largest(given: Given) -> float:
    finite = np.abs(given.numbers[np.isfinite(given.numbers)])
    return float(finite.max()) if finite.size else 0.0


def _check(role: str, given: Given, degrees: bool, where: Callable[[int], str]) -> None:
    """Raises FormatError for angles that cannot be."""
    unit, half = ("deg", 180.0) if degrees else ("rad", HALF)
    most = half if role.startswith("theta") else 4 * half
    wrong = np.abs(given.numbers) > most * LITTLE
    if wrong.any():
        row = int(np.argmax(wrong))
        raise FormatError(
            f"{given.name}: expected angles from {-most:.6g} to {most:.6g} {unit}, "
            f"found {given.numbers[row]:g} in {where(row)}"
        )
