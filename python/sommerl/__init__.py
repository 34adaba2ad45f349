"""Sommerl: measured reflectance as small material files that render fast and look like the measurement.

Needs NumPy alone. Pictures, and the metrics on them, are in `sommerl.render`, and need the packages of sommerl[render].
"""

from importlib import import_module

from .system import threads  # before NumPy is imported

TYPE_CHECKING = False  # as in `typing`, which takes long to load
if TYPE_CHECKING:
    from typing import Any

    from .compression.atlas import Atlas
    from .compression.material import SomManBrdf
    from .compression.paper.options import TrainOptions
    from .compression.paper.train import TrainReport, train
    from .compression.smrl.file import save
    from .formats.load import load, load_table
    from .library.library import Library
    from .models.builtin import NAMES, builtin, builtin_table
    from .reflectance.blend import blend
    from .reflectance.brdf import Brdf
    from .reflectance.cells import MERL, Lattice
    from .reflectance.reciprocal import reciprocal
    from .reflectance.table import BrdfTable
    from .render.compress import compress
    from .system.errors import SommerlError
    from .viewer.notebook import view

    __version__: str


__all__ = [
    "MERL",
    "NAMES",
    "Atlas",
    "Brdf",
    "BrdfTable",
    "Lattice",
    "Library",
    "SomManBrdf",
    "SommerlError",
    "TrainOptions",
    "TrainReport",
    "blend",
    "builtin",
    "builtin_table",
    "compress",
    "load",
    "load_table",
    "reciprocal",
    "save",
    "threads",
    "train",
    "view",
]

_MODULES = {
    "MERL": "reflectance.cells",
    "NAMES": "models.builtin",
    "Atlas": "compression.atlas",
    "Brdf": "reflectance.brdf",
    "BrdfTable": "reflectance.table",
    "Lattice": "reflectance.cells",
    "Library": "library.library",
    "SomManBrdf": "compression.material",
    "SommerlError": "system.errors",
    "TrainOptions": "compression.paper.options",
    "TrainReport": "compression.paper.train",
    "blend": "reflectance.blend",
    "builtin": "models.builtin",
    "builtin_table": "models.builtin",
    "compress": "render.compress",
    "load": "formats.load",
    "load_table": "formats.load",
    "reciprocal": "reflectance.reciprocal",
    "save": "compression.smrl.file",
    "train": "compression.paper.train",
    "view": "viewer.notebook",
}


def __getattr__(name: str) -> "Any":
    """A name is imported when it is first asked for: the command line has signals to hold back before NumPy comes."""
    if name == "__version__":  # which stands in rust/Cargo.toml
        return import_module(f"{__name__}._core").VERSION
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    return found
