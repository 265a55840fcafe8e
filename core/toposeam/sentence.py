"""Sentences for users: errors as one line, escapes, counted nouns."""

from __future__ import annotations

import os
from collections.abc import Iterator

from toposeam.errors import TopoSeamError


def sentence(error: BaseException) -> str:
    """Return the text of an error for the user, on one line."""
    return printable(str(as_toposeam_error(error)))


def as_toposeam_error(error: BaseException) -> TopoSeamError:
    """Return an error as a TopoSeamError with a text for the user.

    Errors of this package are returned unchanged, and errors of click keep their text. Others become an error
    of the kind ``memory``, ``system`` or ``internal``.
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
    """Return a text with escapes for unprintable characters.

    File names may hold line breaks and control sequences, which would break the line or the terminal.
    """
    return "".join(character if character.isprintable() else ascii(character)[1:-1] for character in text)


def counted(number: int, noun: str) -> str:
    """Return a number with its noun, in the plural unless the number is 1.

    Examples
    --------
    >>> counted(1, "patch"), counted(3, "patch"), counted(0, "seam")
    ('1 patch', '3 patches', '0 seams')
    """
    return f"{number} {noun}{'' if number == 1 else 'es' if noun.endswith('ch') else 's'}"


def causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error and its chain of causes, each once: chains may be circular."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__
