"""The ``toposeam`` command: its commands, and the one place where errors become sentences and exit codes."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

import click
from click.shell_completion import get_completion_class

from toposeam_cli.interruption import terminations_raised
from toposeam_cli.sentence import sentence

#: Commands that are imported when they are wanted: loading the numerics takes most of a second, and Ctrl-C may come in it.
_COMMANDS = ("stitch", "compare", "synth", "tile", "fill", "motif", "repeat", "join", "mockup", "book", "batch", "gimp")


class Commands(click.Group):
    """Turns what goes wrong into one sentence on stderr and a non-zero exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of all commands."""
        return sorted({*_COMMANDS, *super().list_commands(ctx)})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of that name, from the module of that name."""
        if cmd_name not in _COMMANDS:
            return super().get_command(ctx, cmd_name)
        command: click.Command = getattr(import_module(f"toposeam_cli.{cmd_name}"), cmd_name)
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Run the chosen command."""
        _never_fail_to_print()
        try:
            with terminations_raised():
                return super().invoke(ctx)
        except KeyboardInterrupt:
            click.echo("Interrupted; no file was left unfinished.", err=True)
            ctx.exit(130)
        except (click.ClickException, click.exceptions.Exit, click.Abort, BrokenPipeError):
            raise
        except Exception as error:
            raise click.ClickException(sentence(error)) from error


def _never_fail_to_print() -> None:
    """Let a terminal or pipe that lacks a character, be it in a file name, show an escape instead."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None and stream.errors == "strict":
            reconfigure(errors="backslashreplace")


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="toposeam", prog_name="toposeam")
def main() -> None:
    """Join images along seams that heat finds."""


@main.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the completion script for a shell.

    \b
    toposeam completion bash > ~/.local/share/bash-completion/completions/toposeam
    """  # noqa: D301 - click wants the character
    kind = get_completion_class(shell)
    if kind is None:
        raise click.ClickException(f"there is no completion for {shell}; use bash, zsh or fish")
    try:
        script = kind(main, {}, "toposeam", "_TOPOSEAM_COMPLETE").source()
    except RuntimeError as error:
        raise click.ClickException(f"completion for {shell}: {error}") from error
    click.echo(script)


if __name__ == "__main__":
    sys.exit(main())
