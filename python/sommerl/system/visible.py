"""Makes text from files, and names of files, safe to print.

Some characters are commands to a terminal, some reverse the direction of a line or are invisible, and a line break ends
a comment in source code. Therefore all text that was read goes through `visible` before it is written to a terminal, a
figure, a page or source code. Errors do this themselves (`SommerlError`).
"""

from __future__ import annotations


def visible(text: str, most: int | None = None) -> str:
    """The text as one line of printable characters.

    White space of any kind becomes a space, and any other character that cannot be printed becomes U+FFFD (�).
    most: the largest number of characters; a longer text is cut off and ends with "…".
    """
    if most is not None and len(text) > most:
        text = text[: most - 1] + "…"
    return "".join(c if c.isprintable() else " " if c.isspace() else "�" for c in text)
