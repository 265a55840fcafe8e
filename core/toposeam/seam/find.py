"""`find_seam`: one call for every method."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, OptionError, PathError
from toposeam.heat.threads import one_thread
from toposeam.images import Image, Mask, as_float, as_mask, widen
from toposeam.optimize.history import Termination
from toposeam.seam.dynamic_programming import dp_labels
from toposeam.seam.exact import exact_labels
from toposeam.seam.graph_cut import graph_cut_labels
from toposeam.seam.heat import HeatOptions, heat_path
from toposeam.seam.match_cost import Floats32, MatchCost, match_cost
from toposeam.seam.overlap import Overlap, Side, between_masks, side_by_side
from toposeam.seam.problem import M_MAX, SeamProblem
from toposeam.seam.seam import Seam
from toposeam.seam.solution import Solution
from toposeam.seam.thesis import ThesisOptions, thesis_path
from toposeam.vector.apply import labels_from_paths
from toposeam.vector.svg import SvgSeam

#: The match cost is computed from blocks of about so many pixels.
_BLOCK_PIXELS = 1 << 18

Method = Literal["heat", "thesis", "shortest-path", "dp", "graph-cut"]
METHODS: tuple[Method, ...] = get_args(Method)

_DIRECT: dict[str, Callable[[SeamProblem], Mask]] = {"shortest-path": exact_labels, "dp": dp_labels, "graph-cut": graph_cut_labels}
_ITERATIVE: dict[str, tuple[type[HeatOptions] | type[ThesisOptions], Callable[..., Solution]]] = {
    "heat": (HeatOptions, heat_path),
    "thesis": (ThesisOptions, thesis_path),
}


def find_seam(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    mask_a: npt.ArrayLike | None = None,
    mask_b: npt.ArrayLike | None = None,
    side: Side = "right",
    method: Method = "heat",
    gradient: bool = True,
    *,
    cost: MatchCost | None = None,
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
    record_frames: bool = False,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Seam:
    """Find the seam along which two overlapping patches join unnoticed.

    Parameters
    ----------
    a, b : (H, W) or (H, W, C) array_like
        The patches on one canvas, same height and width; integers are scaled to [0, 1], one channel is widened to the other's number.
    mask_a, mask_b : (H, W) array_like, optional
        Where each patch has pixels. The overlap is their intersection, and what only one patch covers fixes its side. A mask that is left
        out covers the whole canvas. With neither, the arrays *are* the overlap.
    side : {"right", "left", "bottom", "top"}
        Without masks: where ``b`` continues. The border column or row on ``a``'s side stays ``a``'s, the opposite one ``b``'s.
    method : {"heat", "thesis", "shortest-path", "dp", "graph-cut"}
        `heat` converges the flux of a conductor network; `thesis` follows Algorithms 1 and 2 of the thesis with MMA; `shortest-path` is the
        exact optimum; `dp` the best seam that never turns back; `graph-cut` needs PyMaxflow.
    gradient : bool
        Match cost (2.4) with gradients, or (3.22) without. Ignored when `cost` is given.
    cost : MatchCost, optional
        All options of the match cost.
    weight : (H, W) array_like, optional
        A positive factor on the cost of each pixel's interfaces.
    avoid : (H, W) array_like, optional
        Pixels the seam must not touch.
    core : float
        For a patch that lies inside the other, the share of its depth that must show (:mod:`toposeam.seam.overlap`).
    record_frames : bool
        Keep the densities of every iteration in ``Seam.frames``.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].
    **options
        Fields of :class:`HeatOptions` or :class:`ThesisOptions`.

    Returns
    -------
    Seam

    Raises
    ------
    ImageError, OverlapError, OptionError, MissingPackageError
        Their text says what was received and what to do.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> rng = np.random.default_rng(0)
    >>> a = rng.random((20, 12)); b = a.copy(); b[:, :5] = 1 - b[:, :5]
    >>> seam = ts.find_seam(a, b)
    >>> seam.labels[:, 0].any(), seam.labels[:, -1].all()
    (np.False_, np.True_)
    """
    if method not in METHODS:
        raise OptionError(f"method is {method!r}; choose one of {', '.join(METHODS)}")
    match = cost if cost is not None else MatchCost(gradient=gradient)
    problem, only_b = seam_problem(a, b, mask_a, mask_b, side, match, weight, avoid, core)
    settings: dict[str, Any] = {"side": side, "core": core, **dataclasses.asdict(match)}
    started = time.perf_counter()
    chosen = method_options(method, options)
    if chosen is not None:
        settings |= dataclasses.asdict(chosen)
    solution = solve(problem, method, chosen, record_frames=record_frames, progress=progress)
    return _seam(problem, only_b, solution, method, settings, time.perf_counter() - started)


def method_options(method: Method, options: Mapping[str, Any]) -> HeatOptions | ThesisOptions | None:
    """The checked options of a method, None for a direct one.

    Raises
    ------
    OptionError
        For an unknown method or options it does not have.
    """
    if method not in METHODS:
        raise OptionError(f"method is {method!r}; choose one of {', '.join(METHODS)}")
    if method not in _ITERATIVE:
        if options:
            raise OptionError(f"method {method} takes no options, but {', '.join(sorted(options))} was given; leave it out")
        return None
    kind = _ITERATIVE[method][0]
    try:
        return kind(**options)
    except TypeError as error:
        known = ", ".join(option.name for option in dataclasses.fields(kind))
        raise OptionError(f"method {method} does not know {', '.join(sorted(options))}; its options are {known}") from error


def solve(
    problem: SeamProblem, method: Method, options: HeatOptions | ThesisOptions | None, *, record_frames: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Solution:  # fmt: skip
    """The labels a method finds for a problem."""
    if method in _ITERATIVE:
        with one_thread():
            return _ITERATIVE[method][1](problem, options, record_frames=record_frames, progress=progress)
    labels = _DIRECT[method](problem)
    return Solution(labels=labels, soft=labels.astype(np.float32))


def apply_paths(
    drawing: SvgSeam,
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    mask_a: npt.ArrayLike | None = None,
    mask_b: npt.ArrayLike | None = None,
    side: Side = "right",
    gradient: bool = True,
    *,
    cost: MatchCost | None = None,
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
) -> Seam:
    """Join two patches along paths that were read from a file; see :meth:`Seam.from_svg`."""
    match = cost if cost is not None else MatchCost(gradient=gradient)
    problem, only_b = seam_problem(a, b, mask_a, mask_b, side, match, weight, avoid, core)
    height, width = problem.overlap.canvas
    if (drawing.width, drawing.height) != (width, height):
        raise PathError(
            f"the path belongs to a canvas of {drawing.width:g} × {drawing.height:g} px, but the patches make one of {width} × {height}; "
            "place them as when it was exported"
        )
    top, left = problem.overlap.origin
    lines = [dataclasses.replace(line, points=line.points - np.array([left, top], float)) for line in drawing.polylines]
    labels = labels_from_paths(lines, problem.overlap.shared, problem.overlap.side)
    solution = Solution(labels=labels, soft=labels.astype(np.float32), termination=Termination.GIVEN)
    return _seam(problem, only_b, solution, "path", {"side": side, "core": core, **dataclasses.asdict(match)}, 0.0)


def _seam(problem: SeamProblem, only_b: Mask, solution: Solution, method: str, settings: dict[str, Any], seconds: float) -> Seam:
    problem.check(solution.labels)
    return Seam(
        shown=problem.complete(solution.labels).astype(bool, copy=False), potential=problem.complete(solution.soft), only_b=only_b,
        cost=problem.cost(solution.labels), method=method, history=solution.history, frames=solution.frames,
        termination=solution.termination, seconds=seconds, settings=settings, problem=problem,
    )  # fmt: skip


def seam_problem(
    a: npt.ArrayLike, b: npt.ArrayLike, mask_a: npt.ArrayLike | None, mask_b: npt.ArrayLike | None, side: Side, cost: MatchCost,
    weight: npt.ArrayLike | None = None, avoid: npt.ArrayLike | None = None, core: float = 0.5,
) -> tuple[SeamProblem, Mask]:  # fmt: skip
    """The problem behind :func:`find_seam`, and the (H, W) mask of the pixels only ``b`` covers."""
    shape_a, shape_b = np.shape(a)[:2], np.shape(b)[:2]
    if shape_a != shape_b:
        raise ImageError(f"a has {shape_a} pixels and b has {shape_b}; put both on one canvas of the same size (toposeam.stitch does)")
    if len(shape_a) < 2 or 0 in shape_a:
        raise ImageError(f"a has shape {np.shape(a)}; pass non-empty (H, W) or (H, W, C) arrays")
    canvas = (int(shape_a[0]), int(shape_a[1]))
    if mask_a is None and mask_b is None:
        overlap = side_by_side(canvas, side)
        on_a = on_b = overlap.shared
        only_b = np.zeros(canvas, bool)
    else:
        whole = np.ones(canvas, bool)
        full_a = whole if mask_a is None else as_mask(mask_a, canvas, "mask_a")
        full_b = whole if mask_b is None else as_mask(mask_b, canvas, "mask_b")
        overlap = between_masks(full_a, full_b, core)
        on_a, on_b = overlap.window(full_a).astype(bool), overlap.window(full_b).astype(bool)
        only_b = full_b & ~full_a
    factor = None
    if weight is not None:
        factor = overlap.window(as_weights(weight, canvas)).astype(np.float32)
    right, down = _match_cost(np.asarray(a), np.asarray(b), overlap, on_a, on_b, cost, factor)
    forbidden = float("inf")
    if avoid is not None:
        forbidden = forbid(right, down, overlap.window(as_mask(avoid, canvas, "avoid")))
    return SeamProblem(overlap, right, down, forbidden), only_b


def forbid(right: npt.NDArray[np.float32], down: npt.NDArray[np.float32], avoid: Mask) -> float:
    """Raise, in place, the cost of all interfaces of some (h, w) pixels beyond what a seam accepts; returns that cost."""
    forbidden = np.float32(M_MAX * max(1.0, float(right.max(initial=0)), float(down.max(initial=0))))
    right[(right > 0) & (avoid[:, 1:] | avoid[:, :-1])] = forbidden
    down[(down > 0) & (avoid[1:] | avoid[:-1])] = forbidden
    return float(forbidden)


def _match_cost(
    a: Image, b: Image, overlap: Overlap, on_a: Mask, on_b: Mask, cost: MatchCost, factor: Floats32 | None
) -> tuple[Floats32, Floats32]:
    """The match cost, from blocks of rows: only the rows of one block are held as float32 at a time."""
    h, w = overlap.side.shape
    right, down = np.empty((h, w - 1), np.float32), np.empty((h - 1, w), np.float32)
    step = max(1, _BLOCK_PIXELS // w)
    for start in range(0, h, step):
        stop = min(start + step, h)
        # The lower neighbour of the last row, and a row beyond either end for the gradients.
        low, high = max(start - 1, 0), min(stop + 2, h)
        rows = slice(low, high)
        part = Overlap(overlap.side[rows], overlap.shared[rows], (overlap.origin[0] + low, overlap.origin[1]), overlap.canvas)
        patch_a, patch_b = widen(_patch(a, part, on_a[rows], "a"), _patch(b, part, on_b[rows], "b"))
        beside, below = match_cost(patch_a, patch_b, part, on_a[rows], on_b[rows], cost, None if factor is None else factor[rows])
        right[start:stop] = beside[start - low : stop - low]
        down[start:stop] = below[start - low : stop - low]
    return right, down


def _patch(image: npt.ArrayLike, overlap: Overlap, present: Mask, name: str) -> npt.NDArray[np.float32]:
    """The window of a patch as float32, zero where it has no pixels (whatever the array holds there)."""
    array = np.asarray(image)
    if array.ndim not in (2, 3) or 0 in array.shape:
        raise ImageError(f"{name} has shape {array.shape}; pass a non-empty (H, W) or (H, W, C) array")
    window = overlap.window(array)
    window[~present] = 0
    return as_float(window, name)


def as_weights(weight: npt.ArrayLike, canvas: tuple[int, int]) -> npt.NDArray[np.float64]:
    """The factors on the match cost, one positive number per pixel."""
    array = np.asarray(weight, float)
    if array.shape != canvas:
        raise ImageError(f"weight has shape {array.shape}, the images have {canvas}; pass one value per pixel")
    if not (np.isfinite(array).all() and (array > 0).all()):
        raise OptionError("weight must be positive everywhere; to keep the seam out of some pixels use avoid")
    return array
