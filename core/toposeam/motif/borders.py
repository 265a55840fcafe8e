r"""Lines that an eye would find where cells meet, measured and evened out.

*Measured.* A line across a pattern is a row whose mean differs from that of the rows round it,
:math:`c(y) = |m(y) - (m(y - r) + m(y + r)) / 2|` with r three hundredths of the cell. Between two rows the
larger of theirs counts. What that is on borders, divided by its 95th percentile on all other lines, is 1 or
less where a border is no more conspicuous than the inside; of borders that are nothing special one in twenty
is above.

*Evened.* Motifs that share a border go over into the mean of all towards it. The mean of strokes is gray, and
a border along which all compounds want ink is dark. So the densities of each row near the border are raised
to a power, ρ^γ, with which the row's mean is the one between those of the rows beyond. A power moves haze
more than strokes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_pair
from toposeam.colours import LUMA
from toposeam.errors import ImageError
from toposeam.images import as_float

Floats = npt.NDArray[np.float64]

#: r, as a share of the cell's side, and in px at least.
_REACH, _LEAST_PX = 0.03, 2
#: Half the width of what is evened, as a share of the cell's side.
_BAND = 0.04
#: Powers that a row may be raised to.
_POWERS = (0.6, 4.0)
#: Width over which motifs that join go over into what they have in common, as a share of the cell's side.
_FADE = 0.07


def border_visibility(pattern: npt.ArrayLike, cell: tuple[int, int]) -> float:
    """How conspicuous the borders between a pattern's cells are.

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
            f"the pattern has {values.shape[0]} × {values.shape[1]} px, which is no whole number of cells of "
            f"{rows} × {columns}; give whole cells"
        )
    luminance = values[..., 0] if values.shape[2] < 3 else values[..., :3] @ LUMA
    return max(_visibility(luminance, rows), _visibility(luminance.T, columns))


def _visibility(values: npt.NDArray[np.floating], side: int) -> float:
    mean = values.mean(axis=1, dtype=np.float64)
    reach = max(_LEAST_PX, round(_REACH * side))
    contrast = np.abs(mean - (np.roll(mean, reach) + np.roll(mean, -reach)) / 2)
    line = np.maximum(contrast, np.roll(contrast, 1))  # between row y - 1 and row y
    border = np.arange(len(line)) % side == 0
    inside = float(np.percentile(line[~border], 95))
    return float(line[border].max()) / inside if inside > 1e-9 else 0.0


def evened(densities: Floats, shared: int) -> Floats:
    """Densities without lines along the border.

    Parameters
    ----------
    densities : (N, h, w) float array
        Of several motifs, each taken to go on with itself.
    shared : int
        The rows on both sides of the border that all motifs have in common, and keep so.

    Returns
    -------
    (N, h, w) float array
    """
    result = densities
    for _ in range(2):  # columns change the rows a little
        for axis in (1, 2):
            across = np.moveaxis(result, axis, 1).copy()
            _even_rows(across, shared)
            result = np.moveaxis(across, 1, axis)
    return result


def _even_rows(fields: Floats, shared: int) -> None:
    """Even the rows round the border between a cell and the next, in place."""
    many, height, _ = fields.shape
    band = max(_LEAST_PX, round(_BAND * height), shared + 1)
    mean = fields.mean(axis=2)
    before = mean[:, np.arange(height - 2 * band, height - band)].mean(axis=1)
    after = mean[:, np.arange(band, 2 * band)].mean(axis=1)
    for offset in range(-band, band):
        share = (offset + band + 0.5) / (2 * band)
        wanted = (1 - share) * before + share * after
        row = offset % height
        if -shared <= offset < shared:
            fields[:, row] = _with_mean(fields[:, row], float(wanted.mean()))
            continue
        near = max(0.0, 1 - abs(offset + 0.5) / band)
        for index in range(many):
            goal = (1 - near) * wanted[index] + near * wanted.mean()
            fields[index, row, shared : -shared or None] = _with_mean(
                fields[index, row, shared : -shared or None], float(goal)
            )


def _with_mean(values: Floats, mean: float) -> Floats:
    """Values in (0, 1] raised to the power with which they have a mean."""
    low, high = _POWERS
    for _ in range(30):
        power = np.sqrt(low * high)
        low, high = (power, high) if np.mean(values**power) > mean else (low, power)
    result: Floats = values ** np.sqrt(low * high)
    return result


def faded(densities: Floats, shared: int) -> Floats:
    """Densities of motifs that go over into the mean of all towards the border.

    Parameters
    ----------
    densities : (N, h, w) float array
    shared : int
        So many rows and columns are the mean itself.
    """
    height, width = densities.shape[1:]
    reach = max(_FADE * min(height, width), 1.0)
    depth = [
        (np.minimum(np.arange(side), np.arange(side)[::-1]) + 1 - shared) / reach for side in (height, width)
    ]
    share = np.clip(1.0 - np.minimum(depth[0][:, np.newaxis], depth[1][np.newaxis]), 0.0, 1.0)
    share = share**2 * (3 - 2 * share)
    result: Floats = (1 - share) * densities + share * densities.mean(axis=0)
    return result


def with_mass(density: Floats, mass: float) -> Floats:
    """A density whose inside is raised to the power with which the whole has a mass."""
    height, width = density.shape
    depth = [np.minimum(np.arange(side), np.arange(side)[::-1]) / side for side in (height, width)]
    inside = np.clip(
        (np.minimum(depth[0][:, np.newaxis], depth[1][np.newaxis]) - 2 * _BAND) / _FADE, 0.0, 1.0
    )
    low, high = _POWERS
    for _ in range(40):
        power = np.sqrt(low * high)
        found = np.mean(density ** (1 + (power - 1) * inside))
        low, high = (power, high) if found > mass else (low, power)
    result: Floats = density ** (1 + (np.sqrt(low * high) - 1) * inside)
    return result
