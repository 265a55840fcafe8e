"""``toposeam batch``: many runs of another command."""

from __future__ import annotations

import shlex
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from toposeam.errors import OptionError, TopoSeamError
from toposeam_cli.app.command import Command
from toposeam_cli.app.options import FILE, force_option, is_input, is_output, jobs_option, quiet_option
from toposeam_cli.app.progress import progress_bar
from toposeam_cli.batch.entries import NAME, Entry, expand, parse_patterns, read_entries, to_words
from toposeam_cli.batch.running import commands_with_outputs
from toposeam_cli.files.interruption import Terminated
from toposeam_cli.files.writing import check_output
from toposeam_cli.jobs.journal import Journal
from toposeam_cli.jobs.runner import Job, check, finished, run

#: Options that do not change what a command makes.
_MANNER = ("force", "quiet")


@click.command(cls=Command, context_settings={"ignore_unknown_options": True})
@click.argument(
    "words",
    metavar="JOBS.toml | PATTERN... [OPTIONS OF THE COMMAND]",
    nargs=-1,
    required=True,
    type=click.UNPROCESSED,
)
@click.option(
    "--command", "name", default="stitch", show_default=True, help="With patterns: the command to run."
)
@jobs_option
@click.option(
    "--dask",
    metavar="ADDRESS|local",
    help="Run on the workers of a Dask scheduler, or on a Dask cluster made of -j processes.",
)
@click.option(
    "--results",
    type=FILE,
    help="Table of results, JSON lines, from which an interrupted batch goes on; beside the TOML file by "
    "default.",
)
@click.option(
    "--fresh", is_flag=True, help="Do everything again, also what the table of results says is done."
)
@click.option("-n", "--dry-run", is_flag=True, help="Print what would be run, and run nothing.")
@force_option
@quiet_option
def batch(
    words: tuple[str, ...],
    name: str,
    processes: int,
    dask: str | None,
    results: Path | None,
    fresh: bool,
    dry_run: bool,
    force: bool,
    quiet: bool,
) -> None:
    """Run many jobs: those of a TOML file, or one for each set of pictures that patterns match.

    \b
    toposeam batch jobs.toml -j 4
    toposeam batch 'left_*.png' 'right_*.png' --overlap 25% -o 'out/{name}.png'

    The same again goes on after an interruption and tries once more what failed.
    """  # noqa: D301 - click wants the character
    commands = commands_with_outputs()
    if words[0].lower().endswith(".toml"):
        if len(words) > 1:
            raise click.UsageError(
                f"{words[1]!r} cannot be used with a file of jobs; write the options into its [defaults]"
            )
        entries = read_entries(Path(words[0]), commands)
        results = results or Path(words[0]).with_suffix(".results.jsonl")
    else:
        if name not in commands:
            raise OptionError(f"--command is {name!r}; choose one of {', '.join(commands)}")
        entries = [parse_patterns(commands[name], words, Path())]
        results = results or Path("batch.results.jsonl")
    jobs = [job for entry in entries for job in _jobs(entry, force)]
    check(jobs)
    if dry_run:
        _show(jobs, results, fresh)
        return
    if results.parent.is_dir():  # before any folder is created
        check_output(results, force=True, suffixes=None)
    for folder in {path.parent for job in jobs for path in job.outputs}:
        folder.mkdir(parents=True, exist_ok=True)
    start, tally = time.monotonic(), Counter[str]()
    try:
        with progress_bar(quiet) as bar:
            for outcome in run(
                jobs, processes=processes, dask=dask, journal=results, resume=not fresh, progress=bar.report
            ):
                tally[outcome.status] += 1
                if outcome.status == "failed":
                    bar.say(f"{outcome.job.name}: {outcome.message}")
    except (KeyboardInterrupt, Terminated):
        click.echo(f"{tally.total()} of {len(jobs)} jobs have ended; run the same again to go on.", err=True)
        raise
    if not quiet:
        parts = [
            f"{tally[status]} {text}"
            for status, text in _STATUSES.items()
            if tally[status] or status == "done"
        ]
        click.echo(f"{', '.join(parts)} in {time.monotonic() - start:.1f} s; see {results}")
    if tally["failed"]:
        click.get_current_context().exit(1)


