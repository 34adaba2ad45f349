"""What the names of columns say: which angle or value a column holds, and in which unit.

Of the light: `theta_i`, `theta_in`, `incident zenith`, `SZA`, `phi_i`, …; of the viewer: `_o`, `_r`, `_s`, `_v`, `out`,
`ref`, `scattered`, `viewing`, …; between the two: `dphi`, `Δφ`, `relative azimuth`, and `phi` alone. Values: `r`, `g`,
`b`; CIE `X`, `Y`, `Z`; wavelengths, `550`, `550nm`, `R550`; one grey value, `brdf`. A unit stands behind a name:
`theta_i_deg`, `theta_i [°]`, `phi (rad)`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

Unit = Literal["deg", "rad", "percent", ""]

ANGLES = ("theta_i", "phi_i", "theta_o", "phi_o", "dphi")
RGB, XYZ = ("r", "g", "b"), ("x", "y", "z")
GREY, FACTOR, WAVELENGTH = "grey", "factor", "nm"  # a factor is π times f_r

_GREEK = str.maketrans(
    dict.fromkeys("θϑΘ", " theta ")
    | dict.fromkeys("φϕΦ", " phi ")
    | dict.fromkeys("Δδ∆", " delta ")
    | {"λ": " lambda ", "β": " beta ", "ᵢ": " i ", "ₒ": " o ", "\u00a0": " "}
)
_UNIT = re.compile(
    r"(?:degrees?|deg|°|º|radians?|rads?|\(?1\s*/\s*sr\)?|sr\s*\^?\s*\(?[-−]1\)?|%|percent|nm)", re.IGNORECASE
)
_TRAILING = re.compile(rf"[\s_\-/,:(\[]*(?:in\s+)?({_UNIT.pattern})[\s)\]]*$", re.IGNORECASE)


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_LIGHT = _words("i in inc incident incidence incoming light l source src illumination illum lamp sun solar input")
_VIEWER = _words(
    "o out outgoing output r ref refl reflected reflection s sc scat scatter scattered scattering v view viewing "
    "viewer det detector receiver rec obs observer observation exit exitant e emergent emergence camera"
)
_THETA = _words("theta th zenith polar inclination")
_PHI = _words("phi azimuth azimuthal az azi")
_BETWEEN = _words("d delta rel relative diff difference")
_FILLER = _words("angle angles of direction the")
_SHORT = {
    "aoi": "theta_i", "sza": "theta_i", "vza": "theta_o", "saa": "phi_i", "vaa": "phi_o", "raa": "dphi",
    "angleofincidence": "theta_i", "incidenceangle": "theta_i", "incidentangle": "theta_i", "viewingangle": "theta_o",
    "viewangle": "theta_o", "scatterangle": "theta_o", "scatteringangle": "theta_o", "scatteredangle": "theta_o",
    "detectorangle": "theta_o", "reflectionangle": "theta_o", "anglein": "theta_i", "angleout": "theta_o",
}  # fmt: skip
_GREY_NAMES = _words("brdf bsdf fr f value values val grey gray mono lum luminance brdfvalue bsdfvalue")
_FACTOR_NAMES = _words("brf reflectancefactor radiancefactor beta")
_COLOURS = {"red": "r", "green": "g", "blue": "b"}
_BEFORE_VALUE = r"(?:brdf|bsdf|f_?r|value|val|refl|reflectance|linear|cie|srgb|rgb|xyz)"
_SPECTRAL = re.compile(r"(?:[a-z_ ]+[\s_(\[=a-z]*)??(\d{3,4}(?:\.\d+)?)[\s_]*(?:nm)?[\s)\]]*", re.IGNORECASE)
SHORTEST, LONGEST = 200.0, 2600.0  # [nm]


@dataclass(frozen=True)
class Column:
    """role: one of ANGLES, RGB, XYZ, GREY, FACTOR or WAVELENGTH. unit: as the name says it, "" if it does not."""

    role: str
    unit: Unit = ""
    nanometres: float = 0.0


def column(name: str) -> Column | None:
    """What a column of that name holds; None if that is nothing known."""
    plain = name.strip().strip("\"'").strip()
    body, unit = split_unit(plain)
    return _angle(body, unit) or _value(plain, body, unit)


def split_unit(name: str) -> tuple[str, Unit]:
    """A name without its unit, and that."""
    bracketed = re.search(rf"[\[(]\s*({_UNIT.pattern})\s*[\])]", name, re.IGNORECASE)
    if bracketed:
        return name[: bracketed.start()] + " " + name[bracketed.end() :], unit_of(bracketed[1])
    found = _TRAILING.search(name)
    if not found or found.start() == 0:
        return name, ""
    return name[: found.start()], unit_of(found[1])


def unit_of(text: str) -> Unit:
    """The unit in a cell of its own, as in a row of units; "" for one that means nothing here."""
    text = text.strip().strip("\"'[]() ").lower()
    if text.startswith("deg") or text in ("°", "º"):
        return "deg"
    if text.startswith("rad"):
        return "rad"
    return "percent" if text in ("%", "percent") else ""


def is_unit(text: str) -> bool:
    """Whether a cell holds a unit and nothing else."""
    return (
        not text.strip()
        or re.fullmatch(rf"[\s(\[]*(?:{_UNIT.pattern}|[-–a-z.]{{1,6}})[\s)\]]*", text.strip("\"' "), re.I) is not None
    )


def is_angle(name: str) -> bool:
    found = column(name)
    return found is not None and found.role in ANGLES


def _angle(body: str, unit: Unit) -> Column | None:
    # "ThetaIn" is two words; "theta_i", "theta-i" and "theta i" are two, too.
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", body).translate(_GREEK).lower()
    words = [word for word in re.split(r"[^a-z]+", parted) if word and word not in _FILLER]
    if re.search(r"\d", parted):
        return None
    joined = "".join(re.split(r"[^a-z]+", parted))
    if joined in _SHORT:
        return Column(_SHORT[joined], unit)
    words = [part for word in words for part in _unjoined(word)]
    kinds = {"theta" for word in words if word in _THETA} | {"phi" for word in words if word in _PHI}
    if len(kinds) != 1:
        return None
    kind = kinds.pop()
    others = [word for word in words if word not in (_THETA | _PHI)]
    if kind == "phi" and (not others or all(word in _BETWEEN for word in others)):
        return Column("dphi", unit)
    sides = {"i" if word in _LIGHT else "o" if word in _VIEWER else "" for word in others}
    return Column(f"{kind}_{sides.pop()}", unit) if len(sides) == 1 and "" not in sides else None


def _unjoined(word: str) -> list[str]:
    """ "thetain" as "theta" and "in", "dphi" as "d" and "phi"; other words as they are."""
    for kind in ("theta", "phi", "azimuth", "zenith"):
        if word.startswith(kind) and word != kind and word not in _PHI:
            return [kind, word[len(kind) :]]
        if word.endswith(kind) and word != kind:
            return [word[: -len(kind)], kind]
    return [word]


def _value(plain: str, body: str, unit: Unit) -> Column | None:
    lower = body.translate(_GREEK).lower().strip()
    spectral = _SPECTRAL.fullmatch(plain.translate(_GREEK).strip())
    if spectral and SHORTEST <= float(spectral[1]) <= LONGEST:
        return Column(WAVELENGTH, unit, float(spectral[1]))
    bare = re.sub(rf"^{_BEFORE_VALUE}[\s_.(\[]+(?=.)", "", lower).strip(" _()[]")
    bare = _COLOURS.get(bare, bare)
    if bare in RGB or (bare in XYZ):
        return Column(bare, unit)
    joined = re.sub(r"[^a-z]+", "", lower)
    if joined in _FACTOR_NAMES:
        return Column(FACTOR, unit)
    return Column(GREY, unit) if joined in _GREY_NAMES else None
