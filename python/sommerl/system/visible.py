"""Text from files, and names of files, as it may be shown.

A terminal obeys some characters, others turn a line around or hide in it, and a line's end ends a comment. Whatever was
read goes through `visible` before it reaches a terminal, a figure, a page or source code; errors do by themselves.
"""

from __future__ import annotations


def visible(text: str, most: int | None = None) -> str:
    """The text in one line of characters that can be printed; the others are marks of replacement, and spaces of any
    kind are spaces. most: characters; what is longer is cut off."""
    if most is not None and len(text) > most:
        text = text[: most - 1] + "…"
    return "".join(c if c.isprintable() else " " if c.isspace() else "�" for c in text)
