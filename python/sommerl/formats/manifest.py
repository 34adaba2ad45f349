"""Files of which several are written for one path: data, and a manifest in JSON that says what they are."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .. import __version__
from ..reflectance.brdf import Brdf
from ..system.files import atomic_write


def manifest(kind: str, material: Brdf, metrics: Mapping[str, Any], more: Mapping[str, Any]) -> bytes:
    """What is known of a material whose data stand beside, and, by further keys, of those data."""
    known = {
        f"sommerl_{kind}": 1,
        "written_by": f"Sommerl {__version__}",
        "name": material.name,
        "source_sha256": material.source.sha256,
        "metrics": {key: value for key, value in metrics.items() if isinstance(value, int | float)},
    }
    return json.dumps(known | dict(more), indent=1, allow_nan=False).encode() + b"\n"


def write_all(files: Mapping[Path, bytes]) -> None:
    """Writes each of some files whole."""
    for path, content in files.items():
        with atomic_write(path) as out:
            out.write(content)
