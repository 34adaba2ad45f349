"""The three languages that a material is written in as source code."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Language:
    """A language, and how it declares an array of constants.

    name: its templates are `NAME_begin` and `NAME_end`: what comes before and after the text that all languages share.
    array: a format string with the places type, name, size and values. qualifier: between a material's name and that of
        a function, for people who call it.
    """

    name: str
    array: str
    qualifier: str


CPP = Language("cpp", "static const {type} {name}[{size}] = {{\n{values}\n}};", "::")
GLSL = Language("glsl", "const {type} {name}[{size}] = {type}[{size}](\n{values}\n);", "_")
HLSL = Language("hlsl", "static const {type} {name}[{size}] = {{\n{values}\n}};", "_")

LANGUAGES = {".h": CPP, ".hpp": CPP, ".glsl": GLSL, ".hlsl": HLSL}  # by the extension of a file
