"""A BRDF between two others: their cube roots, blended linearly.

    f = ((1 − w) ∛f_a + w ∛f_b)³

Nothing physical reflects so. A surface of which a share w is covered by the second material reflects the linear blend,
(1 − w) f_a + w f_b, in which the brighter highlight hides the other one at once. Cube roots are about how bright things
look, so that steps of w look even. For f ≥ 0 the blend lies between the two, and nowhere above the linear one (means of
powers). So it reflects no more energy than the brighter of the two; it is reciprocal if both are.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from ..system.errors import OptionError
from .arrays import Triple, ops
from .brdf import Brdf, Buffers

FIRST, SECOND = "first_", "second_"  # before the names of both materials' buffers


def blend(first: Brdf, second: Brdf, weight: float) -> Brdf:
    """The blend of two BRDFs. weight: of the second, from 0 to 1. Raises OptionError for another.

    >>> between = blend(sommerl.load("nickel"), sommerl.load("chrome"), 0.3)
    >>> between.eval([0, 0, 1], [0, 0, 1]).shape
    (3,)
    """
    return BlendedBrdf(first, second, weight)


class BlendedBrdf(Brdf):
    """The blend of two other BRDFs: see `blend`."""

    def __init__(self, first: Brdf, second: Brdf, weight: float) -> None:
        if not 0 <= weight <= 1:
            raise OptionError(f"weight: expected 0 to 1, found {weight:g}")
        self._first, self._second, self._weight = first, second, float(weight)
        self.name = f"{1 - weight:.4g} {first.name} + {weight:.4g} {second.name}"

    @property
    def facts(self) -> dict[str, Any]:
        """What was blended."""
        first, second = self._first, self._second
        digests = {"first_sha256": _digest(first), "second_sha256": _digest(second)}
        return {"blend_weight": self._weight, "blend_first": first.name, "blend_second": second.name, **digests}

    @property
    def reciprocal(self) -> bool:
        return self._first.reciprocal and self._second.reciprocal

    @property
    def signed(self) -> bool:
        return self._first.signed or self._second.signed

    @property
    def mirrored(self) -> bool:
        return self._first.mirrored and self._second.mirrored

    def buffers(self) -> dict[str, NDArray[Any]]:
        both = ((FIRST, self._first), (SECOND, self._second))
        return {f"{before}{name}": buffer for before, brdf in both for name, buffer in brdf.buffers().items()}

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        first = self._first.f_r(wi, wo, _of(FIRST, buffers))
        second = self._second.f_r(wi, wo, _of(SECOND, buffers))
        r, g, b = (_blended(x, y, self._weight) for x, y in zip(first, second, strict=True))
        return r, g, b


def _blended(x: Any, y: Any, weight: float) -> Any:
    mean = (1.0 - weight) * _root(x) + weight * _root(y)
    return mean * mean * mean


def _root(x: Any) -> Any:
    """The cube root, of negative numbers, too."""
    f = ops(x)
    return f.where(x < 0.0, -1.0, 1.0) * f.power(abs(x), 1 / 3)


def _of(before: str, buffers: Buffers) -> dict[str, Any]:
    return {name.removeprefix(before): each for name, each in buffers.items() if name.startswith(before)}


def _digest(brdf: Brdf) -> str:
    return brdf.file_sha256 or brdf.source.sha256
