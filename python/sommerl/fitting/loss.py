"""The domains in which fits compare reflectance."""

from __future__ import annotations

from dataclasses import dataclass

from ..reflectance.arrays import Array
from ..system.jit import drjit
from .options import Loss

LOG_EPSILON = 1e-3  # [1/sr]
SMALLEST_ROOT = 1e-12  # below this, the cube root is taken to be constant, since its slope has no bound at 0


@dataclass(frozen=True)
class Domain:
    """What a loss makes of weighted reflectance, on Dr.Jit arrays."""

    loss: Loss

    @property
    def linear(self) -> bool:
        return self.loss in ("l2", "cosine-l2")

    def weight(self, cos_i: Array) -> Array:
        """By what f_r is multiplied before."""
        return type(cos_i)(1.0) if self.loss == "l2" else cos_i

    def mapped(self, f_r: Array) -> Array:
        """Weighted f_r in the domain."""
        match self.loss:
            case "log":
                return drjit().log(1.0 + f_r / LOG_EPSILON)
            case "cube-root":
                return drjit().cbrt(drjit().maximum(f_r, SMALLEST_ROOT))
            case _:
                return f_r

    def unmapped(self, mapped: Array) -> Array:
        """The inverse of `mapped`."""
        match self.loss:
            case "log":
                return LOG_EPSILON * (drjit().exp(mapped) - 1.0)
            case "cube-root":
                return mapped * mapped * mapped
            case _:
                return mapped

    def slope(self, f_r: Array) -> Array:
        """The derivative of `mapped`."""
        match self.loss:
            case "log":
                return 1.0 / (LOG_EPSILON + f_r)
            case "cube-root":
                root = self.mapped(f_r)
                return drjit().select(f_r > SMALLEST_ROOT, 1.0 / (3.0 * root * root), 0.0)
            case _:
                return 0.0 * f_r + 1.0
