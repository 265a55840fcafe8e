"""Ways round obstacles and over terrain, planned by heat (thesis 2.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Unpack

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats
from toposeam.checks import check_function, check_kind, check_numbers, options_from
from toposeam.errors import ImageError, OptionError, PathError, Term
from toposeam.heat.threads import one_thread
from toposeam.path.gather import PathIteration, PathKeywords, PathOptions
from toposeam.path.levels import plan_coarse_to_fine
from toposeam.path.trace import cost_along, pull_taut
from toposeam.saving import save
from toposeam.sentence import counted
from toposeam.vector.polyline import Polyline, check_length
from toposeam.vector.svg import write_svg

Point = tuple[float, float]

#: Largest ground, px: larger plates do not fit into the memory of usual machines.
MAX_PIXELS = 4_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PlannedPath:
    """Ways from every source to a sink.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> way = ts.path((16, 24), (2, 8), (21, 8))
    >>> 18 < way.length < 21
    True
    """

    #: One line per source, from it to the sink that its heat reaches, px. The pixel in row y and column x
    #: covers [x, x + 1] × [y, y + 1].
    paths: tuple[Polyline, ...]
    #: Cost of each line: the integral of the cost map along it; on an even ground its length.
    costs: tuple[float, ...]
    #: (H, W) material in [0, 1]; of several legs the maximum.
    density: npt.NDArray[np.float32]
    #: The iterations of all legs.
    history: tuple[PathIteration, ...]

    @property
    def length(self) -> float:
        """Length of all ways in px."""
        return sum(path.length for path in self.paths)

    @property
    def cost(self) -> float:
        """Cost of all ways."""
        return sum(self.costs)

    def __array__(
        self, dtype: npt.DTypeLike | None = None, copy: bool | None = None
    ) -> npt.NDArray[np.float32]:
        """Return the density, for NumPy and matplotlib."""
        return np.array(self.density, dtype, copy=copy)

    def to_svg(self, path: str | Path | None = None) -> str:
        """Return the ways as an SVG document of the ground's size in px, and write it if a path is given.

        Parameters
        ----------
        path : str or Path, optional
            Written whole or not at all.

        Returns
        -------
        str

        Raises
        ------
        OSError
        """
        height, width = self.density.shape
        names = [f"way {number}" for number in range(1, len(self.paths) + 1)]
        document = write_svg(self.paths, width, height, {"costs": self.costs}, names)
        if path is not None:
            save(path, document)
        return document

    def __repr__(self) -> str:
        height, width = self.density.shape
        ways = counted(len(self.paths), "way")
        return f"PlannedPath({ways} of {self.length:.1f} px on {width} × {height}, cost {self.cost:.4g})"

    def _repr_svg_(self) -> str:
        return self.to_svg()


def path(
    ground: tuple[int, int] | npt.ArrayLike,
    sources: Point | Sequence[Point],
    sinks: Point | Sequence[Point],
    *,
    obstacles: npt.ArrayLike | None = None,
    stopovers: Sequence[Point] = (),
    options: PathOptions | None = None,
    progress: Callable[[float], None] | None = None,
    **given: Unpack[PathKeywords],
) -> PlannedPath:
    """Plan ways from sources to sinks: optimise the material that conducts heat, and trace it.

    Parameters
    ----------
    ground : (int, int) or (H, W) array_like
        Height and width of an even ground, or the cost of a step of 1 px at every pixel: positive, infinite
        on obstacles.
    sources, sinks : (x, y) or sequence of (x, y)
        Starts and ends of the ways, px. With several of both, each source is connected to the sink that is
        best for all together.
    obstacles : (H, W) bool array_like, optional
        True on obstacles.
    stopovers : sequence of (x, y)
        Points to be visited in this order, between one source and one sink. Each is the sink of one leg and
        the source of the next.
    options : PathOptions, optional
    progress : callable, optional
        Called with the share done, in [0, 1].
    **given
        The options as plain keywords instead.

    Returns
    -------
    PlannedPath

    Raises
    ------
    OptionError
        For points outside the ground, on an obstacle, missing or coinciding, or stopovers with several
        sources or sinks.
    ImageError
        For a ground or obstacles of the wrong shape, or costs that are not positive.
    PathError
        When obstacles separate a source from every sink.

    Examples
    --------
    >>> import toposeam as ts
    >>> import numpy as np
    >>> import toposeam as ts
    >>> wall = np.zeros((20, 30), bool)
    >>> wall[5:, 14:16] = True
    >>> ts.path((20, 30), (4, 15), (26, 15), obstacles=wall)
    PlannedPath(1 way of 31.4 px on 30 × 20, cost 31.42)
    """
    check_function("progress", progress)
    chosen = options_from(PathOptions, options, given, "a path")
    cost = _ground(ground, obstacles)
    starts, ends, between = (
        _pixels(points, cost, name)
        for points, name in ((sources, "source"), (sinks, "sink"), (stopovers, "stopover"))
    )
    for name, found in (("source", starts), ("sink", ends)):
        if not found:
            raise OptionError(
                "there is no {point}; give at least one point",
                kind="count",
                parameter=Term(f"{name}s"),
                point=name,
                count=0,
            )
    if set(starts) & set(ends):
        raise OptionError(
            "a source and a sink lie on the same pixel; move one of them",
            kind="same place",
            parameter=Term("sinks"),
            value=sinks,
        )
    if between and (len(starts) > 1 or len(ends) > 1):
        raise OptionError(
            "stopovers lie between one source and one sink, not {sources} and {sinks}; plan those ways one "
            "by one",
            kind="conflict",
            parameter=Term("stopovers"),
            value=stopovers,
            sources=len(starts),
            sinks=len(ends),
        )
    stops = [starts, *([stop] for stop in between), ends]
    if any(len(a) == len(b) == 1 and a == b for a, b in pairwise(stops)):
        raise OptionError(
            "two stopovers that follow each other lie on the same pixel; leave one out",
            kind="same place",
            parameter=Term("stopovers"),
            value=stopovers,
        )
    _check_connected(cost, stops)
    density = np.zeros(cost.shape)
    history: list[PathIteration] = []
    lines: list[list[Floats]] = [[] for _ in starts]
    legs = list(pairwise(stops))
    for number, (here, there) in enumerate(legs):

        def report(share: float, done: int = number) -> None:
            if progress is not None:
                progress((done + share) / len(legs))

        with one_thread():
            gathered, records, traced = plan_coarse_to_fine(cost, here, there, chosen, number + 1, report)
        density = np.maximum(density, gathered)
        history += records
        for line, points in zip(lines, traced, strict=True):
            line.append(pull_taut(points, cost) if chosen.taut else points)
    whole = [np.concatenate([line[0], *(part[1:] for part in line[1:])]) for line in lines]
    return PlannedPath(
        paths=tuple(Polyline(points) for points in whole),
        costs=tuple(cost_along(points, cost) for points in whole),
        density=density.astype(np.float32),
        history=tuple(history),
    )


def path_cost(path: Polyline, ground: npt.ArrayLike) -> float:
    """Integrate a cost map along a line; infinite if the line crosses an obstacle.

    Parameters
    ----------
    path : Polyline
    ground : (H, W) array_like
        As in :func:`path`.

    Returns
    -------
    float

    Raises
    ------
    ImageError, OptionError
    PathError
        If the line is too long to be followed pixel by pixel.

    Examples
    --------
    >>> path_cost(Polyline(np.array([[0.5, 0.5], [3.5, 0.5]])), np.full((2, 4), 2.0))
    6.0
    """
    check_kind("path", path, Polyline, "a Polyline")
    check_length(path.outline)
    return cost_along(path.outline, _ground(ground, None))


def _ground(ground: tuple[int, int] | npt.ArrayLike, obstacles: npt.ArrayLike | None) -> Floats:
    """Return the (H, W) cost of every pixel, infinite on obstacles."""
    cost = check_numbers("ground", ground)
    if cost.shape == (2,) and (cost >= 1).all() and (cost == np.rint(cost)).all():
        if cost[0] * cost[1] > MAX_PIXELS:
            raise OptionError(
                "a ground of {width:g} × {height:g} px is too large; give at most {most:g} megapixels, with "
                "coarser pixels",
                kind="too large",
                parameter=Term("ground"),
                width=float(cost[1]),
                height=float(cost[0]),
                most=MAX_PIXELS / 1e6,
            )
        cost = np.ones((int(cost[0]), int(cost[1])))
    if cost.ndim != 2 or min(cost.shape) < 2:
        raise ImageError(
            "the ground has shape {shape!s}; give {allowed}",
            kind="shape",
            parameter=Term("ground"),
            shape=cost.shape,
            allowed="height and width, or an (H, W) array of at least 2 × 2 costs",
        )
    if np.isnan(cost).any() or not (cost > 0).all():
        raise ImageError(
            "the ground has costs that are not positive; give every pixel a cost above 0, and infinity to "
            "obstacles",
            kind="number",
            parameter=Term("ground"),
        )
    if obstacles is None:
        return cost
    mask = check_numbers("obstacles", obstacles)
    if mask.shape != cost.shape:
        raise ImageError(
            "{parameter} has shape {shape!s}, the ground {wanted!s}; pass one value per pixel",
            kind="shape",
            parameter=Term("obstacles"),
            shape=mask.shape,
            wanted=cost.shape,
        )
    return np.where(mask != 0, np.inf, cost)


def _pixels(points: Point | Sequence[Point], cost: Floats, name: str) -> list[tuple[int, int]]:
    """Return the pixel (row, column) of each point."""
    parameter = Term(f"{name}s", name)
    given = check_numbers(parameter, points)
    if given.size % 2 or given.ndim not in (1, 2) or given.shape[-1] not in (0, 2):
        raise OptionError(
            "the {point} is of shape {shape!s}; give each point its x and y",
            kind="shape",
            parameter=parameter,
            value=points,
            point=name,
            shape=given.shape,
        )
    given = given.reshape(-1, 2)
    found = []
    for x, y in given.tolist():
        if not (0 <= x < cost.shape[1] and 0 <= y < cost.shape[0]):
            raise OptionError(
                "the {point} ({x:g}, {y:g}) lies outside the ground of {width} × {height} px; move it inside",
                kind="outside",
                parameter=parameter,
                value=(x, y),
                point=name,
                x=x,
                y=y,
                width=cost.shape[1],
                height=cost.shape[0],
            )
        if np.isinf(cost[int(y), int(x)]):
            raise OptionError(
                "the {point} ({x:g}, {y:g}) lies on an obstacle; move it",
                kind="on obstacle",
                parameter=parameter,
                value=(x, y),
                point=name,
                x=x,
                y=y,
            )
        found.append((int(y), int(x)))
    return found


def _check_connected(cost: Floats, stops: list[list[tuple[int, int]]]) -> None:
    label, _ = ndimage.label(np.isfinite(cost))
    reached = {int(label[point]) for point in stops[-1]}
    for point in (point for stop in stops[:-1] for point in stop):
        if int(label[point]) not in reached:
            raise PathError(
                "obstacles part the point ({x}, {y}) from every sink; open a way at least one pixel wide",
                kind="no way",
                x=point[1],
                y=point[0],
            )


#: The former name of :func:`path`.
plan_path = path
