"""Compact materials as 3D textures in half precision, which graphics hardware filters: KTX 2 (.ktx2), beside it a
manifest (.ktx2.json) and a function that samples it (.ktx2.glsl).

A texel holds what the lattice's nodes are blended to, before the cube (`nodes.from_cube_root`), on a grid that is even
in the lattice's own coordinates: θ_h along x, θ_d along y, φ_d along z. Khronos Group, "KTX File Format
Specification", version 2.0, and "Khronos Data Format Specification" 1.3.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..compression.material import SomManBrdf
from ..compression.palette import GainsAndShapes
from ..reflectance.arrays import Array, Triple, gather3, ops
from ..reflectance.brdf import Brdf, Buffers
from ..reflectance.half_diff import phi_d_range
from ..reflectance.nodes import (
    ABOVE,
    BELOW,
    FINE,
    HALF_PI,
    HORIZON,
    KNEE,
    SMALLEST_COSINE,
    NodeLattice,
    from_cube_root,
    place,
)
from ..system.errors import FormatError
from .format import Format
from .manifest import manifest, write_all

WIDTH, HEIGHT, DEPTH = 96, 48, 24  # texels along θ_h, θ_d and φ_d

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
HEAD = struct.Struct("<9I4I2Q")
LEVEL = struct.Struct("<3Q")
RGBA16F = 97  # VK_FORMAT_R16G16B16A16_SFLOAT
TEXEL = 8  # bytes
# Of the data format descriptor: its block of four samples of 16 bits, signed floating-point numbers, linear Rec. 709.
BLOCK = struct.Struct("<IHHBBBBIII")
SAMPLE = struct.Struct("<HBBIII")
CHANNELS = (0, 1, 2, 15)  # red, green, blue, alpha
SIGNED_FLOAT = 0xC0
MINUS_ONE, ONE = (struct.unpack("<I", struct.pack("<f", value))[0] for value in (-1.0, 1.0))


class TextureBrdf(Brdf):
    """What a texture gives where hardware filters it in full precision.

    values: what it holds, (depth, height, width, 3), which is kept in half precision, divided by the largest. like: the
    compact material that it was made from, whose coordinates and signs it has.
    """

    kind = "texture"
    compressed = True

    def __init__(self, values: NDArray[np.float64], like: SomManBrdf) -> None:
        lattice, palette = _parts(like)
        largest = float(np.abs(values).max()) or 1.0
        self.name, self.source, self.metrics = like.name, like.source, like.metrics
        self.values, self.scale = (values / largest).astype(np.float16), palette.scale * largest**3
        self.lattice, self.palette = lattice, palette

    @property
    def reciprocal(self) -> bool:
        return self.lattice.reciprocal

    @property
    def mirrored(self) -> bool:
        return self.lattice.mirrored

    @property
    def signed(self) -> bool:
        return self.palette.signed

    @property
    def lookup(self) -> str:
        return "trilinear"

    def buffers(self) -> dict[str, NDArray[Any]]:
        return {"texels": self.values.astype(np.float32).reshape(-1), "scale": np.array(self.scale)}

    def f_r(self, wi: Triple, wo: Triple, buffers: Buffers) -> Triple:
        f = ops(wi[0])
        depth, height, width = self.values.shape[:3]
        x, y, z = place(wi, wo, self.lattice.reciprocal, self.lattice.mirrored)
        last = depth - 1 if self.mirrored else depth
        along = x * ((width - 1) / FINE), y * ((height - 1) / FINE), z * (last / FINE)
        first = [f.bin(c, max(size - 1, 1)) for c, size in zip(along[:2], (width, height), strict=True)]
        first.append(f.bin(along[2], max(last, 1)))
        share = [f.minimum(f.maximum(c - n, 0.0), 1.0) for c, n in zip(along, first, strict=True)]
        total: list[Array] = [0.0, 0.0, 0.0]
        for corner in range(8):
            weight: Array = 1.0
            at: list[Array] = []
            for axis, size in enumerate((width, height, depth)):
                step = corner >> axis & 1
                weight = weight * (share[axis] if step else 1.0 - share[axis])
                node = first[axis] + step
                at.append(f.where(node >= size, size - 1 if axis < 2 or self.mirrored else 0 * node, node))
            colour = gather3(buffers["texels"], (at[2] * height + at[1]) * width + at[0])
            total = [sum_ + weight * channel for sum_, channel in zip(total, colour, strict=True)]
        return from_cube_root(
            (total[0], total[1], total[2]), wi, wo, buffers["scale"], self.palette.signed, self.palette.smooth
        )


def of(material: SomManBrdf) -> TextureBrdf:
    """The texture of a compact material. Raises FormatError for another."""
    lattice, palette = _parts(material)
    depth = 1 if all(axis == (0,) for axis in lattice.phi_d) else DEPTH
    last = max(depth - 1, 1) if lattice.mirrored else depth
    steps = np.arange(depth) * (FINE / last), np.linspace(0, FINE, HEIGHT), np.linspace(0, FINE, WIDTH)
    z, y, x = (each.reshape(-1) for each in np.meshgrid(*steps, indexing="ij"))
    buffers = material.buffers()
    total = np.zeros((len(x), 3))
    for node, weight in lattice.corners(x, y, z, buffers):
        total += weight[:, None] * np.stack(palette.fetch(node, buffers), axis=-1)
    return TextureBrdf(total.reshape(depth, HEIGHT, WIDTH, 3), material)


def _parts(material: SomManBrdf) -> tuple[NodeLattice, GainsAndShapes]:
    lattice, palette = material.lattice, material.palette
    if isinstance(lattice, NodeLattice) and isinstance(palette, GainsAndShapes):
        return lattice, palette
    raise FormatError(f"{material.name}: expected a compact material for a texture, found another (--target-size)")


def write(material: SomManBrdf, path: str | Path) -> TextureBrdf:
    """Writes a compact material as a texture, its manifest and its function; returns what the texture gives. Raises
    FormatError for another."""
    path = Path(path)
    texture = of(material)
    write_all(dict(zip(beside(path), _files(texture, path.stem), strict=True)))
    return texture


def beside(path: Path) -> list[Path]:
    """All files that are written for a path."""
    return [path, path.with_name(f"{path.name}.json"), path.with_name(f"{path.name}.glsl")]


def _files(texture: TextureBrdf, stem: str) -> list[bytes]:
    from .shader.source import identifier  # only when it is needed

    prefix = identifier(stem)
    said = manifest("texture", texture, texture.metrics, described(texture, prefix))
    return [ktx2(texture.values), said, function(texture, prefix).encode()]


def ktx2(values: NDArray[Any]) -> bytes:
    """A KTX 2 file of one level. values: (depth, height, width, 3); alpha is 1."""
    whole = np.ones((*values.shape[:3], 4), "<f2")
    whole[..., :3] = values
    samples = b"".join(
        SAMPLE.pack(16 * k, 15, channel | SIGNED_FLOAT, 0, MINUS_ONE, ONE) for k, channel in enumerate(CHANNELS)
    )
    block = BLOCK.pack(0, 2, BLOCK.size + len(samples), 1, 1, 1, 0, 0, TEXEL, 0) + samples
    descriptor = struct.pack("<I", 4 + len(block)) + block
    said = b"KTXwriter\0" + f"Sommerl {__version__}\0".encode()
    said = struct.pack("<I", len(said)) + said
    said += bytes(-len(said) % 4)
    first = len(IDENTIFIER) + HEAD.size + LEVEL.size
    data = first + len(descriptor) + len(said)
    pad = -data % TEXEL
    depth, height, width = values.shape[:3]
    layout = first, len(descriptor), first + len(descriptor), len(said), 0, 0
    head = HEAD.pack(RGBA16F, 2, width, height, depth, 0, 1, 1, 0, *layout)
    level = LEVEL.pack(data + pad, whole.nbytes, whole.nbytes)
    return b"".join((IDENTIFIER, head, level, descriptor, said, bytes(pad), whole.tobytes()))


def described(texture: TextureBrdf, prefix: str) -> dict[str, Any]:
    """What a texture is, for programs."""
    depth, height, width = texture.values.shape[:3]
    return {
        "function": f"{prefix}_eval",
        "format": "R16G16B16A16_SFLOAT",
        "size": [width, height, depth],
        "filter": "linear",
        "address": ["clamp", "clamp", "clamp" if texture.mirrored else "repeat"],
        "scale": texture.scale,
        "reciprocal": texture.reciprocal,
        "mirrored": texture.mirrored,
        "signed": texture.signed,
    }


def function(texture: TextureBrdf, prefix: str) -> str:
    """GLSL that evaluates a texture: GLSL ES 3.00, and GLSL 1.30 and newer."""
    from .shader.head import comment  # only when it is needed

    depth, height, width = texture.values.shape[:3]
    range_ = phi_d_range(texture.reciprocal, texture.mirrored)
    angle = f"mod(atan(y, x), {range_:.9g})"
    if texture.mirrored:
        angle = f"atan(abs(y), {'abs(x)' if texture.reciprocal else 'x'})"
    address = "clamp" if texture.mirrored else "clamp along x and y, repeat along z"
    bounded = f"max(cosines, {SMALLEST_COSINE})"
    if texture.palette.smooth:
        bounded = f"sqrt(cosines * cosines + {HORIZON})"
    z = f"{depth - 1 if texture.mirrored else depth}.0"
    return f"""\
