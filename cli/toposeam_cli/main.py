"""The ``toposeam`` command: its commands, and the one place where errors become sentences and exit codes."""

from __future__ import annotations

import os
import sys
from typing import Any

import click
from click.shell_completion import get_completion_class

import toposeam as ts
from toposeam_cli.compare import compare
from toposeam_cli.stitch import stitch


class Commands(click.Group):
    """Turns what goes wrong into one sentence on stderr and a non-zero exit code."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the chosen command."""
        try:
            return super().invoke(ctx)
        except ts.TopoSeamError as error:
            raise click.ClickException(str(error)) from error
        except MemoryError as error:
            raise click.ClickException("the pictures do not fit into memory; use smaller ones, or close other programs") from error
        except KeyboardInterrupt:
            click.echo("Interrupted; no file was left unfinished.", err=True)
            ctx.exit(130)
        except (click.ClickException, click.exceptions.Exit, click.Abort, BrokenPipeError):
            raise
        except Exception as error:
            if os.environ.get("TOPOSEAM_DEBUG"):
                raise
            raise click.ClickException(
                f"something went wrong inside TopoSeam ({type(error).__name__}: {error}); set TOPOSEAM_DEBUG=1 for details and report it"
            ) from error


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(ts.__version__, prog_name="toposeam")
def main() -> None:
    """Join images along seams that heat finds."""


@main.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completion(shell: str) -> None:
    """Print the completion script for a shell.

    \b
    toposeam completion bash > ~/.local/share/bash-completion/completions/toposeam
    """
    kind = get_completion_class(shell)
    if kind is None:
        raise ts.OptionError(f"no completion for {shell}")
    try:
        script = kind(main, {}, "toposeam", "_TOPOSEAM_COMPLETE").source()
    except RuntimeError as error:
        raise ts.OptionError(f"completion for {shell}: {error}") from error
    click.echo(script)


main.add_command(stitch)
main.add_command(compare)

if __name__ == "__main__":
    sys.exit(main())
