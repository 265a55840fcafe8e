"""Result of :func:`toposeam.find_surface`."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Mask
from toposeam.checks import check_number
from toposeam.display import to_png
from toposeam.optimize.history import Iteration, Termination
from toposeam.seam.exact.graph_cut import least_cut
from toposeam.volume.mesh import Mesh, mesh_of
from toposeam.volume.problem.surface_problem import SurfaceProblem


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A surface between two volumes on a (D, H, W) canvas.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 6, 8, 8))
    >>> surface = ts.find_surface(a, b)
    >>> surface.labels.shape, bool(surface.labels[0].any()), bool(surface.labels[-1].all())
    ((6, 8, 8), False, True)
    """

    #: (d, h, w) bool on the problem's window, True where ``b`` shows.
    shown: Mask = field(repr=False)
    #: (d, h, w) float32 in [0, 1] on the problem's window, the label potential.
    potential: npt.NDArray[np.float32] = field(repr=False)
    #: (D, H, W) bool, True on voxels of ``b`` outside the overlap.
    only_b: Mask = field(repr=False)
    #: Σ M over the interfaces the surface cuts.
    cost: float
    #: Lower bound on the cost of every surface of this overlap; 0 if none is proven.
    bound: float = 0.0
    #: Name of the method that found it.
    method: str
    #: One record for every fifty sweeps; `stage` is the number of the grid, 1 for the finest. Direct methods
    #: have none.
    history: tuple[Iteration, ...] = ()
    #: Why the method stopped.
    termination: Termination = Termination.DIRECT
    #: Time of the method in seconds, without the match cost.
    seconds: float = 0.0
    #: The settings that reproduce the surface.
    settings: dict[str, Any] = field(default_factory=dict, repr=False)
    #: The problem it solves.
    problem: SurfaceProblem = field(repr=False)

    def __repr__(self) -> str:
        shape = " × ".join(map(str, self.only_b.shape))
        proven = f", proven ≥ {self.bound:.6g}" if self.bound else ""
        return f"Surface({shape} voxels, cost {self.cost:.6g}{proven}, method {self.method!r})"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        """Return the labels, for NumPy."""
        return np.array(self.labels, dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        """Return the soft labels of the middle slice along each axis, side by side, for notebooks."""
        slices = [np.take(self.soft, self.soft.shape[axis] // 2, axis) for axis in range(3)]
        tall = max(len(part) for part in slices)
        return to_png(
            np.concatenate([np.pad(part, ((0, tall - len(part)), (0, 2))) for part in slices], axis=1)
        )

    @cached_property
    def labels(self) -> Mask:
        """(D, H, W) bool, True where ``b`` shows."""
        return self.problem.on_canvas(self.shown, self.only_b).astype(bool, copy=False)

    @cached_property
    def soft(self) -> npt.NDArray[np.float32]:
        """(D, H, W) float32 in [0, 1], the label potential before the surface was decided.

        Outside the overlap it is 0 where ``a`` shows and 1 where ``b`` shows.
        """
        return self.problem.on_canvas(self.potential, self.only_b).astype(np.float32, copy=False)

    @cached_property
    def _optimum(self) -> float:
        network, weight, index = self.problem.network()
        labels = np.zeros(self.problem.overlap.side.shape, bool)
        labels.ravel()[index] = least_cut(network, weight)
        return self.problem.cost(labels)

    def optimum_ratio(self) -> float:
        """Return the surface's cost divided by the least possible one (1.0 is optimal), which PyMaxflow
        computes on the first call.

        Raises
        ------
        MissingPackageError
            When PyMaxflow is not installed; ``cost / bound`` is at least as large, and needs nothing.
        """
        return self.cost / self._optimum if self._optimum > 0 else 1.0

    def mesh(self, smooth: float = 1.0) -> Mesh:
        """Return the surface inside the overlap as triangles, by marching cubes (scikit-image).

        Parameters
        ----------
        smooth : float
            Standard deviation, in voxels, of a Gaussian on the label map, which smooths the steps of voxels;
            0 for none.

        Raises
        ------
        OverlapError
            When there is no surface inside the overlap.
        """
        check_number("smooth", smooth, 0, 100)
        overlap = self.problem.overlap
        inside = overlap.inside[1]
        start = np.maximum(overlap.start, 0)
        shared = ndimage.binary_dilation(overlap.shared)[inside]
        return mesh_of(self.shown[inside], self.settings["spacing"], smooth, start, shared)
