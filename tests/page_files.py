"""Files of the kinds that the page reads and Python does not write, whole and broken on purpose."""

import struct
import zlib

import numpy as np


def table(values, lattice, trilinear=True):
    """What held.py writes of values (θ_h, θ_d, φ_d, 3)."""
    codes = np.cbrt(np.moveaxis(values, -1, 0)).astype("<f2").view("<u2")
    steps = np.diff(codes, axis=-1, prepend=np.uint16(0)).astype("<u2").reshape(-1)
    head = struct.pack("<4s3HBB", b"SMTB", *lattice.shape, lattice.reciprocal, trilinear)
    return head + (steps & 255).astype(np.uint8).tobytes() + (steps >> 8).astype(np.uint8).tobytes()


def deflated(data):
    coder = zlib.compressobj(9, wbits=-15)
    return coder.compress(data) + coder.flush()


def mbsdf(values, kind=1):
    """values: (θ_in, θ_out, φ, 3), or (θ_in, θ_out, φ) for kind 0."""
    head = b"NVIDIA ARC MBSDF V1\nMBSDF_DATA_REFLECTION=\n"
    return head + struct.pack("<3I", kind, len(values), values.shape[2]) + values.astype("<f4").tobytes()


def merl(planes):
    """planes: (3, 90, 90, 180 or 360)."""
    return np.array(planes.shape[1:], "<i4").tobytes() + planes.astype("<f8").tobytes()


def hdr(rgbe, encoded=True):
    """rgbe: (height, width, 4). encoded: lines of runs and of literal bytes."""
    height, width, _ = rgbe.shape
    data = bytearray(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode())
    for line in rgbe:
        if not encoded:
            data += line.tobytes()
            continue
        data += bytes((2, 2, width >> 8, width & 255))
        for channel in line.T:
            for at in range(0, width, 100):
                part = channel[at : at + 100]
                alike = (part == part[0]).all()
                data += bytes((128 + len(part), part[0])) if alike else bytes((len(part),)) + part.tobytes()
    return bytes(data)


def exr(pixels, compression, dtype="<f4", names="RGB", window=None):
    """pixels: (height, width, channels). compression: 0 none, 2 one line in a block, 3 sixteen."""
    height, width, _ = pixels.shape
    order = sorted(names)
    kind = {"<f2": 1, "<f4": 2, "<u4": 0}[dtype]
    channels = b"".join(n.encode() + b"\0" + struct.pack("<iBxxxii", kind, 0, 1, 1) for n in order) + b"\0"
    box = struct.pack("<4i", *(window or (-3, 5, width - 4, height + 4)))
    attributes = {
        ("channels", "chlist"): channels,
        ("compression", "compression"): bytes([compression]),
        ("dataWindow", "box2i"): box,
    }
    head = b"v/1\x01\x02\0\0\0"
    for (name, type_), value in attributes.items():
        head += f"{name}\0{type_}\0".encode() + struct.pack("<i", len(value)) + value
    head += b"\0"
    lines = {3: 16}.get(compression, 1)
    planes = np.stack([pixels[..., names.index(n)] for n in order], axis=1).astype(dtype)  # line, channel, column
    blocks = []
    for first in range(0, height, lines):
        data = planes[first : first + lines].tobytes()
        if compression:
            halves = data[::2] + data[1::2]
            steps = np.diff(np.frombuffer(halves, np.uint8), prepend=np.uint8(128)) + np.uint8(128)
            steps[0] = halves[0]
            packed = zlib.compress(steps.astype(np.uint8).tobytes())
            data = packed if len(packed) < len(data) else data
        blocks.append(struct.pack("<ii", 5 + first, len(data)) + data)
    starts = np.cumsum([len(head) + 8 * len(blocks), *map(len, blocks)])[:-1]
    return head + starts.astype("<u8").tobytes() + b"".join(blocks)
