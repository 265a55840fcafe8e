r"""Path planning on a heated plate (thesis 2.1; Ryu et al., reference 15 there).

The plate is the ground a robot can drive on, its obstacles are insulation. Heat is generated where the robot starts (2.1) and leaves by
convection where it ends; the material that carries it best (2.7) under a mass bound (2.8) is the way. The bound falls with the iterations,

.. math:: M_0(n) = \max\left(\sum V_e / n^2,\; M_{\min}\right) \qquad (2.9), (2.10)

down to the mass of a straight stroke between the ends, and the exponent p of k = k_0 ρ^p (2.6) grows from 1 when it is there. With p = 1
the optimum is a flux q of least Σ c|q| for conductivities k_0 = 1/c²: heat takes the way of least cost, in any direction, not only along
the grid. The larger p then gathers it into a line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from toposeam.errors import ImageError, OptionError, PathError
from toposeam.heat.plate import Plate
from toposeam.optimize.oc import OCOptions, oc_step
from toposeam.vector.polyline import Polyline

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
Point = tuple[float, float]

#: Conductivity of obstacles and of elements without material, relative to the ground's.
_INSULATION = 1e-6
#: Convection of a sink element.
_CONVECTION = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PathOptions:
    """How the heat is led."""

    #: Width of the stroke whose mass M_min is, px.
    stroke_px: float = 2.0
    #: Iterations with p = 1 and the falling mass bound.
    gather: int = 40
    #: Iterations in which p grows from 1 to its last value.
    sharpen: int = 30
    #: Last penalty exponent.
    p: float = 3.0
    #: Whether the traced way is drawn taut at the end, where a straight line costs no more.
    taut: bool = True

    def __post_init__(self) -> None:
        if not self.stroke_px > 0:
            raise OptionError(f"stroke_px is {self.stroke_px}; it must be positive")
        if self.gather < 1 or self.sharpen < 0:
            raise OptionError(f"gather is {self.gather} and sharpen {self.sharpen}; use at least 1 and 0")
        if not self.p >= 1:
            raise OptionError(f"p is {self.p}; it must be 1 or more")


@dataclass(frozen=True, slots=True, kw_only=True)
class PathIteration:
    """One iteration of the optimisation."""

    #: Which leg between stopovers, from 1.
    leg: int
    #: Thermal compliance (2.7).
    compliance: float
    #: Mass, and its bound M_0(n) (2.9).
    mass: float
    bound: float
    #: Penalty exponent (2.6).
    p: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlannedPath:
    """Ways from every source to a sink."""

    #: One line per source, from it to the sink its heat reaches; px, pixel (row y, column x) covers [x, x + 1] × [y, y + 1].
    paths: tuple[Polyline, ...]
    #: Cost of each: the cost map integrated along it. Without a map its length.
    costs: tuple[float, ...]
    #: (H, W) material the heat gathered, in [0, 1]; of several legs the greatest.
    density: npt.NDArray[np.float32]
    #: Per iteration of every leg.
    history: tuple[PathIteration, ...]

    @property
    def length(self) -> float:
        """Length of all ways in px."""
        return sum(path.length for path in self.paths)

    @property
    def cost(self) -> float:
        """Cost of all ways."""
        return sum(self.costs)


def plan_path(
    ground: tuple[int, int] | npt.ArrayLike,
    sources: Point | Sequence[Point],
    sinks: Point | Sequence[Point],
    *,
    obstacles: npt.ArrayLike | None = None,
    stopovers: Sequence[Point] = (),
    options: PathOptions | None = None,
    progress: Callable[[float], None] | None = None,
) -> PlannedPath:
    """Lead heat from sources to sinks, and follow it.

    Parameters
    ----------
    ground : (int, int) or (H, W) array_like
        Height and width of an even ground, or what a step of 1 px costs at every pixel: positive; infinity is an obstacle.
    sources, sinks : (x, y) or sequence of (x, y)
        Where ways start and end, px. With several of both, every source's heat finds the sink that is best for all together.
    obstacles : (H, W) bool array_like, optional
        True where no way may lead.
    stopovers : sequence of (x, y)
        Points to be visited in this order, between one source and one sink. Each is the sink of one leg and the source of the next.
    options : PathOptions
    progress : callable, optional
        Called with the share done, in [0, 1].

    Returns
    -------
    PlannedPath

    Raises
    ------
    OptionError
        For points outside the ground, on an obstacle, missing or coinciding, or stopovers with several sources or sinks.
    ImageError
        For a ground or obstacles of the wrong shape, or costs that are not positive.
    PathError
        When obstacles part a source from every sink.
    """
    chosen = options if options is not None else PathOptions()
    cost = _ground(ground, obstacles)
    starts, ends, between = (
        _pixels(points, cost, name) for points, name in ((sources, "source"), (sinks, "sink"), (stopovers, "stopover"))
    )
    for name, found in (("source", starts), ("sink", ends)):
        if not found:
            raise OptionError(f"there is no {name}; give at least one point")
    if set(starts) & set(ends):
        raise OptionError("a source and a sink lie on the same pixel; move one of them")
    if between and (len(starts) > 1 or len(ends) > 1):
        raise OptionError(f"stopovers lie between one source and one sink, not {len(starts)} and {len(ends)}; plan those ways one by one")
    stops = [starts, *([stop] for stop in between), ends]
    if any(len(a) == len(b) == 1 and a == b for a, b in pairwise(stops)):
        raise OptionError("two stopovers that follow each other lie on the same pixel; leave one out")
    _check_connected(cost, stops)
    density = np.zeros(cost.shape)
    history: list[PathIteration] = []
    lines: list[list[Floats]] = [[] for _ in starts]
    legs = list(pairwise(stops))
    for number, (here, there) in enumerate(legs):

        def report(share: float, done: int = number) -> None:
            if progress is not None:
                progress((done + share) / len(legs))

        gathered, records = _gather(cost, here, there, chosen, number + 1, report)
        density = np.maximum(density, gathered)
        history += records
        for line, points in zip(lines, _trace(gathered, cost, here, there), strict=True):
            line.append(_taut(points, cost) if chosen.taut else points)
    whole = [np.concatenate([line[0], *(part[1:] for part in line[1:])]) for line in lines]
    return PlannedPath(
        paths=tuple(Polyline(points) for points in whole),
        costs=tuple(_cost_along(points, cost) for points in whole),
        density=density.astype(np.float32),
        history=tuple(history),
    )


def path_cost(path: Polyline, ground: npt.ArrayLike) -> float:
    """A cost map integrated along a line; infinite where it crosses an obstacle."""
    return _cost_along(path.outline, _ground(ground, None))


def _ground(ground: tuple[int, int] | npt.ArrayLike, obstacles: npt.ArrayLike | None) -> Floats:
    """Cost of every pixel, infinite on obstacles."""
    cost = np.asarray(ground, np.float64)
    if cost.shape == (2,) and (cost >= 1).all() and (cost == np.rint(cost)).all():
        cost = np.ones((int(cost[0]), int(cost[1])))
    if cost.ndim != 2 or min(cost.shape) < 2:
        raise ImageError(f"the ground has shape {cost.shape}; give height and width, or an (H, W) array of at least 2 × 2 costs")
    if np.isnan(cost).any() or not (cost > 0).all():
        raise ImageError("the ground has costs that are not positive; give every pixel a cost above 0, and infinity to obstacles")
    if obstacles is None:
        return cost
    mask = np.asarray(obstacles)
    if mask.shape != cost.shape:
        raise ImageError(f"obstacles has shape {mask.shape}, the ground {cost.shape}; pass one value per pixel")
    return np.where(mask != 0, np.inf, cost)


def _pixels(points: Point | Sequence[Point], cost: Floats, name: str) -> list[tuple[int, int]]:
    """(row, column) of each point."""
    given = np.asarray(points, np.float64).reshape(-1, 2)
    found = []
    for x, y in given.tolist():
        if not (0 <= x < cost.shape[1] and 0 <= y < cost.shape[0]):
            raise OptionError(f"the {name} ({x:g}, {y:g}) lies outside the ground of {cost.shape[1]} × {cost.shape[0]} px; move it inside")
        if np.isinf(cost[int(y), int(x)]):
            raise OptionError(f"the {name} ({x:g}, {y:g}) lies on an obstacle; move it")
        found.append((int(y), int(x)))
    return found


def _check_connected(cost: Floats, stops: list[list[tuple[int, int]]]) -> None:
    label, _ = ndimage.label(np.isfinite(cost))
    reached = {int(label[point]) for point in stops[-1]}
    for point in (point for stop in stops[:-1] for point in stop):
        if int(label[point]) not in reached:
            raise PathError(f"obstacles part the point ({point[1]}, {point[0]}) from every sink; open a way at least one pixel wide")


def _gather(
    cost: Floats, sources: list[tuple[int, int]], sinks: list[tuple[int, int]], options: PathOptions, leg: int,
    report: Callable[[float], None],
) -> tuple[Floats, list[PathIteration]]:  # fmt: skip
    """The material at the end of the optimisation, and its history."""
    free = np.isfinite(cost)
    heat, convection = np.zeros(cost.shape), np.zeros(cost.shape)
    for point in sources:
        heat[point] = 1.0
    for point in sinks:
        convection[point] = _CONVECTION
    plate = Plate(heat, convection)
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
        p = 1.0 + (options.p - 1.0) * min(1.0, 1.5 * grown)
        bound = max(volume / n**2, least)  # (2.9), (2.10)
        steady = plate.solve(nominal * (_INSULATION + (1 - _INSULATION) * density**p), nodes)  # (2.6)
        nodes = steady.nodes
        sensitivity = -p * nominal * density ** (p - 1) * steady.energy  # ∂Π/∂ρ
        step = OCOptions(move=1.0 if p == 1.0 else 0.2, damping=1 / (p + 1))
        moved = oc_step(density[free], sensitivity[free], 1.0, bound, 1e-4, 1.0, step)
        density = np.zeros(cost.shape)
        density[free] = moved
        history.append(PathIteration(leg=leg, compliance=steady.compliance, mass=float(moved.sum()), bound=bound, p=p))
        report(n / total)
    return density, history


def _trace(density: Floats, cost: Floats, sources: list[tuple[int, int]], sinks: list[tuple[int, int]]) -> list[Floats]:
    """The way of least resistance through the material, from pixel centre to pixel centre."""
    free = np.isfinite(cost)
    height, width = cost.shape
    number = np.arange(height * width).reshape(height, width)
    resistance = np.where(free, 1.0 / (density + 1e-3), np.inf)
    rows, columns, weights = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        one = (slice(0, height - dy), slice(max(0, -dx), width - max(0, dx)))
        other = (slice(dy, height), slice(max(0, dx), width + min(0, dx)))
        open_ = free[one] & free[other]
        if dx and dy:  # no squeezing between two obstacles that touch at a corner
            open_ &= free[one[0], other[1]] & free[other[0], one[1]]
        rows.append(number[one][open_])
        columns.append(number[other][open_])
        weights.append((np.hypot(dy, dx) * 0.5 * (resistance[one] + resistance[other]))[open_])
    graph = csr_array((np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))), shape=(height * width,) * 2)
    _, before, _ = dijkstra(
        graph, directed=False, indices=[number[sink] for sink in sinks], return_predecessors=True, min_only=True
    )  # fmt: skip
    lines = []
    for source in sources:
        here = int(number[source])
        chain = [here]
        while before[here] >= 0:
            here = int(before[here])
            chain.append(here)
        lines.append(np.column_stack([np.array(chain) % width, np.array(chain) // width]) + 0.5)
    return lines


def _taut(points: Floats, cost: Floats) -> Floats:
    """Leave points out wherever the straight line past them costs no more than the way through them."""
    steps = np.array([_cost_along(points[at : at + 2], cost) for at in range(len(points) - 1)])
    upto = np.concatenate([[0.0], np.cumsum(steps)])
    least = np.full(len(points), np.inf)  # cost of the cheapest way to the end through some of the points
    following = np.zeros(len(points), np.int64)
    least[-1] = 0.0
    for at in range(len(points) - 2, -1, -1):
        reach = np.unique(
            np.concatenate([np.arange(at + 1, min(at + 9, len(points))), np.arange(len(points) - 1, at, -max(1, len(points) // 64))])
        )
        straight = np.array([_cost_along(points[[at, to]], cost) for to in reach])
        totals = straight + least[reach]
        best = int(totals.argmin())
        least[at], following[at] = totals[best], reach[best]
    assert least[0] <= upto[-1] + 1e-6  # noqa: S101 - single steps are among the choices
    chain = [0]
    while chain[-1] < len(points) - 1:
        chain.append(int(following[chain[-1]]))
    return points[chain]


def _cost_along(points: Floats, cost: Floats) -> float:
    """The exact integral: pixel after pixel, each with the length of the line in it."""
    total = 0.0
    for (x, y), (to_x, to_y) in pairwise(points.tolist()):
        crossings = [np.zeros(1), np.ones(1)]
        for start, end in ((x, to_x), (y, to_y)):
            low, high = sorted((start, end))
            if high > low:
                crossings.append((np.arange(np.floor(low) + 1, np.ceil(high)) - start) / (end - start))
        share = np.sort(np.concatenate(crossings))
        middle = 0.5 * (share[1:] + share[:-1])
        inside = share[1:] - share[:-1] > 1e-12  # where the line runs through a corner
        column = (x + middle[inside] * (to_x - x)).astype(np.int64)
        row = (y + middle[inside] * (to_y - y)).astype(np.int64)
        values = cost[np.minimum(row, cost.shape[0] - 1), np.minimum(column, cost.shape[1] - 1)]
        total += float(np.hypot(to_x - x, to_y - y)) * float((values * np.diff(share)[inside]).sum())
    return total
