"""One object of a finished texture replaced by itself, by another one or by ground: find what fits in its
place, and cut it along a closed seam that runs through ground only.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from toposeam.arrays import Indices, Mask
from toposeam.images import box_of
from toposeam.seam.labels import BEST
from toposeam.texture.objects.object_catalog import SEAM_RING, At, Key, ObjectCatalog
from toposeam.texture.objects.object_fits import (
    PLACE_STEP,
    ObjectFit,
    ObjectFits,
    ObjectWindow,
    diamond_dilation,
)
from toposeam.texture.placement.patch_placer import ClosedPatch, PatchPlacer

#: What an object becomes, where that is not one object of a given number: any whole one, or else ground; or
#: ground.
MENDED, GROUND = -1, -2
#: Largest distance between the middles of a cut object and of its replacement, in steps of `PLACE_STEP`.
_MAX_STEPS_ASIDE = 2
#: Largest number of objects that a task forbids: a request to another process is short.
MAX_FORBIDDEN = 16
#: Largest ratio of the areas of two objects that are exchanged for each other.
_MAX_AREA_RATIO = 2.5
#: Number of best fits that are tried before a replacement is given up.
_FITS_TRIED = 6

#: Numbers of the objects to try, none for ground, and up to how many steps aside.
Attempt = tuple[list[int], int]


class ReplacementTask(NamedTuple):
    """An object that is to become another one, up to some steps aside."""

    key: Key
    #: Number of that object, `MENDED` or `GROUND`.
    becomes: int
    steps_aside: int = 0
    #: Numbers of the objects that it must not become.
    forbidden: tuple[int, ...] = ()

    def numbers(self) -> list[int]:
        """Encode the task as numbers, equally many for every task."""
        unused = MAX_FORBIDDEN - len(self.forbidden)
        return [*self.key, self.becomes, self.steps_aside, *self.forbidden, *unused * [-1]]


class Replacement(NamedTuple):
    """A patch that replaces an object."""

    #: First row and column of the patch on the canvas, and on the atlas.
    at: At
    place: At
    #: (h, w) bool: where it shows; before it is cut, where it may show.
    shows: Mask
    #: Number of pixels that go, by object, and that come, by object.
    gone: dict[Key, int]
    come: dict[Key, int]
    #: First patches of the copies that it continues, and by how many pixels these grow at most.
    joined: frozenset[int]
    grown: int


#: A patch before it is cut, and what it replaces.
Uncut = tuple[ClosedPatch, Replacement]


class ObjectReplacer:
    """Replaces objects that do not touch, on a placer's canvas, which it does not change. Every process may
    have one of its own.

    Parameters
    ----------
    placer : PatchPlacer
        It has a guard.
    shape : (int, int)
        Height and width of its patches.
    """

    def __init__(self, placer: PatchPlacer, shape: tuple[int, int]) -> None:
        self._placer, self._canvas, self._atlas = placer, placer.canvas, placer.atlas
        guard = np.zeros(placer.atlas.usable.size, np.float32) if placer.guard is None else placer.guard
        self.catalog = ObjectCatalog(guard, placer.features, placer.atlas, placer.canvas)
        self._fits = ObjectFits(placer, self.catalog)
        #: Largest area of a connected copy, px of the canvas.
        self.largest = placer.ranking.largest_copy(shape)
        limits = zip(placer.canvas.shape, placer.canvas.wrap, strict=True)
        #: Largest distance, px, from the middle of a window to its border at which it does not meet itself.
        self._room = min(
            ((limit - 1) // 2 for limit, wraps in limits if wraps), default=max(placer.canvas.shape)
        )
        self._areas = np.array([len(one.pixels) for one in self.catalog.all])
        self._similar: dict[int, list[int]] = {}
        self._reaches: dict[tuple[int, int, int], int] = {}

    def replace_all(self, tasks: bytes) -> list[Replacement | None]:
        """Carry out tasks, whose numbers follow one another as int32; None for those that cannot be done."""
        found = [
            self._carry_out(ReplacementTask((number, row, column), becomes, aside, tuple(forbidden)))
            for number, row, column, becomes, aside, *forbidden in np.frombuffer(tasks, np.int32)
            .reshape(-1, 5 + MAX_FORBIDDEN)
            .tolist()
        ]
        cut = iter(self.cut([one for one in found if one is not None]))
        return [None if one is None else next(cut) for one in found]

    def cut(self, found: Sequence[Uncut]) -> list[Replacement]:
        """Cut patches that do not touch, at the same time."""
        if not found:
            return []
        patches, cut = [patch for patch, _ in found], self._placer.cut_closed
        together = self._placer.options.method in BEST
        cuts = cut(patches) if together else [one for patch in patches for one in cut([patch])]
        return [one._replace(shows=shows) for (_, one), shows in zip(found, cuts, strict=True)]

    def similar(self, number: int) -> list[int]:
        """List the other objects about as large as one."""
        if number not in self._similar:
            areas, own = self._areas, self._areas[number]
            alike = (areas * _MAX_AREA_RATIO > own) & (areas < _MAX_AREA_RATIO * own)
            alike[number] = False
            self._similar[number] = np.flatnonzero(alike).tolist()
        return self._similar[number]

    def reach_of(self, task: ReplacementTask) -> int:
        """Compute how many px round an object's middle a task reads and changes at most; -1 where the canvas
        is too small for it.
        """
        kind = task.key[0], task.becomes, task.steps_aside
        if kind not in self._reaches:
            attempts: list[Attempt] = [([task.becomes], task.steps_aside)] if task.becomes >= 0 else [([], 0)]
            attempts += self._attempts(task._replace(forbidden=())) if task.becomes == MENDED else []
            reaches = (self._reach(task.key[0], *one) for one in attempts)
            self._reaches[kind] = max((reach for reach in reaches if reach <= self._room), default=-1)
        return self._reaches[kind]

    def fitting(self, key: Key, steps_aside: int) -> Indices:
        """List the numbers of the objects that have room in the place of one, up to some steps aside; its own
        is the first.
        """
        others = self.similar(key[0])
        reach = self._reach(key[0], others, steps_aside)
        rooms = (
            self._fits.rooms(self._fits.window(key, reach), others, steps_aside)
            if reach <= self._room
            else ()
        )
        return np.array([key[0], *sorted(number for number, _ in rooms)], np.intp)

    def replace(self, key: Key, attempts: Sequence[Attempt], with_touching: bool = False) -> Uncut | None:
        """Find the best fit of the first attempt for which there is room; None where there is none.

        Parameters
        ----------
        key : (int, int, int)
            The object that goes.
        attempts : sequence of (list of int, int)
        with_touching : bool
            Whether cut objects that touch it go as well.
        """
        reaches = [self._reach(key[0], numbers, aside) for numbers, aside in attempts]
        possible = [one for one, reach in zip(attempts, reaches, strict=True) if reach <= self._room]
        if not possible:
            return None
        reach = max(reach for reach in reaches if reach <= self._room)
        window = self._fits.window(key, reach, with_touching)
        if not window.goes.any():
            return None
        for numbers, aside in possible:
            fits = self._fits.objects(window, numbers, aside) if numbers else self._fits.grounds(window)
            for fit in sorted(fits, key=lambda fit: fit.error)[:_FITS_TRIED]:
                found = self._laid(window, fit)
                if found is not None:
                    return found
        return None

    def _carry_out(self, task: ReplacementTask) -> Uncut | None:
        """Find a patch for a task; None where there is none."""
        key, becomes, aside, _ = task
        if becomes >= 0:
            return self.replace(key, [([becomes], aside)])
        if becomes == MENDED:
            attempts = self._attempts(task)
            # Which objects touch it depends on the window's size, so attempts with them are made singly.
            for some, with_touching in (attempts, False), *(([one], True) for one in attempts):
                found = self.replace(key, some, with_touching)
                if found is not None:
                    return found
        return self.replace(key, [([], 0)])

    def _attempts(self, task: ReplacementTask) -> list[Attempt]:
        """List what a cut object may become: itself, or another one."""
        number = task.key[0]
        others = [other for other in self.similar(number) if other not in task.forbidden]
        return [([number], 0), (others, 0), (others, _MAX_STEPS_ASIDE)]

    def _reach(self, number: int, others: Iterable[int], steps_aside: int) -> int:
        """Compute how many px round an object's middle others, and seams round them, may take."""
        largest = max(self.catalog.all[k].reach for k in (number, *others))
        return largest + steps_aside * PLACE_STEP + SEAM_RING + 2

    def _laid(self, window: ObjectWindow, fit: ObjectFit) -> Uncut | None:
        """Make a patch of what fits, if there is room for it and its copy does not grow too large."""
        atlas, canvas, (_, number, place) = self._atlas, self._canvas, fit
        must = window.goes.copy()
        if number >= 0:
            one = self.catalog.all[number]
            y, x = (one.pixels + one.middle - place).T
            must[y, x] = window.inside[y, x]
        rows, columns = (start + np.arange(length) for start, length in zip(place, must.shape, strict=True))
        height, width = atlas.usable.shape
        on = ((rows >= 0) & (rows < height))[:, np.newaxis] & (columns >= 0) & (columns < width)
        at = np.clip(rows, 0, height - 1)[:, np.newaxis], np.clip(columns, 0, width - 1)
        on &= atlas.copied[at]
        marks = self.catalog.marks[at]
        other = (marks > 0) & (marks != number + 1)
        if (must & (other | window.busy | ~on)).any():
            return None
        may = diamond_dilation(must, SEAM_RING) & window.inside & on
        may = (may & ~diamond_dilation(other | window.busy)) | must
        patch, joined = self._patch(window, place, must, may)
        area, grown = sum(map(canvas.area_of, joined)), patch.changes(patch.may)
        if joined and area + grown > self.largest:
            (shows,) = self._placer.cut_closed([patch])
            grown = patch.changes(shows)
            if area + grown > self.largest:
                return None
        come: dict[Key, int] = {}
        if number >= 0:  # objects do not lie in the ring that the seam runs through
            middle = zip(self.catalog.all[number].middle, place, (window.top, window.left), strict=True)
            new = self.catalog.key(number, *(own - first + start for own, first, start in middle))
            come = {new: int(np.count_nonzero(must & (marks > 0)))}
        first = divmod(int(patch.source[0, 0]), atlas.width)
        return patch, Replacement(patch.at, first, patch.may, window.gone, come, joined, grown)

    def _patch(
        self, window: ObjectWindow, place: At, must: Mask, may: Mask
    ) -> tuple[ClosedPatch, frozenset[int]]:
        """Take a patch from a place of the atlas, as large as it has to be, with the first patches of the
        copies that it continues.
        """
        canvas, box = self._canvas, box_of(may)
        top, left = window.top + box[0].start, window.left + box[1].start
        shape = must[box].shape[0], must[box].shape[1]
        source = self._placer.patch((place[0] + box[0].start, place[1] + box[1].start), shape)
        before = canvas.read(top - 1, left - 1, shape[0] + 2, shape[1] + 2)
        y, x = np.nonzero(before[1:-1, 1:-1] == source)
        row, column, _ = canvas.window(top, left, *shape)
        labels = np.unique(canvas.labels[row[y, 0], column[0, x]])
        joined = frozenset(canvas.copy_of(label) for label in labels.tolist())
        patch = ClosedPatch(at=(top, left), source=source, before=before, must=must[box], may=may[box])
        return patch, joined
