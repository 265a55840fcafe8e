"""Patches laid in waves: those whose windows do not touch are worked on at the same time.

In raster order a patch waits for its neighbours on the left and in the row above, so patches on a slope of
the canvas do not wait for one another. All of a wave see the canvas as it was before it, and their places are
picked in turn (:mod:`toposeam.texture.placement.wave_conflicts`), so the texture is the same however many
processes work on it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from toposeam.arrays import Mask
from toposeam.texture.canvas.places import Offers, Site
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.scheduling.process_pool import Crew

At = tuple[int, int]


class Laying:
    """Patches of one shape, each laid in two halves, maybe by different processes: the best places are looked
    for, and, when one has been picked, where the patch from it shows.
    """

    def __init__(self, placer: PatchPlacer, shape: tuple[int, int]) -> None:
        self._placer, self._shape = placer, shape
        placer.refresh()
        self._sites: dict[At, Site] = {}

    def offers(self, at: At) -> Offers | None:
        """Find the best places for a window; None where nothing is empty."""
        site = self._placer.site(*at, self._shape)
        if site is None:
            return None
        self._sites[at] = site
        return self._placer.ranking.offers(site)

    def shows(self, at: At, place: At) -> Mask | None:
        """Find where the patch from a place shows."""
        site = self._sites.pop(at, None) or self._placer.site(*at, self._shape)
        return None if site is None else self._placer.shows(site, self._placer.patch(place, self._shape))


class LayingGuided(Laying):
    """Patches that are laid only where they follow the guide."""

    def shows(self, at: At, place: At) -> Mask | None:
        """Find where the patch from a place shows; None if it does not follow the guide."""
        follows = self._placer.follows(at, self._placer.patch(place, self._shape))
        return super().shows(at, place) if follows else None


def lay_wave(
    placer: PatchPlacer, crew: Crew, kind: type, windows: Sequence[At], shape: tuple[int, int]
) -> list[bool]:
    """Lay patches at the same time on windows that do not touch; return whether each was laid.

    Places are picked in the windows' order as soon as they are known, and patches are painted in it when all
    are picked, whichever process finds them.

    Parameters
    ----------
    placer : PatchPlacer
    crew : Crew
        Its tool is the placer.
    kind : type
        Has the methods of :class:`Laying`.
    windows : sequence of (int, int)
        First rows and columns on the canvas.
    shape : (int, int)
        Height and width of the patches.
    """
    crew.begin(kind, shape, len(windows))
    for at in windows:
        crew.ask("offers", at)
    offered: dict[At, Offers | None] = {}
    places: dict[At, At] = {}
    shown: dict[At, Mask | None] = {}
    conflicts, picked, laid = placer.wave_conflicts(), 0, 0
    for (method, (at, *_)), found in crew.answers():
        (offered if method == "offers" else shown)[at] = found
        while picked < len(windows) and windows[picked] in offered:
            at = windows[picked]
            offers = offered[at]
            if offers is None:
                shown[at] = None
            else:
                places[at] = placer.pick(at, shape, offers, conflicts)
                crew.ask("shows", at, places[at])
            picked += 1
        while laid < picked == len(windows) and windows[laid] in shown:
            at = windows[laid]
            shows = shown[at]
            if shows is not None:
                placer.canvas.paint(*at, placer.patch(places[at], shape), shows)
            laid += 1
    return [shown[at] is not None for at in windows]


def waves_of(rows: list[int], columns: list[int], width: int, length: int | None = None) -> list[list[At]]:
    """Group windows in raster order into waves of those that do not wait for one another.

    Parameters
    ----------
    rows, columns : list of int
        First rows and columns of the windows.
    width : int
        Width of a window with what it reads on one side of it, px.
    length : int, optional
        Length of the rows, where they go round. Then each row begins further on than the one above, so that
        all patches above a window are there.

    Examples
    --------
    >>> waves_of([0, 7], [0, 7, 14], 8)
    [[(0, 0)], [(0, 7)], [(0, 14), (7, 0)], [(7, 7)], [(7, 14)]]
    """
    count, ahead = len(columns), 1  # this many windows further on, they are apart
    last = count if length is not None else 0
    while ahead < count and any(
        (columns[(k + ahead) % count] - columns[k]) % (length or math.inf) < width
        for k in range(last or count - ahead)
    ):
        ahead += 1
    skew, delay = (0, ahead) if length is None else (ahead - 1, min(2 * ahead - 1, count))
    waves: list[list[At]] = [[] for _ in range(count + delay * (len(rows) - 1))]
    for row, top in enumerate(rows):
        for step in range(count):
            waves[step + delay * row].append((top, columns[(step + skew * row) % count]))
    return waves
