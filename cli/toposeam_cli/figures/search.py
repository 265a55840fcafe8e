"""How heat found a seam, as a figure or as an animation: the file's extension decides."""

from __future__ import annotations

import toposeam as ts
from toposeam_cli.figures import animation
from toposeam_cli.figures.history import check_matplotlib, history_figure

SUFFIXES = (".png", ".svg", ".pdf", *animation.SUFFIXES)


def check_search(suffix: str) -> None:
    """Refuse what could not be drawn, before a seam is searched for it.

    Raises
    ------
    MissingPackageError
        When matplotlib is needed and not installed.
    """
    if suffix.lower() not in animation.SUFFIXES:
        check_matplotlib()


def draw_search(seam: ts.Seam, suffix: str) -> bytes:
    """The file's content, for a seam that was found with ``record_frames=True``."""
    suffix = suffix.lower()
    return animation.animate(seam, suffix) if suffix in animation.SUFFIXES else history_figure(seam, suffix)
