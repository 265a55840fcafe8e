"""One object of a finished texture replaced by itself, by another one or by ground: what goes, what fits in
its place, and where that shows, along a closed seam that runs through ground only.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from toposeam.images import Mask, box_of
from toposeam.seam.labels import BEST
from toposeam.texture.atlas import Ints32
from toposeam.texture.candidates import STEP, Candidates, Fit, Window, diamond_dilation
from toposeam.texture.closed_cuts import Patch, closed_cuts
from toposeam.texture.lay import PatchPlacer
from toposeam.texture.objects import RING, At, Key, Objects
from toposeam.texture.search import Ints

#: An object of which less than this share shows is cut, and so is one that its exemplar's border cuts.
WHOLE = 0.985
#: What an object becomes where no number says it: whole, if there is any way, else ground; or ground.
MENDED, GROUND = -1, -2
#: By how many steps an object may lie beside the middle of the one that was cut.
_ASIDE = 2
#: So many objects at most that one must not become are told: requests are short.
FORBIDDEN = 16
#: Objects are exchanged for others up to so many times as large, or as small.
_ALIKE = 2.5
#: So many of what fits best are tried.
_TRIED = 6

#: Which objects are tried, up to so many steps aside; ground where there are none.
Try = tuple[list[int], int]


class ToReplace(NamedTuple):
    """Which object is to become what, up to so many steps aside."""

    key: Key
    becomes: int
    aside: int = 0
    #: What it must not become.
    without: tuple[int, ...] = ()

    def numbers(self) -> list[int]:
        """The same as numbers, so many for every task."""
        return [*self.key, self.becomes, self.aside, *self.without, *(FORBIDDEN - len(self.without)) * [-1]]


class Found(NamedTuple):
    """A patch that replaces an object."""

    patch: Patch
    #: How many pixels go of which objects, and how many come of another one.
    gone: dict[Key, int]
    come: dict[Key, int]
    #: By how many pixels the copies that it continues grow at most.
    grown: int


class Replaced(NamedTuple):
    """The same, when it is cut."""

    #: First row and column of the patch on the canvas, and on the atlas.
    at: At
    place: At
    shows: Mask
    gone: dict[Key, int]
    come: dict[Key, int]
    #: First patches of the copies that it continues.
    joined: frozenset[int]
    grown: int


class Replacing:
    """Replaces objects that do not touch, on a placer's canvas, which it does not change; maybe in another
    process.

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
        self.objects = Objects(guard, placer.features, placer.atlas, placer.canvas)
        #: How many pixels of the canvas a copy may show on.
        self.largest = placer.ranking.largest_copy(shape)
        self._candidates = Candidates(placer.features, placer.atlas, self.objects)
        limits = zip(placer.canvas.shape, placer.canvas.wrap, strict=True)
        #: How many px round a place a window may have that does not meet itself.
        self._room = min(
            ((limit - 1) // 2 for limit, wraps in limits if wraps), default=max(placer.canvas.shape)
        )

        self._sizes = np.array([len(one.pixels) for one in self.objects.all])
        self._like: dict[int, list[int]] = {}
        self._reaches: dict[tuple[int, int, int], int] = {}

    def replaced(self, tasks: bytes) -> list[Replaced | None]:
        """Tasks, whose numbers follow one another as int32, done if they can be."""
        found = [
            self._found(ToReplace((number, row, column), becomes, aside, tuple(without)))
            for number, row, column, becomes, aside, *without in np.frombuffer(tasks, np.int32)
            .reshape(-1, 5 + FORBIDDEN)
            .tolist()
        ]
        cut = iter(self.cut([one for one in found if one is not None]))
        return [None if one is None else next(cut) for one in found]

    def cut(self, found: Sequence[Found]) -> list[Replaced]:
        """Patches that do not touch, cut at the same time."""
        if not found:
            return []
        patches = [one.patch for one in found]
        if self._placer.options.method in BEST:
            cuts = closed_cuts(self._placer, patches)
        else:
            cuts = [cut for patch in patches for cut in closed_cuts(self._placer, [patch])]
        return [
            Replaced(
                at=patch.at,
                place=divmod(int(patch.source[0, 0]), self._atlas.width),
                shows=shows,
                gone=one.gone,
                come=one.come,
                joined=patch.joined,
                grown=one.grown,
            )
            for one, patch, shows in zip(found, patches, cuts, strict=True)
        ]

    def like(self, number: int) -> list[int]:
        """Other objects about as large as one."""
        if number not in self._like:
            alike = (self._sizes * _ALIKE > self._sizes[number]) & (
                self._sizes < _ALIKE * self._sizes[number]
            )
            alike[number] = False
            self._like[number] = np.flatnonzero(alike).tolist()
        return self._like[number]

    def around(self, task: ToReplace) -> int:
        """How many px round its middle a task looks at, at most; -1 where there is no room for it."""
        kind = task.key[0], task.becomes, task.aside
        if kind not in self._reaches:
            tries: list[Try] = [([task.becomes], task.aside)] if task.becomes >= 0 else [([], 0)]
            tries += self._tries(task._replace(without=())) if task.becomes == MENDED else []
            around = (self._around(task.key[0], *one) for one in tries)
            self._reaches[kind] = max((far for far in around if far <= self._room), default=-1)
        return self._reaches[kind]

    def fitting(self, key: Key, aside: int) -> Ints:
        """The objects that have room in the place of one, up to so many steps aside, itself too."""
        others = self.like(key[0])
        around = self._around(key[0], others, aside)
        found = (
            self._candidates.rooms(self._window(key, around), others, aside) if around <= self._room else ()
        )
        return np.array([key[0], *sorted(number for number, _ in found)], np.intp)

    def replace(self, key: Key, tries: Sequence[Try], beside: bool = False) -> Found | None:
        """The one that fits best of some objects, up to so many steps aside, over another, or ground where
        none is given: what there is room for first, if there is. With `beside` what is cut and touches it
        goes as well.
        """
        around = [self._around(key[0], numbers, aside) for numbers, aside in tries]
        fitting = [one for one, far in zip(tries, around, strict=True) if far <= self._room]
        if not fitting:
            return None
        window = self._window(key, max(far for far in around if far <= self._room), beside)
        if not window.goes.any():
            return None
        candidates = self._candidates
        for numbers, aside in fitting:
            fits = candidates.fits(window, numbers, aside) if numbers else candidates.grounds(window)
            for fit in sorted(fits, key=lambda fit: fit.error)[:_TRIED]:
                found = self._laid(window, fit)
                if found is not None:
                    return found
        return None

    def _found(self, task: ToReplace) -> Found | None:
        key, becomes, aside, _ = task
        if becomes >= 0:
            return self.replace(key, [([becomes], aside)])
        if becomes == MENDED:
            tries = self._tries(task)
            # What goes beside it depends on how far the window reaches.
            for some, beside in (tries, False), *(([one], True) for one in tries):
                found = self.replace(key, some, beside)
                if found is not None:
                    return found
        return self.replace(key, [([], 0)])

    def _tries(self, task: ToReplace) -> list[Try]:
        """What a cut object may become: itself, or another one."""
        number = task.key[0]
        others = [other for other in self.like(number) if other not in task.without]
        return [([number], 0), (others, 0), (others, _ASIDE)]

    def _around(self, number: int, others: Iterable[int], aside: int) -> int:
        """How many px round an object's middle others may take there."""
        return max(self.objects.all[k].reach for k in (number, *others)) + aside * STEP + RING + 2

    def _window(self, key: Key, around: int, beside: bool = False) -> Window:
        """So many px round an object's middle."""
        top, left, side = key[1] - around, key[2] - around, 2 * around + 1
        known = self._canvas.read(top, left, side, side)
        inside = known >= 0
        shown = (self.objects.marks.ravel()[np.maximum(known, 0)] > 0) & inside
        goes = self._seen(key, known, top, left)
        gone = {key: int(np.count_nonzero(goes & shown))}
        if beside:
            y, x = np.nonzero(diamond_dilation(goes, 3) & shown & ~goes)
            for other in self.objects.at(y + top, x + left, known[y, x]):
                if self._is_cut(other):
                    seen = self._seen(other, known, top, left)
                    gone[other] = int(np.count_nonzero(seen & shown))
                    goes |= seen
        return Window(top, left, known, inside, goes, gone, shown & ~goes)

    def _is_cut(self, key: Key) -> bool:
        """Whether the canvas shows less of an object than it could, or its exemplar does."""
        one = self.objects.all[key[0]]
        if not one.whole:
            return True
        places = (np.array(one.middle) + one.pixels) @ (self._atlas.width, 1)
        top, left, side = key[1] - one.reach, key[2] - one.reach, 2 * one.reach + 1
        known = self._canvas.read(top, left, side, side)
        shown = np.count_nonzero(known[tuple((one.pixels + one.reach).T)] == places)
        return bool(shown < WHOLE * max(self.objects.room(key), 1))

    def _seen(self, key: Key, known: Ints32, top: int, left: int) -> Mask:
        """Where a window shows an object and its fringe."""
        y, x = np.arange(known.shape[0])[:, np.newaxis], np.arange(known.shape[1])[np.newaxis]
        lines = []
        for line, first, at, middle, limit, wraps in zip(
            (y, x),
            (top, left),
            key[1:],
            self.objects.all[key[0]].middle,
            self._canvas.shape,
            self._canvas.wrap,
            strict=True,
        ):
            away = (first - at + limit // 2) % limit - limit // 2 if wraps else first - at
            lines.append(middle + away + line)
        seen: Mask = known == lines[0] * self._atlas.width + lines[1]
        seen &= self.objects.fringed.ravel()[np.maximum(known, 0)] == key[0] + 1
        return seen

    def _laid(self, window: Window, fit: Fit) -> Found | None:
        """What fits as a patch, if there is room for it and its copy does not grow too large."""
        atlas, canvas, (_, number, place) = self._atlas, self._canvas, fit
        must = window.goes.copy()
        if number >= 0:
            one = self.objects.all[number]
            y, x = (one.pixels + one.middle - place).T
            must[y, x] = window.inside[y, x]
        rows, columns = (start + np.arange(length) for start, length in zip(place, must.shape, strict=True))
        height, width = atlas.usable.shape
        on = ((rows >= 0) & (rows < height))[:, np.newaxis] & (columns >= 0) & (columns < width)
        at = np.clip(rows, 0, height - 1)[:, np.newaxis], np.clip(columns, 0, width - 1)
        on &= atlas.copied[at]
        marks = self.objects.marks[at]
        other = (marks > 0) & (marks != number + 1)
        if (must & (other | window.busy | ~on)).any():
            return None
        may = diamond_dilation(must, RING) & window.inside & on
        may = (may & ~diamond_dilation(other | window.busy)) | must
        patch = self._patch(window, place, must, may)
        area, grown = sum(map(canvas.area_of, patch.joined)), patch.changes(patch.may)
        if patch.joined and area + grown > self.largest:
            (shows,) = closed_cuts(self._placer, [patch])
            grown = patch.changes(shows)
            if area + grown > self.largest:
                return None
        if number < 0:
            return Found(patch, window.gone, {}, grown)
        # Objects do not lie in the ring that the seam runs through.
        middle = zip(self.objects.all[number].middle, place, (window.top, window.left), strict=True)
        come = self.objects.key(number, *(own - first + start for own, first, start in middle))
        return Found(patch, window.gone, {come: int(np.count_nonzero(must & (marks > 0)))}, grown)

    def _patch(self, window: Window, place: At, must: Mask, may: Mask) -> Patch:
        """A patch from a place of the atlas, as large as it has to be."""
        canvas, box = self._canvas, box_of(may)
        top, left = window.top + box[0].start, window.left + box[1].start
        shape = box[0].stop - box[0].start, box[1].stop - box[1].start
        source = self._placer.patch((place[0] + box[0].start, place[1] + box[1].start), shape)
        before = canvas.read(top - 1, left - 1, shape[0] + 2, shape[1] + 2)
        y, x = np.nonzero(before[1:-1, 1:-1] == source)
        row, column, _ = canvas.window(top, left, *shape)
        labels = np.unique(canvas.labels[row[y, 0], column[0, x]])
        joined = frozenset(canvas.copy_of(label) for label in labels.tolist())
        return Patch(
            at=(top, left), source=source, before=before, must=must[box], may=may[box], joined=joined
        )
