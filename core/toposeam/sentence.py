"""What went wrong, as one sentence for the user, and other words."""

from __future__ import annotations

import os
from collections.abc import Iterator

from toposeam.errors import TopoSeamError


def sentence(error: BaseException) -> str:
    """What to tell the user about an error, on one line."""
    return printable(str(as_told(error)))


def as_told(error: BaseException) -> TopoSeamError:
    """The error, or one of ours that tells the user about it.

    Of these the kind is ``memory``, ``system`` or ``internal``; errors of click keep their sentence.
    """
    if isinstance(error, TopoSeamError):
        return error
    if callable(format_message := getattr(error, "format_message", None)):  # click's own errors
        return TopoSeamError(str(format_message()))
    if isinstance(error, MemoryError):
        return TopoSeamError(
            "the pictures do not fit into memory; use smaller ones, or close other programs", kind="memory"
        )
    if isinstance(error, OSError):
        return TopoSeamError(
            "the system refused ({reason}); free some space, or check the rights and where the output goes",
            kind="system",
            reason=str(error.strerror or error),
        )
    if os.environ.get("TOPOSEAM_DEBUG"):
        raise error
    return TopoSeamError(
        "something went wrong inside TopoSeam ({what}); set TOPOSEAM_DEBUG=1 for details and report it",
        kind="internal",
        what=f"{type(error).__name__}: {error}",
    )


def printable(text: str) -> str:
    """The text with escapes for what would break a line or a terminal: file names may hold line breaks and
    worse.
    """
    return "".join(character if character.isprintable() else ascii(character)[1:-1] for character in text)


def counted(number: int, noun: str) -> str:
    """One thing, or a number of them.

    Examples
    --------
    >>> counted(1, "patch"), counted(3, "patch"), counted(0, "seam")
    ('1 patch', '3 patches', '0 seams')
    """
    return f"{number} {noun}{'' if number == 1 else 'es' if noun.endswith('ch') else 's'}"


def causes(error: BaseException | None) -> Iterator[BaseException]:
    """An error, then what it came from, and so on, each once: a cause may be its own."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__
