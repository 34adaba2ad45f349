"""The first few of some names, where there may be hundreds."""

from __future__ import annotations

from collections.abc import Sequence

MOST = 3


def first_few(names: Sequence[str]) -> str:
    """Names between commas; of more than three the first, and how many more there are."""
    return ", ".join(names[:MOST]) + (f" and {len(names) - MOST} more" if names[MOST:] else "")
