"""Objects of a finished texture made whole, and exchanged where one comes twice near by.

On a ground with objects, patches leave some objects cut where two of them met, and bring others a second time
within sight, as what lies between them goes with them. When all is laid, each such object is replaced by
itself: by another one with the ground round it (:mod:`toposeam.texture.repair.object_replacement`), those
that do not touch at the same time. Which one becomes which is found by the rule of fewest conflicts (Minton
et al. 1992, doi:10.1016/0004-3702(92)90007-K).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from toposeam.arrays import Indices
from toposeam.texture.placement.near_copies import NEAR
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.repair.object_index import Positions
from toposeam.texture.repair.object_replacement import (
    FORBIDDEN,
    GROUND,
    MENDED,
    WHOLE,
    Replaced,
    Replacing,
    ToReplace,
)
from toposeam.texture.repair.objects import Key
from toposeam.texture.scheduling.process_pool import Crew

#: An object of which more than this share shows counts as there.
_THERE = 0.4
#: px by which the middle of a cut object may be off: added to the distance within which two are near.
_SLACK = 4
#: Min-conflicts iterations for every object that repeats near by; rounds, by how many steps aside what could
#: not be laid is tried again.
_THOUGHT, _ROUNDS = 40, (0, 1, 2)
#: Objects that do not touch and are replaced at the same time, and about how many of them in one call: most
#: of the time of a small seam goes into calls.
_AT_ONCE, _IN_ONE = 16, 4
#: Number of waiting objects from which these are taken.
_LOOKED_AT = 128
#: Replacements per patch of a texture, at most: shared memory has room for no more.
MOST = 64


class Exchange:
    """Exchanges objects on a placer's canvas, which is full.

    Parameters
    ----------
    placer : PatchPlacer
        It has a guard.
    shape : (int, int)
        Height and width of its patches.
    crew : Crew
        Who looks for what fits, and cuts; its tool is the placer.
    most : int
        How many patches the canvas may have in the end.
    """

    def __init__(self, placer: PatchPlacer, shape: tuple[int, int], crew: Crew, most: int) -> None:
        self._placer, self._canvas, self._crew, self._most = placer, placer.canvas, crew, most
        crew.begin(Replacing, shape, _AT_ONCE)
        crew.ask("replaced", b"")  # so that others prepare themselves while this process does
        crew.pass_on()
        self._own: Replacing = crew.own()
        self._objects = self._own.objects
        self._all, self._shown = self._objects.all, self._objects.shown()
        #: How many pixels of objects the canvas shows, and should for their share of the exemplars.
        self._now, self._due = self._shown.total(), self._objects.density() * placer.canvas.index.size
        near = NEAR * int(placer.atlas.shapes.min(axis=1).max()) + _SLACK
        self._there = Positions(placer.canvas.shape, placer.canvas.wrap, near)
        self._note(self._shown)

    def run(self) -> int:
        """Make objects whole and exchange those that repeat near by; return how many were replaced."""
        shares = {key: self._share(key) for key in self._shown}
        done = self._replace(sorted(shares, key=lambda one: (-shares[one], one)), self._mending)
        for aside in _ROUNDS:
            chosen = self._chosen(aside)
            tasks = {key: ToReplace(key, number, aside) for key, number in chosen.items()}
            done += self._replace(list(tasks), tasks.get)
        return done + sum(map(self._part, self._twice()))

    def _share(self, key: Key) -> float:
        """Compute what share of an object shows, of what could."""
        return float(self._shown[key] / max(self._objects.room(key), 1))

    def _mending(self, key: Key) -> ToReplace | None:
        """Decide whether a cut object is made whole, or becomes ground, so that objects cover their share of
        the canvas. All that are replaced at the same time see the same coverage.
        """
        share, room = self._share(key), self._objects.room(key)
        if share <= 0 or (share >= WHOLE and self._all[key[0]].whole):
            return None
        return ToReplace(key, MENDED if self._now + (0.5 - share) * room < self._due else GROUND)

    def _replace(self, keys: Sequence[Key], task_of: Callable[[Key], ToReplace | None]) -> int:
        """Replace objects, of those that touch the first ones first; return how many could be."""
        done, left = 0, [key for key in keys if task_of(key) is not None]
        #: What an object did not become, as that came near by meanwhile.
        refused: defaultdict[Key, set[int]] = defaultdict(set)
        while left and self._canvas.patches + _AT_ONCE <= self._most:
            tasks = [task for task in map(task_of, left[:_LOOKED_AT]) if task is not None]
            now = [self._without(task, refused[task.key]) for task in self._apart(tasks)]
            again, started = [], {task.key for task in now}
            for task, found in zip(now, self._found(now), strict=True):
                if found is not None:
                    twice = self._near(task) & {key[0] for key in found.come}
                    refused[task.key] |= twice
                    painted = not twice and self._paint(found)
                    done += painted
                    again += [] if painted else [task.key]
            left[:_LOOKED_AT] = again + [task.key for task in tasks if task.key not in started]
        return done

    def _without(self, task: ToReplace, refused: set[int]) -> ToReplace:
        """Forbid a task to bring what shows near by; replace by ground where that has been tried
        too often.
        """
        if len(refused) >= FORBIDDEN:
            return ToReplace(task.key, GROUND)
        without = [*sorted(refused), *sorted(self._near(task) - refused)]
        return task._replace(without=tuple(without[:FORBIDDEN]))

    def _near(self, task: ToReplace) -> set[int]:
        """Find what a cut object should not become, as it shows near by already."""
        if task.becomes != MENDED:
            return set()
        alike = self._own.like(task.key[0])
        return {key[0] for key in self._there.near(task.key[1:])}.intersection(alike)

    def _apart(self, tasks: Sequence[ToReplace]) -> list[ToReplace]:
        """Select some of the first tasks, which do not touch."""
        around = np.array([self._own.around(task) for task in tasks], np.intp)
        middles = np.array([task.key[1:] for task in tasks], np.intp).reshape(-1, 2)
        found: list[ToReplace] = []
        free = np.ones(len(tasks), bool)
        while len(found) < _AT_ONCE and free.any():
            first = int(free.argmax())
            found.append(tasks[first])
            touch = np.ones(len(tasks), bool)
            for axis, line in enumerate(middles.T):
                touch &= self._canvas.distance(axis, line - line[first]) <= around + around[first] + 2
            touch[first] = True
            free &= ~touch
        return found

    def _found(self, tasks: Sequence[ToReplace]) -> list[Replaced | None]:
        """Run tasks that do not touch, in any of the processes."""
        parts = max(-(-len(tasks) // _IN_ONE), min(len(tasks), 2))
        groups = []
        for part in np.array_split([task.numbers() for task in tasks], parts) if parts else ():
            groups.append(part.astype(np.int32).tobytes())
            self._crew.ask("replaced", groups[-1])
        found = {given: done for (_, (given,)), done in self._crew.answers()}
        return [one for group in groups for one in found[group]]

    def _paint(self, found: Replaced) -> bool:
        """Paint what was found, unless a copy that others have continued meanwhile would grow too large."""
        canvas, copies = self._canvas, {self._canvas.copy_of(first) for first in found.joined}
        if copies and sum(map(canvas.area_of, copies)) + found.grown > self._own.largest:
            return False
        canvas.paint(*found.at, self._placer.patch(found.place, found.shows.shape), found.shows)
        self._shown.subtract(found.gone)
        self._shown.update(found.come)
        self._now += sum(found.come.values()) - sum(found.gone.values())
        self._note({*found.gone, *found.come})
        return True

    def _twice(self) -> list[Key]:
        """Find the objects that repeat near by."""
        return sorted(
            key
            for key, near in self._there.neighbours().items()
            if any(one[0] == key[0] for one in near if one != key)
        )

    def _is_twice(self, key: Key) -> bool:
        """Test whether an object shows, and once more near by."""
        near = set(self._there.near(key[1:]))
        return key in near and any(one[0] == key[0] for one in near - {key})

    def _part(self, key: Key) -> bool:
        """Replace an object that still repeats near by, as its first choice had no room, by any other that
        does not.
        """
        if not self._is_twice(key) or self._canvas.patches == self._most:  # the other one may have gone
            return False
        near = {one[0] for one in self._there.near(key[1:])}
        others = [number for number in self._own.like(key[0]) if number not in near]
        found = self._own.replace(key, [(others, aside) for aside in _ROUNDS]) if others else None
        return found is not None and self._paint(*self._own.cut([found]))

    def _note(self, keys: Iterable[Key]) -> None:
        """Record whether these objects show."""
        for key in keys:
            self._there.put(key, self._shown[key] > _THERE * len(self._all[key[0]].pixels))

    def _chosen(self, aside: int) -> dict[Key, int]:
        """Choose what objects should become so that none repeats near by (min-conflicts): again and again,
        one that does becomes what is near it least often.
        """
        slots, rng = self._there.all(), self._placer.rng
        slot_of = {key: slot for slot, key in enumerate(slots)}
        near_to = self._there.neighbours()
        beside = [np.array([slot_of[near] for near in near_to[key] if near != key], np.intp) for key in slots]
        numbers = np.array([key[0] for key in slots], np.intp)
        # How many near each are the same.
        same = [np.count_nonzero(numbers[near] == own) for near, own in zip(beside, numbers, strict=True)]
        twice = np.array(same, np.intp)
        best, fewest = numbers.copy(), np.count_nonzero(twice)
        fitting: dict[int, Indices] = {}
        for _ in range(_THOUGHT * fewest):
            bad = np.flatnonzero(twice)
            if not len(bad):
                break
            slot = int(bad[rng.integers(len(bad))])
            if slot not in fitting:
                fitting[slot] = self._own.fitting(slots[slot], aside)
            near, before = beside[slot], numbers[slot]
            count = np.bincount(numbers[near], minlength=len(self._all))[fitting[slot]]
            least = fitting[slot][count == count.min()]
            numbers[slot] = least[rng.integers(len(least))]
            change = (numbers[near] == numbers[slot]).astype(np.intp) - (numbers[near] == before)
            twice[near] += change
            twice[slot] += change.sum()
            if (left := np.count_nonzero(twice)) < fewest:
                best, fewest = numbers.copy(), left
        return {key: number for key, number in zip(slots, best.tolist(), strict=True) if number != key[0]}
