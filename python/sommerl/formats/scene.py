"""Scene snippets that load a material through the Mitsuba plug-in `sommerl`: .xml to include, .json for `load_dict`."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, cast

from ..system import door
from ..system.errors import FormatError
from ..system.files import atomic_write
from ..system.visible import visible
from .format import Format
from .names import split_member

HEAD = """\
<!-- Written by Sommerl. The material's file is named relative to this one. A scene with this file in it:
       sommerl render scene.xml -o scene.exr
     In Python, before it is loaded:
       from sommerl.render.llvm import mitsuba; from sommerl.render.bsdf import register
       mi = mitsuba(); register(); scene = mi.load_file("scene.xml")
     In the scene, a file in this folder: <include filename={include}/>, and <ref id={id}/> in each shape. -->
"""
COMMENT = (
    "Written by Sommerl. The material's file is named relative to this one. In Python: "
    "from sommerl.render.llvm import mitsuba; from sommerl.render.bsdf import register, snippet; "
    "mi = mitsuba(); register(); bsdf = mi.load_dict(snippet({path}))"
)
LONGEST = 2**16  # bytes of a .json


def write(material: str | Path, path: str | Path) -> None:
    """Writes a snippet for a material: a file, whose place is given relative to the snippet's, or a built-in.

    Raises FormatError for a name that the snippet cannot hold.
    """
    path = Path(path)
    xml = path.suffix.lower() == ".xml"
    file, member = split_member(material)
    name = str(material)
    if file.is_file():
        # Where the folders really are: from behind a link, ".." leads elsewhere.
        place = os.path.relpath(Path(os.path.realpath(file.parent)) / file.name, os.path.realpath(path.parent))
        name = Path(place).as_posix() + (f":{member}" if member else "")
    for text in (name, path.name) if xml else ():
        if "$" in text or visible(text) != text:
            raise FormatError(
                f"{path}: expected names without $, of characters that can be printed, which is what Mitsuba's XML "
                f"takes, found {text}; .json takes others"
            )
    text = _xml(name, path) if xml else _json(name, path)
    with atomic_write(path) as out:
        out.write(text.encode())


def _xml(name: str, path: Path) -> str:
    from xml.sax.saxutils import quoteattr  # which loads all that opens network connections

    # No two hyphens in a comment.
    quoted = [quoteattr(text).replace("--", "-&#45;") for text in (path.name, path.stem)]
    head = HEAD.format(include=quoted[0], id=quoted[1])
    return (
        f'<scene version="3.0.0">\n{head}    <bsdf type="sommerl" id={quoteattr(path.stem)}>\n'
        f'        <string name="filename" value={quoteattr(name)}/>\n    </bsdf>\n</scene>\n'
    )


def _json(name: str, path: Path) -> str:
    comment = COMMENT.format(path=repr(path.name))
    found = {"comment": comment, "type": "sommerl", "filename": name}
    return json.dumps(found, indent=2) + "\n"


def read(path: str | Path) -> dict[str, Any]:
    """The dictionary in a .json snippet, with `filename` resolved against the folder of the snippet.

    Raises FormatError if it is not a snippet.
    """
    path = Path(path)
    try:
        found = json.loads(door.read(path, LONGEST, "a snippet"))
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: expected JSON, found something else ({error})") from error
    snippet = cast("dict[str, Any]", found) if isinstance(found, dict) else {}
    if not isinstance(snippet.get("filename"), str):
        raise FormatError(f"{path}: expected a snippet with a filename, found something else")
    file, member = split_member(path.parent / snippet["filename"])
    if file.is_file():
        snippet["filename"] = str(file) + (f":{member}" if member else "")
    return snippet


FORMAT = Format(
    "Mitsuba snippet",
    (".xml", ".json"),
    "a bsdf for a scene (.xml) or for load_dict (.json), which loads the material from its own file",
    write=write,
    names_source=True,
)
