"""Pictures of data, with matplotlib."""

from .scattered import coverage
from .spheres import fits

__all__ = ["coverage", "fits"]
