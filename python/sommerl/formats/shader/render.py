"""The functions of a material in one of the languages, from the one text that the templates hold.

The templates are written in a plain subset of what the languages share, with words of its own:

    FUNCTION real name(real a, OUT real b) {    a function; b is an output
    SET b = a;  name(a, REF b)                  an output is assigned to; a variable is given for one
    PICK(condition, a, b)                       a if the condition holds, else b; both may be calculated
    real, real3, uint, bool                     types, whose names make values, too: real(2)
    abs, sqrt, floor, atan2                     built-in functions

One variable is declared in a statement, parameters are not assigned to, and braces are about all that is conditional.
Every other word is a variable, and gets an underscore at its end: no macro of the including program has such a name.
"""

from __future__ import annotations

import re
from importlib import resources

from .language import Language

TYPE = r"(?:real3|real|uint|bool)\b"
NUMBER = r"\d[\w.]*(?<=e)[-+]\w+|\d[\w.]*"
TOKEN = re.compile(rf"//.*|\.\w+|{NUMBER}|\w+")
FUNCTION = re.compile(rf"FUNCTION ({TYPE}) (\w+)\((.*)\) {{")
PARAMETER = re.compile(rf"(OUT )?({TYPE}) (\w+)")
PICK = "PICK("
FORMS = {"static", "inline", "fn", "var", "ptr", "function", "out", "thread", "select"}  # of all languages
KEPT = {"if", "for", "return", "bool"} | FORMS


def rendered(code: str, language: Language, name: str) -> str:
    """A filled-in template in a language. name: how the names of all functions and arrays begin."""
    code = _picked(code, language.pick)
    code = FUNCTION.sub(lambda found: _function(found, language), code)
    if language.inferred:
        code = re.sub(rf"^( *(?:for \()?){TYPE} (\w+) =", r"\1var \2 =", code, flags=re.M)
        code = re.sub(rf"^( *)({TYPE}) (\w+);", r"\1var \3: \2;", code, flags=re.M)
    code = code.replace("SET ", language.assigned).replace("REF ", language.given)
    code = re.sub(rf"\breal\(({NUMBER})\)", lambda found: language.literal.format(real_number(found[1])), code)

    def word(found: re.Match[str]) -> str:
        token, call = found[0], code.startswith("(", found.end())
        if not token[0].isalpha() or token in KEPT or token.startswith(f"{name}_"):
            return token
        known = language.words.get(token, token if call or token == "uint" else f"{token}_")
        return known if call else language.declared.get(token, known)

    return TOKEN.sub(word, code)


def real_number(text: str) -> str:
    """A number that all languages take for a real one."""
    return text if "." in text or "e" in text else f"{text}.0"


def _function(found: re.Match[str], language: Language) -> str:
    """The head of a function."""
    parameters: list[str] = []
    for output, kind, name in PARAMETER.findall(found[3]):
        whole = language.output.format(kind) if output else kind
        parameters.append(language.parameter.format(type=whole, name=name))
    return language.function.format(type=found[1], name=found[2], parameters=", ".join(parameters))


def _picked(code: str, form: str) -> str:
    """The code with its PICKs in a language's form, the innermost first."""
    while (start := code.rfind(PICK)) >= 0:
        parts, depth, at = [""], 1, start + len(PICK)
        while depth:
            letter = code[at]
            depth += (letter == "(") - (letter == ")")
            if letter == "," and depth == 1:
                parts.append("")
            elif depth:
                parts[-1] += letter
            at += 1
        code = code[:start] + form.format(*(part.strip() for part in parts)) + code[at:]
    return code


def template(name: str, **parts: str) -> str:
    """A template, with a text in place of each line that is nothing but @PART@."""
    text = resources.files("sommerl.formats.shader").joinpath("templates", f"{name}.template").read_text("utf-8")
    for part, inserted in parts.items():
        text = text.replace(f"@{part}@\n", inserted)
    return text
