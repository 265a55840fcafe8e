r"""Lines that an eye would find where cells meet, measured.

*Measured.* A line across a pattern is a row whose mean differs from that of the rows round it,
:math:`c(y) = |m(y) - (m(y - r) + m(y + r)) / 2|` with r three hundredths of the cell. Between two rows the
larger of theirs counts. What that is on borders, divided by its 95th percentile on all other lines, is 1 or
less where a border is no more conspicuous than the inside; of borders that are nothing special one in twenty
is above.

Ink wash that changes from one motif to the next would show the border, even if the rows are alike: where
motifs share a border, it goes over into the mean of all towards it. Strokes do not: the mean of strokes is
gray, and a crisp edge makes gaps of that.

*Taken off* a line is in the optimisation, see :mod:`toposeam.motif.symmetry.mirrors`, and what is left of it
after, :mod:`toposeam.motif.border_smoothing`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.checks import check_pair
from toposeam.colours import LUMA
from toposeam.errors import ImageError, Term
from toposeam.images import as_float

#: r, as a share of the cell's side, and in px at least.
_REACH, _LEAST_PX = 0.03, 2
#: Powers that a row may be raised to.
_POWERS = (0.6, 4.0)
#: From this depth inside on, wholly from this much further, densities may change for the sake of the mass;
#: as shares of the cell's side.
_INSIDE, _FULLY = 0.08, 0.07
#: Over this share of the cell's side wash fades into the mean of all, the latter if strokes lie beside it.
FADE, BESIDE_STROKES = 0.07, 0.2


def border_visibility(pattern: npt.ArrayLike, cell: tuple[int, int]) -> float:
    """Compute the visibility of the borders between a pattern's cells.

    Parameters
    ----------
    pattern : (H, W) or (H, W, 3) array_like
        Whole cells, at least one each way; it is taken to go on by translation.
    cell : (rows, columns)
        Of one cell, px.

    Returns
    -------
    float
        About 1 or less where they cannot be told from lines inside, see the module's text. The larger of both
        directions.

    Raises
    ------
    ImageError

    Examples
    --------
    >>> field = np.random.default_rng(0).random((64, 64))
    >>> field[::32] += 1
    >>> border_visibility(field, (32, 32)) > 2
    True
    """
    values = as_float(pattern)
    rows, columns = check_pair("cell", cell, 8)
    if values.shape[0] % rows or values.shape[1] % columns:
        raise ImageError(
            "the pattern has {height} × {width} px, which is no whole number of cells of {rows} × {columns}; "
            "give whole cells",
            kind="shape",
            parameter=Term("cell"),
            value=cell,
            height=values.shape[0],
            width=values.shape[1],
            rows=rows,
            columns=columns,
        )
    luminance = values[..., 0] if values.shape[2] < 3 else values[..., :3] @ LUMA
    return max(line_visibility(luminance, rows), line_visibility(luminance.T, columns))


def reach_of(side: int) -> int:
    """Compute the distance from a line of the rows it is compared with, px, for a cell of that side."""
    return max(_LEAST_PX, round(_REACH * side))


def line_visibility(values: npt.NDArray[np.floating], side: int) -> float:
    """Compute `border_visibility` of the borders between rows of cells only, (H, W) brightness."""
    mean = values.mean(axis=1, dtype=np.float64)
    reach = reach_of(side)
    contrast = np.abs(mean - (np.roll(mean, reach) + np.roll(mean, -reach)) / 2)
    line = np.maximum(contrast, np.roll(contrast, 1))  # between row y - 1 and row y
    border = np.arange(len(line)) % side == 0
    inside = float(np.percentile(line[~border], 95))
    return float(line[border].max()) / inside if inside > 1e-9 else 0.0


def faded(densities: Floats, shared: int, share: float = FADE) -> Floats:
    """Return the densities of motifs that go over into the mean of all towards the border.

    Parameters
    ----------
    densities : (N, h, w) float array
    shared : int
        So many rows and columns are the mean itself.
    share : float
        Of the cell's side, over which they do.
    """
    height, width = densities.shape[1:]
    reach = max(share * min(height, width), 1.0)
    depth = [
        (np.minimum(np.arange(side), np.arange(side)[::-1]) + 1 - shared) / reach for side in (height, width)
    ]
    share = np.clip(1.0 - np.minimum(depth[0][:, np.newaxis], depth[1][np.newaxis]), 0.0, 1.0)
    share = share**2 * (3 - 2 * share)
    result: Floats = (1 - share) * densities + share * densities.mean(axis=0)
    return result


def with_mass(density: Floats, mass: float) -> Floats:
    """Return a density whose inside is raised to the power with which the whole has a mass."""
    height, width = density.shape
    depth = [np.minimum(np.arange(side), np.arange(side)[::-1]) / side for side in (height, width)]
    inside = np.clip((np.minimum(depth[0][:, np.newaxis], depth[1][np.newaxis]) - _INSIDE) / _FULLY, 0.0, 1.0)
    low, high = _POWERS
    for _ in range(40):
        power = np.sqrt(low * high)
        found = np.mean(density ** (1 + (power - 1) * inside))
        low, high = (power, high) if found > mass else (low, power)
    result: Floats = density ** (1 + (np.sqrt(low * high) - 1) * inside)
    return result
