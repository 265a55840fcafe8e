"""The `Seam`: which patch shows where, the line between them, what it costs and how it was found."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.images import Mask
from toposeam.optimize.history import Frame, Iteration, Termination
from toposeam.seam.exact import exact_labels
from toposeam.seam.problem import SeamProblem
from toposeam.vector.polyline import Polyline, trace_boundary
from toposeam.vector.svg import write_svg


@dataclass(frozen=True, kw_only=True, eq=False)
class Seam:
    """A seam between two patches on an (H, W) canvas."""

    #: (h, w) bool on the problem's window, True where ``b`` shows.
    shown: Mask
    #: (h, w) float32 in [0, 1] on the problem's window, the label potential.
    potential: npt.NDArray[np.float32]
    #: (H, W) bool, what shows ``b`` outside of the overlap.
    only_b: Mask = field(repr=False)
    #: Σ M over the interfaces the seam cuts; comparable across methods for the same patches and cost options.
    cost: float
    #: Name of the method that found it.
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
    problem: SeamProblem = field(repr=False)

    @cached_property
    def labels(self) -> Mask:
        """(H, W) bool, True where ``b`` shows."""
        return self.problem.on_canvas(self.shown, self.only_b).astype(bool, copy=False)

    @cached_property
    def soft(self) -> npt.NDArray[np.float32]:
        """(H, W) float32 in [0, 1]: 0 where ``a`` shows, 1 where ``b`` shows, between them the label potential before the seam was decided.

        On an overlap so large that it starts out contracted, what coarser networks had decided has one value per region.
        """
        return self.problem.on_canvas(self.potential, self.only_b).astype(np.float32, copy=False)

    @cached_property
    def paths(self) -> list[Polyline]:
        """The seam as lines through pixel corners, ``b`` to the right of the direction of travel."""
        top, left = self.problem.overlap.origin
        shift = np.array([left, top], float)
        traced = trace_boundary(self.problem.complete(self.shown), self.problem.seam_ground)
        return [Polyline(points=line.points + shift, closed=line.closed) for line in traced]

    @cached_property
    def _optimum(self) -> float:
        return self.problem.total(exact_labels(self.problem))

    def optimum_ratio(self) -> float:
        """The seam's cost divided by the least possible one (1.0 is optimal); the optimum is computed on the first call.

        Among more than two layers the cost of both includes the interfaces with the layers around, which stay as they are.
        """
        return self.problem.total(self.shown) / self._optimum if self._optimum > 0 else 1.0

    def to_svg(self, path: str | Path | None = None) -> str:
        """The seam as an SVG document of the canvas's size, one path per line, its settings in ``<metadata>``.

        Parameters
        ----------
        path : str or Path, optional
            Also write the document there (an existing file is replaced).

        Returns
        -------
        str
        """
        height, width = self.problem.overlap.canvas
        text = write_svg(self.paths, width, height, {**self.settings, "method": self.method, "cost": self.cost})
        if path is not None:
            Path(path).write_text(text, encoding="utf-8")
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
            When the document cannot be read, belongs to another canvas size, or its paths do not separate the patches.
        """
        from toposeam.seam.find import apply_paths
        from toposeam.vector.svg import read_svg

        return apply_paths(read_svg(source), a, b, **options)
