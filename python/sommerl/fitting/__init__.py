"""Fits analytic models to materials. Needs SciPy and Dr.Jit: sommerl[fit]."""

from .fit import Fit, fit, fit_all, fit_models
from .options import FitOptions

__all__ = ["Fit", "FitOptions", "fit", "fit_all", "fit_models"]
