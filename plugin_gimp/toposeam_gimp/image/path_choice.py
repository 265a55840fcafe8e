"""GI-free: the choice of an image's paths to be applied to a seam.

A stitched group has two of its own for each seam: a smooth one to bend, and the exact one. Others may lie
beside them, drawn by hand or imported from a file. A path that is selected in the Paths dialog is meant;
without one, the only one that is newer than the group; without that, or where the smooth one is selected and
as it was written, the group's own that was bent, else its smooth one. Where that leaves a doubt, the user is
asked; where another path could have been expected, it is told.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from toposeam_gimp.texts import _


class UnclearError(Exception):
    """Several paths could be meant; the text says what to do."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A path that could be meant."""

    name: str
    #: Whether it belongs to the group itself.
    own: bool
    selected: bool
    #: Whether it is no longer as it was written; only of the group's own.
    touched: bool = False
    #: Whether it came later than the group's own.
    newer: bool = False
    #: The lines to apply.
    lines: Sequence[Any] = ()


class Choice(NamedTuple):
    """The paths that are meant."""

    #: Several only where they are the lines of one drawing.
    paths: Sequence[Candidate]
    #: What people should know about it.
    remark: str | None = None


def chosen(candidates: Sequence[Candidate], seam: str) -> Choice:
    """Return the paths that are meant for a seam, among its own (smooth one first) and others that fit it.

    Raises
    ------
    UnclearError
        Names the paths.
    """
    own = [candidate for candidate in candidates if candidate.own]
    others = [candidate for candidate in candidates if not candidate.own]
    bent = [candidate for candidate in own if candidate.touched]
    selected = [candidate for candidate in candidates if candidate.selected]
    if any(not candidate.own for candidate in selected) and _drawings(selected) == 1:
        return Choice(selected)
    if len(selected) > 1:
        raise UnclearError(
            _("Several paths are selected for the seam {seam}: {paths}. Select one of them.").format(
                seam=seam, paths=_listed(selected)
            )
        )
    newer = [candidate for candidate in others if candidate.newer]
    if selected:
        # The smooth one is selected since it was made; any other was selected by the user.
        wanted = selected[0].touched or selected[0] is not own[0] or not bent
        meant = selected if wanted else bent[:1]
        text = _(
            "“{used}” was followed, and not “{newer}”, which is newer: the path that is selected counts."
        )
        return Choice(
            meant,
            text.format(used=meant[0].name, newer=newer[0].name) if newer and meant == selected else None,
        )
    if newer and not bent and len(newer) == len(others) and _drawings(newer) == 1:
        text = _("“{used}” was followed, the newest path of the seam {seam}.")
        return Choice(newer, text.format(used=newer[0].name, seam=seam))
    if others:
        raise UnclearError(
            _(
                "There are several paths for the seam {seam}: {paths}. Select the one that counts in the "
                "Paths dialog."
            ).format(seam=seam, paths=_listed(candidates))
        )
    if len(bent) > 1:
        raise UnclearError(
            _(
                "Both paths of the seam {seam} were bent: {paths}. Select the one that counts in the Paths "
                "dialog."
            ).format(seam=seam, paths=_listed(bent))
        )
    return Choice(bent or candidates[:1])


def _drawings(candidates: Sequence[Candidate]) -> int:
    """Count the drawings whose lines the paths are."""
    return len({stem(candidate.name) for candidate in candidates})


def fits(name: str, seam: str) -> bool:
    """Test whether a path's name says that it belongs to a seam between two of many layers."""
    return stem(name) == stem(seam)


def is_seam(name: str) -> bool:
    """Test whether a path is called as `toposeam stitch --seam` calls seams, after whatever files."""
    return stem(name) == "seam" or " : " in name


def stem(name: str) -> str:
    """Return a path's name without what GIMP and SVG add to tell copies and the lines of one drawing
    apart.
    """
    return " ".join(re.sub(r"(\s*(#\d+|\(\d+\)|\d+))+$", "", name).split())


def _listed(candidates: Sequence[Candidate]) -> str:
    return ", ".join(f"“{candidate.name}”" for candidate in candidates)
