"""Packages that are not needed for everything, imported where they are."""

from __future__ import annotations

import importlib
import warnings
from typing import Any

from .errors import MissingDependencyError
from .interrupt import undisturbed


def optional(module: str, package: str, purpose: str, extra: str) -> Any:
    """A module of an optional package. Raises MissingDependencyError, which says what for and how to install it."""
    try:
        with undisturbed(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # colour-science tells everybody that it could plot, too
            return importlib.import_module(module)
    except ImportError as error:
        raise MissingDependencyError(f"{purpose}: expected {package}, found none; install sommerl[{extra}]") from error
