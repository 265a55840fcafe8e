r"""Visibility of the borders between cells of a pattern.

*Measure.* A line across a pattern is a row whose mean differs from that of the rows round it,
:math:`c(y) = |m(y) - (m(y - r) + m(y + r)) / 2|` with r three hundredths of the cell. The line between
two rows has the larger of their values. The visibility of a border is its value divided by the 95th
percentile on all other lines: 1 or less where it is no more conspicuous than the inside. Of ordinary lines,
one in twenty is above 1.

Ink wash that changes from one motif to the next would show the border, even if the rows have equal means. So
where motifs share a border, wash fades into the mean of all motifs towards it. Strokes do not fade: their
mean is gray, which a crisp edge would turn into gaps.

The optimisation avoids such lines, see :mod:`toposeam.motif.symmetry.mirrors`; the rest is removed
afterwards, see :mod:`toposeam.motif.border_smoothing`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, uniform_filter1d

from toposeam.arrays import Floats, Floats32
from toposeam.checks import check_pair
from toposeam.colours import LUMA
from toposeam.errors import ImageError, Term
from toposeam.images import as_float
from toposeam.motif.symmetry.rules import symmetry
from toposeam.motif.symmetry.tiling import extend

#: Distance r of the rows compared, as a share of the cell's side, and its least value, px.
_COMPARED_DISTANCE, _MIN_COMPARED_PX = 0.03, 2
#: Distance of the rows between which brightness bends at an edge, and the length along which the bend is
#: averaged, as shares of the cell's side.
_BEND, _ALONG = 0.015, 1 / 6
#: Range of the powers to which densities may be raised to restore the mass.
_POWERS = (0.6, 4.0)
#: Distance from the border at which densities begin to change for the mass, and the width over which the
#: change becomes full; shares of the cell's side.
_UNCHANGED_BORDER, _TRANSITION = 0.08, 0.07
#: Width over which wash fades into the mean of all motifs, as a share of the cell's side; the second one if
#: some of the motifs have strokes.
FADE, BESIDE_STROKES = 0.14, 0.2
#: Standard deviation of that mean's blur, as a share of the cell's side.
_MEAN_BLUR = 0.025


def border_visibility(pattern: npt.ArrayLike, cell: tuple[int, int]) -> float:
    """Compute the visibility of the borders between a pattern's cells.

    Parameters
    ----------
    pattern : (H, W) or (H, W, 3) array_like
        Whole cells, at least one each way. The pattern is taken to repeat by translation.
    cell : (rows, columns)
        Size of one cell, px.

    Returns
    -------
    float
        The larger value of both directions. About 1 or less if borders cannot be distinguished from lines
        inside.

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
    luminance, (rows, columns) = _luminance(pattern, cell)
    return max(line_visibility(luminance, rows), line_visibility(luminance.T, columns))


