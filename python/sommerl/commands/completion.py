"""The command `completion`: what a shell needs to complete command lines."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from .arguments import Arguments, Material, positional
from .parser import add_command

Shell = Literal["bash", "zsh", "tcsh"]


@dataclass(frozen=True, kw_only=True)
class CompletionArguments(Arguments):
    """What `completion` is asked for."""

    shell: Shell = positional("SHELL", help="bash, zsh or tcsh")


def arguments(add: Any) -> None:
    """Adds the command to the command line."""
    summary = "Prints a script by which a shell completes commands, options, their values and names of files."
    example = """sommerl completion bash > ~/.local/share/bash-completion/completions/sommerl
  sommerl completion zsh > ~/.zfunc/_sommerl      # a folder of your $fpath
  sommerl completion tcsh >> ~/.tcshrc"""
    add_command(add, "completion", completion, CompletionArguments, summary, example)


def completion(options: CompletionArguments) -> dict[str, Any]:
    import shtab

    from .cli import parser  # which has this module among its commands

    commands = parser()
    for made in [commands, *commands.leaves()]:
        for action in made.actions():
            if action.type in (Path, Material):
                action.complete = shtab.FILE  # pyright: ignore[reportAttributeAccessIssue]
    script = shtab.complete(commands, options.shell).rstrip("\n")
    if not options.json:
        print(script)
    return {"shell": options.shell, "script": script}
