"""Sommerl: measured reflectance as small material files that render fast and look like the measurement.

Needs NumPy alone. Pictures, and the metrics on them, are in `sommerl.render` and `sommerl.metrics`; they need the
packages of sommerl[render].
"""

from . import threads  # before NumPy is imported
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
