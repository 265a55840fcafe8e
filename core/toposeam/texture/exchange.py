"""Objects of a finished texture made whole, and exchanged where one comes twice near by.

On a ground with objects, patches leave some objects cut where two of them met, and bring others a second time
within sight, as what lies between them goes with them. When all is laid, each such object is replaced by
itself: by another one with the ground round it, along a closed seam that runs through ground only. Which one
becomes which is found by the rule of fewest conflicts (Minton et al. 1992, doi:10.1016/0004-3702(92)90007-K).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence

import numpy as np

from toposeam.images import Mask, box_of
from toposeam.seam.labels import BEST
from toposeam.texture.atlas import Ints32
from toposeam.texture.candidates import STEP, Candidates, Fit, Window, diamond_dilation
from toposeam.texture.closed_cuts import Cutting, Patch, closed_cuts
from toposeam.texture.crew import Crew
from toposeam.texture.lay import PatchPlacer
from toposeam.texture.objects import RING, At, Key, Objects
from toposeam.texture.positions import Positions
from toposeam.texture.search import Ints

#: An object of which less than this share shows is cut; one of which more than that shows counts as there.
_WHOLE, _THERE = 0.95, 0.4
#: Within this share of an exemplar's shorter side, and so many px more as cut ones have their middle
#: elsewhere, two of the same are near each other.
_NEAR, _SLACK = 0.5, 4
#: By how many steps an object may lie beside the middle of the one that was cut.
_ASIDE = 2
#: Objects are exchanged for others up to so many times as large, or as small.
_ALIKE = 2.5
#: So many of what fits best are tried.
_TRIED = 6
#: So many exchanges are thought through for every object that comes twice near by, and so often is looked
#: again for what could not be laid, by how many steps aside.
_THOUGHT, _ROUNDS = 40, (0, 1, 2)
#: So many exchanges, which do not touch, are cut at the same time.
_AT_ONCE = 4


class Exchange:
    """Exchanges objects on a placer's canvas, which is full.

    Parameters
    ----------
    placer : PatchPlacer
        It has a guard.
    shape : (int, int)
        Height and width of its patches.
    crew : Crew
        Who cuts; its tool is the placer.
    """

    def __init__(self, placer: PatchPlacer, shape: tuple[int, int], crew: Crew) -> None:
        self._placer, self._canvas, self._atlas = placer, placer.canvas, placer.atlas
        self._crew, self._shape = crew, shape
        guard = np.zeros(placer.atlas.usable.size, np.float32) if placer.guard is None else placer.guard
        self._objects = Objects(guard, placer.atlas, placer.canvas)
        self._largest, self._all = placer.largest_copy(shape), self._objects.all
        near = _NEAR * int(self._atlas.shapes.min(axis=1).max()) + _SLACK
        self._candidates = Candidates(placer.features, placer.atlas, self._objects)
        self._shown = self._objects.shown()
        limits = zip(placer.canvas.shape, placer.canvas.wrap, strict=True)
        #: How many px round a place a window may have that does not meet itself.
        self._room = min(
            ((limit - 1) // 2 for limit, wraps in limits if wraps), default=max(placer.canvas.shape)
        )
        self._there = Positions(placer.canvas.shape, placer.canvas.wrap, near)
        self._note(self._shown)
        #: What has been laid, but not painted yet, windows that do not touch: what nobody cuts yet, and what
        #: is being cut.
        self._laid: list[Patch] = []
        self._asked: list[Patch] = []
        self._at_once = _AT_ONCE if placer.options.method in BEST else 1

    def run(self) -> int:
        """Make objects whole, and exchange those that come twice near by; how many were replaced."""
        done, shares = 0, {key: self._share(key) for key in self._shown}
        self._crew.begin(Cutting, self._shape, len(shares))
        for key in sorted(shares, key=lambda one: (-shares[one], one)):
            done += shares[key] < _WHOLE and self._mend(key)
        for aside in _ROUNDS:
            for key, number in self._chosen(aside).items():
                done += self._replace(key, [([number], aside)])
        done += sum(map(self._part, self._twice()))
        self._cut()
        self._paint()
        return done

    def _share(self, key: Key) -> float:
        """What share of an object shows of what could."""
        return self._shown[key] / max(self._objects.room(key), 1)

    def _mend(self, key: Key) -> bool:
        """Make a cut object whole, replace it by another one or, if little of it is left, by ground."""
        share = self._share(key)
        if not 0 < share < _WHOLE:
            return False
        if share > _THERE:
            others = self._others(key)
            tries = [([key[0]], 0), (others, 0), (others, _ASIDE)]
            # What goes beside it depends on how far the window reaches.
            if self._replace(key, tries) or any(self._replace(key, [one], beside=True) for one in tries):
                return True
        return self._replace(key, [([], 0)])

    def _twice(self) -> list[Key]:
        """Objects that are there twice near by."""
        return [key for key in self._there.all() if self._is_twice(key)]

    def _is_twice(self, key: Key) -> bool:
        """Whether an object is there, and near by once more."""
        near = set(self._there.near(key[1:]))
        return key in near and any(one[0] == key[0] for one in near - {key})

    def _part(self, key: Key) -> bool:
        """Replace an object that still comes twice near by, as what it should have become had no room there,
        by any other that does not.
        """
        if not self._is_twice(key):  # the other one has gone
            return False
        others = self._others(key)
        return bool(others) and self._replace(key, [(others, aside) for aside in _ROUNDS])

    def _like(self, number: int) -> list[int]:
        """Other objects about as large as one."""
        sizes = [len(one.pixels) for one in self._all]
        return [
            k for k, size in enumerate(sizes) if k != number and 1 / _ALIKE < size / sizes[number] < _ALIKE
        ]

    def _others(self, key: Key) -> list[int]:
        """Other objects about as large as one that do not show near it."""
        near = {one[0] for one in self._there.near(key[1:])}
        return [k for k in self._like(key[0]) if k not in near]

    def _replace(self, key: Key, tries: Sequence[tuple[list[int], int]], beside: bool = False) -> bool:
        """Lay the one that fits best of some objects, up to so many steps aside, over another, or ground
        where none is given: what there is room for first, and whether there was. With `beside` what is cut
        and touches it goes as well.
        """
        around = [self._around(key, numbers, aside) for numbers, aside in tries]
        fitting = [one for one, far in zip(tries, around, strict=True) if far <= self._room]
        if not fitting:
            return False
        window = self._window(key, max(far for far in around if far <= self._room), beside)
        if not window.goes.any():
            return False
        found = self._candidates
        for numbers, aside in fitting:
            fits = found.fits(window, numbers, aside) if numbers else found.grounds(window)
            if any(self._lay(window, fit) for fit in sorted(fits, key=lambda fit: fit.error)[:_TRIED]):
                return True
        return False

    def _around(self, key: Key, numbers: Iterable[int], aside: int) -> int:
        """How many px round an object's middle others may take there."""
        return max(self._all[k].reach for k in (key[0], *numbers)) + aside * STEP + RING + 2

    def _window(self, key: Key, around: int, beside: bool = False) -> Window:
        """So many px round an object's middle."""
        top, left, side = key[1] - around, key[2] - around, 2 * around + 1
        if any(self._meets(patch, top, left, side) for patch in self._laid):
            self._cut()
            self._paint()
        elif any(self._meets(patch, top, left, side) for patch in self._asked):
            self._paint()
        known = self._canvas.read(top, left, side, side)
        inside = known >= 0
        marks = self._objects.marks.ravel()[np.maximum(known, 0)] * inside
        shown = marks > 0
        goes = self._seen(key, known, top, left)
        gone = {key: int(np.count_nonzero(goes & shown))}
        if beside:
            y, x = np.nonzero(diamond_dilation(goes, 3) & shown & ~goes)
            for other in self._objects.at(y + top, x + left, known[y, x]):
                if self._share(other) < _WHOLE:
                    seen = self._seen(other, known, top, left)
                    gone[other] = int(np.count_nonzero(seen & shown))
                    goes |= seen
        return Window(top, left, known, inside, goes, gone, shown & ~goes)

    def _meets(self, patch: Patch, top: int, left: int, side: int) -> bool:
        """Whether a patch touches a window."""
        for start, first, length, limit, wraps in zip(
            (top, left), patch.at, patch.source.shape, self._canvas.shape, self._canvas.wrap, strict=True
        ):
            ahead, back = first - start, start - first
            if wraps:
                ahead, back = ahead % limit, back % limit
            if not (0 <= ahead <= side or 0 <= back <= length):
                return False
        return True

    def _seen(self, key: Key, known: Ints32, top: int, left: int) -> Mask:
        """Where a window shows an object and its fringe."""
        y, x = np.arange(known.shape[0])[:, np.newaxis], np.arange(known.shape[1])[np.newaxis]
        lines = []
        for line, first, at, middle, limit, wraps in zip(
            (y, x),
            (top, left),
            key[1:],
            self._all[key[0]].middle,
            self._canvas.shape,
            self._canvas.wrap,
            strict=True,
        ):
            away = (first - at + limit // 2) % limit - limit // 2 if wraps else first - at
            lines.append(middle + away + line)
        seen: Mask = known == lines[0] * self._atlas.width + lines[1]
        seen &= self._objects.fringed.ravel()[np.maximum(known, 0)] == key[0] + 1
        return seen

    def _lay(self, window: Window, fit: Fit) -> bool:
        """Lay what fits, if there is room for it and its copy does not grow too large."""
        placer, atlas, canvas, (_, number, place) = self._placer, self._atlas, self._canvas, fit
        must = window.goes.copy()
        if number >= 0:
            one = self._all[number]
            y, x = (one.pixels + one.middle - place).T
            must[y, x] = window.inside[y, x]
        rows, columns = (start + np.arange(length) for start, length in zip(place, must.shape, strict=True))
        height, width = atlas.usable.shape
        on = ((rows >= 0) & (rows < height))[:, np.newaxis] & (columns >= 0) & (columns < width)
        at = np.clip(rows, 0, height - 1)[:, np.newaxis], np.clip(columns, 0, width - 1)
        on &= atlas.copied[at]
        marks = self._objects.marks[at]
        other = (marks > 0) & (marks != number + 1)
        if (must & (other | window.busy | ~on)).any():
            return False
        may = diamond_dilation(must, RING) & window.inside & on
        may = (may & ~diamond_dilation(other | window.busy)) | must
        patch = self._patch(window, place, must, may)
        if patch.joined and not self._fits_a_copy(patch):
            self._cut()
            self._paint()
            (shows,) = closed_cuts(placer, [patch])
            changes = np.count_nonzero(shows & (patch.before[1:-1, 1:-1] != patch.source))
            if sum(map(canvas.area_of, set(map(canvas.copy_of, patch.joined)))) + changes > self._largest:
                return False
        # Objects do not lie in the ring that the seam runs through.
        self._shown.subtract(window.gone)
        changed = set(window.gone)
        if number >= 0:
            middle = zip(self._all[number].middle, place, (window.top, window.left), strict=True)
            come = self._objects.key(number, *(own - first + start for own, first, start in middle))
            self._shown[come] += int(np.count_nonzero(must & (marks > 0)))
            changed.add(come)
        self._note(changed)
        self._laid.append(patch)
        row, column, _ = canvas.window(*patch.at, *patch.may.shape)
        canvas.waiting[row, column] = patch.may.view(np.uint8) + patch.must
        if len(self._laid) >= self._at_once:
            self._cut()
        return True

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

    def _fits_a_copy(self, patch: Patch) -> bool:
        """Whether the copy that a patch continues cannot grow too large, wherever it and others that are not
        painted yet show.
        """
        most, copies = patch.most(), patch.joined
        others = [one for one in (*self._asked, *self._laid) if one.joined]
        while meeting := [one for one in others if one.joined & copies]:
            others = [one for one in others if not one.joined & copies]
            copies = copies.union(*(one.joined for one in meeting))
            most += sum(one.most() for one in meeting)
        return sum(map(self._canvas.area_of, copies)) + most <= self._largest

    def _cut(self) -> None:
        """Have cut what has been laid, by whoever is free, while others are looked for."""
        self._paint()
        if self._laid:
            corners = [divmod(int(patch.source[0, 0]), self._atlas.width) for patch in self._laid]
            places = [
                (*patch.at, *corner, *patch.source.shape)
                for patch, corner in zip(self._laid, corners, strict=True)
            ]
            self._crew.ask("shows", np.array(places, np.int32).tobytes())
            self._crew.pass_on()
            self._asked, self._laid = self._laid, []

    def _paint(self) -> None:
        """Paint what is being cut."""
        if self._asked:
            for _, cuts in self._crew.answers():
                for patch, shows in zip(self._asked, cuts, strict=True):
                    self._canvas.paint(*patch.at, patch.source, shows)
            self._asked = []

    def _note(self, keys: Iterable[Key]) -> None:
        """Keep in mind whether these objects are there."""
        for key in keys:
            self._there.put(key, self._shown[key] > _THERE * len(self._all[key[0]].pixels))

    def _chosen(self, aside: int) -> dict[Key, int]:
        """What objects should become so that none comes twice near by: again and again, one that does becomes
        what is near it least often.
        """
        slots, rng = self._there.all(), self._placer.rng
        number_of = {key: slot for slot, key in enumerate(slots)}
        numbers = [key[0] for key in slots]
        beside = [[number_of[near] for near in self._there.near(key[1:]) if near != key] for key in slots]
        # How many near each are the same.
        twice = [
            sum(numbers[one] == number for one in near) for near, number in zip(beside, numbers, strict=True)
        ]
        bad = [slot for slot, count in enumerate(twice) if count]  # in order
        best, fewest = numbers.copy(), len(bad)
        fitting: dict[int, Ints] = {}
        for _ in range(_THOUGHT * len(bad)):
            if not bad:
                break
            slot = bad[int(rng.integers(len(bad)))]
            if slot not in fitting:
                fitting[slot] = self._fitting(slots[slot], aside)
            near = [numbers[one] for one in beside[slot]]
            count = np.bincount(np.array(near, np.intp), minlength=len(self._all))[fitting[slot]]
            least = fitting[slot][count == count.min()]
            before, numbers[slot] = numbers[slot], int(least[int(rng.integers(len(least)))])
            for one in beside[slot]:
                change = (numbers[one] == numbers[slot]) - (numbers[one] == before)
                if change:
                    twice[one] += change
                    twice[slot] += change
                    _keep(bad, one, twice[one] > 0)
            _keep(bad, slot, twice[slot] > 0)
            if len(bad) < fewest:
                best, fewest = numbers.copy(), len(bad)
        return {key: number for key, number in zip(slots, best, strict=True) if number != key[0]}

    def _fitting(self, key: Key, aside: int) -> Ints:
        """The objects that have room in the place of one, itself too."""
        others = self._like(key[0])
        around = self._around(key, others, aside)
        found = (
            self._candidates.rooms(self._window(key, around), others, aside) if around <= self._room else ()
        )
        return np.array([key[0], *sorted(number for number, _ in found)], np.intp)


def _keep(slots: list[int], slot: int, there: bool) -> None:
    """Have a number in a list in order, or not."""
    at = bisect_left(slots, slot)
    if there != (at < len(slots) and slots[at] == slot):
        if there:
            slots.insert(at, slot)
        else:
            del slots[at]
