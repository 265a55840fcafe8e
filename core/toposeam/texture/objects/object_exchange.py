"""Make the objects of a finished texture whole, and exchange those that repeat near by.

On a ground with objects, patches cut some objects where two patches meet, and show others twice near by, as a
patch brings all that lies on it. When all patches are laid, each such object is replaced singly, by itself or
by another one with the ground round it (:mod:`toposeam.texture.objects.object_replacement`). Objects that do
not touch are replaced at the same time. Which object becomes which is found by the rule of fewest conflicts
(Minton et al. 1992, doi:10.1016/0004-3702(92)90007-K).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from toposeam.arrays import Indices
from toposeam.texture.objects.object_catalog import WHOLE_SHARE, Key
from toposeam.texture.objects.object_positions import ObjectPositions
from toposeam.texture.objects.object_replacement import (
    GROUND,
    MAX_FORBIDDEN,
    MENDED,
    ObjectReplacer,
    Replacement,
    ReplacementTask,
)
from toposeam.texture.placement.near_copies import NEAR
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.scheduling.process_pool import Crew

#: An object counts as present if more than this share of its pixels shows.
_PRESENT_SHARE = 0.4
#: Error, px, of the middle of a cut object, added to the distance within which two objects are near.
_MIDDLE_ERROR = 4
#: Largest number of min-conflicts iterations for every object that repeats near by: it bounds the time where
#: not all can be kept apart.
_ITERATIONS_PER_REPEAT = 40
#: Steps aside in each round; what could not be laid is tried again in the next one.
_STEPS_ASIDE = (0, 1, 2)
#: Number of objects that are replaced at the same time, and how many of them in one call, about: most of the
#: time of a small seam goes into calls.
_TASKS_AT_ONCE, _TASKS_PER_CALL = 16, 4
#: Number of waiting objects from which those are chosen: the choice compares all pairs.
_TASKS_COMPARED = 128


def make_objects_whole(placer: PatchPlacer, shape: tuple[int, int], crew: Crew, most: int) -> int:
    """Make cut objects whole, and exchange objects that repeat near by.

    Parameters
    ----------
    placer : PatchPlacer
        Its canvas is full, and it has a guard.
    shape : (int, int)
        Height and width of its patches, px.
    crew : Crew
        The processes that do it; its tool is the placer.
    most : int
        Largest number of patches on the canvas in the end.

    Returns
    -------
    int
        Number of objects that were replaced, each by one patch.
    """
    return ObjectExchange(placer, shape, crew, most).run()


class ObjectExchange:
    """The objects of a full canvas while they are replaced; parameters as of :func:`make_objects_whole`."""

    def __init__(self, placer: PatchPlacer, shape: tuple[int, int], crew: Crew, most: int) -> None:
        self._placer, self._canvas, self._crew, self._most = placer, placer.canvas, crew, most
        crew.begin(ObjectReplacer, shape, _TASKS_AT_ONCE)
        crew.ask("replace_all", b"")  # so that others prepare themselves while this process does
        crew.pass_on()
        self._replacer: ObjectReplacer = crew.own()
        self._catalog = self._replacer.catalog
        self._all, self._shown = self._catalog.all, self._catalog.shown()
        #: Number of pixels of objects that the canvas shows, and that it would at the exemplars' coverage.
        self._covered = self._shown.total()
        self._wanted = self._catalog.density() * placer.canvas.index.size
        near = NEAR * int(placer.atlas.shapes.min(axis=1).max()) + _MIDDLE_ERROR
        self._positions = ObjectPositions(placer.canvas.shape, placer.canvas.wrap, near)
        self._update_positions(self._shown)

    def run(self) -> int:
        """Make objects whole and exchange those that repeat near by; return how many were replaced."""
        shares = {key: self._share(key) for key in self._shown}
        done = self._replace(sorted(shares, key=lambda one: (-shares[one], one)), self._mend_task)
        for aside in _STEPS_ASIDE:
            chosen = self._choose(aside)
            tasks = {key: ReplacementTask(key, number, aside) for key, number in chosen.items()}
            done += self._replace(list(tasks), tasks.get)
        return done + sum(map(self._separate, self._repeated()))

    def _share(self, key: Key) -> float:
        """Compute the share of an object's pixels on the canvas that shows."""
        return float(self._shown[key] / max(self._catalog.room(key), 1))

    def _mend_task(self, key: Key) -> ReplacementTask | None:
        """Decide whether a cut object becomes a whole one or ground, so that objects cover the same share of
        the canvas as of the exemplars; None for whole objects. All that are replaced at the same time see the
        same coverage.
        """
        share, room = self._share(key), self._catalog.room(key)
        if share <= 0 or (share >= WHOLE_SHARE and self._all[key[0]].whole):
            return None
        return ReplacementTask(key, MENDED if self._covered + (0.5 - share) * room < self._wanted else GROUND)

    def _replace(self, keys: Sequence[Key], task_of: Callable[[Key], ReplacementTask | None]) -> int:
        """Replace objects; of those that touch, the first one first. Return how many could be replaced."""
        done, left = 0, [key for key in keys if task_of(key) is not None]
        #: Numbers that an object did not become, as they came near by in the meantime.
        refused: defaultdict[Key, set[int]] = defaultdict(set)
        while left and self._canvas.patches + _TASKS_AT_ONCE <= self._most:
            tasks = [task for task in map(task_of, left[:_TASKS_COMPARED]) if task is not None]
            now = [self._forbidding(task, refused[task.key]) for task in self._apart(tasks)]
            again, started = [], {task.key for task in now}
            for task, found in zip(now, self._answers_to(now), strict=True):
                if found is not None:
                    repeated = self._shown_near(task) & {key[0] for key in found.come}
                    refused[task.key] |= repeated
                    painted = not repeated and self._paint(found)
                    done += painted
                    again += [] if painted else [task.key]
            left[:_TASKS_COMPARED] = again + [task.key for task in tasks if task.key not in started]
        return done

    def _forbidding(self, task: ReplacementTask, refused: set[int]) -> ReplacementTask:
        """Forbid a task to bring objects that show near by; choose ground if too many have been refused."""
        if len(refused) >= MAX_FORBIDDEN:
            return ReplacementTask(task.key, GROUND)
        forbidden = [*sorted(refused), *sorted(self._shown_near(task) - refused)]
        return task._replace(forbidden=tuple(forbidden[:MAX_FORBIDDEN]))

    def _shown_near(self, task: ReplacementTask) -> set[int]:
        """Find the objects that a cut one should not become, as they show near by already."""
        if task.becomes != MENDED:
            return set()
        alike = self._replacer.similar(task.key[0])
        return {key[0] for key in self._positions.near(task.key[1:])}.intersection(alike)

    def _apart(self, tasks: Sequence[ReplacementTask]) -> list[ReplacementTask]:
        """Select tasks whose windows do not touch, the first ones first."""
        reach = np.array([self._replacer.reach_of(task) for task in tasks], np.intp)
        middles = np.array([task.key[1:] for task in tasks], np.intp).reshape(-1, 2)
        found: list[ReplacementTask] = []
        free = np.ones(len(tasks), bool)
        while len(found) < _TASKS_AT_ONCE and free.any():
            first = int(free.argmax())
            found.append(tasks[first])
            touch = np.ones(len(tasks), bool)
            for axis, line in enumerate(middles.T):
                touch &= self._canvas.distance(axis, line - line[first]) <= reach + reach[first] + 2
            touch[first] = True
            free &= ~touch
        return found

    def _answers_to(self, tasks: Sequence[ReplacementTask]) -> list[Replacement | None]:
        """Have tasks that do not touch carried out by any of the processes."""
        parts = max(-(-len(tasks) // _TASKS_PER_CALL), min(len(tasks), 2))
        groups = []
        for part in np.array_split([task.numbers() for task in tasks], parts) if parts else ():
            groups.append(part.astype(np.int32).tobytes())
            self._crew.ask("replace_all", groups[-1])
        found = {given: done for (_, (given,)), done in self._crew.answers()}
        return [one for group in groups for one in found[group]]

    def _paint(self, found: Replacement) -> bool:
        """Paint a replacement, unless it would make a copy too large that others have continued in the
        meantime.
        """
        canvas, copies = self._canvas, {self._canvas.copy_of(first) for first in found.joined}
        if copies and sum(map(canvas.area_of, copies)) + found.grown > self._replacer.largest:
            return False
        canvas.paint(*found.at, self._placer.patch(found.place, found.shows.shape), found.shows)
        self._shown.subtract(found.gone)
        self._shown.update(found.come)
        self._covered += sum(found.come.values()) - sum(found.gone.values())
        self._update_positions({*found.gone, *found.come})
        return True

    def _repeated(self) -> list[Key]:
        """List the objects that repeat near by."""
        return sorted(
            key
            for key, near in self._positions.neighbours().items()
            if any(one[0] == key[0] for one in near if one != key)
        )

    def _repeats(self, key: Key) -> bool:
        """Test whether an object is present, and once more near by."""
        near = set(self._positions.near(key[1:]))
        return key in near and any(one[0] == key[0] for one in near - {key})

    def _separate(self, key: Key) -> bool:
        """Replace an object that still repeats near by, as its first choice had no room, by any other one
        that will not repeat.
        """
        if not self._repeats(key) or self._canvas.patches == self._most:  # the other one may have gone
            return False
        near = {one[0] for one in self._positions.near(key[1:])}
        others = [number for number in self._replacer.similar(key[0]) if number not in near]
        found = self._replacer.replace(key, [(others, aside) for aside in _STEPS_ASIDE]) if others else None
        return found is not None and self._paint(*self._replacer.cut([found]))

    def _update_positions(self, keys: Iterable[Key]) -> None:
        """Record which of some objects are present."""
        for key in keys:
            self._positions.put(key, self._shown[key] > _PRESENT_SHARE * len(self._all[key[0]].pixels))

    def _choose(self, aside: int) -> dict[Key, int]:
        """Choose what objects become so that none repeats near by, by min-conflicts: one that repeats, drawn
        at random, becomes the object that is near it least often, until none repeats.
        """
        slots, rng = self._positions.all(), self._placer.rng
        slot_of = {key: slot for slot, key in enumerate(slots)}
        near_to = self._positions.neighbours()
        beside = [np.array([slot_of[near] for near in near_to[key] if near != key], np.intp) for key in slots]
        numbers = np.array([key[0] for key in slots], np.intp)
        # Number of objects near each that are the same one.
        same = [np.count_nonzero(numbers[near] == own) for near, own in zip(beside, numbers, strict=True)]
        twice = np.array(same, np.intp)
        best, fewest = numbers.copy(), np.count_nonzero(twice)
        fitting: dict[int, Indices] = {}
        for _ in range(_ITERATIONS_PER_REPEAT * fewest):
            bad = np.flatnonzero(twice)
            if not len(bad):
                break
            slot = int(bad[rng.integers(len(bad))])
            if slot not in fitting:
                fitting[slot] = self._replacer.fitting(slots[slot], aside)
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