// {comment(texture.name)}
// Written by Sommerl {__version__}. f_r [1/sr], linear RGB, without the cosine, of a 3D texture.
// Size: {width} x {height} x {depth}. Filter: linear. Address: {address}.
// wi, wo: unit vectors to the light and to the viewer, in the surface frame, z along the normal.
highp vec3 {prefix}_eval(highp sampler3D values, highp vec3 wi, highp vec3 wo) {{
    if (!(wi.z > 0.0 && wo.z > 0.0)) return vec3(0.0);
    highp vec3 s = wi + wo;
    highp vec3 v = wi - wo;
    highp float x = -v.z * length(s);
    highp float y = v.y * s.x - v.x * s.y;
    highp float theta_h = atan(length(s.xy), s.z);
    highp float theta_d = atan(length(v), length(s));
    highp float phi_d = x == 0.0 && y == 0.0 ? 0.0 : {angle};
    // Along theta_h, texels are closest to each other at the highlight.
    highp float a = sqrt(theta_h * {1 / HALF_PI:.9g});
    highp float h = a < {KNEE / BELOW} ? a * {BELOW / FINE} : {KNEE / FINE} + (a - {KNEE / BELOW}) * {ABOVE / FINE:.9g};
    highp vec3 at = vec3(h, theta_d * {1 / HALF_PI:.9g}, phi_d * {1 / range_:.9g});
    at = (at * vec3({width - 1}.0, {height - 1}.0, {z}) + 0.5) / vec3({width}.0, {height}.0, {depth}.0);
    highp vec3 root = textureLod(values, at, 0.0).rgb;
{"" if texture.signed else "    root = max(root, 0.0);"}
    highp vec2 cosines = vec2(wi.z, wo.z);
    highp vec2 bounded = {bounded};
    return root * root * root * ({texture.scale:.9g} / (bounded.x * bounded.y));
}}
"""


FORMAT = Format(
    "texture",
    (".ktx2",),
    "a 3D texture in half precision, with its manifest and its GLSL",
    write=write,
    beside=beside,
    compressed=True,
)
