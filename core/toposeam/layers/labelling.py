"""Which layer shows at every pixel: what is allowed, and what it costs where two layers adjoin.

A *labelling* gives each covered pixel of the canvas to one layer that may show there. It costs Σ M_ij(p, q) over neighbouring pixels p and
q that show different layers i and j, M_ij being the match cost of these two (:mod:`toposeam.seam.match_cost`). For two layers that is the
seam problem; the rules of :mod:`toposeam.seam.overlap` are carried over to many:

- A layer does not show at its own end, where it has pixels but not the neighbour that another layer has, unless all layers there end.
- A connected piece of a layer that has no pixel to itself keeps its *core*, the pixels at least ``core`` times as deep as its deepest.
  Where the cores of two layers meet, the later one has it.
- Where only one of p and q is covered by both layers, its values count twice; where neither is, nothing is known and M_ij is 0.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.errors import OptionError
from toposeam.images import Mask, as_float, widen
from toposeam.layers.layer import Box, Canvas, Layer, cut
from toposeam.layers.painting import Owner
from toposeam.seam.find import forbid
from toposeam.seam.match_cost import Floats32, MatchCost, match_cost
from toposeam.seam.overlap import FREE, NONE, A, B, Overlap, neighbours
from toposeam.seam.problem import SeamProblem

_NEIGHBOURS: Any = (np.s_[:, :-1], np.s_[:-1]), (np.s_[:, 1:], np.s_[1:])  # each pixel's right and lower one

#: Least cost of an interface in an expansion, so that no pixel is without connection.
_LEAST_LINK = 1e-6

#: Two layers by their numbers, the lower one first.
Pair = tuple[int, int]


@dataclass(frozen=True, slots=True, eq=False)
class PairCost:
    """The match cost of two layers wherever both have pixels, and which of them may show there."""

    box: Box
    side: npt.NDArray[np.uint8]
    shared: Mask
    right: Floats32
    down: Floats32
    forbidden: float

    def on(self, box: Box) -> tuple[Floats32, Floats32]:
        """The costs in another box, 0 where they are not known."""
        top, left, bottom, right = self.box
        right_box, down_box = Box(box.top, box.left, box.bottom, box.right - 1), Box(box.top, box.left, box.bottom - 1, box.right)
        return cut(self.right, Box(top, left, bottom, right - 1), right_box), cut(self.down, Box(top, left, bottom - 1, right), down_box)


class Labelling:
    """The labelling problem of placed layers.

    Parameters
    ----------
    layers : sequence of Layer
    canvas : Canvas
    covered : sequence of (h, w) bool arrays
        Per layer, on its place, where it has pixels it may show (:func:`exclusive_covers`).
    core : float
        As for :func:`toposeam.find_seam`.
    match : MatchCost
    weight, avoid : (H, W) array, optional
        As for :func:`toposeam.find_seam`, on the canvas.

    Attributes
    ----------
    places : list of Box
    allowed : list of (h, w) bool arrays
        Per layer, on its place, where it is one of those to be chosen from.
    """

    def __init__(
        self, layers: Sequence[Layer], canvas: Canvas, covered: Sequence[Mask], core: float, match: MatchCost,
        weight: npt.NDArray[Any] | None = None, avoid: Mask | None = None,
    ) -> None:  # fmt: skip
        self.layers, self.canvas, self.covered = layers, canvas, covered
        self.match, self.weight, self.avoid = match, weight, avoid
        self.places = [canvas.place(layer) for layer in layers]
        self.allowed = self._away_from_ends()
        self._keep_cores(core)
        self._costs: dict[Pair, PairCost | None] = {}

    def _away_from_ends(self) -> list[Mask]:
        ground = np.zeros(self.canvas.shape, bool)
        for place, covered in zip(self.places, self.covered, strict=True):
            ground[place.slices] |= covered
        inner, somewhere = [], np.zeros(self.canvas.shape, bool)
        for place, covered in zip(self.places, self.covered, strict=True):
            around = place.grown(1)
            ended = neighbours(cut(ground, self.canvas.box, around) & ~cut(covered, place, around))[1:-1, 1:-1]
            inner.append(covered & ~ended)
            somewhere[place.slices] |= inner[-1]
        return [np.where(somewhere[self.places[i].slices], inner[i], self.covered[i]) for i in range(len(self.places))]

    def _keep_cores(self, core: float) -> None:
        depth = np.zeros(self.canvas.shape, np.uint16)
        for place, covered in zip(self.places, self.covered, strict=True):
            depth[place.slices] += covered
        claimed = np.zeros(self.canvas.shape, bool)
        for index in reversed(range(len(self.layers))):
            place, covered = self.places[index], self.covered[index]
            piece, count = ndimage.label(covered)
            alone = np.bincount(piece[depth[place.slices] == 1], minlength=count + 1) > 0
            alone[0] = True
            if alone.all():
                continue
            deep = ndimage.distance_transform_edt(np.pad(covered, 1))[1:-1, 1:-1]
            deepest = ndimage.maximum(deep, piece, np.arange(count + 1))
            middle = ~alone[piece] & (deep >= np.maximum(core * deepest[piece], 2.0)) & ~claimed[place.slices] & self.allowed[index]
            claimed[place.slices] |= middle
            self._give(index, middle)

    def _give(self, index: int, pixels: Mask) -> None:
        """Allow no layer but one at some pixels of its place."""
        place = self.places[index]
        for other, (there, allowed) in enumerate(zip(self.places, self.allowed, strict=True)):
            if other != index and all(place.shared(there).shape):
                allowed &= ~cut(pixels, place, there)

    def divide(self, pair: Pair, labels: Mask) -> None:
        """Forbid each of two layers what a given seam leaves to the other; `labels` on the canvas, True for the second layer."""
        first, second = pair
        for index, other, shows in ((first, second, ~labels), (second, first, labels)):
            place, there = self.places[index], self.places[other]
            taken = cut(shows, self.canvas.box, place) & cut(self.allowed[other], there, place) & self.allowed[index]
            self.allowed[other] &= ~cut(taken, place, there)

    def legal(self, owner: Owner) -> None:
        """Give pixels of a layer that may not show there to the first one that may, in place."""
        wrong = np.zeros(owner.shape, bool)
        for index, (place, allowed) in enumerate(zip(self.places, self.allowed, strict=True)):
            wrong[place.slices] |= (owner[place.slices] == index) & ~allowed
        for index, (place, allowed) in enumerate(zip(self.places, self.allowed, strict=True)):
            now = wrong[place.slices] & allowed
            owner[place.slices][now] = index
            wrong[place.slices][now] = False

    def on_top(self) -> Owner:
        """The labelling in which each pixel shows the last layer that may show there."""
        owner: Owner = np.full(self.canvas.shape, -1, np.int16)
        for index, (place, allowed) in enumerate(zip(self.places, self.allowed, strict=True)):
            owner[place.slices][allowed] = index
        return owner

    def cost(self, pair: Pair) -> PairCost | None:
        """The match cost of two layers, None where they share no pixel."""
        if pair not in self._costs:
            self._costs[pair] = self._match(*pair)
        return self._costs[pair]

    def box(self, pair: Pair) -> Box:
        """What the places of two layers have in common, and one pixel around."""
        return self.places[pair[0]].shared(self.places[pair[1]]).grown(1)

    def _match(self, first: int, second: int) -> PairCost | None:
        if not all(self.places[first].shared(self.places[second]).shape):
            return None
        box = self.box((first, second))
        on_a, on_b = (cut(self.covered[index], self.places[index], box) for index in (first, second))
        shared = on_a & on_b
        if not shared.any():
            return None
        may_a, may_b = (cut(self.allowed[index], self.places[index], box) for index in (first, second))
        side = np.full(box.shape, NONE, np.uint8)
        side[may_a], side[may_b] = A, B
        side[may_a & may_b] = FREE
        overlap = Overlap(side, shared, (box.top, box.left), self.canvas.shape)
        a, b = widen(self._colours(first, box, on_a), self._colours(second, box, on_b))
        weight = None if self.weight is None else overlap.window(self.weight).astype(np.float32)
        right, down = match_cost(a, b, overlap, on_a, on_b, self.match, weight)
        forbidden = float("inf") if self.avoid is None else forbid(right, down, overlap.window(self.avoid))
        return PairCost(box, side, shared, right, down, forbidden)

    def _colours(self, index: int, box: Box, present: Mask) -> Floats32:
        image = cut(self.layers[index].image, self.places[index], box)
        image[~present] = 0
        return as_float(image, self.layers[index].name)

    def problem(self, owner: Owner, pair: Pair, settle: bool = False) -> SeamProblem | None:
        """The region that two layers hold between them as a seam problem; None where they share no pixel.

        Parameters
        ----------
        owner : (H, W) int16 array
        pair : (int, int)
        settle : bool
            Decide what is free but not tied to both sides, where no seam can be.
        """
        cost = self.cost(pair)
        if cost is None:
            return None
        shows = cut(owner, self.canvas.box, cost.box, fill=-1)
        first, second = shows == pair[0], shows == pair[1]
        inside = first | second
        side = np.full(cost.box.shape, NONE, np.uint8)
        side[first], side[second] = A, B
        free = inside & (cost.side == FREE)
        side[free] = FREE
        right = np.where(inside[:, 1:] & inside[:, :-1], cost.right, np.float32(0))
        down = np.where(inside[1:] & inside[:-1], cost.down, np.float32(0))
        beside = [self._beside(index, pair, shows, free, cost.box) for index in pair]
        overlap = Overlap(side, cost.shared & inside, (cost.box.top, cost.box.left), self.canvas.shape)
        problem = SeamProblem(overlap, right, down, cost.forbidden, showing_a=beside[0], showing_b=beside[1])
        return _settled(problem, second) if settle else problem

    def _beside(self, index: int, pair: Pair, shows: Owner, free: Mask, box: Box) -> Floats32:
        """(h, w) cost of showing one layer of a pair at its free pixels, beside those that other layers hold."""
        total = np.zeros(box.shape, np.float32)
        for other in np.unique(shows).tolist():
            cost = self.cost((min(index, other), max(index, other))) if other >= 0 and other not in pair else None
            if cost is None:
                continue
            held = shows == other
            for values, s, t in zip(cost.on(box), *_NEIGHBOURS, strict=True):
                total[s] += np.where(free[s] & held[t], values, np.float32(0))
                total[t] += np.where(free[t] & held[s], values, np.float32(0))
        return total

    def expansion(self, owner: Owner, index: int) -> tuple[SeamProblem, Box]:
        """Whether to let a layer show more of itself, as a seam problem (``b`` is the layer) on its place and one pixel around it.

        At neighbours p and q that show i and j and may both turn to k, keeping both costs s = M_ij, turning p c = M_kj, turning q b = M_ik,
        and turning both nothing. With x = 1 for a turned pixel that is ::

            s + (c - b - s) / 2 x_p + (b - c - s) / 2 x_q + (b + c - s) / 2 |x_p - x_q|

        the cost of an interface and of showing either layer, as a seam problem has them. Where s > b + c, which no seam problem can
        say, b + c stands for s.
        """
        box = self.places[index].grown(1)
        shows = cut(owner, self.canvas.box, box, fill=-1)
        own = shows == index
        free = cut(self.allowed[index], self.places[index], box) & (shows >= 0) & ~own
        side = np.where(shows < 0, np.uint8(NONE), np.uint8(A))
        side[own], side[free] = B, FREE
        turned = np.zeros(box.shape, np.float32)
        links = []
        others = [k for k in np.unique(shows).tolist() if k >= 0 and k != index]
        for axis, (s, t) in enumerate(zip(*_NEIGHBOURS, strict=True)):
            keep_p, keep_q, both = (np.zeros(free[s].shape, np.float32) for _ in range(3))
            for k in others:
                cost = self.cost((min(k, index), max(k, index)))
                if cost is not None:
                    values = cost.on(box)[axis]
                    keep_p += np.where(shows[s] == k, values, np.float32(0))
                    keep_q += np.where(shows[t] == k, values, np.float32(0))
            for i, j in self.adjoining(shows):
                cost = self.cost((i, j)) if index not in (i, j) else None
                if cost is not None:
                    border = ((shows[s] == i) & (shows[t] == j)) | ((shows[s] == j) & (shows[t] == i))
                    both += np.where(border, cost.on(box)[axis], np.float32(0))
            known = (free[s] | free[t]) & (shows[s] >= 0) & (shows[t] >= 0)
            keep_q[own[s]], keep_p[own[t]] = keep_p[own[s]] + keep_q[own[s]], keep_p[own[t]] + keep_q[own[t]]
            keep_p[own[s]], keep_q[own[t]] = keep_q[own[s]], keep_p[own[t]]
            both = np.minimum(both, keep_p + keep_q)
            links.append(np.where(known, np.maximum((keep_p + keep_q - both) / 2, np.float32(_LEAST_LINK)), np.float32(0)))
            turned[s] += np.where(known & free[s], (keep_q - keep_p - both) / 2, np.float32(0))
            turned[t] += np.where(known & free[t], (keep_p - keep_q - both) / 2, np.float32(0))
        overlap = Overlap(side, free | own, (box.top, box.left), self.canvas.shape)
        right, down = links
        problem = SeamProblem(overlap, right, down, showing_a=np.maximum(-turned, 0), showing_b=np.maximum(turned, 0))
        return _settled(problem, own), box

    def total(self, shows: Owner, box: Box) -> float:
        """Σ M of a labelling in a box."""
        total = 0.0
        for i, j in self.adjoining(shows):
            cost = self.cost((i, j))
            for values, s, t in zip(cost.on(box), *_NEIGHBOURS, strict=True) if cost is not None else ():
                border = ((shows[s] == i) & (shows[t] == j)) | ((shows[s] == j) & (shows[t] == i))
                total += float(values[border].sum(dtype=np.float64))
        return total

    def adjoining(self, owner: Owner) -> list[Pair]:
        """The pairs of layers that show side by side somewhere, in order."""
        found: set[Pair] = set()
        for s, t in ((owner[:, :-1], owner[:, 1:]), (owner[:-1], owner[1:])):
            border = (s != t) & (s >= 0) & (t >= 0)
            codes = np.minimum(s, t)[border].astype(np.int64) * len(self.layers) + np.maximum(s, t)[border]
            found |= {divmod(int(code), len(self.layers)) for code in np.unique(codes)}
        return sorted(found)


def _settled(problem: SeamProblem, second: Mask) -> SeamProblem:
    """The problem with those free pixels decided that nothing ties to one of the two sides: they cost nothing there."""
    component, count = ndimage.label(problem.overlap.side == FREE)
    tied_a, tied_b = (np.bincount(component.ravel(), ties.ravel(), count + 1) > 0 for ties in (problem.grid.cold, problem.grid.hot))
    if tied_a[1:].all() and tied_b[1:].all():
        return problem
    side = problem.overlap.side.copy()
    loose = ~tied_a & ~tied_b
    for label, chosen in (
        (A, (tied_a & ~tied_b)[component] | (loose[component] & ~second)), (B, (tied_b & ~tied_a)[component] | (loose[component] & second))
    ):  # fmt: skip
        side[chosen & (component > 0)] = label
    return dataclasses.replace(problem, overlap=dataclasses.replace(problem.overlap, side=side))


def exclusive_covers(layers: Sequence[Layer], places: Sequence[Box], canvas: Canvas) -> list[Mask]:
    """Per layer, on its place, where it has pixels that may show and no other layer must be kept.

    Raises
    ------
    OptionError
        When two layers must both be kept at a pixel, or one is to be kept nowhere that it has pixels.
    """
    covered = [layer.covered for layer in layers]
    if all(layer.keep is None for layer in layers):
        return covered
    keeper = np.full(canvas.shape, -1, np.int16)
    for index, (layer, place) in enumerate(zip(layers, places, strict=True)):
        if layer.keep is None:
            continue
        kept = covered[index] & np.asarray(layer.keep)
        if not kept.any():
            raise OptionError(f"{layer.name} is to be kept where it has no pixels; check its keep mask")
        before = keeper[place.slices][kept]
        if before.max() >= 0:
            rival = layers[int(before.max())].name
            count = np.count_nonzero(before >= 0)
            raise OptionError(f"{rival} and {layer.name} are both to be kept at {count} pixels; keep only one of them there")
        keeper[place.slices][kept] = index
    return [
        cover & ((keeper[place.slices] < 0) | (keeper[place.slices] == index))
        for index, (cover, place) in enumerate(zip(covered, places, strict=True))
    ]
