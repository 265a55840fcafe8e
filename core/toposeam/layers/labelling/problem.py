"""The labelling problem: which layers are allowed at each pixel, and the cost where two layers adjoin.

A *label map* gives each covered pixel of the canvas the number of one layer that is allowed there, and -1 to
pixels that no layer covers. It costs Σ M_ij(p, q) over neighbours p and q that show different layers i and j;
M_ij is the match cost of these two (:mod:`toposeam.seam.problem.match_cost`). For two layers this is the seam
problem. :mod:`toposeam.layers.labelling.posing` decides which layers are allowed, and the value of M_ij where
the two layers do not both cover both pixels.

An *expansion* lowers the cost by letting one layer show at more pixels (Boykov, Veksler and Zabih 2001,
doi:10.1109/34.969114); a *swap* divides the pixels that show one of two layers anew. Both are minimum cuts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Labels, Mask
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.tile_map import EDGES, blocks, new_map, several, uniform
from toposeam.layers.labelling.label_map import Pair
from toposeam.seam.problem.overlap import FREE, NONE, A, B, Overlap, neighbours
from toposeam.seam.problem.seam_problem import SeamProblem

#: Slices of the left and upper pixels of all interfaces, and of their right and lower neighbours.
_NEIGHBOURS: Any = (np.s_[:, :-1], np.s_[:-1]), (np.s_[:, 1:], np.s_[1:])


class PairCost(Protocol):
    """The match cost of two layers on all interfaces where both have pixels."""

    @property
    def box(self) -> Box:
        """The overlap of the two places, grown by one pixel."""
        ...

    def on(self, box: Box, beside: Mask | None = None) -> tuple[Floats32, Floats32]:
        """Return the costs of the interfaces to the right, (h, w - 1), and below, (h - 1, w), in any box.

        A cost is 0 where it is not known, and may be 0 where neither pixel is one of `beside`, (h, w) bool.
        """
        ...

    def shared(self, box: Box) -> Mask:
        """(h, w) bool mask of a box, True where both layers have pixels."""
        ...

    def part(self, box: Box, shared_parts: dict[int, Any]) -> PairCost:
        """Return the same cost for use inside a box only, in another process.

        `shared_parts` collects the parts that several costs share.
        """


@dataclass(frozen=True, slots=True, eq=False)
class Labelling:
    """The problem of choosing a layer for every pixel of a canvas, at full size or reduced.

    A label map costs Σ M over the interfaces between different layers; M is the match cost of the two layers.
    :attr:`toposeam.layers.Composition.labelling` is that of a stitched picture.

    Parameters
    ----------
    canvas : Box
    places : sequence of Box
        The box of the canvas that each layer fills.
    allowed : sequence of (h, w) bool arrays
        Per layer, on its place, True where the layer may be chosen.
    costs : mapping from pairs of layers to PairCost
        The match costs of all pairs that share a pixel.
    forbidden : float
        Interfaces that cost at least this much are forbidden.

    Examples
    --------
    >>> import toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> labelling = ts.stitch(ts.layers.overlapping(a, b, overlap=10)).labelling
    >>> labelling.canvas, list(labelling.costs)
    (Box(top=0, left=0, bottom=30, right=70), [(0, 1)])
    >>> labelling.contested(10**6) < 30 * 10  # the overlap without its borders
    True
    """

    canvas: Box
    places: Sequence[Box]
    allowed: Sequence[Mask]
    costs: Mapping[Pair, PairCost]
    forbidden: float = float("inf")

    def allowed_in(self, index: int, box: Box) -> Mask:
        """(h, w) bool mask of a box, True where a layer is allowed."""
        return cut(self.allowed[index], self.places[index], box)

    def labels_in(self, label_map: Labels, box: Box) -> Labels:
        """Return a copy of the label map in a box, -1 off the canvas."""
        return cut(label_map, self.canvas, box, fill=-1)

    def contested(self, enough: int) -> int:
        """Count the pixels where more than one layer is allowed; stop counting at `enough`."""
        count = 0
        for box in blocks(self.canvas):
            number = np.zeros(box.shape, np.uint8)
            for _, common, allowed in self._allowed_on(box):
                number[common.within(box)] += allowed
            count += int(np.count_nonzero(number > 1))
            if count >= enough:
                break
        return count

    def make_allowed(self, label_map: Labels) -> None:
        """Replace labels that are not allowed, in place.

        Such a pixel gets an allowed layer that shows beside it; else the first allowed one; else -1.
        """
        for box in blocks(self.canvas, EDGES):
            layer = uniform(label_map, box)
            if layer is not None and layer >= 0 and box.shared(self.places[layer]) == box:
                inside = box.moved(-self.places[layer].top, -self.places[layer].left)
                if uniform(self.allowed[layer], inside):
                    continue
            labels = label_map[box.slices].copy()
            right = np.zeros(box.shape, bool)
            choices = list(self._allowed_on(box))
            for index, common, allowed in choices:
                here = common.within(box)
                right[here] |= (labels[here] == index) & allowed
            if right.all():
                continue
            around = self.labels_in(label_map, box.grown(1))
            for nearby in (True, False):
                for index, common, allowed in choices:
                    here = common.within(box)
                    wrong = allowed & ~right[here]
                    if nearby and wrong.any():
                        wrong &= neighbours(around == index)[1:-1, 1:-1][here]
                    labels[here][wrong] = index
                    right[here] |= wrong
            labels[~right] = -1
            label_map[box.slices] = labels

    def _allowed_on(self, box: Box) -> Iterator[tuple[int, Box, Mask]]:
        """Yield each layer that lies on a box, the common box, and the mask where it is allowed there."""
        for index, place in enumerate(self.places):
            common = place.shared(box)
            if all(common.shape):
                yield index, common, cut(self.allowed[index], place, common)

    def on_top(self) -> Labels:
        """Return the label map in which each pixel shows the last layer that is allowed there."""
        label_map: Labels = new_map(self.canvas.shape, -1, np.int16)
        for box in blocks(self.canvas):
            labels = np.full(box.shape, -1, np.int16)
            for index, common, allowed in self._allowed_on(box):
                labels[common.within(box)][allowed] = index
            label_map[box.slices] = labels
        return label_map

    def seam(
        self, label_map: Labels, pair: Pair, *, within: Box | None = None, beside: bool = False
    ) -> SeamProblem | None:
        """Pose the seam between two layers of a label map as a problem whose ``b`` is the second one.

        Parameters
        ----------
        label_map : (H, W) int16 array
        pair : (int, int)
        within : Box, optional
            Pose it in this box only.
        beside : bool
            Compute only the costs beside the seam.

        Returns
        -------
        SeamProblem, or None where the two share no pixel
        """
        cost = self.costs.get(pair)
        box = None if cost is None else cost.box if within is None else cost.box.shared(within)
        if cost is None or box is None or min(box.shape) < 2:
            return None
        labels = self.labels_in(label_map, box)
        first, second = labels == pair[0], labels == pair[1]
        inside = first | second
        free = inside & self.allowed_in(pair[0], box) & self.allowed_in(pair[1], box)
        side = np.full(box.shape, NONE, np.uint8)
        side[first], side[second], side[free] = A, B, FREE
        wanted = neighbours(first) & second | neighbours(second) & first if beside else None
        right, down = cost.on(box, wanted)
        right[~(inside[:, 1:] & inside[:, :-1])] = 0
        down[~(inside[1:] & inside[:-1])] = 0
        unary = [self._beside(index, pair, labels, free, box) for index in pair]
        overlap = Overlap(side, cost.shared(box) & inside, (box.top, box.left), self.canvas.shape)
        return SeamProblem(overlap, right, down, self.forbidden, showing_a=unary[0], showing_b=unary[1])

    def _beside(self, index: int, pair: Pair, labels: Labels, free: Mask, box: Box) -> Floats32:
        """(h, w) unary cost of showing one layer of a pair at its free pixels: that of the interfaces with
        third layers.
        """
        total = np.zeros(box.shape, np.float32)
        for other in _labels_of(labels):
            cost = self.costs.get((min(index, other), max(index, other))) if other not in pair else None
            if cost is None:
                continue
            theirs = labels == other
            touching = free & neighbours(theirs)
            if not touching.any():
                continue
            for values, s, t in zip(cost.on(box, touching), *_NEIGHBOURS, strict=True):
                for here, there in ((s, t), (t, s)):
                    ends = free[here] & theirs[there]
                    total[here][ends] += values[ends]
        return total

    def total(self, labels: Labels, box: Box) -> float:
        """Compute Σ M of a label map in a box."""
        total = 0.0
        for i, j in self.adjoining(labels):
            cost = self.costs.get((i, j))
            for values, s, t in zip(cost.on(box), *_NEIGHBOURS, strict=True) if cost is not None else ():
                border = ((labels[s] == i) & (labels[t] == j)) | ((labels[s] == j) & (labels[t] == i))
                total += float(values[border].sum(dtype=np.float64))
        return total

    def interfaces(
        self, label_map: Labels, box: Box
    ) -> Iterator[tuple[Pair, npt.NDArray[np.intp], npt.NDArray[np.intp], int, Floats32]]:
        """Yield the interfaces of all seams in a box of the canvas, pair by pair and axis by axis.

        Parameters
        ----------
        label_map : (H, W) int16 array
        box : Box

        Yields
        ------
        pair : (int, int)
        x, y : (n,) int arrays
            The left or upper pixel of each interface, on the canvas.
        axis : int
            1 for interfaces between neighbours in a row, 0 between those in a column.
        cost : (n,) float32 array
        """
        box = box.shared(self.canvas)
        labels = label_map[box.slices]
        for i, j in self.adjoining(labels):
            cost = self.costs.get((i, j))
            for axis, values, s, t in zip((1, 0), cost.on(box), *_NEIGHBOURS, strict=True) if cost else ():
                border = ((labels[s] == i) & (labels[t] == j)) | ((labels[s] == j) & (labels[t] == i))
                rows, columns = np.nonzero(border)
                if len(rows):
                    yield (i, j), columns + box.left, rows + box.top, axis, values[rows, columns]

    def adjoining(self, labels: Labels) -> list[Pair]:
        """Find the pairs of layers that show side by side somewhere, in order."""
        count = len(self.places)
        beside = np.zeros((count + 1) ** 2, bool)  # by pair, the lower number first; -1 counts as last
        for box in several(labels, Box(0, 0, *labels.shape)):
            part = labels[box.slices]
            for s, t in ((part[:, :-1], part[:, 1:]), (part[:-1], part[1:])):
                border = s != t
                p, q = s[border] % (count + 1), t[border] % (count + 1)
                beside[np.minimum(p, q).astype(np.intp) * (count + 1) + np.maximum(p, q)] = True
        firsts, seconds = np.nonzero(beside.reshape(count + 1, count + 1)[:, :count])
        return list(zip(firsts.tolist(), seconds.tolist(), strict=True))


def _labels_of(labels: Labels) -> list[int]:
    """Return the numbers of the layers that show, in order."""
    return np.flatnonzero(np.bincount(labels.ravel() + 1)[1:]).tolist()
