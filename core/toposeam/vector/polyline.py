"""Lines through pixel corners, and the boundary of a label map as such lines.

Pixel (row y, column x) covers [x, x + 1] × [y, y + 1], so corners have integer coordinates and the picture is
[0, W] × [0, H], y downwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Floats, Ints, Mask
from toposeam.checks import check_range
from toposeam.display import line_svg
from toposeam.errors import OptionError, PathError, Term

#: Longest line that is followed pixel by pixel, px to the side plus px down.
_LONGEST_PX = 1e6

# Directions of travel, clockwise as seen on the screen: turning right adds one.
_EAST, _SOUTH, _WEST, _NORTH = range(4)


def check_length(outline: Floats) -> None:
    """Refuse a line, (N, 2), that is too long to be followed pixel by pixel.

    Raises
    ------
    PathError
    """
    reach = float(np.abs(np.diff(outline, axis=0)).sum())
    if not reach <= _LONGEST_PX:
        raise PathError(
            "the line goes {reach:.3g} px to the side and down; keep it within {most:g} px",
            kind="long path",
            reach=reach,
            most=_LONGEST_PX,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Polyline:
    """A line of straight segments in pixel coordinates.

    Parameters
    ----------
    points : (N, 2) array_like
        x and y in px, finite, at least two points. Kept as a read-only float64 copy.
    closed : bool
        Whether the last point is joined to the first, which then is not repeated (a repetition is dropped).

    Raises
    ------
    PathError
        For any other shape, or NaN or infinite coordinates.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> line = ts.vector.Polyline(points=np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 4.0]]))
    >>> line.length
    7.0
    """

    points: Floats
    closed: bool = False

    def __post_init__(self) -> None:
        try:
            points = np.array(self.points).astype(np.float64, casting="same_kind")
        except (TypeError, ValueError) as error:
            raise PathError(
                "{parameter} are no numbers ({reason}); a path needs an (N, 2) array",
                kind="type",
                parameter=Term("points"),
                value=self.points,
                reason=str(error),
            ) from error
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
            raise PathError(
                "{parameter} has shape {shape!s}; a path needs an (N, 2) array of at least two points",
                kind="shape",
                parameter=Term("points"),
                shape=points.shape,
            )
        if not np.isfinite(points).all():
            raise PathError(
                "{parameter} has NaN or infinite coordinates; give every point of the path a finite x and y",
                kind="number",
                parameter=Term("points"),
            )
        if not isinstance(self.closed, bool | np.bool_):
            raise PathError(
                "{parameter} is of type {type}; pass {allowed}",
                kind="type",
                parameter=Term("closed"),
                value=self.closed,
                type=type(self.closed).__name__,
                allowed="True or False",
            )
        if self.closed and len(points) > 2 and (points[0] == points[-1]).all():
            points = points[:-1].copy()
        points.setflags(write=False)
        object.__setattr__(self, "points", points)

    def __repr__(self) -> str:
        return f"Polyline({len(self.points)} points, {'closed' if self.closed else 'open'})"

    def _repr_svg_(self) -> str:
        along = " ".join(f"{x:g},{y:g}" for x, y in self.points.tolist())
        return line_svg(f"M {along}{' Z' if self.closed else ''}", self.points)

    @property
    def outline(self) -> Floats:
        """The points in the order of travel, (N, 2); of a closed path (N + 1, 2), back to the first one."""
        return np.concatenate([self.points, self.points[:1]]) if self.closed else self.points

    @property
    def length(self) -> float:
        """Length in px."""
        return float(np.hypot(*np.diff(self.outline, axis=0).T).sum())

    def simplified(self, tolerance: float) -> Polyline:
        """Simplify the line to fewer points (Douglas and Peucker 1973, doi:10.3138/FM57-6770-U75U-7727).

        Parameters
        ----------
        tolerance : float
            Largest distance of a point left out from the new line, px.

        Returns
        -------
        Polyline
            A subset of the points, with both ends; of a closed line at least three.

        Examples
        --------
        >>> Polyline([[0, 0], [1, 0], [1, 1], [2, 1], [2, 2]]).simplified(0.75).points.tolist()
        [[0.0, 0.0], [2.0, 2.0]]
        """
        check_range(0, tolerance=tolerance)
        if len(self.points) < 3:
            return self
        from skimage.measure import approximate_polygon

        points = approximate_polygon(self.outline, tolerance)  # type: ignore[no-untyped-call]
        return self if self.closed and len(points) < 4 else Polyline(points, self.closed)


def trace_boundary(labels: Mask, valid: Mask) -> list[Polyline]:
    """Trace the boundary between label True and label False, along the interfaces of valid pixels.

    Parameters
    ----------
    labels : (H, W) bool array
    valid : (H, W) bool array
        An interface counts only where both its pixels are valid.

    Returns
    -------
    list of Polyline
        Turning points and ends only, True on the right of travel. Open paths come first, then closed ones,
        each kind in raster order of its first point; a closed path starts at its first corner in raster
        order. Where two True pixels meet diagonally both paths turn right: they touch and do not cross, and
        the True pixels stay apart.

    Raises
    ------
    OptionError
        When the two arrays are not two-dimensional and of one shape.
    """
    labels, valid = np.asarray(labels, bool), np.asarray(valid, bool)
    if labels.ndim != 2 or labels.shape != valid.shape:
        raise OptionError(
            "labels has shape {labels!s} and valid {valid!s}; pass two (H, W) arrays of one shape",
            kind="shape",
            labels=labels.shape,
            valid=valid.shape,
        )
    tail, head, direction = _boundary_edges(labels, valid)
    if not len(tail):
        return []
    chain, begin, closed = _chains(_successors(tail, head, direction))
    last = np.append(begin[1:], len(chain)) - 1
    before = np.roll(chain, 1)
    before[begin] = chain[last]
    turns = direction[chain] != direction[before]
    turns[begin] |= ~closed
    corners = tail[chain]
    width = labels.shape[1] + 1
    points = np.column_stack([corners % width, corners // width])[turns]
    ends = head[chain[last]]
    ends = np.column_stack([ends % width, ends // width])
    polylines = []
    for line, end, is_closed in zip(
        np.split(points, np.cumsum(turns)[begin[1:] - 1]), ends, closed.tolist(), strict=True
    ):
        polylines.append(Polyline(line if is_closed else np.concatenate([line, [end]]), is_closed))
    return polylines


def _boundary_edges(labels: Mask, valid: Mask) -> tuple[Ints, Ints, Ints]:
    """List the boundary's unit edges: the corners they leave and reach, and their directions.

    Corners are flat indices, W + 1 to a row. Edges are sorted by the corner they leave, then by direction.
    """
    width = labels.shape[1]
    flat_labels, flat_valid = labels.ravel(), valid.ravel()
    edges = []
    for axis, ahead, back in ((1, _NORTH, _SOUTH), (0, _EAST, _WEST)):
        step = 1 if axis else width
        differ = labels[:, 1:] != labels[:, :-1] if axis else labels[1:] != labels[:-1]
        index = np.flatnonzero(differ)
        row, column = np.divmod(index, max(width - axis, 1))
        second = (row if axis else row + 1) * width + column + axis
        seam = flat_valid[second] & flat_valid[second - step]
        row, column, second = row[seam], column[seam], second[seam]
        # True in the second pixel (right of a vertical interface, below a horizontal one) must lie on the
        # right of travel.
        direction = np.where(flat_labels[second], ahead, back)
        upper_left = (row * (width + 1) + column + 1) if axis else ((row + 1) * (width + 1) + column)
        lower_right = upper_left + (width + 1 if axis else 1)
        forward = (direction == _SOUTH) | (direction == _EAST)
        edges.append(
            (
                np.where(forward, upper_left, lower_right),
                np.where(forward, lower_right, upper_left),
                direction,
            )
        )
    tail, head, direction = (np.concatenate(parts).astype(np.int64) for parts in zip(*edges, strict=True))
    order = np.argsort(tail * 4 + direction)
    return tail[order], head[order], direction[order]


def _successors(tail: Ints, head: Ints, direction: Ints) -> Ints:
    """Find the edge that follows each edge, -1 at an end.

    Round a corner arriving and leaving edges alternate, so no path can cross another.
    """
    key = tail * 4 + direction
    following = np.full(len(tail), -1, np.int64)
    for turn in (3, 0, 1):  # left, straight on, right: the last one found wins
        wanted = head * 4 + (direction + turn) % 4
        place = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        following = np.where(key[place] == wanted, place, following)
    return following


def _chains(following: Ints) -> tuple[Ints, Ints, Mask]:
    """Order edges along their paths; returns them, the beginning of each path, and whether it is closed."""
    after = following.tolist()
    has_previous = np.zeros(len(after), bool)
    has_previous[following[following >= 0]] = True
    open_starts = np.flatnonzero(~has_previous).tolist()
    chain: list[int] = []
    begin: list[int] = []
    visited = bytearray(len(after))
    for start in (*open_starts, *range(len(after))):
        if visited[start]:
            continue
        begin.append(len(chain))
        edge = start
        while edge >= 0 and not visited[edge]:
            visited[edge] = 1
            chain.append(edge)
            edge = after[edge]
    return np.array(chain, np.int64), np.array(begin, np.int64), np.arange(len(begin)) >= len(open_starts)
