"""GI-free: the choice of the paths that a seam follows.

A stitched group has its own path for each seam. There may be others, drawn by hand or imported from a file. A
path that is selected in the Paths dialog is applied; without a selection, the only one that is newer than the
group's, unless that was bent; else the group's own. In doubt the user is asked; if another path could have
been expected, a remark says so.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from toposeam_gimp.texts import _


class UnclearError(Exception):
    """Several paths are possible; the text says what to do."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A path that may be applied."""

    name: str
    #: Whether it belongs to the group itself.
    own: bool
    selected: bool
    #: Whether it was changed since it was written; for the group's own only.
    touched: bool = False
    #: Whether it is newer than the group's own.
    newer: bool = False
    #: The lines to apply.
    lines: Sequence[Any] = ()


class Choice(NamedTuple):
    """The paths that are applied to a seam."""

    #: Several paths only if they are the lines of one drawing.
    paths: Sequence[Candidate]
    #: A remark for the user about the choice.
    remark: str | None = None


def chosen(candidates: Sequence[Candidate], seam: str) -> Choice:
    """Choose the paths of a seam, among its own and others that fit it.

    Raises
    ------
    UnclearError
        Names the paths.
    """
    own = [candidate for candidate in candidates if candidate.own]
    others = [candidate for candidate in candidates if not candidate.own]
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
        text = _(
            "“{used}” was followed, and not “{newer}”, which is newer: the path that is selected counts."
        )
        remark = text.format(used=own[0].name, newer=newer[0].name) if newer else None
        return Choice(selected, remark)
    bent = any(candidate.touched for candidate in own)
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
    return Choice(own)


def _drawings(candidates: Sequence[Candidate]) -> int:
    """Count the drawings to which the paths belong."""
    return len({stem(candidate.name) for candidate in candidates})


def fits(name: str, seam: str) -> bool:
    """Test whether a path's name fits a seam between two of many layers."""
    return stem(name) == stem(seam)


def is_seam(name: str) -> bool:
    """Test whether a path has a name of `toposeam stitch --seam`, for any files."""
    return stem(name) == "seam" or " : " in name


def stem(name: str) -> str:
    """Return a path's name without GIMP's and SVG's suffixes for copies and for the lines of one drawing."""
    return " ".join(re.sub(r"(\s*(#\d+|\(\d+\)|\d+))+$", "", name).split())


def _listed(candidates: Sequence[Candidate]) -> str:
    return ", ".join(f"“{candidate.name}”" for candidate in candidates)
