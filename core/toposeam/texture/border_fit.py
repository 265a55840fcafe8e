"""Pictures whose lines run aslant, bent a little so that they go on where opposite borders meet.

Lines that reach a border elsewhere than they leave the opposite one end in the band that :func:`tile` lays
anew. So the rows along a border are compared with those along the opposite one: the shift of each column that
brings them together is found by dynamic programming, as smooth as can be, and the picture is sheared by as
much, half of it at either border. Where that closes one axis and the other stays open, the picture is cropped
to where its outer columns, or rows, are most alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats, Image
from toposeam.images import as_array, as_float, full_scale
from toposeam.texture.canvas.tileable import Tileable, wraps_of
from toposeam.texture.exemplar.sources import DataRange, white_of

#: Largest angle by which a picture is sheared, in degrees.
_MOST_DEG = 8.0
#: Number of rows at a border that are compared.
_ROWS = 3
#: Distance, px, between the columns whose shifts are chosen, and the largest step from one to the next, px.
_EVERY = 4
#: Cost of a step of 1 px, as a mean square of the picture's deviation over as many columns.
_STEP_COST = 0.02
#: Largest ratio of the cost of borders that were brought together to what it was before, and the least cost
#: before, as a share of the picture's variance, for a picture to be bent. Gravel and grass have 0.5 at least.
_CLOSED, _OPEN = 0.25, 0.3
#: Distance, px, to either side of a border within which the other axis is compared with itself.
_COMPARED = 8
#: Least share of a side that is kept where outer columns are to be alike, what each share that is left out
#: costs, and the largest ratio of what they cost then to what they did before.
_LEAST_KEPT, _LOSS, _ALIKE = 0.66, 0.4, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class BorderFit:
    """How a picture is bent and cropped so that its lines go on across its borders.

    Examples
    --------
    >>> import numpy as np
    >>> bend = BorderFit(np.full(40, 4.0), None, (slice(0, 40), slice(2, 38)))
    >>> bend.most, bend.apply(np.ones((40, 40))).shape
    (2.0, (40, 36))
    """

    #: (W,) shift to the right, px, of each column from the upper to the lower border, and (H,) shift down of
    #: each row from the left to the right one; None for none.
    across: Floats | None
    down: Floats | None
    #: Rows and columns of the bent picture that are kept.
    kept: tuple[slice, slice]

    @property
    def most(self) -> float:
        """Largest displacement of a pixel, px."""
        return max(float(np.abs(one).max() / 2) for one in (self.across, self.down) if one is not None)

    def apply(self, image: npt.ArrayLike, *, mixed: bool = True) -> Image:
        """Bend and crop a picture of the size that was looked at.

        Parameters
        ----------
        image : (H, W) or (H, W, C) array_like
        mixed : bool
            Whether neighbouring pixels may be mixed (cubic splines); maps of numbers keep their values.

        Returns
        -------
        (H', W') or (H', W', C) array of its dtype
        """
        array = as_array(image)
        height, width = array.shape[:2]
        y, x = np.mgrid[:height, :width].astype(np.float64)
        row, column = y.copy(), x.copy()
        if self.across is not None:
            column += self.across * (y / max(height - 1, 1) - 0.5)
        if self.down is not None:
            row += self.down[:, np.newaxis] * (x / max(width - 1, 1) - 0.5)
        planes = array[..., np.newaxis] if array.ndim == 2 else array
        bent = np.empty_like(planes)
        for channel in range(planes.shape[2]):
            plane = planes[..., channel]
            values = ndimage.map_coordinates(
                plane.astype(np.float64), [row, column], order=3 if mixed else 0, mode="nearest"
            )
            low, high = float(plane.min()), float(plane.max())
            values = np.clip(values, low, high)
            bent[..., channel] = np.rint(values) if np.issubdtype(array.dtype, np.integer) else values
        result = np.ascontiguousarray(bent[self.kept])
        return result[..., 0] if array.ndim == 2 else result


def fit_borders(
    image: npt.ArrayLike, *, tileable: Tileable = "both", data_range: DataRange = None
) -> BorderFit | None:
    """Find how a picture has to be bent so that its lines go on where it repeats; None where that is no help.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
    tileable : {"both", "x", "y"} or True
        The axes on which it is to repeat, as for :func:`toposeam.tile`.
    data_range : float, optional
        The value that counts as white.

    Returns
    -------
    BorderFit or None

    Raises
    ------
    ImageError
        For a picture that cannot be used.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> y, x = np.mgrid[:120, :120]
    >>> aslant = 0.5 + 0.4 * np.cos(2 * np.pi * (x + 0.06 * y) / 30)
    >>> ts.texture.fit_borders(aslant).apply(aslant).shape[0]
    120
    >>> ts.texture.fit_borders(np.random.default_rng(0).random((120, 120))) is None
    True
    """
    array = as_array(image)
    white = white_of(data_range, 1)[0]
    values = as_float(array, "image", white or full_scale(array.dtype))
    values = values[..., np.newaxis] if values.ndim == 2 else values
    deviation = values.std(axis=(0, 1)) + 1e-6
    values = values / deviation
    wraps = wraps_of(tileable)
    across = _shifts(values) if wraps[0] else None
    down = _shifts(values.swapaxes(0, 1)) if wraps[1] else None
    if across is None and down is None:
        return None
    if across is not None and down is not None:  # one is sheared, what that leaves open is cropped
        across, down = (across, None) if np.abs(across).max() <= np.abs(down).max() else (None, down)
    margins = [math.ceil(0 if one is None else np.abs(one).max() / 2) for one in (down, across)]
    kept = tuple(
        slice(margin, length - margin) for margin, length in zip(margins, array.shape[:2], strict=True)
    )
    fit = BorderFit(across, down, (kept[0], kept[1]))
    if not all(wraps):
        return fit
    bent = fit.apply(values)
    rows, columns = fit.kept
    if across is not None:
        low, high = _most_alike(bent.swapaxes(0, 1))
        columns = slice(columns.start + low, columns.start + high)
    else:
        low, high = _most_alike(bent)
        rows = slice(rows.start + low, rows.start + high)
    return BorderFit(across, down, (rows, columns))


def _shifts(values: Floats) -> Floats | None:
    """Find the shift of each column along its row at which the lower border goes on at the upper one: (W,),
    None where none is needed, or none does.
    """
    height, width = values.shape[:2]
    upper, lower = values[:_ROWS].mean(axis=0), values[-_ROWS:].mean(axis=0)
    most = round(math.tan(math.radians(_MOST_DEG)) * height)
    count = width // _EVERY
    if most < 1 or count < 3:
        return None
    steps = np.arange(-most, most + 1)
    at = np.arange(width)[:, np.newaxis] + steps
    cost = np.square(upper[:, np.newaxis] - lower[np.clip(at, 0, width - 1)]).mean(axis=2)
    cost[(at < 0) | (at >= width)] = np.median(cost)
    cost = cost[: count * _EVERY].reshape(count, _EVERY, -1).sum(axis=1)
    before = float(cost[:, most].sum())
    if before < _OPEN * count * _EVERY:
        return None
    paid, chosen = _STEP_COST * _EVERY, []
    best = cost[0].copy()
    for line in cost[1:]:
        ways = np.stack([np.append(np.inf, best[:-1]) + paid, best, np.append(best[1:], np.inf) + paid])
        chosen.append(ways.argmin(axis=0))
        best = ways.min(axis=0) + line
    if float(best.min()) > _CLOSED * before:
        return None
    path = [int(best.argmin())]
    for ways_back in reversed(chosen):
        path.append(path[-1] + int(ways_back[path[-1]]) - 1)
    middles = (np.arange(count) + 0.5) * _EVERY - 0.5
    found = np.interp(np.arange(width), middles, steps[path[::-1]].astype(float))
    smooth: Floats = ndimage.gaussian_filter1d(found, 1.5 * _EVERY, mode="nearest")
    return smooth


def _most_alike(values: Floats) -> tuple[int, int]:
    """Find the rows from which on, and from which on again, the picture is most alike, if it is much more so
    than at its borders.
    """
    height = len(values)
    flat = values.reshape(height, -1)
    norms = np.square(flat).sum(axis=1)
    apart = (norms[:, np.newaxis] + norms - 2 * flat @ flat.T) / flat.shape[1]
    reach = min(_COMPARED, height // 8)
    count = height - 2 * reach
    around = sum(apart[o : o + count, o : o + count] for o in range(2 * reach + 1)) / (2 * reach + 1)
    first, again = np.mgrid[:count, :count]
    kept = (again - first) / height
    cost = around + _LOSS * (1 - kept)
    cost[kept < _LEAST_KEPT] = np.inf
    low, high = divmod(int(cost.argmin()), count)
    if not np.isfinite(cost[low, high]) or around[low, high] > _ALIKE * apart[0, -1]:
        return 0, height
    return low + reach, high + reach
