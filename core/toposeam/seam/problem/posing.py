"""Posing a seam problem: from two patches, their masks and options to the overlap and its match cost."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Image, Mask
from toposeam.checks import check_choice
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import as_array, as_float, as_mask, check_shape, unit_of, widen
from toposeam.seam.problem.blend_reach import STEP, Reach, any_by_steps, within_reach
from toposeam.seam.problem.match_cost import Law, MatchCost, match_cost, match_options
from toposeam.seam.problem.overlap import SIDES, Overlap, Side, between_masks, pairs_along, side_by_side
from toposeam.seam.problem.seam_problem import M_MAX, SeamProblem

#: Pixels, about, of the rows whose match cost is computed at a time, to bound the memory.
_BLOCK_PIXELS = 1 << 18


def pose(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    mask_a: npt.ArrayLike | None,
    mask_b: npt.ArrayLike | None,
    side: Side | None,
    gradient: bool | None,
    cost: MatchCost | None,
    *,
    weight: npt.ArrayLike | None,
    avoid: npt.ArrayLike | None,
    core: float,
    speck: float | None,
    data_range: float | None,
    usual: Law = "natural",
) -> tuple[SeamProblem, Mask, dict[str, Any]]:
    """Pose the problem of arguments as :func:`find_seam` takes them.

    Returns
    -------
    problem : SeamProblem
    only_b : (H, W) bool array
        Pixels that only ``b`` covers.
    settings : dict
        The options that reproduce the problem.

    Raises
    ------
    OptionError
        For arguments that would be ignored, besides all that :func:`seam_problem` refuses.
    """
    match = match_options(gradient, cost, usual)
    masked = mask_a is not None or mask_b is not None
    if side is not None:
        check_choice("side", side, SIDES)
    if side is not None and masked:
        raise OptionError(
            "{parameter} is {value!r}, but masks say where each {patch} continues; leave one "
            "or the other out",
            kind="conflict",
            parameter=Term("side"),
            value=side,
        )
    problem, only_b = seam_problem(
        a, b, mask_a, mask_b, side or "right", match, weight, avoid, core, speck, data_range
    )
    place: dict[str, Any] = {"core": core, "speck": speck} if masked else {"side": side or "right"}
    return problem, only_b, {**place, **dataclasses.asdict(match)}


def seam_problem(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    mask_a: npt.ArrayLike | None,
    mask_b: npt.ArrayLike | None,
    side: Side,
    cost: MatchCost,
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
    speck: float | None = None,
    data_range: float | None = None,
) -> tuple[SeamProblem, Mask]:
    """Build the problem behind :func:`find_seam`, and the (H, W) mask of the pixels that only ``b`` covers.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> problem, only_b = seam_problem(*rng.random((2, 4, 6)), None, None, "right", MatchCost())
    >>> problem.right.shape, only_b.any()  # one pixel of margin all round
    ((6, 7), np.False_)
    """
    a, b = as_array(a, "a"), as_array(b, "b")
    shape_a, shape_b = a.shape[:2], b.shape[:2]
    if shape_a != shape_b:
        raise ImageError(
            "{a} has {size_a!s} pixels and {b} has {size_b!s}; put both on one canvas of the "
            "same size (toposeam.stitch does)",
            kind="shape",
            size_a=shape_a,
            size_b=shape_b,
        )
    canvas = (int(shape_a[0]), int(shape_a[1]))
    overlap, on_a, on_b, only_b = placed(
        canvas, mask_a, mask_b, core, speck, lambda: side_by_side(canvas, side)
    )
    factor = None
    if weight is not None:
        factor = overlap.window(as_weights(weight, canvas)).astype(np.float32)
    right, down = costs_on(a, b, overlap, on_a, on_b, cost, factor, data_range)
    forbidden = float("inf")
    if avoid is not None:
        forbidden = forbid((down, right), overlap.window(as_mask(avoid, canvas, "avoid")))
    return SeamProblem(overlap, right, down, forbidden), only_b


def placed(
    canvas: tuple[int, ...],
    mask_a: npt.ArrayLike | None,
    mask_b: npt.ArrayLike | None,
    core: float,
    speck: float | None,
    unmasked: Callable[[], Overlap],
) -> tuple[Overlap, Mask, Mask, Mask]:
    """Build the overlap of two patches, or volumes.

    Returns it, the masks of either on its window, and the mask of the canvas that only ``b`` covers.

    Parameters
    ----------
    canvas : shape of both
    mask_a, mask_b : arrays of that shape, optional
        The pixels of each; where only one of them is given, the other is the whole canvas.
    core, speck
        As for :func:`toposeam.find_seam`.
    unmasked : callable
        Builds the overlap where neither is given.
    """
    if mask_a is None and mask_b is None:
        overlap = unmasked()
        return overlap, overlap.shared, overlap.shared, np.zeros(canvas, bool)
    whole = np.ones(canvas, bool)
    full_a = whole if mask_a is None else as_mask(mask_a, canvas, "mask_a")
    full_b = whole if mask_b is None else as_mask(mask_b, canvas, "mask_b")
    overlap = between_masks(full_a, full_b, core, speck)
    on_a, on_b = overlap.window(full_a).astype(bool), overlap.window(full_b).astype(bool)
    return overlap, on_a, on_b, full_b & ~full_a


def forbid(costs: Sequence[Floats32], avoid: Mask, forbidden: float | None = None) -> float:
    """Raise, in place, the cost of all interfaces of some pixels, or voxels, beyond what a seam accepts.

    Parameters
    ----------
    costs : sequence of float32 arrays
        The costs along each axis of `avoid`; where a cost is 0 there is no interface.
    avoid : (h, w) or (d, h, w) bool array
    forbidden : float, optional
        The new cost; by default `M_MAX` times that of the dearest interface, or of 1 if that is more.

    Returns
    -------
    float
        The new cost.

    Examples
    --------
    >>> down, right = np.ones((1, 3), np.float32), np.ones((2, 2), np.float32)
    >>> forbid((down, right), np.array([[True, False, False], [False, False, False]]), 9.0)
    9.0
    >>> down, right
    (array([[9., 1., 1.]], dtype=float32), array([[9., 1.],
           [1., 1.]], dtype=float32))
    """
    if forbidden is None:
        forbidden = float(np.float32(M_MAX * max(1.0, *(float(values.max(initial=0)) for values in costs))))
    for axis, values in enumerate(costs):
        s, t = pairs_along(axis)
        values[(values > 0) & (avoid[s] | avoid[t])] = forbidden
    return forbidden


def costs_on(
    a: Image,
    b: Image,
    overlap: Overlap,
    on_a: Mask,
    on_b: Mask,
    cost: MatchCost,
    factor: Floats32 | None,
    data_range: float | None,
) -> tuple[Floats32, Floats32]:
    """Compute the match cost block by block: only the rows of one block are stored as float32 at a time."""
    h, w = overlap.side.shape
    right, down = np.empty((h, w - 1), np.float32), np.empty((h - 1, w), np.float32)
    look = cost.look
    step = max(4 * look, _BLOCK_PIXELS // w)
    reach = _reach(a, b, overlap, on_a, on_b, cost.reach, data_range) if cost.reach else None
    for start in range(0, h, step):
        stop = min(start + step, h)
        # The last row needs its lower neighbour, and either end the rows on which costs depend, besides.
        low, high = max(start - look, 0), min(stop + 1 + look, h)
        rows = slice(low, high)
        part = Overlap(
            overlap.side[rows],
            overlap.shared[rows],
            (overlap.start[0] + low, overlap.start[1]),
            overlap.canvas,
        )
        here_a = on_a[rows]
        here_b = here_a if on_b is on_a else on_b[rows]  # one array, whose steps are computed once
        patch_a, patch_b = widen(
            _patch(a, part, here_a, "a", data_range), _patch(b, part, here_b, "b", data_range)
        )
        weight = None if factor is None else factor[rows]
        nearby = None
        if reach is not None:
            patch_a, weight, nearby = within_reach(reach, patch_a, weight, rows, slice(0, w), cost)
        beside, below = match_cost(patch_a, patch_b, part, here_a, here_b, cost, weight, nearby=nearby)
        right[start:stop] = beside[start - low : stop - low]
        down[start:stop] = below[start - low : stop - low]
    return right, down


def _reach(
    a: Image,
    b: Image,
    overlap: Overlap,
    on_a: Mask,
    on_b: Mask,
    reach: float,
    data_range: float | None,
) -> Reach:
    def part(rows: slice) -> tuple[Floats32, Mask, Mask]:
        start = (overlap.start[0] + rows.start, overlap.start[1])
        here = Overlap(overlap.side[rows], overlap.shared[rows], start, overlap.canvas)
        one, other = widen(
            _patch(a, here, on_a[rows], "a", data_range, STEP),
            _patch(b, here, on_b[rows], "b", data_range, STEP),
        )
        return one - other, here.shared[::STEP, ::STEP], any_by_steps(on_a[rows] != on_b[rows])

    height, width = overlap.side.shape
    return Reach.by_rows((height, width), part, reach)


def _patch(
    image: Image, overlap: Overlap, present: Mask, name: str, data_range: float | None, step: int = 1
) -> npt.NDArray[np.float32]:
    """Return the window of a patch as float32, set to zero where the patch has no pixels."""
    window = overlap.window(image)
    window[~present] = 0
    return as_float(window[::step, ::step], name, data_range)


def as_weights(weight: npt.ArrayLike, shape: tuple[int, ...]) -> npt.NDArray[np.float64]:
    """Return the factors on the match cost, one positive number per pixel, or voxel, of the canvas.

    Raises
    ------
    ImageError
        When they are no numbers, or of another shape.
    OptionError
        When one is not positive and finite.
    """
    try:
        array = np.asarray(weight).astype(np.float64, casting="same_kind", copy=False)
    except (TypeError, ValueError) as error:
        raise ImageError(
            "{array} cannot be read as numbers ({reason}); pass one value per {unit}",
            kind="array",
            array=Term("weight"),
            reason=str(error),
            unit=unit_of(shape),
        ) from error
    check_shape(array, shape, "weight")
    if not (np.isfinite(array).all() and (array > 0).all()):
        what, where = ("surface", "voxels") if len(shape) == 3 else ("seam", "pixels")
        raise OptionError(
            "{parameter} must be positive everywhere; to keep the {what} out of some {where} use {avoid}",
            kind="number",
            parameter=Term("weight"),
            what=what,
            where=where,
        )
    return array
