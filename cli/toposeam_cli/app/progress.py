"""How far a batch has come, on a terminal."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from toposeam_cli.jobs.runner import Progress


class ProgressBar:
    """A bar on a terminal, nothing in a pipe; what is said meanwhile does not disturb it."""

    def __init__(self, bar: Any) -> None:
        self._bar = bar

    def report(self, progress: Progress) -> None:
        """Show how far the run has come."""
        if self._bar is None:
            return
        failed = f", {progress.failed} failed" if progress.failed else ""
        left = (
            ""
            if progress.remaining_s is None
            else f", {self._bar.format_interval(round(progress.remaining_s))} left"
        )
        self._bar.n = progress.share
        self._bar.set_description_str(f"{progress.finished} of {progress.total}{failed}{left}")

    def say(self, text: str) -> None:
        """Print a line to stderr."""
        if self._bar is None:
            click.echo(text, err=True)
        else:
            self._bar.write(text, file=sys.stderr)


@contextmanager
def progress_bar(quiet: bool = False) -> Iterator[ProgressBar]:
    """A bar for :func:`toposeam_cli.jobs.runner.run`: pass its ``report`` as `progress`."""
    if quiet or not (sys.stderr and sys.stderr.isatty()):  # there is none when it was closed
        yield ProgressBar(None)
        return
    from tqdm import tqdm

    columns, rows = shutil.get_terminal_size()
    shape = {"ncols": min(100, columns), "nrows": rows, "bar_format": "{percentage:3.0f}% |{bar}| {desc}"}
    with tqdm(total=1.0, file=sys.stderr, **shape) as bar:
        yield ProgressBar(bar)


@contextmanager
def share_bar(label: str, quiet: bool) -> Iterator[Callable[[float], None] | None]:
    """A bar on a terminal for what reports the share of the work done, nothing in a pipe."""
    if quiet or not (sys.stderr and sys.stderr.isatty()):  # there is none when it was closed
        yield None
        return
    bar = click.progressbar(length=1000, label=label, file=sys.stderr)
    try:  # not `with bar`: interrupted while it is drawn for the first time, it would leave the cursor hidden
        bar.render_progress()
        yield lambda share: bar.update(max(0, round(1000 * share) - bar.pos))
        bar.update(1000 - bar.pos)
    finally:
        bar.render_finish()
