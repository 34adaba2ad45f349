"""The languages that a material is written in as source code: what words and forms the templates' own ones become."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

_TERNARY = "({0} ? {1} : {2})"
_OF_C = "{type} {name}[{size}] = {{\n{values}\n}};"
_MACRO = "#define {reader}(i) {name}[i]"
_FLOATS = {"uint": "uint", "real": "float"}


@dataclass(frozen=True, kw_only=True)
class Language:
    """A language; `render` describes the words of the templates.

    name: what people call it. shared: the template of what stands first, the same for all materials; "" for none.
    words: the types and built-in functions by their words in the templates, where they are not the same.
    declared: the types where something is declared, where they are not as in `words`.
    array: an array of constants; elements: the types of those; suffix: after real ones. reader: what reads an element.
    macros: whether the reader is a macro, so that the including program can put another one in its place.
    inferred: whether variables are declared by `var`, without a type.
    literal: a real number in code. pick: PICK. assigned, given: SET and REF. function: the head of a function.
    parameter, output: one of its parameters, and the type of one that is an output. These are format
        strings whose types and functions are words of the templates.
    """

    name: str
    words: Mapping[str, str]
    elements: Mapping[str, str] = field(default_factory=lambda: _FLOATS)
    declared: Mapping[str, str] = field(default_factory=dict[str, str])
    shared: str = ""
    array: str = f"static const {_OF_C}"
    suffix: str = "f"
    reader: str = _MACRO
    macros: bool = True
    literal: str = "{}f"
    pick: str = _TERNARY
    assigned: str = ""
    given: str = ""
    function: str = "{type} {name}({parameters}) {{"
    parameter: str = "{type} {name}"
    output: str = "out {}"
    inferred: bool = False


CPP = Language(
    name="C++",
    words={"real": "sommerl_real", "real3": "sommerl_real3", "uint": "sommerl_uint"}
    | {"abs": "std::fabs", "sqrt": "std::sqrt", "floor": "std::floor", "atan2": "std::atan2"},
    elements={"uint": "sommerl_uint", "real": "double"},
    suffix="",
    shared="shared_cpp",
    literal="real({})",
    function="static inline {type} {name}({parameters}) {{",
    output="{}&",
)
GLSL = Language(
    name="GLSL",
    words={"real": "float", "real3": "vec3", "atan2": "atan"},
    # GLSL ES wants a precision wherever a program has not chosen one; elsewhere the word means nothing.
    declared={"real": "highp float", "real3": "highp vec3", "uint": "highp uint"},
    array="const highp {type} {name}[{size}] = {type}[{size}](\n{values}\n);",
)
HLSL = Language(name="HLSL", words={"real": "float", "real3": "float3"})
MSL = Language(
    name="MSL",
    words={"real": "float", "real3": "float3"} | {name: f"metal::{name}" for name in ("abs", "sqrt", "floor", "atan2")},
    shared="shared_msl",
    array=f"constant {_OF_C}",
    function="static inline {type} {name}({parameters}) {{",
    output="thread {}&",
)
WGSL = Language(
    name="WGSL",
    words={"real": "f32", "real3": "vec3f", "uint": "u32"},
    elements={"uint": "u32", "real": "f32"},
    array="const {name} = array<{type}, {size}>(\n{values}\n);",
    reader="fn {reader}(i: u32) -> {type} {{\n    return {name}[i];\n}}",
    macros=False,
    pick="select({2}, {1}, {0})",
    assigned="*",
    given="&",
    function="fn {name}({parameters}) -> {type} {{",
    parameter="{name}: {type}",
    output="ptr<function, {}>",
    inferred=True,
)

LANGUAGES = {".h": CPP, ".hpp": CPP, ".glsl": GLSL, ".hlsl": HLSL, ".metal": MSL, ".wgsl": WGSL}  # by extension
