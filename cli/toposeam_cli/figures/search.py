"""The search for a seam by heat, as a figure or as an animation: the file's extension decides."""

from __future__ import annotations

import toposeam as ts

#: Extensions of animations.
ANIMATED = (".gif", ".webp")
SUFFIXES = (".png", ".svg", ".pdf", *ANIMATED)


def check_search(suffix: str) -> None:
    """Refuse a figure that cannot be drawn, before a seam is searched for it.

    Raises
    ------
    MissingPackageError
        When matplotlib is needed and not installed.
    """
    if suffix.lower() not in ANIMATED:
        from toposeam_cli.figures.history import check_matplotlib

        check_matplotlib()


def draw_search(seam: ts.seam.Seam, suffix: str) -> bytes:
    """Draw the search of a seam found with ``record_frames=True``; return the file's content."""
    suffix = suffix.lower()
    if suffix in ANIMATED:
        from toposeam_cli.figures.animation import animate

        return animate(seam, suffix)
    from toposeam_cli.figures.history import history_figure

    return history_figure(seam, suffix)
