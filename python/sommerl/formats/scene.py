"""Scene snippets that load a material through the Mitsuba plug-in `sommerl`: .xml to include, .json for `load_dict`."""

from __future__ import annotations

import json
import os
from pathlib import Path
from xml.sax.saxutils import quoteattr

from ..errors import FormatError
from ..files import atomic_write
from ..visible import visible
from .names import split_member

HEAD = """\
<!-- Before a scene with this file in it is loaded, in Python:
       from sommerl.render.llvm import mitsuba; from sommerl.render.bsdf import register
       mi = mitsuba(); register(); scene = mi.load_file("scene.xml")
     In the scene, a file in this folder: <include filename={include}/>, and <ref id={id}/> in each shape. -->
"""


def write(material: str | Path, path: str | Path) -> None:
    """Writes a snippet for a material: a file or a built-in.

    The file's place is given relative to the snippet's in .xml, and absolute in .json: a dictionary has no place.

    Raises FormatError for a name that Mitsuba's XML cannot hold.
    """
    path = Path(path)
    file, member = split_member(material)
    name = str(material)
    if file.is_file():
        place = file.resolve() if path.suffix.lower() == ".json" else Path(os.path.relpath(file, path.parent))
        name = place.as_posix() + (f":{member}" if member else "")
    if path.suffix.lower() != ".json" and (visible(name), visible(path.name)) != (name, path.name):
        raise FormatError(
            f"{path}: expected names of characters that can be printed, which XML takes, found {name}; .json takes it"
        )
    if "$" in name and path.suffix.lower() != ".json":
        raise FormatError(
            f"{path}: expected a material without $ in its name, which Mitsuba's XML takes for a "
            f"parameter, found {name}; .json takes it"
        )
    if path.suffix.lower() == ".json":
        text = json.dumps({"type": "sommerl", "filename": name}, indent=2) + "\n"
    else:
        # No two hyphens in a comment.
        quoted = [quoteattr(text).replace("--", "-&#45;") for text in (path.name, path.stem)]
        head = HEAD.format(include=quoted[0], id=quoted[1])
        text = (
            f'<scene version="3.0.0">\n{head}    <bsdf type="sommerl" id={quoteattr(path.stem)}>\n'
            f'        <string name="filename" value={quoteattr(name)}/>\n    </bsdf>\n</scene>\n'
        )
    with atomic_write(path) as out:
        out.write(text.encode())
