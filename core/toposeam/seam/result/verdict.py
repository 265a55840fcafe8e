"""Verdicts: how likely a seam is to be seen, and where. For people, and for scripts that make many joins.

Along the seam the costs of the law "natural" (:mod:`toposeam.seam.problem.natural`) are averaged over squares
of 16 px. Of a mean cost c per interface, which is V² of one pixel plus V² of the other, the likeness is::

    1 / (1 + c / 18)

1 where both pictures show the same, ½ where each of the two pixels differs by three times the just
noticeable, near 0 where something is cut in two.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

#: Side of the squares over which costs are averaged, px.
SQUARE_PX = 16
#: Mean cost per interface at which the likeness is one half.
HALF_COST = 18.0
#: Share of a seam's interfaces that are its worst part.
_WORST_SHARE = 0.1
#: Least likeness of the worst part of a seam that counts as not to be seen.
UNSEEN = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """The likeness of two pictures along a seam.

    Examples
    --------
    >>> str(Verdict(mean=0.97, worst=0.91, where=(12, 40))), str(Verdict(mean=0.8, worst=0.2, where=(12, 40)))
    ('not to be seen', 'look at 12,40')
    """

    #: Mean likeness of all interfaces, in [0, 1]; 1 where no seam is.
    mean: float
    #: That of the worst tenth.
    worst: float
    #: (x, y) on the canvas, px: the middle of the worst square.
    where: tuple[int, int] | None
    #: (K, 4): x, y, likeness and number of interfaces of each square.
    _squares: npt.NDArray[np.float64] | None = field(default=None, repr=False, compare=False)

    @property
    def unseen(self) -> bool:
        """True if even the worst tenth of the seam is unlikely to be noticed."""
        return self.worst >= UNSEEN

    def inside(self, box: tuple[int, int, int, int] | None) -> Verdict:
        """Judge the part of the seam inside a crop of the canvas, with places counted from its corner.

        Parameters
        ----------
        box : (int, int, int, int), optional
            left, top, width and height, px; by default the verdict stays.
        """
        if box is None or self._squares is None:
            return self
        left, top, width, height = box
        squares = self._squares - np.array([left, top, 0, 0])
        x, y = squares[:, 0], squares[:, 1]
        return _of_squares(squares[(x >= 0) & (y >= 0) & (x < width) & (y < height)])

    def __str__(self) -> str:
        if self.unseen or self.where is None:
            return "not to be seen"
        return f"look at {self.where[0]},{self.where[1]}"

    def summary(self) -> dict[str, Any]:
        """Return the verdict as in JSON: likeness, worst_likeness, look_at."""
        return {
            "likeness": round(self.mean, 4),
            "worst_likeness": round(self.worst, 4),
            "look_at": None if self.unseen or self.where is None else list(self.where),
        }


def verdict_of(
    cost: npt.NDArray[np.floating[Any]], x: npt.NDArray[np.integer[Any]], y: npt.NDArray[np.integer[Any]]
) -> Verdict:
    """Judge a seam by the cost of each of its interfaces, by the law "natural".

    Parameters
    ----------
    cost : (n,) float array
    x, y : (n,) int arrays
        Where the interfaces lie on the canvas, px.

    Returns
    -------
    Verdict
    """
    if not len(cost):
        return Verdict(mean=1.0, worst=1.0, where=None)
    _, square = np.unique(np.stack([y // SQUARE_PX, x // SQUARE_PX]), axis=1, return_inverse=True)
    square = square.ravel()
    count = np.bincount(square)
    likeness = 1 / (1 + np.bincount(square, cost) / count / HALF_COST)
    means = (np.bincount(square, along) / count for along in (x, y))
    return _of_squares(np.stack([*means, likeness, count], axis=1))


def _of_squares(squares: npt.NDArray[np.float64]) -> Verdict:
    """Judge a seam by its (K, 4) squares: x, y, likeness, number of interfaces."""
    if not len(squares):
        return Verdict(mean=1.0, worst=1.0, where=None)
    likeness, count = squares[:, 2], squares[:, 3]
    order = np.argsort(likeness)
    share = np.cumsum(count[order]) / count.sum()
    worst = order[: int(np.searchsorted(share, _WORST_SHARE)) + 1]
    return Verdict(
        mean=float(np.average(likeness, weights=count)),
        worst=float(np.average(likeness[worst], weights=count[worst])),
        where=(round(squares[order[0], 0]), round(squares[order[0], 1])),
        _squares=squares,
    )


def worst_of(verdicts: Iterable[Verdict | None]) -> Verdict | None:
    """Choose the verdict with the least likeness of a worst part; None where one is missing, or all are."""
    found = list(verdicts)
    known = [verdict for verdict in found if verdict is not None]
    return min(known, key=lambda verdict: verdict.worst) if known and len(known) == len(found) else None
