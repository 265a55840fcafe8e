"""The one place that prints lines and progress bars: names of files and layers come from others, and may hold
anything.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import timedelta
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from toposeam.sentence import printable

if TYPE_CHECKING:
    from toposeam_cli.jobs.runner import Progress

#: Columns of a bar, and steps from its beginning to its end.
_WIDTH = 30
_STEPS = 1000

#: Takes the label and share of work in place of a bar.
_listener: ContextVar[Callable[[str, float], None] | None] = ContextVar("_listener", default=None)


def say(text: str, *, err: bool = False, lines: bool = False, nl: bool = True) -> None:
    """Print a line, with escapes for line breaks, control characters and what turns the order of text round.

    Parameters
    ----------
    text : str
    err : bool
        Whether to print to stderr.
    lines : bool
        Whether line breaks and tabs are the text's own: JSON, TOML, scripts, in which those of names are
        escaped already.
    nl : bool
        Whether to end the line.
    """
    click.echo(shown(text, lines=lines), err=err, nl=nl)


def shown(text: str, *, lines: bool = False) -> str:
    """Return a text as :func:`say` prints it."""
    if not lines:
        return printable(text)
    return "\n".join("\t".join(map(printable, line.split("\t"))) for line in text.split("\n"))


class ProgressBar:
    """A progress bar on a terminal, nothing in a pipe. Lines printed meanwhile do not break it."""

    def __init__(self, shown: bool) -> None:
        self._text = ""
        self._bar = self._new_bar() if shown else None

    def _new_bar(self) -> Any:
        return click.progressbar(
            length=_STEPS,
            bar_template="[%(bar)s]  %(info)s",
            show_eta=False,  # the run knows better: jobs have weights
            show_percent=True,
            item_show_func=lambda _: self._text or None,
            width=_WIDTH,
            file=sys.stderr,
        )

    def draw(self) -> None:
        """Draw the bar, no wider than the terminal."""
        if self._bar is None:
            return
        room = shutil.get_terminal_size().columns - 1 - len("[]  100%  ")
        self._text = self._text[: max(0, room)]
        self._bar.width = max(0, min(_WIDTH, room - len(self._text)))
        self._bar.render_progress()

    def report(self, progress: Progress) -> None:
        """Show the progress of a run."""
        if self._bar is None:
            return
        failed = f", {progress.failed} failed" if progress.failed else ""
        left = (
            "" if progress.remaining_s is None else f", {timedelta(seconds=round(progress.remaining_s))} left"
        )
        self._text = f"{progress.finished} of {progress.total}{failed}{left}"
        self._bar.make_step(max(0, round(_STEPS * progress.share) - self._bar.pos))
        self.draw()

    def say(self, text: str) -> None:
        """Print a line to stderr."""
        if self._bar is None:
            say(text, err=True)
            return
        sys.stderr.write(f"\r{' ' * (self._bar.max_width or 0)}\r")
        say(text, err=True)
        position, self._bar = self._bar.pos, self._new_bar()
        self._bar.make_step(position)
        self.draw()

    def close(self) -> None:
        """Leave the bar as it is, and show the cursor again."""
        if self._bar is not None:
            self._bar.render_finish()


@contextmanager
def progress_bar(quiet: bool = False) -> Iterator[ProgressBar]:
    """Show a bar for :func:`toposeam_cli.jobs.runner.run` during the block: pass its ``report`` as
    `progress`.
    """
    bar = ProgressBar(not quiet and _on_terminal())
    try:  # the first drawing, too, may be interrupted after it has hidden the cursor
        bar.draw()
        yield bar
    finally:
        bar.close()


@contextmanager
def share_bar(label: str, quiet: bool) -> Iterator[Callable[[float], None] | None]:
    """Show a bar on a terminal during the block, for work that reports its share done, in [0, 1]; yield None
    in a pipe.
    """
    listener = _listener.get()
    if listener is not None:
        yield partial(listener, label)
        return
    if quiet or not _on_terminal():
        yield None
        return
    bar = click.progressbar(length=_STEPS, label=shown(label), file=sys.stderr)
    try:  # not `with bar`: interrupted while it is drawn for the first time, it would leave the cursor hidden
        bar.render_progress()
        yield lambda share: bar.update(max(0, round(_STEPS * share) - bar.pos))
        bar.update(_STEPS - bar.pos)
    finally:
        bar.render_finish()


@contextmanager
def listening(listener: Callable[[str, float], None]) -> Iterator[None]:
    """Call a function with the label and share of all work that would show a bar, during the block."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)


def _on_terminal() -> bool:
    return bool(sys.stderr and sys.stderr.isatty())  # there is none when it was closed
