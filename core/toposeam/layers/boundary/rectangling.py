"""Bend a canvas a little, so that the border of what shows on it comes nearer to a rectangle.

The displacement is a uniform cubic B-spline on square cells, and the sum of these is made small:

- the distance of each Jacobian to the nearest one that stretches and turns within bounds (local steps);
- of points of straight lines to the nearest line, which turns within bounds, too;
- of border points to the sides of the rectangle, with forces that are capped, so that bounds win;
- second differences.

Local steps and one linear system take turns, whose matrix is factorised once (as projective dynamics do).
He, Chang and Sun, "Rectangling panoramic images via warping" (SIGGRAPH 2013), reach the rectangle always,
since nothing bounds them.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import linalg

from toposeam.arrays import Floats, Mask
from toposeam.layers.boundary.ground import BorderGround
from toposeam.layers.canvas.layer import Box

#: Cells along the longer side.
_CELLS = 32
#: Over-relaxation of the rounds: as good as twice as many.
_OVER = 1.8
#: Largest logarithm of a singular value, where there is texture and where it is plain.
_STRETCH, _PLAIN_STRETCH = 0.066, 0.14
#: Greatest turn, degrees: anywhere, of lines, and of lines within so many degrees of an axis.
_TURN, _AXIS_TURN, _NEAR_AXIS = 1.2, 1.0, 14.0
#: Weights: of a Jacobian with bounds, of one with the identity, where nothing shows; of a border point; of a
#: point of a line, and of one near an axis.
_BOUND, _STILL, _NOWHERE, _PULL, _LINE, _AXIS = 20.0, 0.5, 0.02, 1.0, 14.0, 50.0
#: Largest force on a border point, in cells; farthest border that is pulled, as a share of the shorter side.
_FORCE, _REACH = 0.35, 0.16

#: Border points x, y, the side that they are to reach, and whether it is the lower one (1) or the upper (-1).
_Pull: TypeAlias = tuple[Floats, float, int]


class Rectangling:
    """The displacement of a canvas on a grid of cells, and what acts on it."""

    def __init__(self, cover: Mask, ground: BorderGround, *, goes_round: bool) -> None:
        height, width = cover.shape
        self.goes_round, self.cover = goes_round, cover
        longer = max(height, width)
        cells = max(4, round(_CELLS * width / longer))
        #: Side of a cell, px.
        self.cell = width / cells * (1 + 1e-9) if goes_round else longer / _CELLS
        self._cells = -(-height // self.cell), cells if goes_round else -(-width // self.cell)
        rows, columns = (int(count) for count in self._cells)
        self.shape = rows + 3, columns + (0 if goes_round else 3)
        y, x = (np.arange(0.25, count, 0.5) * self.cell for count in (rows, columns))
        y, x = y[y < height], x[x < width]
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        self._right, self._down = self._values(points, (1, 0)), self._values(points, (0, 1))
        near = np.rint(points).astype(np.intp)
        near = np.minimum(near, np.array([width, height]) - 1)
        radius = max(1, round(self.cell / 2))
        shown, busy = (
            ndimage.maximum_filter(each, 2 * radius + 1)[near[:, 1], near[:, 0]]
            for each in (cover.astype(np.float32), ground.texture * cover)
        )
        self._weight = self.cell**2 * np.where(shown > 0, _BOUND + _STILL, _NOWHERE)
        self._share = np.where(shown > 0, _BOUND / (_BOUND + _STILL), 1.0)
        self._bound = np.where(busy > 0.1, _STRETCH, _PLAIN_STRETCH)
        self._lines(ground.lines)
        self._weighted = [(each.T * self._weight).tocsr() for each in (self._right, self._down)]
        self._at_lines = (self._at_points.T * self._stiff).tocsr()
        base = self._weighted[0] @ self._right + self._weighted[1] @ self._down
        base = base + self._at_lines @ self._at_points + self._smooth()
        self._base = base + 1e-6 * sparse.eye_array(base.shape[0])

    def _lines(self, lines: Floats) -> None:
        """Take points of straight lines."""
        way = lines[:, 2:] - lines[:, :2]
        count = np.maximum(3, (2 * np.hypot(*way.T) / self.cell).astype(int) + 1)
        owner = np.repeat(np.arange(len(lines)), count)
        share = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)) / (count[owner] - 1)
        self._points, self._owner = lines[owner, :2] + share[:, None] * way[owner], owner
        self._angle = np.arctan2(way[:, 1], way[:, 0])
        off = np.abs((self._angle + np.pi / 4) % (np.pi / 2) - np.pi / 4)
        near = off < np.radians(_NEAR_AXIS)
        self._turn = np.radians(np.where(near, _AXIS_TURN, _TURN))
        self._stiff = np.where(near, _AXIS, _LINE)[owner]
        self._at_points = self._values(self._points)

    def _values(self, points: Floats, derivative: tuple[int, int] = (0, 0)) -> sparse.csr_array:
        """Return the matrix from coefficients to displacements at points x, y, or to their derivatives."""
        where, weights = [], []
        for axis in (0, 1):
            cells = int(self._cells[1 - axis])
            at = np.clip(points[:, axis] / self.cell, 0, cells - 1e-9)
            base = at.astype(np.intp)
            weights.append(_spline(at - base, derivative[axis]) / self.cell ** derivative[axis])
            column = base[:, None] + np.arange(4)
            where.append((column - 1) % cells if self.goes_round and axis == 0 else column)
        columns = where[1][:, :, None] * self.shape[1] + where[0][:, None, :]
        values = weights[1][:, :, None] * weights[0][:, None, :]
        ends = np.arange(0, 16 * len(points) + 1, 16)
        shape = len(points), self.shape[0] * self.shape[1]
        return sparse.csr_array((values.ravel(), columns.ravel(), ends), shape=shape)

    def solve(self, box: Box, rounds: int, start: Floats | None = None) -> Floats:
        """Find the displacement with which the border comes near a box as far as bounds allow.

        Parameters
        ----------
        box : Box
        rounds : int
            Of local steps; after 40 from nothing they end.
        start : (rows, columns, 2) float array, optional
            The displacement found for a box near this one.

        Returns
        -------
        (rows, columns, 2) float array
            Coefficients of a :class:`toposeam.layers.canvas.MeshTransform` on these cells, px.
        """
        axes = (1,) if self.goes_round else (0, 1)
        pulls = {axis: _pulls(self.cover, box, self.cell / 2, axis, self.goes_round) for axis in axes}
        at_border = {axis: [self._values(points) for points, _, _ in pulls[axis]] for axis in axes}
        weighted, lines, base = self._weighted, self._at_lines, self._base
        solvers = {
            axis: linalg.splu(
                (base + sum(_PULL * one.T @ one for one in at_border[axis])).tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0,
                options={"SymmetricMode": True},
            )
            for axis in axes
        }
        found = np.zeros((base.shape[0], 2))
        if start is not None:
            found = start[:, 1:-2] if self.goes_round else start
            found = found.reshape(-1, 2)
        for _ in range(rounds):
            goal = self._near_bounds(self._right @ found, self._down @ found)
            straight = self._straight(self._points + self._at_points @ found) - self._points
            new = np.zeros_like(found)
            for axis in axes:
                right = weighted[0] @ goal[0][:, axis] + weighted[1] @ goal[1][:, axis]
                right += lines @ straight[:, axis]
                for (points, side, sign), rows in zip(pulls[axis], at_border[axis], strict=True):
                    moved = rows @ found[:, axis]
                    force = np.clip(sign * (points[:, axis] + moved - side), 0, _FORCE * self.cell)
                    right += _PULL * (rows.T @ (moved - sign * force))
                new[:, axis] = solvers[axis].solve(right)
            found = found + _OVER * (new - found)
        found = found.reshape(*self.shape, 2)
        if self.goes_round:
            found = found[:, np.arange(-1, self.shape[1] + 2) % self.shape[1]]
        return found

    def _smooth(self) -> sparse.csr_array:
        """Return the sum of squares of second differences."""
        one = []
        for axis, count in enumerate(self.shape):
            difference = sparse.diags_array(
                [np.full(count, value) for value in (1.0, -2.0, 1.0)],
                offsets=[-1, 0, 1],
                shape=(count, count),
            )
            inner = difference.tocsr()[1:-1]
            if axis == 1 and self.goes_round:
                inner = difference.tolil()
                inner[0, -1] = inner[-1, 0] = 1
                inner = inner.tocsr()
            one.append(inner.T @ inner)
        still = [sparse.eye_array(count) for count in self.shape]
        return (sparse.kron(one[0], still[1]) + sparse.kron(still[0], one[1])).tocsr()

    def _near_bounds(self, right: Floats, down: Floats) -> tuple[Floats, Floats]:
        """Return the derivatives nearest to given ones whose Jacobians stretch and turn within bounds."""
        a, d = right[:, 0] + 1, down[:, 1] + 1
        b, c = down[:, 0], right[:, 1]
        # [[a, b], [c, d]] is a turn by `turn`, enlarged by q, plus a reflection enlarged by r: its singular
        # values are q + r and q - r.
        q, r = np.hypot(a + d, c - b) / 2, np.hypot(a - d, c + b) / 2
        turn, mirror = np.arctan2(c - b, a + d), np.arctan2(c + b, a - d)
        large, small = (np.clip(each, np.exp(-self._bound), np.exp(self._bound)) for each in (q + r, q - r))
        q, r = (large + small) / 2, (large - small) / 2
        bounded = np.clip(turn, -np.radians(_TURN), np.radians(_TURN))
        mirror = mirror + bounded - turn
        cos, sin = q * np.cos(bounded), q * np.sin(bounded)
        across, along = r * np.cos(mirror), r * np.sin(mirror)
        share = self._share[:, None]
        return (
            share * np.stack([cos + across - 1, sin + along], axis=1),
            share * np.stack([along - sin, cos - across - 1], axis=1),
        )

    def _straight(self, points: Floats) -> Floats:
        """Return the points nearest to moved ones that lie on lines, turned within bounds."""
        owner, count = self._owner, np.maximum(np.bincount(self._owner, minlength=len(self._angle)), 1)
        middle = np.stack([np.bincount(owner, one, len(count)) / count for one in points.T], axis=1)
        x, y = (points - middle[owner]).T
        xx, yy, xy = (np.bincount(owner, each, len(count)) for each in (x * x, y * y, x * y))
        turn = (0.5 * np.arctan2(2 * xy, xx - yy) - self._angle + np.pi / 2) % np.pi - np.pi / 2
        angle = (self._angle + np.clip(turn, -self._turn, self._turn))[owner]
        along = x * np.cos(angle) + y * np.sin(angle)
        return np.asarray(middle[owner] + np.stack([along * np.cos(angle), along * np.sin(angle)], axis=1))


def _pulls(cover: Mask, box: Box, step: float, axis: int, goes_round: bool) -> list[_Pull]:
    """Find border points inside a box that are to move along an axis (0: x) to its sides."""
    inside = cover[box.slices] if axis == 0 else cover[box.slices].T
    lines, length = inside.shape
    chosen = np.unique(np.linspace(0, lines - 1, int(lines / step) + 2).astype(np.intp))
    shows = np.asarray(inside.any(axis=1))
    ends = [inside.argmax(axis=0), lines - 1 - inside[::-1].argmax(axis=0)]
    found: list[_Pull] = []
    for sign, edge in ((1, inside.argmax(axis=1)), (-1, length - 1 - inside[:, ::-1].argmax(axis=1))):
        side = 0 if sign == 1 else length - 1
        at = edge[chosen]
        gap = np.abs(at - side)
        # What the other axis closes sooner is left to it.
        aside = np.where(
            ends[0][at] >= chosen, chosen, np.where(ends[1][at] <= chosen, lines - 1 - chosen, np.inf)
        )
        use = shows[chosen] & (gap < _REACH * min(cover.shape)) & (goes_round | (gap <= aside + 1))
        along, across = (box.left, box.top) if axis == 0 else (box.top, box.left)
        points = np.stack([at + along, chosen + across][:: 1 if axis == 0 else -1], axis=1)[use]
        found.append((points.astype(float), float(side + along), sign))
    return found


def _spline(t: Floats, derivative: int) -> Floats:
    """Return the (N, 4) weights of a uniform cubic B-spline, or of its derivative, at shares of a cell."""
    if derivative:
        return np.stack([-((1 - t) ** 2), 3 * t**2 - 4 * t, -3 * t**2 + 2 * t + 1, t**2], axis=1) / 2
    return (
        np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6
    )
