"""The class of all commands: help in two lengths, and words that people type instead of ours."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from toposeam_cli.app.progress import say

#: These headings come after a command's own.
_LAST = ("Output", "Speed and memory", "Help")
#: Lines of examples in the short help.
_EXAMPLES = 2
#: Words that ask for help in Windows.
HELP_WORDS = ("/?", "/h", "/help", "-?")
#: Keys in the context of click: the words of the command line, and that all options are to be shown.
WORDS = "toposeam.words"
_ALL = "toposeam.help_all"


class HeadedOption(click.Option):
    """An option that stands under a heading in the full help; layouts have those that are `kept`."""

    def __init__(self, *names: Any, heading: str = "Output", kept: bool = False, **settings: Any) -> None:
        super().__init__(*names, **settings)
        self.heading, self.kept = heading, kept


def option(*names: str, heading: str, **settings: Any) -> Callable[[Any], Any]:
    """Define an option as :func:`click.option` does, with its heading in ``--help-all``, and perhaps
    ``kept=True``.
    """
    return click.option(*names, cls=HeadedOption, heading=heading, **settings)


class Command(click.Command):
    """A command that shows the options people need most, and all of them with ``--help-all``.

    Parameters
    ----------
    everyday : sequence of str
        Names of the options that ``--help`` shows, in this order. Without any, it shows all.
    """

    def __init__(self, *arguments: Any, everyday: Sequence[str] = (), **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.everyday = tuple(everyday)
        self._help_all = click.Option(
            ["--help-all"],
            is_flag=True,
            is_eager=True,
            expose_value=False,
            callback=_show_all,
            help=f"Show all {sum(isinstance(each, click.Option) for each in self.params)} options.",
        )

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the parameters, and the options that ask for help."""
        parameters = super().get_params(ctx)
        return [*parameters, self._help_all] if self.everyday else parameters

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the description: in the short help its first paragraph and examples only."""
        whole = self.help
        if self.everyday and not ctx.meta.get(_ALL):
            self.help = _shortened(whole or "")
        try:
            super().format_help_text(ctx, formatter)
        finally:
            self.help = whole

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the everyday options, or all under their headings."""
        if not self.everyday:
            super().format_options(ctx, formatter)
            return
        options = [each for each in self.get_params(ctx) if isinstance(each, click.Option)]
        named = {name.removeprefix("--"): each for each in options for name in each.opts}
        asking = [each for each in options if each not in self.params]
        if not ctx.meta.get(_ALL):
            _section(ctx, formatter, "Options", [*(named[name] for name in self.everyday), *asking])
            return
        sections: dict[str, list[click.Option]] = {}
        for each in options:
            heading = each.heading if isinstance(each, HeadedOption) else "Help"
            sections.setdefault(heading, []).append(each)
        for heading in sorted(sections, key=lambda name: _LAST.index(name) if name in _LAST else -1):
            _section(ctx, formatter, heading, sections[heading])

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words of the command line, with those that people write instead of ours."""
        try:
            return super().parse_args(ctx, self._meant(ctx, args))
        except click.NoSuchOption as error:
            owner = self._owner(error.option_name.lstrip("-"))
            if owner is None:
                raise
            raise click.UsageError(
                f"No such option '{error.option_name}'. Did you mean '{owner}'?", ctx=error.ctx
            ) from error

    def _owner(self, value: str) -> str | None:
        """Return an option with its value, if the word is one of its choices, else None."""
        for each in self.params:
            if isinstance(each.type, click.Choice) and value in each.type.choices:
                return f"{max(each.opts, key=len)} {value}"
        return None

    def _meant(self, ctx: click.Context, args: Sequence[str]) -> list[str]:
        """Translate words to those that click takes: two numbers behind an option for a pair become one word,
        like 512x512; ``-output``, ``/o`` and ``-o=FILE`` become options, and Windows' words for help become
        ours.
        """
        parameters = self.get_params(ctx)
        names = {name for each in parameters for name in each.opts}
        signs = {name: getattr(each.type, "sign", None) for each in parameters for name in each.opts}
        words: list[str] = []
        rest = list(args)
        while rest and rest[0] != "--":
            word = rest.pop(0)
            if word in HELP_WORDS and not Path(word).exists():
                word = "--help"
            elif word[:1] == "/" and not {f"-{word[1:]}", f"--{word[1:]}"}.isdisjoint(names):
                word = f"{'-' if len(word) == 2 else '--'}{word[1:]}"
            elif len(word) > 2 and f"-{word.partition('=')[0]}" in names:
                word = f"-{word}"
            elif word[:2] in names and word[2:3] == "=":
                rest.insert(0, word[3:])
                word = word[:2]
            words.append(word)
            sign = signs.get(word)
            numbers = sum(re.fullmatch(r"[+-]?\d+", number) is not None for number in rest[:2])
            if sign and numbers == 2 and not Path(rest[1]).exists():
                words.append(sign.join(rest[:2]))
                del rest[:2]
        return [*words, *rest]


def _show_all(ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
    """Print the full help and end."""
    if value and not ctx.resilient_parsing:
        say(full_help(ctx.command, ctx), lines=True)
        ctx.exit()


def full_help(command: click.Command, ctx: click.Context) -> str:
    """Return the help of a command with all its options."""
    ctx.meta[_ALL] = True
    return command.get_help(ctx)


def _section(
    ctx: click.Context, formatter: click.HelpFormatter, heading: str, options: Sequence[click.Option]
) -> None:
    records = [record for each in options if (record := each.get_help_record(ctx)) is not None]
    with formatter.section(heading):
        formatter.write_dl(records)


def _shortened(text: str) -> str:
    """Return the first paragraph of a help text, and its first examples."""
    paragraphs = re.split(r"\n\s*\n", text.strip())
    examples = next((each for each in paragraphs[1:] if each.strip().startswith("\b")), "")
    return f"{paragraphs[0]}\n\n" + "\n".join(examples.splitlines()[: 1 + _EXAMPLES])
