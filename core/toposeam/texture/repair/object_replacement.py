"""One object of a finished texture replaced by itself, by another one or by ground: what goes, what fits in
its place, and where that shows, along a closed seam that runs through ground only.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from toposeam.arrays import Indices, Ints32, Mask
from toposeam.images import box_of
from toposeam.seam.labels import BEST
from toposeam.texture.exemplar.atlas import values_at
from toposeam.texture.placement.patch_placer import ClosedPatch, PatchPlacer
from toposeam.texture.repair.objects import RING, At, Key, Objects

#: An object of which less than this share shows is cut, and so is one that its exemplar's border cuts.
WHOLE = 0.985
#: What an object becomes other than a given one: whole, if there is any way, else ground; or ground.
MENDED, GROUND = -1, -2
#: Largest number of steps between the middles of a cut object and of its replacement.
_ASIDE = 2
#: Largest number of objects that a task forbids: requests are short.
FORBIDDEN = 16
#: Largest ratio of sizes of objects that are exchanged for each other.
_ALIKE = 2.5
#: Number of the best fits that are tried.
_TRIED = 6
#: px between the places beside a middle that are tried.
_STEP = 3
#: Approximate number of places that are compared where ground replaces what is left of an object.
_GROUNDS = 400

#: Which objects are tried, ground where there are none, and up to how many steps aside.
Try = tuple[list[int], int]


class ToReplace(NamedTuple):
    """An object that is to become another one, up to some steps aside."""

    key: Key
    becomes: int
    aside: int = 0
    #: What it must not become.
    without: tuple[int, ...] = ()

    def numbers(self) -> list[int]:
        """Encode the task as numbers, equally many for every task."""
        return [*self.key, self.becomes, self.aside, *self.without, *(FORBIDDEN - len(self.without)) * [-1]]


class Replaced(NamedTuple):
    """A patch that replaces an object; until it is cut it shows wherever it may."""

    #: First row and column of the patch on the canvas, and on the atlas.
    at: At
    place: At
    shows: Mask
    #: How many pixels go of which objects, and how many come of another one.
    gone: dict[Key, int]
    come: dict[Key, int]
    #: First patches of the copies that it continues, and by how many pixels these grow at most.
    joined: frozenset[int]
    grown: int


#: A patch before it is cut, and what it replaces.
Found = tuple[ClosedPatch, Replaced]


def diamond_dilation(mask: Mask, steps: int = 1) -> Mask:
    """Dilate a mask by a diamond of some steps: on small masks sooner than
    :func:`scipy.ndimage.binary_dilation`.

    Examples
    --------
    >>> diamond_dilation(np.eye(1, 5, 2, dtype=bool)).astype(int).tolist()
    [[0, 1, 1, 1, 0]]
    """
    for _ in range(steps):
        grown = mask.copy()
        grown[1:] |= mask[:-1]
        grown[:-1] |= mask[1:]
        grown[:, 1:] |= mask[:, :-1]
        grown[:, :-1] |= mask[:, 1:]
        mask = grown
    return mask


@dataclass(frozen=True, eq=False)
class Window:
    """The canvas round a place."""

    top: int
    left: int
    known: Ints32
    inside: Mask
    #: What has to go, how many pixels of which objects that is, and where others are.
    goes: Mask
    gone: dict[Key, int]
    busy: Mask

    @cached_property
    def beside_others(self) -> Mask:
        """Mask of other objects and the pixels next to them: flat."""
        return diamond_dilation(self.busy).ravel()

    @cached_property
    def ground(self) -> Mask:
        """Mask of the ground that stays: flat."""
        return np.asarray(self.inside.ravel() & ~self.goes.ravel() & ~self.beside_others)


class Fit(NamedTuple):
    """Something that could be laid there."""

    error: float
    #: Which object; -1 for ground.
    number: int
    #: Place of the window's first pixel on the atlas.
    place: At


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
        self._bare = placer.atlas.copied & ~diamond_dilation(self.objects.marks > 0)
        limits = zip(placer.canvas.shape, placer.canvas.wrap, strict=True)
        #: How many px round a place a window may have that does not meet itself.
        self._room = min(
            ((limit - 1) // 2 for limit, wraps in limits if wraps), default=max(placer.canvas.shape)
        )
        self._sizes = np.array([len(one.pixels) for one in self.objects.all])
        self._like: dict[int, list[int]] = {}
        self._reaches: dict[tuple[int, int, int], int] = {}

    def replaced(self, tasks: bytes) -> list[Replaced | None]:
        """Carry out tasks, whose numbers follow one another as int32; None for those that cannot be done."""
        found = [
            self._found(ToReplace((number, row, column), becomes, aside, tuple(without)))
            for number, row, column, becomes, aside, *without in np.frombuffer(tasks, np.int32)
            .reshape(-1, 5 + FORBIDDEN)
            .tolist()
        ]
        cut = iter(self.cut([one for one in found if one is not None]))
        return [None if one is None else next(cut) for one in found]

    def cut(self, found: Sequence[Found]) -> list[Replaced]:
        """Cut patches that do not touch, at the same time."""
        if not found:
            return []
        patches, cut = [patch for patch, _ in found], self._placer.cut_closed
        together = self._placer.options.method in BEST
        cuts = cut(patches) if together else [one for patch in patches for one in cut([patch])]
        return [one._replace(shows=shows) for (_, one), shows in zip(found, cuts, strict=True)]

    def like(self, number: int) -> list[int]:
        """List the other objects about as large as one."""
        if number not in self._like:
            sizes, own = self._sizes, self._sizes[number]
            alike = (sizes * _ALIKE > own) & (sizes < _ALIKE * own)
            alike[number] = False
            self._like[number] = np.flatnonzero(alike).tolist()
        return self._like[number]

    def around(self, task: ToReplace) -> int:
        """Compute how many px round its middle a task looks at, at most; -1 where there is no room for it."""
        kind = task.key[0], task.becomes, task.aside
        if kind not in self._reaches:
            tries: list[Try] = [([task.becomes], task.aside)] if task.becomes >= 0 else [([], 0)]
            tries += self._tries(task._replace(without=())) if task.becomes == MENDED else []
            around = (self._around(task.key[0], *one) for one in tries)
            self._reaches[kind] = max((far for far in around if far <= self._room), default=-1)
        return self._reaches[kind]

    def fitting(self, key: Key, aside: int) -> Indices:
        """List the objects that have room in the place of one, up to some steps aside, itself too."""
        others = self.like(key[0])
        around = self._around(key[0], others, aside)
        rooms = self._rooms(self._window(key, around), others, aside) if around <= self._room else ()
        return np.array([key[0], *sorted(number for number, _ in rooms)], np.intp)

    def replace(self, key: Key, tries: Sequence[Try], beside: bool = False) -> Found | None:
        """Find the one that fits best of some objects, up to some steps aside, over another, or ground where
        none is given: the first try for which there is room. With `beside` what is cut and touches it goes as
        well.
        """
        around = [self._around(key[0], numbers, aside) for numbers, aside in tries]
        fitting = [one for one, far in zip(tries, around, strict=True) if far <= self._room]
        if not fitting:
            return None
        window = self._window(key, max(far for far in around if far <= self._room), beside)
        if not window.goes.any():
            return None
        for numbers, aside in fitting:
            fits = self._fits(window, numbers, aside) if numbers else self._grounds(window)
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
        """List what a cut object may become: itself, or another one."""
        number = task.key[0]
        others = [other for other in self.like(number) if other not in task.without]
        return [([number], 0), (others, 0), (others, _ASIDE)]

    def _around(self, number: int, others: Iterable[int], aside: int) -> int:
        """Compute how many px round an object's middle others may take there."""
        return max(self.objects.all[k].reach for k in (number, *others)) + aside * _STEP + RING + 2

    def _window(self, key: Key, around: int, beside: bool = False) -> Window:
        """Read the canvas within some px of an object's middle."""
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
        """Test whether the canvas shows less of an object than it could, or its exemplar does."""
        one = self.objects.all[key[0]]
        if not one.whole:
            return True
        places = (np.array(one.middle) + one.pixels) @ (self._atlas.width, 1)
        top, left, side = key[1] - one.reach, key[2] - one.reach, 2 * one.reach + 1
        known = self._canvas.read(top, left, side, side)
        shown = np.count_nonzero(known[tuple((one.pixels + one.reach).T)] == places)
        return bool(shown < WHOLE * max(self.objects.room(key), 1))

    def _seen(self, key: Key, known: Ints32, top: int, left: int) -> Mask:
        """Find where a window shows an object and its fringe."""
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
        """Make a patch of what fits, if there is room for it and its copy does not grow too large."""
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
        patch, joined = self._patch(window, place, must, may)
        area, grown = sum(map(canvas.area_of, joined)), patch.changes(patch.may)
        if joined and area + grown > self.largest:
            (shows,) = self._placer.cut_closed([patch])
            grown = patch.changes(shows)
            if area + grown > self.largest:
                return None
        come: dict[Key, int] = {}
        if number >= 0:  # objects do not lie in the ring that the seam runs through
            middle = zip(self.objects.all[number].middle, place, (window.top, window.left), strict=True)
            new = self.objects.key(number, *(own - first + start for own, first, start in middle))
            come = {new: int(np.count_nonzero(must & (marks > 0)))}
        first = divmod(int(patch.source[0, 0]), atlas.width)
        return patch, Replaced(patch.at, first, patch.may, window.gone, come, joined, grown)

    def _patch(self, window: Window, place: At, must: Mask, may: Mask) -> tuple[ClosedPatch, frozenset[int]]:
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

    def _rooms(self, window: Window, numbers: list[int], aside: int) -> Iterator[tuple[int, Indices]]:
        """Yield the objects that have room in the middle of a window, or beside it, and where their middles
        may lie then: flat indices of the window.
        """
        side, busy = len(window.known), window.beside_others
        line = side // 2 + _STEP * np.arange(-aside, aside + 1)
        middles = (line[:, np.newaxis] * side + line).ravel()
        for number in numbers:
            one = self.objects.all[number]
            if one.whole:
                at = middles[:, np.newaxis] + one.pixels @ (side, 1)
                taken = busy.take(at).any(axis=1)
                if not taken.all():
                    yield number, middles[~taken]

    def _fits(self, window: Window, numbers: list[int], aside: int) -> list[Fit]:
        """Find where some objects have room in the middle of a window, or beside it, and how they fit."""
        found, features = [], self._placer.features.reshape(self._atlas.usable.size, -1)
        side, known = len(window.known), None
        for number, middles in self._rooms(window, numbers, aside):
            known = values_at(self._placer.features, window.known.ravel()) if known is None else known
            one = self.objects.all[number]
            at = middles[:, np.newaxis] + (one.ring[:, 0] * side + one.ring[:, 1])
            counts = window.ground.take(at)
            apart = known.take(at, axis=0)
            apart -= features.take((one.ring + one.middle) @ (self._atlas.width, 1), axis=0)
            errors = np.einsum("mrc,mrc,mr->m", apart, apart, counts.astype(np.float32))
            errors /= np.maximum(np.count_nonzero(counts, axis=1), 1)
            for error, middle in zip(errors.tolist(), middles.tolist(), strict=True):
                place = one.middle[0] - middle // side, one.middle[1] - middle % side
                found.append(Fit(error, number, place))
        return found

    def _grounds(self, window: Window) -> list[Fit]:
        """Find ground for what has to go in a window."""
        width, features = self._atlas.width, self._placer.features
        box = box_of(window.goes)
        rows, columns = (
            max(limit - side.stop + side.start, 0) for limit, side in zip(self._bare.shape, box, strict=True)
        )
        step = max(1, round((rows * columns / _GROUNDS) ** 0.5))
        grid = np.mgrid[step // 2 : rows : step, step // 2 : columns : step].reshape(2, -1).T
        places = grid - (box[0].start, box[1].start)
        y, x = np.nonzero(window.goes)
        covers = self._bare.ravel()[(places @ (width, 1))[:, np.newaxis] + y * width + x].all(axis=1)
        places = places[covers]
        rim = diamond_dilation(window.goes, 2) & ~window.goes & ~window.busy & window.inside
        y, x = np.nonzero(rim)
        at = (places @ (width, 1))[:, np.newaxis] + y * width + x
        free = (at >= 0) & (at < self._bare.size)
        free &= self._bare.ravel()[at * free]
        off = values_at(features, at * free) - values_at(features, window.known[y, x])
        error = (np.square(off).sum(axis=2) * free).sum(axis=1) / np.maximum(free.sum(axis=1), 1)
        few = 2 * free.sum(axis=1) < len(y)  # hardly anything to go by
        return [
            Fit(one, -1, (row, column))
            for one, (row, column) in zip((error + few).tolist(), places.tolist(), strict=True)
        ]