_STATUSES = {"done": "done", "skipped": "done before", "failed": "failed"}


def _jobs(entry: Entry, force: bool) -> list[Job]:
    jobs = []
    for settings, found in expand(entry):
        name = settings.pop("name", None)
        if name is not None and not isinstance(name, str):
            raise entry.refuse(f"name is {name!r}; write a text")
        jobs.append(_job(entry, settings, name, found, force))
    if len(jobs) > 1 and len({path for job in jobs for path in job.outputs}) < sum(
        len(job.outputs) for job in jobs
    ):
        raise entry.refuse(
            f"{len(jobs)} sets of pictures match, but the outputs are the same; put {NAME} into each output, "
            f"like out/{NAME}.png"
        )
    return jobs


def _job(entry: Entry, settings: Mapping[str, Any], name: str | None, found: str, force: bool) -> Job:
    """Return the job that runs a command with these settings; the command itself checks them."""
    command = entry.command
    flags = {parameter.name: parameter for parameter in command.params if parameter.name in _MANNER}
    wanted = {"force": force or settings.get("force") is True, "quiet": True}
    manner = [max(flag.opts, key=len) for key, flag in flags.items() if wanted[str(key)]]
    words = to_words(entry, {key: value for key, value in settings.items() if key not in _MANNER})
    try:
        # Its names for help come from the parent, and click keeps them with the command.
        parameters = command.make_context(
            command.name, list(words), parent=click.get_current_context(silent=True)
        ).params
    except click.MissingParameter as error:
        text = f"{error.format_message().rstrip('.')}; every job needs it, so add it"
        raise entry.refuse(text) from error
    except click.UsageError as error:
        text = error.format_message().rstrip(".")
        raise entry.refuse(f"{found}: {text}" if found else text) from error
    paths: dict[bool, list[Path]] = {True: [], False: []}
    for parameter in command.params:
        value = parameters.get(str(parameter.name))
        if (is_input(parameter) or is_output(parameter)) and value is not None:
            paths[is_output(parameter)] += [
                Path(path) for path in (value if isinstance(value, list | tuple) else [value])
            ]
    if not paths[True]:
        raise entry.refuse("it makes no file; give it an output")
    inputs = [file for path in paths[False] for file in (path, *_named_in(path, command))]
    return Job(
        name or _relative(paths[True][0], entry.folder),
        "toposeam_cli.batch.running:run_command",
        {"command": command.name, "words": words},
        outputs=tuple(paths[True]),
        inputs=tuple(inputs),
        weight=max(1.0, sum(path.stat().st_size for path in inputs if path.is_file())),
        manner={"manner": manner},
    )


def _named_in(path: Path, command: click.Command) -> tuple[Path, ...]:
    """Return the files that a layout names."""
    if path.suffix.lower() in (".toml", ".json", ".pto"):
        from toposeam_cli.stitching.saved_layout import named_files

        with suppress(TopoSeamError):  # another kind of file, or its job reports what is wrong with it
            return tuple(named_files(path, command))
    return ()


def _relative(path: Path, folder: Path) -> str:
    try:
        return str(path.relative_to(folder.absolute()))
    except ValueError:
        return str(path)


def _show(jobs: Sequence[Job], results: Path, fresh: bool) -> None:
    """Print the command line of every job that would run."""
    rows = {}
    if results.exists() and not fresh:
        with Journal(results) as journal:
            rows = journal.rows
    for job in jobs:
        if finished(job, rows.get(job.name)):
            click.echo(f"# {job.name} is done")
        else:
            click.echo(
                shlex.join(
                    ["toposeam", job.arguments["command"], *job.manner["manner"], *job.arguments["words"]]
                )
            )
