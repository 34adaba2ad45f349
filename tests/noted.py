"""Files of which the notes are made up."""

import json
import struct

from compact import material, sealed

from sommerl.compression.smrl.file import encode

ESCAPES = "\x1b]0;x\x07\x9b31m\u202e\u200b\x7f"
FINE = [
    {},
    {"options": {"clusters": 256, "alpha": 1, "rule": "paper", "new": None, "newer": True, "text": "ü" * 1000}},
    {"metrics": {"rmse": 1e-300, "huge": -1e300}, "something else": [[1]]},
    {"options": {"source_facts": {"reciprocal": True, "samples": 3, "coverage": 0.5, "later": "x"}}},
]
NOT_PLAIN = [
    {"options": {"source_facts": [1, 2]}},
    {"options": {"source_facts": "abc"}},
    {"options": {"source_facts": 5}},
    {"options": {"source_facts": None}},
    {"options": {"source_facts": {"asymmetry": {"a": [1]}}}},
    {"options": {"source_facts": {"new": {"source_facts": {}}}}},
    {"options": {"a": [[[]]]}},
    {"options": {"a": "x" * 1001}},
    {"options": {"x" * 101: 1}},
    {"options": {str(n): n for n in range(65)}},
    {"options": {"a": 10**301}},
    {"options": {"a": "\ud800"}},
    {"options": None},
    {"metrics": {"rmse": {"x": 1}}},
    {"metrics": {"psnr": [1, 2]}},
]
# Plain, but not of the type that their names have.
MISTYPED = [
    {"options": {"source_facts": {"asymmetry": "str"}}},
    {"options": {"source_facts": {"reciprocal": ESCAPES}}},
    {"options": {"source_facts": {"reciprocal": 1}}},
    {"options": {"source_facts": {"samples": 0.5}}},
    {"options": {"source_facts": {"samples": True}}},
    {"options": {"source_facts": {"coverage": None}}},
    {"options": {"clusters": "many"}},
    {"metrics": {"rmse": "small"}},
]


def with_notes(noted):
    """The bytes of a file of nodes with such notes."""
    data = noted if isinstance(noted, bytes) else json.dumps(noted).encode()
    body = encode(material("minimal"))[10:]
    at = 1 + 1 + body[1]
    at += 1 + body[at]
    assert body[at : at + 2] == b"\0\0"
    return sealed(body[:at] + struct.pack("<H", len(data)) + data + body[at + 2 :])
