"""Imports of optional packages, which only some commands need."""

from __future__ import annotations

import importlib
import warnings
from typing import Any

from .errors import MissingDependencyError
from .interrupt import hold_interrupts


def optional(module: str, package: str, purpose: str, extra: str) -> Any:
    """A module of an optional package.

    package: its name for people. purpose: what needs it. extra: the extra of `sommerl` that installs it.
    Raises MissingDependencyError if it is not installed, or cannot be imported.
    """
    try:
        with hold_interrupts(), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # colour-science warns if it cannot plot, which nobody asks of it
            return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            f"{purpose}: {package} is needed and not installed: pip install 'sommerl[{extra}]'"
        ) from error
    except ImportError as error:
        raise MissingDependencyError(
            f"{purpose}: {package} is needed and cannot be imported ({error}); install it again: "
            f"pip install --force-reinstall 'sommerl[{extra}]'"
        ) from error