def _luminance(pattern: npt.ArrayLike, cell: tuple[int, int]) -> tuple[Floats32, tuple[int, int]]:
    """Return the brightness of a pattern, and the size of its cells, checked.

    Raises
    ------
    ImageError
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
    luminance = values[..., 0] if values.shape[2] < 3 else values[..., :3] @ LUMA.astype(np.float32)
    return luminance.astype(np.float32, copy=False), (rows, columns)


def compared_distance(side: int) -> int:
    """Return the distance, px, between a line and the rows it is compared with, for a cell of that side."""
    return max(_MIN_COMPARED_PX, round(_COMPARED_DISTANCE * side))


def line_visibility(values: npt.NDArray[np.floating], side: int) -> float:
    """Compute `border_visibility` for the borders between rows of cells only, of an (H, W) brightness."""
    mean = values.mean(axis=1, dtype=np.float64)
    reach = compared_distance(side)
    contrast = np.abs(mean - (np.roll(mean, reach) + np.roll(mean, -reach)) / 2)
    return _border_share(contrast, side)


def _border_share(contrast: Floats, side: int) -> float:
    """Return the largest value of the lines on borders, divided by the 95th percentile of all others."""
    line = np.maximum(contrast, np.roll(contrast, 1))  # between row y - 1 and row y
    border = np.arange(len(line)) % side == 0
    inside = float(np.percentile(line[~border], 95))
    return float(line[border].max()) / inside if inside > 1e-9 else 0.0


def border_edges(pattern: npt.ArrayLike, cell: tuple[int, int]) -> float:
    """Compute the visibility of straight edges along the borders between a pattern's cells.

    An edge may be pale here and dark there, so that the mean of its row is that of others and
    :func:`border_visibility` does not see it. So the bend of brightness across a row, between rows
    `_BEND` of the cell apart, is averaged along a sixth of a cell only; the line's value is the root mean
    square of that, divided by the 95th percentile on all other lines.

    Parameters
    ----------
    pattern, cell
        As of :func:`border_visibility`.

    Returns
    -------
    float
        The larger value of both directions.

    Raises
    ------
    ImageError

    Examples
    --------
    >>> field = np.random.default_rng(0).random((96, 96))
    >>> field[::32, :48] += 1
    >>> field[::32, 48:] -= 1
    >>> border_edges(field, (32, 32)) > 1.2
    True
    """
    luminance, (rows, columns) = _luminance(pattern, cell)
    return max(edge_visibility(luminance, rows), edge_visibility(luminance.T, columns))


def edge_visibility(values: npt.NDArray[np.floating], side: int) -> float:
    """Compute `border_edges` for the borders between rows of cells only, of an (H, W) brightness."""
    reach = max(1, round(_BEND * side))
    bend = 2 * values - np.roll(values, reach, 0) - np.roll(values, -reach, 0)
    bend = uniform_filter1d(bend, max(3, round(_ALONG * side)), axis=1, mode="wrap")
    return _border_share(np.sqrt(np.square(bend, dtype=np.float64).mean(axis=1)), side)


def fade_to_mean(densities: Floats, repeat: str, shared: int = 0, share: float = FADE) -> Floats:
    """Fade the densities of motifs into the mean of all towards the border, where that is blurred: so no
    border has an edge, whichever motifs meet there. Images of the border inside of the cell are faded, too.

    Parameters
    ----------
    densities : (N, h, w) float array
    repeat : str
        The rule by which all of them repeat.
    shared : int
        Number of rows and columns along the border that become the mean itself, which is not blurred then, as
        strokes have it, too.
    share : float
        Width of the transition, as a share of the cell's shorter side.
    """
    height, width = densities.shape[1:]
    side = min(height, width)
    reach, sigma = max(share * side, 1.0), _MEAN_BLUR * side
    margin = int(np.ceil(4 * sigma))
    mean = densities.mean(axis=0)
    if not shared:
        mean = gaussian_filter(extend(mean, repeat, margin), sigma, mode="nearest")
        mean = mean[margin : margin + height, margin : margin + width]
    depth = [
        (np.minimum(np.arange(long), np.arange(long)[::-1]) + min(shared, 1) - shared) / reach
        for long in (height, width)
    ]
    near = np.clip(1.0 - np.minimum(depth[0][:, np.newaxis], depth[1][np.newaxis]), 0.0, 1.0)
    near = symmetry(repeat, (height, width)).largest(near**2 * (3 - 2 * near))
    result: Floats = (1 - near) * densities + near * mean
    return result


def restore_mass(density: Floats, mass: float) -> Floats:
    """Raise the inside of a density to a power so that its mean becomes `mass`."""
    height, width = density.shape
    depth = [np.minimum(np.arange(side), np.arange(side)[::-1]) / side for side in (height, width)]
    nearest = np.minimum(depth[0][:, np.newaxis], depth[1][np.newaxis])
    inside = np.clip((nearest - _UNCHANGED_BORDER) / _TRANSITION, 0.0, 1.0)
    low, high = _POWERS
    for _ in range(40):
        power = np.sqrt(low * high)
        found = np.mean(density ** (1 + (power - 1) * inside))
        low, high = (power, high) if found > mass else (low, power)
    result: Floats = density ** (1 + (np.sqrt(low * high) - 1) * inside)
    return result
