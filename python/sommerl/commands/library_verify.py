"""The command `library verify`: is every file of a library as its record says?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..library.verify import verify
from . import answers, console
from .arguments import Arguments, positional
from .outcome import PartlyDone
from .parser import add_command


@dataclass(frozen=True, kw_only=True)
class VerifyArguments(Arguments):
    """What `library verify` is asked for."""

    library: Path = positional("DIR", help="a library's folder")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Checks every file of a library against its checksum, decodes it, and looks for unknown and missing ones."
    add_command(add, "verify", run, VerifyArguments, summary, "sommerl library verify library/")


def run(options: VerifyArguments) -> dict[str, Any]:
    """Checks a library. Raises PartlyDone if anything is wrong with it."""
    with console.progress(f"verifying {options.library}") as advance:
        checked, faults = verify(options.library, advance)
    for fault in faults:
        console.tell(f"error: {fault.sentence}")
    answer = answers.of_materials([], checked=checked, faults=[asdict(fault) for fault in faults])
    if faults:
        sentence = f"{options.library}: expected {checked} materials as they were written, found {len(faults)} faults"
        raise PartlyDone(sentence, answer)
    if not options.json:
        console.say(f"{options.library}: {checked} materials, each as it was written")
    return answer
