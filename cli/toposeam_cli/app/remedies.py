"""Errors about a line that cannot be understood, with the line to type instead where we know it."""

from __future__ import annotations

import difflib
import os
import shlex
import subprocess
from collections.abc import Sequence
from pathlib import Path

import click

from toposeam.sentence import printable
from toposeam_cli.app.command import WORDS

#: Suffixes of results: a proposed result gets that of its input if it is one of these.
_WRITTEN = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".gif", ".mp4", ".mov", ".webm", ".npy")
#: Suffixes of words that look like names of inputs.
_PICTURES = (*_WRITTEN, ".heic", ".avif", ".bmp", ".jp2", ".ora", ".pto", ".toml")


def refuse_no_command(context: click.Context, commands: Sequence[str]) -> None:
    """Refuse words that begin with no command, if we can say what was meant.

    Raises
    ------
    UsageError
    """
    words = list(context.meta[WORDS])
    first = words[0]
    files = [word for word in words if _is_file(word)]
    if first == "help":
        named = [word for word in words[1:] if word in commands]
        raise click.UsageError(f"Write: {_line(['toposeam', *named[:1], '--help'])}", ctx=context)
    if len(files) > 1 and (_is_file(first) or first.startswith("-")):
        line = _with_output(["toposeam", "stitch", *words])
        raise click.UsageError(f"No command is given; to join pictures, write: {line}", ctx=context)
    if _is_file(first):
        raise click.UsageError(
            f"No command is given; say what to do with {first}: toposeam --help lists the commands",
            ctx=context,
        )
    near = difflib.get_close_matches(first.lower(), commands, 1)
    if near:
        raise click.UsageError(f"No such command '{first}'. Did you mean '{near[0]}'?", ctx=context)


def of_missing(error: click.MissingParameter) -> str | None:
    """Return the remedy if the missing parameter names the result, else None."""
    from toposeam_cli.app.options import is_output  # which loads the numerics

    context = error.ctx
    if context is None or error.param is None or not is_output(error.param):
        return None
    words = context.meta.get(WORDS)
    if not words:
        return None
    return (
        f"Missing option '-o', which says where the result goes; write: {_with_output(['toposeam', *words])}"
    )


def _with_output(words: list[str]) -> str:
    """Return the line with ``-o``: before its last word if that names a new file, else with a name of ours at
    the end. A line that has ``-o`` stays.
    """
    given = any(word in ("-o", "--output") or word.startswith("--output=") for word in words)
    if not given:
        files = [word for word in words if _is_file(word)]
        last = words[-1]
        is_new = last in files and len(files) > 2 and not os.path.lexists(last)
        if is_new and Path(last).suffix.lower() in _WRITTEN and "*" not in last:
            words = [*words[:-1], "-o", last]
        else:
            suffixes = (Path(word).suffix.lower() for word in files[:1])
            suffix = next((suffix for suffix in suffixes if suffix in _WRITTEN), ".png")
            words = [*words, "-o", f"result{suffix}"]
    return _line(words)


def _is_file(word: str) -> bool:
    """Test whether a word names a file, or looks like a name of one."""
    if word.startswith("-") or Path(word).suffix.lower() in _PICTURES:
        return not word.startswith("-")
    try:
        return Path(word).is_file()
    except (OSError, ValueError):  # too long, or no name at all
        return False


def _line(words: Sequence[str]) -> str:
    """Return the words quoted for a shell."""
    if os.name == "nt":
        return subprocess.list2cmdline(words)
    return printable(" ".join(word if _is_plain(word) else shlex.quote(word) for word in words))


def _is_plain(word: str) -> bool:
    """Test whether a word needs no quotes; patterns of file names need none, as they were written without."""
    bare = word.replace("*", "").replace("?", "")
    return not bare or shlex.quote(bare) == bare
