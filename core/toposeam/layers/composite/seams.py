"""Seams of a composition that are known, and what stands for any: an outline, or figures only."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from toposeam.arrays import Floats, Image, Labels
from toposeam.images import box_of
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.tile_map import BLOCK, several
from toposeam.layers.execution.tasks import Executor
from toposeam.layers.labelling.label_map import Pair
from toposeam.optimize.history import Termination
from toposeam.seam.result.seam import Seam
from toposeam.seam.result.verdict import STEP_REACH, Verdict, adjoining, breaks_at, steps_beside
from toposeam.vector.polyline import Polyline

if TYPE_CHECKING:
    from toposeam.layers.labelling.problem import Labelling

#: Most blocks in which the steps along seams are measured; of more, some are taken.
_MOST_BLOCKS = 64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeamOutline:
    """The paths and figures of a seam, without the problem that it solves."""

    pair: Pair
    paths: tuple[Polyline, ...]
    cost: float
    method: str
    bound: float
    stages: int
    iterations: int
    termination: Termination
    seconds: float
    settings: Mapping[str, Any]
    verdict: Verdict | None = None

    @classmethod
    def of(cls, pair: Pair, seam: Seam) -> SeamOutline:
        """Copy everything but the problem from the seam of a pair."""
        return cls(
            pair=pair,
            paths=tuple(seam.paths),
            cost=seam.cost,
            method=seam.method,
            bound=seam.bound,
            stages=seam.history[-1].stage if seam.history else 0,
            iterations=len(seam.history),
            termination=seam.termination,
            seconds=seam.seconds,
            settings=seam.settings,
            verdict=seam.verdict,
        )

    @property
    def length(self) -> float:
        """Total length of the paths, px."""
        return sum(line.length for line in self.paths)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeamFigures:
    """Length, cost and verdict of a seam, which are computed without making the seam."""

    #: The number of interfaces that cost something, px.
    length: float
    cost: float
    #: The verdict; None unless the match cost follows the law "natural".
    verdict: Verdict | None


@dataclass(frozen=True, eq=False)
class KnownSeams:
    """Seams that were found one by one, as those of two layers are."""

    known: Mapping[Pair, Seam]
    #: Poses the labelling problem of all layers.
    pose: Callable[[], Labelling]

    @cached_property
    def labelling(self) -> Labelling:
        """The labelling problem whose solution has these seams."""
        return self.pose()

    @property
    def pairs(self) -> Sequence[Pair]:
        """The pair of layers that each seam divides, by number."""
        return tuple(self.known)

    def seam(self, pair: Pair, beside: bool = False) -> Seam:
        """Return the seam between two layers."""
        return self.known[pair]

    def figures(self, executor: Executor | None = None) -> Mapping[Pair, SeamFigures]:
        """Return length, cost and verdict of all seams."""
        return {
            pair: SeamFigures(length=seam.length, cost=seam.cost, verdict=seam.verdict)
            for pair, seam in self.known.items()
        }


def with_steps(
    canvas: Canvas,
    labels: Labels,
    view: Box,
    window: Callable[[slice, slice], Image],
    verdicts: Mapping[Pair, Verdict],
) -> dict[Pair, Verdict]:
    """Return verdicts with the steps and breaks that the joined picture shows; parameters of
    :func:`steps_along`, and the verdict on each seam, by its likeness.
    """
    steps = steps_along(canvas, labels, view, window, {pair: one.poor for pair, one in verdicts.items()})
    return {pair: one.with_steps(steps[pair]) for pair, one in verdicts.items()}


def steps_along(
    canvas: Canvas,
    labels: Labels,
    view: Box,
    window: Callable[[slice, slice], Image],
    poor: Mapping[Pair, Floats],
) -> dict[Pair, Floats]:
    """Measure how visibly the joined picture shows its seams.

    Steps of tone, hue and grain are measured all along the seams, breaks where both pictures show something
    else.

    Parameters
    ----------
    canvas : Canvas
        A flat one.
    labels : (H, W) int16
    view : Box
        The part of the canvas that is shown.
    window : callable
        Returns the pixels of rows and columns of the picture, which begins at the view's corner.
    poor : mapping
        For the layers that each seam divides: x, y on the canvas, px, and likeness of places where these show
        something else, (N, 3), the poorest first.

    Returns
    -------
    dict of (int, int) to (K, 3) float arrays
        x, y on the canvas, px, and step or break of each piece of the seam: 1 is just seen.
    """
    steps = {pair: [np.zeros((0, 3))] for pair in poor}
    shown = view.shared(canvas.box)
    places_of = {pair: _worst_in(places, shown) for pair, places in poor.items()}
    for block in _chosen_blocks(labels, shown, list(places_of.values())):
        part = labels[block.slices]
        here = set(np.unique(part).tolist())
        for pair in (pair for pair in poor if here.issuperset(pair)):
            border = adjoining(*(part == index for index in pair))
            if not border.any():
                continue
            box = Box.of(*box_of(border)).moved(*block[:2]).grown(STEP_REACH).shared(shown)
            layers = [canvas.layers[index] for index in pair]
            places = [canvas.places[index] for index in pair]
            shows = labels[box.slices]
            pixels = (
                window(*box.moved(-view.top, -view.left).slices),
                [cut(layer.image, place, box) for layer, place in zip(layers, places, strict=True)],
                [cut(layer.covered, place, box) for layer, place in zip(layers, places, strict=True)],
                [shows == index for index in pair],
                layers[0].white,
            )
            corner = box.left, box.top, 0
            near = _worst_in(places_of[pair], block)
            beside = [steps_beside(*pixels), breaks_at(*pixels, (near - corner)[:, :2])]
            steps[pair].append(np.concatenate(beside) + corner)
    return {pair: np.concatenate(found) for pair, found in steps.items()}


def _worst_in(places: Floats, box: Box) -> Floats:
    """Keep the rows x, y, … that lie in a box."""
    x, y = places[:, 0], places[:, 1]
    return places[(x >= box.left) & (x < box.right) & (y >= box.top) & (y < box.bottom)]


def _chosen_blocks(labels: Labels, shown: Box, poor: Sequence[Floats]) -> list[Box]:
    """Choose the blocks that are looked at: those with the poorest places, and evenly of the others."""
    found = list(several(labels, shown, side=BLOCK)) if min(shown.shape) > 0 else []
    if len(found) <= _MOST_BLOCKS:
        return found
    places = np.concatenate([np.zeros((0, 3)), *poor])
    worst = [float(_worst_in(places, block)[:, 2].min(initial=1)) for block in found]
    order = np.argsort(worst, kind="stable")
    first = order[: _MOST_BLOCKS // 2]
    others = order[_MOST_BLOCKS // 2 :]
    rest = np.sort(others)[:: -(-len(others) // (_MOST_BLOCKS - len(first)))]
    return [found[k] for k in sorted([*first.tolist(), *rest.tolist()])]
