"""Sommerl: measured reflectance as small material files that render fast and look like the measurement.

Needs NumPy alone. Pictures, and the metrics on them, are in `sommerl.render` and `sommerl.metrics`; they need the
packages of sommerl[render].
"""

import sys
from importlib import import_module
from types import ModuleType

from . import threads  # before NumPy is imported

TYPE_CHECKING = False  # as in `typing`, which takes long to load
if TYPE_CHECKING:
    from typing import Any

    from .brdf import Brdf
    from .errors import SommerlError
    from .lattice import MERL, Lattice
    from .load import load, load_table
    from .materials import NAMES, builtin, builtin_table
    from .som_man.file import save
    from .som_man.material import SomManBrdf
    from .som_man.options import TrainOptions
    from .som_man.train import TrainReport, train
    from .table import BrdfTable

__version__ = "0.1.0"

__all__ = [
    "MERL",
    "NAMES",
    "Brdf",
    "BrdfTable",
    "Lattice",
    "SomManBrdf",
    "SommerlError",
    "TrainOptions",
    "TrainReport",
    "builtin",
    "builtin_table",
    "load",
    "load_table",
    "save",
    "threads",
    "train",
]

_MODULES = {
    "MERL": "lattice",
    "NAMES": "materials",
    "Brdf": "brdf",
    "BrdfTable": "table",
    "Lattice": "lattice",
    "SomManBrdf": "som_man.material",
    "SommerlError": "errors",
    "TrainOptions": "som_man.options",
    "TrainReport": "som_man.train",
    "builtin": "materials",
    "builtin_table": "materials",
    "load": "load",
    "load_table": "load",
    "save": "som_man.file",
    "train": "som_man.train",
}


def __getattr__(name: str) -> "Any":
    """A name is imported when it is first asked for: the command line has signals to hold back before NumPy comes."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    return found


class _Package(ModuleType):
    """Here, `load` is the function, also once the module of that name has been imported."""

    def __setattr__(self, name: str, value: object) -> None:
        if name not in _MODULES or not isinstance(value, ModuleType):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
