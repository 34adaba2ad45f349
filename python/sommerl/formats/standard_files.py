"""Writes what was fitted of standards' surface models as the files that engines read: MaterialX (.mtlx) of OpenPBR, and
glTF (.gltf); and the names of Blender's Principled BSDF for OpenPBR's inputs."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as xml
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..models import open_pbr
from ..models.standard import Surface
from ..system.files import atomic_write

DIGITS = 6  # significant ones of each number

# Blender 4.0 and newer; its Principled BSDF names what OpenPBR has, and halves the weight of the specular reflection.
BLENDER = {
    "Base Color": "base_color",
    "Diffuse Roughness": "base_diffuse_roughness",
    "Metallic": "base_metalness",
    "Roughness": "specular_roughness",
    "IOR": "specular_ior",
    "Specular Tint": "specular_color",
    "Coat Weight": "coat_weight",
    "Coat Roughness": "coat_roughness",
    "Coat IOR": "coat_ior",
    "Coat Tint": "coat_color",
    "Sheen Weight": "fuzz_weight",
    "Sheen Roughness": "fuzz_roughness",
    "Sheen Tint": "fuzz_color",
}


def blender(surface: Surface) -> dict[str, Any]:
    """The inputs of Blender's Principled BSDF, by the names of its sockets; colours as RGBA. surface: of OpenPBR.

    Under a coat, OpenPBR widens the highlight and darkens the base, which Blender does not: roughness and colour of
    the base are those that are seen through it.
    """
    values = dict(surface.values)
    seen = [base * open_pbr.darkening(surface.values, k) for k, base in enumerate(values["base_color"])]
    values |= {"specular_roughness": open_pbr.roughness_below(surface.values), "base_color": np.array(seen)}
    found: dict[str, Any] = {"Specular IOR Level": rounded(values["specular_weight"]) / 2}
    for socket, name in BLENDER.items():
        value = rounded(values[name])
        found[socket] = [*value, 1.0] if surface.model.by_key[name].colour else value
    return found


def material_x(surface: Surface) -> bytes:
    """A MaterialX document with the surface, of OpenPBR, and a material of it; colours are linear Rec. 709."""
    name = re.sub(r"\W+", "_", surface.name, flags=re.ASCII).strip("_") or "material"
    name = f"_{name}" if name[0].isdigit() else name
    root = xml.Element("materialx", version="1.39", colorspace="lin_rec709")
    root.append(xml.Comment(" Written by Sommerl "))
    shader = xml.SubElement(root, "open_pbr_surface", name=f"{name}_surface", type="surfaceshader")
    for key, value in surface.values.items():
        kind = "color3" if surface.model.by_key[key].colour else "float"
        number = rounded(value)
        text = ", ".join(map(str, np.atleast_1d(number).tolist()))
        xml.SubElement(shader, "input", name=key, type=kind, value=text)
    material = xml.SubElement(root, "surfacematerial", name=name, type="material")
    xml.SubElement(material, "input", name="surfaceshader", type="surfaceshader", nodename=f"{name}_surface")
    xml.indent(root)
    return xml.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"


def gltf(surface: Surface) -> bytes:
    """A glTF document with one material, and nothing that uses it. surface: of glTF."""
    values = {key: rounded(value) for key, value in surface.values.items()}
    extensions = {
        f"KHR_materials_{extension}": {key: value for key, value in values.items() if key.startswith(extension)}
        for extension in ("specular", "clearcoat", "sheen")
    }
    metallic_roughness = {
        "baseColorFactor": [*values["baseColorFactor"], 1.0],
        "metallicFactor": values["metallicFactor"],
        "roughnessFactor": values["roughnessFactor"],
    }
    material = {"name": surface.name, "pbrMetallicRoughness": metallic_roughness, "extensions": extensions}
    asset = {"version": "2.0", "generator": f"Sommerl {__version__}"}
    document = {"asset": asset, "extensionsUsed": sorted(extensions), "materials": [material]}
    return json.dumps(document, indent=1, allow_nan=False).encode() + b"\n"


#: By extension: the model whose material it is, and what writes it.
FILES: dict[str, tuple[str, Callable[[Surface], bytes]]] = {
    ".mtlx": ("openpbr", material_x),
    ".gltf": ("gltf", gltf),
}


def write(path: Path, surface: Surface) -> None:
    """Writes a file of the kind that its extension names; see FILES."""
    with atomic_write(path) as out:
        out.write(FILES[path.suffix.lower()][1](surface))


def rounded(value: Any) -> Any:
    """A number, or a colour as a list, to DIGITS digits."""
    numbers = [float(f"{x:.{DIGITS}g}") for x in np.atleast_1d(value).tolist()]
    return numbers if np.ndim(value) else numbers[0]
