"""All surface models of standards, by name."""

from __future__ import annotations

from .gltf import GLTF
from .open_pbr import OPEN_PBR
from .principled import PRINCIPLED
from .standard import SurfaceModel

STANDARDS: dict[str, SurfaceModel] = {model.name: model for model in (OPEN_PBR, PRINCIPLED, GLTF)}
