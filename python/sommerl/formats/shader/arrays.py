"""Arrays of constants in source code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .language import Language
from .render import real_number

A_LINE = 10  # numbers


@dataclass(frozen=True)
class Array:
    """An array of constants.

    name: after the material's own; in capitals, the name of what reads an element. kind: uint or real.
    """

    name: str
    kind: str
    values: list[str]

    @property
    def reader(self) -> str:
        return f"@NAME@_{self.name.upper()}"

    def declared(self, language: Language) -> str:
        """The declaration, and that of what reads it; left out where the including program has defined the latter."""
        name, end = f"@NAME@_{self.name}", language.suffix if self.kind == "real" else ""
        texts = [f"{value}{end}" for value in self.values]
        lines = ("    " + ",".join(texts[i : i + A_LINE]) for i in range(0, len(texts), A_LINE))
        kind = language.elements[self.kind]
        constants = language.array.format(type=kind, name=name, size=len(texts), values=",\n".join(lines))
        text = f"{constants}\n{language.reader.format(reader=self.reader, name=name, type=kind)}\n"
        return f"#ifndef {self.reader}\n{text}#endif\n" if language.macros else text

    def described(self, language: Language) -> str:
        """A line for people."""
        size, kind = len(self.values), language.elements[self.kind]
        octets = size * (8 if kind == "double" else 4)
        return f"//   @NAME@_{self.name}: {size} of {kind} ({octets} bytes), {self.reader}(i)\n"


def of_words(name: str, values: NDArray[np.uint32]) -> Array:
    return Array(name, "uint", [f"{word:#x}u" for word in values.tolist()])


def of_reals(name: str, values: NDArray[np.float64]) -> Array:
    """Exact in single precision."""
    return Array(name, "real", numbers(values))


def numbers(values: NDArray[np.float64]) -> list[str]:
    return [real_number(f"{value:.9g}") for value in values.reshape(-1)]


def packed(index: NDArray[Any]) -> tuple[Array, dict[str, str]]:
    """All indices in words of 32 bits, the first in the lowest bits; and the values of the template `entry`."""
    flat, bits = index.reshape(-1), 8 * index.dtype.itemsize
    padded = np.append(flat, np.zeros(-len(flat) % (32 // bits), flat.dtype))
    whole = padded.astype(padded.dtype.newbyteorder("<")).view("<u4")
    return of_words("word", whole), {
        "PER_WORD": str(32 // bits),
        "BITS": str(bits),
        "MASK": str(2**bits - 1),
    }
