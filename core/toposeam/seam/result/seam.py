"""The `Seam`: which patch shows where, the line between them, what it costs and how it was found."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Mask
from toposeam.checks import check_number
from toposeam.errors import OptionError, PathError, Term
from toposeam.optimize.history import Frame, Iteration, Termination
from toposeam.saving import save
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.overlap import Side
from toposeam.seam.problem.posing import pose
from toposeam.seam.problem.seam_problem import SeamProblem, Solution
from toposeam.seam.result.verdict import Verdict, verdict_of
from toposeam.sentence import counted
from toposeam.vector.polyline import Polyline, trace_boundary

if TYPE_CHECKING:
    from toposeam.vector.svg import SvgSeam

#: Largest distance, px, from a seam to its simplified lines: less than a pixel, but enough for the stairs of
#: pixel corners to become straight.
EDITABLE_PX = 0.75


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Seam:
    """A seam between two patches on an (H, W) canvas.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> rng = np.random.default_rng(0)
    >>> seam = ts.find_seam(*rng.random((2, 40, 12)), gradient=False)
    >>> seam.labels.shape, seam.soft.dtype, len(seam.paths)
    ((40, 12), dtype('float32'), 1)
    >>> seam.summary()["ratio"]
    1.0
    """

    #: (h, w) bool on the problem's window, True where ``b`` shows.
    _shown: Mask
    #: (h, w) float32 in [0, 1] on the problem's window, the label potential; None where it is computed when
    #: it is first read.
    _potential: npt.NDArray[np.float32] | None
    #: (H, W) bool mask of the pixels outside of the overlap that show ``b``, or a function that returns it.
    _only_b: Mask | Callable[[], Mask]
    #: Σ M over the interfaces the seam cuts; comparable across methods for the same patches and cost options.
    cost: float
    #: Lower bound on the cost of every seam of this overlap, up to rounding; 0 where nothing is proven. Exact
    #: engines and ``prove=True`` give the least cost itself. Heat gives the size of its flow where it solved
    #: the overlap whole (up to 30,000 px), plus the cost between fixed pixels, which every seam pays.
    bound: float = 0.0
    #: The engine that found it: the method that was asked for, or the one that "auto" chose, which is
    #: "shortest-path", "graph-cut" (a maximum flow) or "heat"; "path" for a seam that was given.
    method: str
    #: One record per inner iteration; empty for direct methods.
    history: tuple[Iteration, ...] = ()
    #: Densities per iteration, when asked for.
    frames: tuple[Frame, ...] = ()
    #: Why the method stopped.
    termination: Termination = Termination.DIRECT
    #: Seconds the method took, match cost excluded.
    seconds: float = 0.0
    #: The settings that reproduce the seam.
    settings: dict[str, Any] = field(default_factory=dict)
    #: The problem it solves.
    problem: SeamProblem

    def __repr__(self) -> str:
        height, width = self.problem.overlap.canvas
        steps = f", {counted(len(self.history), 'iteration')}" if self.history else ""
        return (
            f"Seam({self.method}, canvas {width} × {height} px, cost {self.cost:.6g}{steps}, "
            f"{self.termination})"
        )

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        """Return the labels, for NumPy and matplotlib."""
        return np.array(self.labels, dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        """Draw the seam for notebooks: over ``a`` dark, ``b`` light, and the label potential between them."""
        from toposeam.display import to_png
        from toposeam.seam.result.drawing import draw_seams

        return to_png(draw_seams(0.15 + 0.7 * self.soft, [self]))

    @property
    def only_b(self) -> Mask:
        """(H, W) bool mask of the pixels outside of the overlap that show ``b``."""
        return self._only_b() if callable(self._only_b) else self._only_b

    @cached_property
    def labels(self) -> Mask:
        """(H, W) bool, True where ``b`` shows."""
        return self.problem.on_canvas(self._shown, self.only_b).astype(bool, copy=False)

    @cached_property
    def soft(self) -> npt.NDArray[np.float32]:
        """(H, W) float32 in [0, 1]: 0 where ``a`` shows, 1 where ``b`` shows, between them the label
        potential before the seam was decided.

        Where method "auto" chose an exact engine, the potential is computed when it is first read. In an
        overlap of more than 30,000 px, by method "heat", too, it is computed in a band of some thirty pixels
        on either side of the seam. With the other methods it equals the labels.
        """
        return self.problem.on_canvas(potential_on_window(self), self.only_b).astype(np.float32, copy=False)

    @cached_property
    def _window_potential(self) -> npt.NDArray[np.float32]:
        if self._potential is None:
            from toposeam.seam.heat.method import potential_beside

            return potential_beside(self.problem, self._shown)
        return self._potential

    @cached_property
    def paths(self) -> list[Polyline]:
        """The seam as lines through pixel corners, ``b`` to the right of the direction of travel."""
        top, left = self.problem.overlap.start
        shift = np.array([left, top], float)
        traced = trace_boundary(self.problem.complete(self._shown), self.problem.seam_ground)
        return [Polyline(points=line.points + shift, closed=line.closed) for line in traced]

    @cached_property
    def _optimum(self) -> float:
        from toposeam.seam.exact.optimum import exact_labels

        found = self.problem.total(self._shown)  # capacities of SciPy's maximum flow are rounded
        return min(found, self.problem.total(exact_labels(self.problem)))

    def optimum_ratio(self) -> float:
        """Divide the seam's cost by the least possible one; 1.0 is optimal.

        The optimum is computed on the first call.

        Among more than two layers the cost of both includes the interfaces with the layers around, which stay
        as they are.
        """
        return self.problem.total(self._shown) / self._optimum if self._optimum > 0 else 1.0

    @cached_property
    def verdict(self) -> Verdict | None:
        """The verdict on how likely the seam is to be seen; None unless its law is "natural"."""
        if self.settings.get("law") != "natural":
            return None
        return verdict_of(*self.problem.crossings(self._shown))

    @property
    def length(self) -> float:
        """Length of all its lines, px."""
        return sum(line.length for line in self.paths)

    def simplified(self, tolerance: float = EDITABLE_PX) -> list[Polyline]:
        """Simplify :attr:`paths` to few points, for editing by hand.

        Parameters
        ----------
        tolerance : float
            Largest distance of a point left out from the new line, px.

        Raises
        ------
        OptionError
            When `tolerance` is negative.
        """
        check_number("tolerance", tolerance, 0)
        return [line.simplified(tolerance) for line in self.paths]

    def summary(self) -> dict[str, Any]:
        """Return the seam in numbers, as in JSON: method, cost, optimum, ratio (of both), bound (what is
        proven, 0 for nothing), stages, iterations, termination, paths (their number), length_px and seconds;
        of the law "natural" also likeness, worst_likeness and look_at (:class:`toposeam.seam.Verdict`).

        The optimum can take longer to compute than the seam took.
        """
        ratio = self.optimum_ratio()
        return {
            "method": self.method,
            "cost": self.cost,
            "optimum": self.cost / ratio,
            "ratio": ratio,
            "bound": self.bound,
            "stages": self.history[-1].stage if self.history else 0,
            "iterations": len(self.history),
            "termination": str(self.termination),
            "paths": len(self.paths),
            "length_px": round(self.length),
            "seconds": round(self.seconds, 6),
        } | ({} if self.verdict is None else self.verdict.summary())

    def to_svg(self, path: str | Path | None = None) -> str:
        """Write the seam as an SVG document of the canvas's size, with its settings in ``<metadata>``.

        Each line is a path.

        Parameters
        ----------
        path : str or Path, optional
            Also write the document there (an existing file is replaced).

        Returns
        -------
        str
        """
        from toposeam.vector.svg import write_svg

        height, width = self.problem.overlap.canvas
        text = write_svg(
            self.paths, width, height, {**self.settings, "method": self.method, "cost": self.cost}
        )
        if path is not None:
            save(path, text)
        return text

    @classmethod
    def from_svg(cls, source: str | Path | bytes, a: npt.ArrayLike, b: npt.ArrayLike, **options: Any) -> Seam:
        """Apply a seam read from SVG, perhaps edited by hand, to two patches.

        Parameters
        ----------
        source : path, or the document itself as str or bytes
        a, b, **options
            The patches and their masks, side and cost options, as for :func:`toposeam.find_seam`.

        Raises
        ------
        PathError
            When the document cannot be read, belongs to another canvas size, or its paths do not separate the
            patches.
        """
        from toposeam.vector.svg import read_svg

        return apply_paths(read_svg(source), a, b, **options)


def apply_paths(
    drawing: SvgSeam,
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    mask_a: npt.ArrayLike | None = None,
    mask_b: npt.ArrayLike | None = None,
    *,
    side: Side | None = None,
    gradient: bool | None = None,
    cost: MatchCost | None = None,
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
    speck: float | None = None,
    data_range: float | None = None,
) -> Seam:
    """Join two patches along given paths: read from a file, or made of polylines.

    Parameters
    ----------
    drawing : SvgSeam
        As :func:`toposeam.vector.read_svg` returns it, on the patches' canvas.
    a, b, mask_a, mask_b, side, gradient, cost, weight, avoid, core, speck, data_range
        As for :func:`toposeam.find_seam`.

    Returns
    -------
    Seam
        Its `method` is "path", its `termination` "given".

    Raises
    ------
    PathError
        When the paths belong to a canvas of another size, or do not separate the patches.
    OptionError
        When `drawing` is no SvgSeam, or an option cannot be used.

    Examples
    --------
    A straight line down the middle:

    >>> import numpy as np, toposeam as ts
    >>> a, b = np.zeros((2, 3, 6)); b = b + 1
    >>> line = ts.vector.Polyline([[3, 0], [3, 3]])
    >>> seam = ts.seam.apply_paths(ts.vector.SvgSeam((line,), 6, 3, None, ("seam 1",)), a, b)
    >>> seam.labels.astype(int)
    array([[0, 0, 0, 1, 1, 1],
           [0, 0, 0, 1, 1, 1],
           [0, 0, 0, 1, 1, 1]])
    """
    from toposeam.seam.result.apply import labels_from_paths
    from toposeam.vector.svg import SvgSeam

    if not isinstance(drawing, SvgSeam):
        raise OptionError(
            "{parameter} is of class {type}; pass {allowed}",
            kind="type",
            parameter=Term("drawing"),
            value=drawing,
            type=type(drawing).__name__,
            allowed="what read_svg returns",
        )
    problem, only_b, settings = pose(
        a,
        b,
        mask_a,
        mask_b,
        side,
        gradient,
        cost,
        weight=weight,
        avoid=avoid,
        core=core,
        speck=speck,
        data_range=data_range,
    )
    height, width = problem.overlap.canvas
    if (drawing.width, drawing.height) != (width, height):
        raise PathError(
            "the path belongs to a canvas of {own_width:g} × {own_height:g} px, but the "
            "{patches} make one of {width} × {height}; place them as when it was exported",
            kind="other canvas",
            own_width=drawing.width,
            own_height=drawing.height,
            width=width,
            height=height,
        )
    top, left = problem.overlap.start
    lines = [
        dataclasses.replace(line, points=line.points - np.array([left, top], float))
        for line in drawing.polylines
    ]
    labels = labels_from_paths(lines, problem.overlap.shared, problem.overlap.side)
    solution = Solution(labels=labels, soft=labels.astype(np.float32), termination=Termination.GIVEN)
    return seam_of(problem, only_b, solution, "path", settings, 0.0)


def seam_of(
    problem: SeamProblem,
    only_b: Mask,
    solution: Solution,
    method: str,
    settings: dict[str, Any],
    seconds: float,
) -> Seam:
    """Build the seam of a solution."""
    problem.check(solution.labels)
    return Seam(
        _shown=problem.complete(solution.labels).astype(bool, copy=False),
        _potential=None if solution.contracted else problem.complete(solution.soft),
        _only_b=only_b,
        cost=problem.cost(solution.labels),
        bound=solution.bound,
        method=method,
        history=solution.history,
        frames=solution.frames,
        termination=solution.termination,
        seconds=seconds,
        settings=settings,
        problem=problem,
    )


def knows_potential(seam: Seam) -> bool:
    """Return whether the label potential was stored when the seam was found, so that none is computed."""
    return seam._potential is not None


def potential_on_window(seam: Seam) -> npt.NDArray[np.float32]:
    """Return the label potential on the window of the seam's problem, (h, w) float32.

    ``Seam.soft`` is as large as the canvas.
    """
    return seam._window_potential
