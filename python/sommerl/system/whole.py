"""Options that are whole numbers."""

from __future__ import annotations

from operator import index
from typing import Any

from .errors import OptionError


def make_whole(options: Any, *fields: str) -> None:
    """Has these fields of frozen options hold Python's own whole numbers, in place of NumPy's; None stays. Raises
    OptionError for what is no whole number."""
    for field in fields:
        value = getattr(options, field)
        try:
            object.__setattr__(options, field, None if value is None else index(value))
        except TypeError as error:
            raise OptionError(f"{field}: expected a whole number, found {value!r}") from error
