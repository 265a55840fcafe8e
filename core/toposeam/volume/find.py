"""`find_surface`: the surface along which two volumes join."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_choice, check_function, options_from
from toposeam.errors import OptionError, Term
from toposeam.heat.threads import one_thread
from toposeam.seam.exact.graph_cut import least_cut
from toposeam.seam.problem.match_cost import MatchCost, check_no_reach, match_options
from toposeam.seam.problem.seam_problem import Solution
from toposeam.typing import SURFACE_METHODS as SURFACE_METHODS
from toposeam.typing import SurfaceMethod as SurfaceMethod
from toposeam.volume.heat.method import SurfaceKeywords, SurfaceOptions, heat_surface
from toposeam.volume.problem.posing import check_spacing, surface_problem
from toposeam.volume.problem.surface_problem import SurfaceProblem
from toposeam.volume.surface import Surface


def find_surface(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    mask_a: npt.ArrayLike | None = None,
    mask_b: npt.ArrayLike | None = None,
    *,
    axis: int | None = None,
    method: SurfaceMethod = "heat",
    gradient: bool | None = None,
    cost: MatchCost | None = None,
    spacing: Sequence[float] = (1.0, 1.0, 1.0),
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
    speck: float | None = None,
    channel_axis: int | None = None,
    data_range: float | None = None,
    options: SurfaceOptions | None = None,
    progress: Callable[[float], None] | None = None,
    **given: Unpack[SurfaceKeywords],
) -> Surface:
    """Find the surface along which two overlapping volumes, or clips, join unnoticed.

    Parameters
    ----------
    a, b : (D, H, W) or (D, H, W, C) array_like
        The volumes on one canvas; integers are scaled to [0, 1], one channel is widened to the other's
        number. Of a clip axis 0 is time.
    mask_a, mask_b : (D, H, W) array_like, optional
        True where the volume has voxels. The overlap is the intersection of both; voxels of one volume only
        fix its side. A mask that is left out covers the whole canvas. With neither, the whole canvas is the
        overlap.
    axis : {0, 1, 2}, optional
        Without masks: the axis along which ``b`` continues, 0 by default. Index 0 there stays ``a``'s, the
        last one ``b``'s.
    method : {"heat", "graph-cut"}
        `heat` lets heat gather on the surface, from coarse to fine; `graph-cut` needs PyMaxflow.
    gradient : bool, optional
        Law of the match cost: True for "gradient" (2.4) along the three axes, False for "colour" (3.22);
        "natural" by default.
    cost : MatchCost, optional
        All options of the match cost, instead of `gradient`.
    spacing : three positive floats
        Depth, height and width of a voxel. The cost of an interface is weighted with the area of its face, so
        that the surface avoids running along slices that are far apart. For clips the first number is the
        weight of a frame against a pixel.
    weight : (D, H, W) array_like, optional
        A positive factor on the cost of each voxel's interfaces.
    avoid : (D, H, W) array_like, optional
        Voxels the surface must not touch.
    core : float in (0, 1]
        For a volume that lies inside the other, the share of its depth, from its middle outwards, that must
        show: 1 is all of it but its border, where the surface must run, and 0.05 hardly more than its middle
        (:mod:`toposeam.seam.problem.overlap`).
    speck : float, optional
        Least number of connected voxels of a piece inside the other volume that must show. Smaller pieces may
        vanish, unless the volume has hardly anything else. By default 64, or 0.05 % of the volume's own
        voxels if that is more. With 0 every piece shows.
    channel_axis : int, optional
        Axis of the channels in four-dimensional arrays; last by default.
    data_range : float, optional
        The value that counts as white, for integers other than uint8 and uint16 and for floats beyond ±2.
    options : SurfaceOptions, optional
        Options of method "heat"; its fields may also be given as keywords.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    Surface

    Raises
    ------
    ImageError, OverlapError, OptionError, MissingPackageError
        The text states the value received and a remedy.

    Examples
    --------
    Two volumes that agree in one slice only are joined there:

    >>> import numpy as np, toposeam as ts
    >>> rng = np.random.default_rng(0)
    >>> a, b = rng.random((2, 9, 20, 20))
    >>> b[3:5] = a[3:5]
    >>> surface = ts.find_surface(a, b)
    >>> surface.labels[3].any(), surface.labels[4].all()
    (np.False_, np.True_)
    """
    check_function("progress", progress)
    check_choice("method", method, SURFACE_METHODS)
    match = check_no_reach(match_options(gradient, cost), "surfaces")
    masked = mask_a is not None or mask_b is not None
    if axis is not None:
        check_choice("axis", axis, (0, 1, 2))
    if axis is not None and masked:
        raise OptionError(
            "{parameter} is {value!r}, but masks say where each volume continues; leave one or the other out",
            kind="conflict",
            parameter=Term("axis"),
            value=axis,
        )
    if method != "heat" and (options is not None or given):
        unwanted = list(given) or ["options"]
        raise OptionError(
            "{method} takes no options; leave {names} out",
            kind="conflict",
            parameter=Term(unwanted[0]),
            method=Term("method", f"method {method}", value=method),
            names=tuple(map(Term, unwanted)),
        )
    chosen = options_from(SurfaceOptions, options, given, f"method {method}")
    where = 0 if axis is None else axis
    spacing = check_spacing(spacing)
    problem, only_b = surface_problem(
        a, b, mask_a, mask_b, where, match, spacing, weight, avoid, core, speck, channel_axis, data_range
    )
    settings: dict[str, Any] = {"core": core, "speck": speck} if masked else {"axis": where}
    settings |= {"spacing": spacing, **dataclasses.asdict(match)}
    if method == "heat":
        settings |= dataclasses.asdict(chosen)
    return solve_surface(problem, only_b, method, chosen, settings, progress)


def solve_surface(
    problem: SurfaceProblem,
    only_b: npt.NDArray[np.bool_],
    method: SurfaceMethod,
    options: SurfaceOptions,
    settings: dict[str, Any],
    progress: Callable[[float], None] | None = None,
) -> Surface:
    """Return the frozen surface that a method finds for a problem."""
    started = time.perf_counter()
    if method == "heat":
        with one_thread():
            solution, bound = heat_surface(problem, options, progress)
        total = problem.cost(solution.labels)
    else:
        network, weight, index = problem.network()
        labels = problem.complete(np.zeros(problem.overlap.side.shape, bool))
        labels.ravel()[index] = least_cut(network, weight)
        solution = Solution(labels=labels, soft=labels.astype(np.float32))
        bound = total = problem.cost(labels)
    return Surface(
        shown=solution.labels,
        potential=solution.soft,
        only_b=only_b,
        cost=total,
        bound=min(bound, total),
        method=method,
        history=solution.history,
        termination=solution.termination,
        seconds=time.perf_counter() - started,
        settings=settings,
        problem=problem,
    )
