"""GI-free: which of an image's paths are meant to be applied to a seam.

A stitched group has two of its own for each seam: a smooth one to bend, and the exact one. Others may lie
beside them, drawn by hand or imported from a file. A path that is selected in the Paths dialog is meant;
without one, or where it is as it was written, the group's own that was bent, else its smooth one. Where that
leaves a doubt, the user is asked.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

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
    #: The lines to apply.
    lines: Sequence[Any] = ()


def chosen(candidates: Sequence[Candidate], seam: str) -> list[Candidate]:
    """The paths that are meant for a seam, among its own (smooth one first) and others that fit it; several
    only where they are the lines of one drawing.

    Raises
    ------
    UnclearError
        Names the paths.
    """
    selected = [candidate for candidate in candidates if candidate.selected]
    others = [candidate for candidate in selected if not candidate.own]
    if others and len({stem(candidate.name) for candidate in selected}) == 1:
        return others
    if len(selected) > 1:
        raise UnclearError(
            _("Several paths are selected for the seam {seam}: {paths}. Select one of them.").format(
                seam=seam, paths=_listed(selected)
            )
        )
    bent = [candidate for candidate in candidates if candidate.own and candidate.touched]
    if selected and (selected[0].touched or not selected[0].own or not bent):
        return selected
    if not selected and any(not candidate.own for candidate in candidates):
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
    return list(bent or candidates[:1])


def fits(name: str, seam: str) -> bool:
    """Whether a path's name says that it belongs to a seam between two of many layers."""
    return stem(name) == stem(seam)


def stem(name: str) -> str:
    """A path's name without what GIMP and SVG add to tell copies and the lines of one drawing apart."""
    return " ".join(re.sub(r"(\s*(#\d+|\(\d+\)|\d+))+$", "", name).split())


def _listed(candidates: Sequence[Candidate]) -> str:
    return ", ".join(f"“{candidate.name}”" for candidate in candidates)
