"""Strokes of a brush that say which layer shows, or where no seam may run.

A stroke is a line of points with a radius, in pixels of the picture on which it was painted. It therefore
stays valid when the picture is read at another size or warped to another canvas: each pixel of the canvas is
mapped back to the picture, and belongs to the stroke if it lies within the radius of the line.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Floats32, Mask
from toposeam.checks import check_choice, check_items, check_kind, check_number, check_whole
from toposeam.errors import OptionError, Term
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, cut
from toposeam.layers.canvas.tile_map import new_map
from toposeam.layers.canvas.transforms import Transform, similarity
from toposeam.layers.labelling.pair_cost import FORBIDDEN
from toposeam.layers.labelling.problem import Labelling, PairCost
from toposeam.seam.problem.posing import forbid

#: "show": this layer shows; "hide": it does not, where another one can; "away": no seam runs here.
StrokeKind: TypeAlias = Literal["show", "hide", "away"]
KINDS: tuple[StrokeKind, ...] = get_args(StrokeKind)

#: Directions in which the outline of a brush is mapped to the canvas to find its box.
_OUTLINE = np.exp(2j * np.pi * np.arange(8) / 8).view(float).reshape(-1, 2)
#: Largest coordinate of a point, and largest radius, px.
_FARTHEST = 1e6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stroke:
    """A stroke of a round brush on a picture.

    Raises
    ------
    OptionError

    Examples
    --------
    >>> Stroke(points=[(10, 20), (40, 25)], radius=6, layer=1).kind
    'show'
    """

    #: (n, 2) float64, x and y, px of the picture from its upper left corner; (0.5, 0.5) is the middle of the
    #: first pixel.
    points: Floats
    #: px of the picture.
    radius: float
    #: The number of the layer on whose picture it was painted.
    layer: int
    #: "show": this layer shows here; "hide": it does not, where another one can; "away": no seam runs here.
    kind: StrokeKind = "show"

    def __post_init__(self) -> None:
        try:
            points = np.atleast_2d(np.asarray(self.points, float))
        except (TypeError, ValueError):
            points = np.zeros(0)
        if points.ndim != 2 or points.shape[1] != 2 or not len(points) or not _near(points):
            raise OptionError(
                "the points of a stroke are of shape {shape!s}; give one or more pairs of numbers, x and y, "
                "in px of its picture",
                kind="shape",
                parameter=Term("points"),
                shape=np.shape(self.points) if not isinstance(self.points, str) else (),
            )
        object.__setattr__(self, "points", points)
        check_number("radius", self.radius, 0, _FARTHEST, above=True)
        check_whole("layer", self.layer, 0)
        check_choice("kind", self.kind, KINDS)

    def on(self, canvas: Canvas, transform: Transform | None = None) -> Iterator[tuple[Box, Mask]]:
        """Yield boxes of a canvas and the (h, w) bool masks of the stroke in them; boxes may overlap.

        Parameters
        ----------
        canvas : Canvas
        transform : Transform, optional
            From the pixels of the picture to the coordinates of the canvas's layers; by default the layer is
            only moved.
        """
        transform = similarity(canvas.layers[self.layer].at) if transform is None else transform
        shift = np.array(canvas.origin, float)
        points = self.points - 0.5  # transforms count from the centre of the first pixel
        lines = pairwise(points) if len(points) > 1 else [(points[0], points[0])]
        for line in lines:
            start, end = line
            count = max(2, min(16, int(np.hypot(*(end - start)) / (2 * self.radius)) + 2))
            middles = start + np.linspace(0, 1, count)[:, np.newaxis] * (end - start)
            outline = transform.to_canvas((middles[:, np.newaxis] + self.radius * _OUTLINE).reshape(-1, 2))
            outline = outline[np.isfinite(outline).all(axis=1)] - shift
            if not len(outline):
                continue
            low, high = outline.min(axis=0), outline.max(axis=0)
            margin = 2 + 0.2 * (high - low) / count  # the outline bulges between the mapped points
            left, top = np.floor(low - margin).astype(int).tolist()
            right, bottom = np.ceil(high + margin).astype(int).tolist()
            for box, moved in _on_canvas(Box(top, left, bottom + 1, right + 1), canvas):
                rows, columns = np.mgrid[moved.top : moved.bottom, moved.left : moved.right]
                at = transform.to_picture(np.stack([columns, rows], axis=-1) + shift)
                yield box, _distance(at, start, end) <= self.radius


def apply_strokes(
    labelling: Labelling,
    strokes: Sequence[Stroke],
    canvas: Canvas,
    transforms: Sequence[Transform | None] | None = None,
) -> tuple[Labelling, tuple[int, ...]]:
    """Return a labelling problem in which strokes hold; later ones win over earlier ones.

    Strokes may be applied one after another: the result is that of all at once.

    Parameters
    ----------
    labelling : Labelling
        The problem without these strokes.
    strokes : sequence of Stroke
    canvas : Canvas
        The canvas of the problem.
    transforms : sequence of Transform or None, optional
        Per layer, the map from the pixels of its picture to the coordinates of the layers, as
        :attr:`toposeam.layers.Placement.transforms`; None for a layer that is only moved.

    Returns
    -------
    Labelling
        The same problem with other allowed layers and forbidden interfaces.
    tuple of int
        The strokes, by number, that change nothing: their layer has no pixels there, or no other one has.

    Raises
    ------
    OptionError
        If a stroke belongs to no layer.

    Examples
    --------
    >>> import toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 20, 60))
    >>> joined = ts.stitch(ts.layers.overlapping(a, b, overlap=40))
    >>> stroke = Stroke(points=[(30, 10), (50, 10)], radius=4, layer=0)
    >>> asked, lost = apply_strokes(joined.labelling, [stroke], joined.canvas)
    >>> again = ts.layers.recut(asked, joined.solution)
    >>> again.labels[10, 28:52].max(), lost
    (np.int16(0), ())
    """
    check_kind("labelling", labelling, Labelling, "a Labelling, such as Composition.labelling")
    check_kind("canvas", canvas, Canvas, "a Canvas, such as Composition.canvas")
    if transforms is not None:
        check_kind("transforms", transforms, Sequence, "a transform or None for each layer")
    strokes = check_items("strokes", strokes, Stroke, "a sequence of Strokes")
    count = len(canvas.layers)
    given: Sequence[Transform | None] = [None] * count if transforms is None else transforms
    flat = canvas.cut_open()
    allowed, away, lost = [mask.copy() for mask in labelling.allowed], None, []
    for number, stroke in enumerate(strokes):
        if stroke.layer >= count or len(given) != count:
            raise OptionError(
                "stroke {number} is of layer {layer}, with {count} layers and {given} transforms; number the "
                "layers from 0, and give each one transform or None",
                kind="choice",
                parameter=Term("strokes"),
                number=number,
                layer=stroke.layer,
                count=count,
                given=len(given),
            )
        found = False
        for box, mask in stroke.on(canvas, given[stroke.layer]):
            if stroke.kind == "away":
                away = new_map(labelling.canvas.shape, False, bool) if away is None else away
                away[box.slices] = away[box.slices] | mask
                found = True
            elif stroke.kind == "show":
                found |= _show(allowed, flat, stroke.layer, box, mask)
            else:
                found |= _hide(allowed, flat, stroke.layer, box, mask)
        if not found:
            lost.append(number)
    result = dataclasses.replace(labelling, allowed=allowed)
    if away is not None:
        costs = {pair: AwayCost(cost, away, labelling.canvas) for pair, cost in labelling.costs.items()}
        result = dataclasses.replace(result, costs=costs, forbidden=FORBIDDEN)
    return result, tuple(lost)


def _show(masks: list[Mask], flat: Canvas, index: int, box: Box, mask: Mask) -> bool:
    """Allow only one layer, in place, where it has pixels; return whether it has any in the mask."""
    here = mask & cut(flat.covers[index], flat.places[index], box)
    if not here.any():
        return False
    for k, place in enumerate(flat.places):
        if all(place.shared(box).shape):
            _allow(masks, flat, k, box, here, k == index)
    return True


def _hide(masks: list[Mask], flat: Canvas, index: int, box: Box, mask: Mask) -> bool:
    """Forbid a layer, in place, where another one has pixels; return whether both have any in the mask."""
    others = [k for k, place in enumerate(flat.places) if k != index and all(place.shared(box).shape)]
    covers = {k: cut(flat.covers[k], flat.places[k], box) for k in others}
    here = mask & cut(flat.covers[index], flat.places[index], box)
    here &= np.any(list(covers.values()), axis=0) if covers else False
    if not here.any():
        return False
    allowed = np.any([cut(masks[k], flat.places[k], box) for k in others], axis=0)
    for k in others:  # where an earlier stroke shows only this layer
        _allow(masks, flat, k, box, here & ~allowed & covers[k], True)
    _allow(masks, flat, index, box, here, False)
    return True


def _allow(masks: list[Mask], flat: Canvas, index: int, box: Box, where: Mask, value: bool) -> None:
    """Allow or forbid a layer at some pixels of a box, in place."""
    common = flat.places[index].shared(box)
    chosen = where[common.within(box)]
    if chosen.any():
        inside = common.moved(-flat.places[index].top, -flat.places[index].left).slices
        before = masks[index][inside]
        masks[index][inside] = before | chosen if value else before & ~chosen


@dataclass(frozen=True, slots=True, eq=False)
class AwayCost:
    """The match cost of two layers, forbidden at the interfaces of some pixels of the canvas."""

    cost: PairCost
    #: (H, W) bool map of the canvas: pixels that no seam may touch.
    away: Mask
    canvas: Box

    @property
    def box(self) -> Box:
        """The overlap of the two places, grown by one pixel."""
        return self.cost.box

    def on(self, box: Box, beside: Mask | None = None) -> tuple[Floats32, Floats32]:
        """Return the costs in a box."""
        right, down = self.cost.on(box, beside)
        away = cut(self.away, self.canvas, box)
        if away.any():
            forbid((down, right), away, FORBIDDEN)
        return right, down

    def shared(self, box: Box) -> Mask:
        """(h, w) bool mask of a box, True where both layers have pixels."""
        return self.cost.shared(box)

    def part(self, box: Box, shared_parts: dict[int, Any]) -> PairCost:
        """Return the same cost for use inside a box only, in another process."""
        return AwayCost(self.cost.part(box, shared_parts), np.asarray(self.away[:, :]), self.canvas)


def _near(points: npt.NDArray[Any]) -> bool:
    return bool(np.isfinite(points).all() and np.abs(points).max() <= _FARTHEST)


def _on_canvas(box: Box, canvas: Canvas) -> Iterator[tuple[Box, Box]]:
    """Yield the parts of a box that lie on a canvas, and the same parts where they were before a round canvas
    brought them to its first turn.
    """
    if canvas.period is None:
        common = box.shared(canvas.box)
        if all(common.shape):
            yield common, common
        return
    for turn in range(box.left // canvas.period, -(-box.right // canvas.period)):
        common = box.moved(0, -turn * canvas.period).shared(canvas.box)
        if all(common.shape):
            yield common, common.moved(0, turn * canvas.period)


def _distance(points: Floats, start: Floats, end: Floats) -> Floats:
    """(…) distances of (…, 2) points from the line between two points."""
    along = end - start
    square = float(along @ along)
    offset = points - start
    share = np.clip(offset @ along / square, 0, 1) if square else np.zeros(points.shape[:-1])
    result: Floats = np.hypot(*np.moveaxis(offset - share[..., np.newaxis] * along, -1, 0))
    return result
