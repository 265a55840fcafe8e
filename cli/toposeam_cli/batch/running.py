"""The commands that a batch can run, and the function that runs one in a worker process."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import redirect_stdout
from typing import Any

import click

from toposeam_cli.app import registry
from toposeam_cli.app.options import is_output


def run_command(command: str, words: Sequence[str], manner: Sequence[str] = ()) -> Any:
    """Run a command in this process, as a worker does.

    Returns
    -------
    dict or None
        The command's summary.
    """
    with redirect_stdout(io.StringIO()):  # its messages belong into the table
        words = [*manner, *words]
        return registry.load(command).main(words, prog_name=f"toposeam {command}", standalone_mode=False)


def commands_with_outputs() -> dict[str, click.Command]:
    """Return the commands that make files, by name."""
    commands = {name: registry.load(name) for name in registry.COMMANDS if name not in registry.NO_JOBS}
    return {name: command for name, command in commands.items() if any(map(is_output, command.params))}
