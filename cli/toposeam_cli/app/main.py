"""The ``toposeam`` command: its commands, and the one place where errors become sentences and exit codes."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class

from toposeam.sentence import sentence
from toposeam_cli.app.command import HELP_WORDS, WORDS, full_help
from toposeam_cli.app.progress import say, shown
from toposeam_cli.app.registry import COMMANDS, CONTEXT, load
from toposeam_cli.files.interruption import terminations_raised

#: The commands by what they do, as the help lists them; all others are tools.
GROUPS = {
    "Join": ("stitch", "edit", "enblend", "compare", "loop", "volume"),
    "Grow": ("synth", "tile", "fill"),
    "Invent": ("motif", "repeat", "join", "mockup", "book"),
}


class Commands(click.Group):
    """The group of all commands. It turns each error into one sentence on stderr and a non-zero exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands."""
        return sorted({*COMMANDS, *super().list_commands(ctx)})

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return the command of that name. Ctrl-C may come while its numerics load."""
        return load(cmd_name) if cmd_name in COMMANDS else super().get_command(ctx, cmd_name)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words before the command, and keep all words for :mod:`~toposeam_cli.app.remedies`."""
        ctx.meta[WORDS] = tuple(args)
        if not args and not ctx.resilient_parsing:
            args = ["--help"]
        if args and args[0] in HELP_WORDS:
            args = ["--help", *args[1:]]
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption:
            self._refuse(ctx)
            raise

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the words begin with, and the words after it."""
        if self.get_command(ctx, args[0]) is None and not ctx.resilient_parsing:
            self._refuse(ctx)
        return super().resolve_command(ctx, args)

    def _refuse(self, ctx: click.Context) -> None:
        """Refuse words that begin with no command, if we can say what was meant."""
        from toposeam_cli.app.remedies import refuse_no_command

        refuse_no_command(ctx, self.list_commands(ctx))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands by groups with their first lines, without importing any."""
        commands = self.list_commands(ctx)
        grouped = [name for names in GROUPS.values() for name in names]
        tools = [name for name in commands if name not in grouped]
        wide = max(map(len, commands))
        for heading, names in (*GROUPS.items(), ("Tools", tools)):
            with formatter.section(heading):
                formatter.write_dl(
                    [(f"{name:{wide}}", _first_line(name, self.commands, 200)) for name in names]
                )

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands that begin so, without importing any, and the options."""
        found = [
            CompletionItem(name, help=_first_line(name, self.commands, 60))
            for name in self.list_commands(ctx)
            if name.startswith(incomplete)
        ]
        return found + click.Command.shell_complete(self, ctx, incomplete)

    def main(self, *args: Any, standalone_mode: bool = True, **given: Any) -> Any:
        """Run the command line and exit, with code 130 also for Ctrl-C before the command begins or while it
        ends, of which click would make 1.
        """
        if any(name.endswith("_COMPLETE") for name in os.environ):
            import toposeam_cli.app.shells  # noqa: F401 - registers the completion of PowerShell
        run: Any = super().main
        if not standalone_mode:
            return run(*args, standalone_mode=False, **given)
        try:
            code = run(*args, standalone_mode=False, **given)
        except click.ClickException as error:
            vars(error).update(message=shown(error.message))  # click's own quote what was typed
            error.show()
            code = error.exit_code
        except click.Abort:
            code = 130
        sys.exit(code)

    def invoke(self, ctx: click.Context) -> None:
        """Run the chosen command."""
        _never_fail_to_print()
        try:
            with terminations_raised():
                super().invoke(ctx)  # what a command returns is for batches; here it would be an exit code
        except KeyboardInterrupt:
            say("Interrupted; no file was left unfinished.", err=True)
            ctx.exit(130)
        except click.MissingParameter as error:  # its own text lists choices in several lines
            from toposeam_cli.app.remedies import of_missing

            text = of_missing(error) or " ".join(error.format_message().split())
            raise click.UsageError(text, ctx=error.ctx) from error
        except (click.ClickException, click.exceptions.Exit, click.Abort, BrokenPipeError):
            raise
        except Exception as error:
            raise click.ClickException(sentence(error)) from error


def _first_line(name: str, loaded: Mapping[str, click.Command], width: int) -> str:
    """Return the summary of a command, cut to a width."""
    command = loaded[name] if name in loaded else click.Command(name, help=COMMANDS[name])
    return command.get_short_help_str(width)


def _never_fail_to_print() -> None:
    """Print an escape for each character that a terminal or pipe lacks, as in file names."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None and stream.errors == "strict":
            reconfigure(errors="backslashreplace")


def _show_all(ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
    """Print the help of all commands with all their options, and end."""
    if not value or ctx.resilient_parsing:
        return
    say(ctx.get_help(), lines=True)
    for name in main.list_commands(ctx):
        command = main.get_command(ctx, name)
        if command is not None:
            say("", lines=True)
            say(full_help(command, click.Context(command, ctx, name)), lines=True)
    ctx.exit()


@click.group(cls=Commands, context_settings=CONTEXT)
@click.version_option(None, "-V", "--version", package_name="toposeam", prog_name="toposeam")
@click.option(
    "--help-all",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_all,
    help="Show all options of all commands.",
)
def main() -> None:
    """Join, grow and invent images along optimal seams.

    \b
    toposeam stitch left.jpg right.jpg -o both.jpg
    toposeam stitch --help
    """  # noqa: D301 - click wants the character


@main.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish", "powershell"]))
def completion(shell: str) -> None:
    """Print the completion script for a shell.

    \b
    toposeam completion bash > ~/.local/share/bash-completion/completions/toposeam
    toposeam completion powershell >> $PROFILE
    """  # noqa: D301 - click wants the character
    import toposeam_cli.app.shells  # noqa: F401 - registers the completion of PowerShell

    kind = get_completion_class(shell)
    if kind is None:
        raise click.ClickException(f"there is no completion for {shell}; use bash, zsh or fish")
    try:
        script = kind(main, {}, "toposeam", "_TOPOSEAM_COMPLETE").source()
    except RuntimeError as error:
        raise click.ClickException(f"completion for {shell}: {error}") from error
    say(script, lines=True)


@main.command()
def manual() -> None:
    """Print the manual page.

    \b
    toposeam manual > ~/.local/share/man/man1/toposeam.1
    """  # noqa: D301 - click wants the character
    from importlib.metadata import version

    from toposeam_cli.app import shells

    say(shells.manual(main, "toposeam", version("toposeam")), lines=True, nl=False)
