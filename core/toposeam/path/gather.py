r"""Optimisation of the material that conducts heat from sources to sinks on a plate (thesis 2.1; Ryu et al.,
reference 15 there).

The plate is the ground on which a robot can drive; obstacles are insulation. Heat is generated where the
robot starts (2.1) and leaves by convection where it ends. The material of least thermal compliance (2.7)
under a mass bound (2.8) is the way. The bound falls with the iterations,

.. math:: M_0(n) = \max\left(\sum V_e / n^2,\; M_{\min}\right) \qquad (2.9), (2.10)

down to the mass M_min of a straight stroke between the ends. Once it has reached M_min, the exponent p of
k = k_0 ρ^p (2.6) grows from 1. With p = 1 and conductivities k_0 = 1/c² the optimum is a flux q of least
Σ c|q|: heat takes the way of least cost, in any direction, not only along the grid. A larger p then gathers
the material into a line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats
from toposeam.checks import check_choice, check_range, check_whole
from toposeam.heat.plate import MOST_ITERATIONS, Plate
from toposeam.optimize.oc import OCOptions, oc_step
from toposeam.path.strip import Strip

#: Conductivity of obstacles and of elements without material, relative to the ground's.
_INSULATION = 1e-6
#: Convection of a sink element, relative to the ground's conductivity.
_CONVECTION = 1.0
#: Least rows and columns, px, for which the multigrid solver is used: narrower grounds have no coarser grid.
_MIN_MULTIGRID_SIDE = 8
#: Largest number of iterations that an option may ask for.
_MAX_ITERATIONS = 10_000


class PathKeywords(TypedDict, total=False):
    """Fields of :class:`PathOptions`."""

    stroke_px: float
    gather: int
    sharpen: int
    penalty: float
    taut: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class PathOptions:
    """Options of :func:`toposeam.path`.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> way = ts.path((16, 24), (2, 8), (21, 8), options=ts.path.PathOptions(gather=10, sharpen=10))
    >>> len(way.paths)
    1
    """

    #: Width of the stroke whose mass M_min is, px.
    stroke_px: float = 2.0
    #: Iterations with p = 1 and the falling mass bound.
    gather: int = 40
    #: Iterations in which p grows from 1 to its last value.
    sharpen: int = 30
    #: Last penalty exponent.
    penalty: float = 3.0
    #: Replace parts of the traced way by straight lines where these cost no more.
    taut: bool = True

    def __post_init__(self) -> None:
        check_range(0, above=True, stroke_px=self.stroke_px)
        check_whole("gather", self.gather, 1, _MAX_ITERATIONS)
        check_whole("sharpen", self.sharpen, 0, _MAX_ITERATIONS)
        check_range(1, 10, penalty=self.penalty)
        check_choice("taut", self.taut, (True, False))


@dataclass(frozen=True, slots=True, kw_only=True)
class PathIteration:
    """One iteration of the optimisation.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> way = ts.path((16, 24), (2, 8), (21, 8))
    >>> way.history[0].leg
    1
    """

    #: Number of the leg between stopovers, from 1.
    leg: int
    #: Thermal compliance (2.7).
    compliance: float
    #: Mass, and its bound M_0(n) (2.9).
    mass: float
    bound: float
    #: Penalty exponent (2.6).
    penalty: float
    #: Side of an element, px. Grounds of more than 30,000 px are reduced first. Masses are in elements.
    cell_px: int = 1


def optimise_material(
    cost: Floats,
    sources: list[tuple[int, int]],
    sinks: list[tuple[int, int]],
    options: PathOptions,
    leg: int,
    report: Callable[[float], None],
    *,
    cell_px: int = 1,
) -> tuple[Floats, list[PathIteration]]:
    """Optimise the material that conducts heat from sources to sinks.

    Parameters
    ----------
    cost : (h, w) float array
        Cost of every element; infinite on obstacles.
    sources, sinks : list of (row, column)
        Elements in which heat is generated, and from which it leaves.
    options : PathOptions
    leg : int
        Number of the leg, for the history.
    report : callable
        Called with the share of the iterations done, in (0, 1].
    cell_px : int
        Side of an element, px, for the history.

    Returns
    -------
    density : (h, w) float array in [0, 1]
        The material.
    history : list of PathIteration
    """
    free = _connected_to(cost, sources + sinks)
    heat, convection = np.zeros(cost.shape), np.zeros(cost.shape)
    for point in sources:
        heat[point] = 1.0
    for point in sinks:
        convection[point] = _CONVECTION
    few = 2 * np.count_nonzero(free) < free.size or min(free.shape) < _MIN_MULTIGRID_SIDE
    plate: Plate | Strip = Strip(heat, convection, free) if few else Plate(heat, convection)
    typical = float(np.median(cost[free]))
    nominal = np.where(free, (typical / np.where(free, cost, 1.0)) ** 2, _INSULATION)
    volume = float(np.count_nonzero(free))
    # M_min: a straight stroke from every source to its nearest sink (2.9).
    ends = np.array(sinks, float)
    straight = sum(float(np.hypot(*(ends - point).T).min()) for point in np.array(sources, float))
    least = min(options.stroke_px * straight, volume)
    density = np.where(free, 1.0, 0.0)
    nodes = None
    history = []
    total = options.gather + options.sharpen
    for n in range(1, total + 1):
        grown = max(0, n - options.gather) / max(options.sharpen, 1)
        p = 1.0 + (options.penalty - 1.0) * min(1.0, 1.5 * grown)
        bound = max(volume / n**2, least)  # (2.9), (2.10)
        steady = plate.solve(nominal * (_INSULATION + (1 - _INSULATION) * density**p), nodes)  # (2.6)
        nodes = steady.nodes
        if steady.iterations > MOST_ITERATIONS and isinstance(plate, Plate):  # walls slow multigrid down
            plate = Strip(heat, convection, free)
        sensitivity = -p * nominal * density ** (p - 1) * steady.energy  # ∂Π/∂ρ
        step = OCOptions(move=1.0 if p == 1.0 else 0.2, damping=1 / (p + 1))
        moved = oc_step(density[free], sensitivity[free], 1.0, bound, 1e-4, 1.0, step)
        density = np.zeros(cost.shape)
        density[free] = moved
        history.append(
            PathIteration(
                leg=leg,
                compliance=steady.compliance,
                mass=float(moved.sum()),
                bound=bound,
                penalty=p,
                cell_px=cell_px,
            )
        )
        report(n / total)
    return density, history


def _connected_to(cost: Floats, ends: list[tuple[int, int]]) -> npt.NDArray[np.bool_]:
    """Return the (h, w) bool mask of the free pixels that are connected to any of the ends."""
    pieces, _ = ndimage.label(np.isfinite(cost))
    return np.isin(pieces, [pieces[end] for end in ends if pieces[end]])  # sinks may lie outside the strip
