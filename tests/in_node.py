"""The page's modules, run by Node."""

import json
import struct
from importlib.resources import files

from helpers import run_node

FOLDERS = ("viewer/page", "compression/smrl/javascript")
# A message is a length, JSON of such a length, and the bytes of a file; so is each answer, but for the bytes.
MAIN = """
import fs from "node:fs";
%s
const given = fs.readFileSync(0);
const answers = [];
for (let at = 0; at < given.length; ) {
    const [head, size] = [given.readUInt32LE(at), given.readUInt32LE(at + 4)];
    const message = JSON.parse(given.subarray(at + 8, at + 8 + head));
    at += 8 + head + size;
    message.file = given.buffer.slice(given.byteOffset + at - size, given.byteOffset + at);
    answers.push(await answer(message));
}
fs.writeFileSync(1, JSON.stringify(answers));
"""


def program(folder, answer):
    """Runs `async function answer(message)` of JavaScript on messages: pairs of what goes through JSON, and bytes."""
    for source in FOLDERS:
        for module in (files("sommerl") / source).iterdir():
            if module.name.endswith(".js"):
                (folder / module.name).write_text(module.read_text("utf-8"), "utf-8")
    (folder / "program.js").write_text(MAIN % answer, "utf-8")
    (folder / "package.json").write_text('{"type": "module"}')

    def run(messages):
        given = bytearray()
        for message, data in messages:
            head = json.dumps(message).encode()
            given += struct.pack("<II", len(head), len(data)) + head + data
        return json.loads(run_node(folder / "program.js", given=bytes(given)))

    return run
