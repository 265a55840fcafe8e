r"""Cells of any wallpaper group made of a picture, as in a kaleidoscope.

For each point of the plane, its image under the group that is nearest to a chosen centre is looked up in the
picture. The points that are their own nearest image form the Dirichlet domain of the centre. There the
picture is undistorted, and copies surround it. Domains meet at mirrors wherever the group has some. At other
borders unlike parts of the picture meet; there images that are nearly as near are mixed with weights

.. math:: w_i = \exp\left(-(d_i - d_{min}) / f\right)

for distances d_i and a feather f, so that no border is hard and the pattern keeps the whole group.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates

from toposeam.arrays import Floats
from toposeam.checks import check_choice, check_function, check_number, check_numbers, check_pair
from toposeam.errors import OptionError, Term
from toposeam.images import as_float
from toposeam.motif.symmetry.rules import GENERATORS, HEXAGONAL, check_repeat, operations

#: The groups a kaleidoscope can show.
GROUPS = (*GENERATORS, *HEXAGONAL)
#: Centre of the domain, in the cell: a point that no operation of any group leaves fixed.
_CENTRE = (0.29, 0.17)
#: Offsets of neighbouring cells whose copies may be nearest.
_AROUND = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
#: Largest cell, px: larger ones do not fit into the memory of usual machines.
_MAX_PIXELS = 400_000_000
#: Largest d_i - d_min of images that are mixed, in feathers: beyond, weights are below 0.3 %.
_MAX_FEATHERS = 6.0
#: Pixels that are worked on at once, to bound memory.
_STRIP_PX = 200_000


def kaleidoscope(
    image: npt.ArrayLike,
    repeat: str,
    cell: tuple[int, int],
    *,
    at: tuple[float, float] | None = None,
    feather: float = 0.01,
    progress: Callable[[float], None] | None = None,
) -> npt.NDArray[np.float32]:
    """Make a cell that repeats by a wallpaper group out of a picture.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
    repeat : str
        One of the wallpaper groups, "p1" to "p6m".
    cell : (rows, columns)
        Size of the cell, px of the picture. A hexagonal group uses the columns only, and has √3 times as many
        rows.
    at : (x, y), optional
        Point of the picture at the centre of the domain, px; by default the middle of the picture.
    feather : float
        Width over which unlike parts mix, as a share of the cell's shorter side, 0 to 0.5.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    (rows, columns) or (rows, columns, C) float32 array in [0, 1]
        The cell repeats by translation.

    Raises
    ------
    OptionError, ImageError

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> cell = kaleidoscope(rng.random((40, 60)), "p4m", (16, 16))
    >>> bool(np.allclose(cell, cell.T) and np.allclose(cell, cell[::-1]))
    True
    """
    check_function("progress", progress)
    picture = as_float(image)
    check_choice("repeat", repeat, GROUPS)
    rows, columns = check_pair("cell", cell, 2)
    if repeat in HEXAGONAL:
        rows = round(columns * np.sqrt(3.0))
    else:
        check_repeat(repeat, (rows, columns))
    if rows * columns > _MAX_PIXELS:
        raise OptionError(
            "the cell would have {rows} × {columns} px; ask for at most {most:g} megapixels",
            kind="too large",
            rows=rows,
            columns=columns,
            most=_MAX_PIXELS / 1e6,
        )
    soft = check_number("feather", feather, 0, 0.5) * min(rows, columns)
    height, width = picture.shape[:2]
    place = check_numbers("at", (width / 2, height / 2) if at is None else at)
    if place.shape != (2,):
        raise OptionError(
            "{parameter} is {value!r}; pass two numbers, x and y in px",
            kind="type",
            parameter=Term("at"),
            value=at,
        )
    x, y = place.tolist()
    if not (0 <= x <= width and 0 <= y <= height):
        raise OptionError(
            "{parameter} is ({x:g}, {y:g}), outside the picture of {width} × {height} px; move it inside",
            kind="outside",
            parameter=Term("at"),
            value=at,
            x=x,
            y=y,
            width=width,
            height=height,
        )
    # Lattice coordinates to px, and back.
    hexagonal = repeat in HEXAGONAL
    basis = np.array(
        [[columns, -columns / 2], [0, columns * np.sqrt(0.75)]] if hexagonal else np.diag((columns, rows))
    )
    inverse = np.linalg.inv(basis)
    result = np.empty((rows * columns, picture.shape[2]), np.float32)
    for start in range(0, rows * columns, _STRIP_PX):
        flat = np.arange(start, min(start + _STRIP_PX, rows * columns))
        place = np.stack([flat % columns + 0.5, flat // columns + 0.5])
        away = _copies(inverse @ place, repeat, basis)
        result[flat] = _sample(picture, away, np.array([x, y]), soft)
        if progress is not None:
            progress((start + len(flat)) / (rows * columns))
    shaped = result.reshape(rows, columns, -1)
    return shaped[..., 0] if np.ndim(image) == 2 else shaped


def _copies(place: Floats, repeat: str, basis: Floats) -> Floats:
    """Compute the images of points under every operation, px from the centre: (copies, 2, N)."""
    centre = np.array(_CENTRE)[:, np.newaxis]
    found = []
    for (a, b), (c, d), (t, u) in operations(repeat):
        image = np.array([[a, b], [c, d]]) @ place + np.array([[t / 2], [u / 2]]) - centre
        image -= np.rint(image)
        found += [basis @ (image + np.array([[i], [j]])) for i, j in _AROUND]
    return np.stack(found)


def _sample(
    picture: npt.NDArray[np.float32], away: Floats, at: Floats, soft: float
) -> npt.NDArray[np.float32]:
    """Sample the picture at the nearest copies, and mix those that are nearly as near: (N, C)."""
    distance = np.hypot(away[:, 0], away[:, 1])
    behind = distance - distance.min(axis=0)
    if soft > 0:
        weight = np.where(behind < _MAX_FEATHERS * soft, np.exp(-behind / soft), 0.0)
    else:
        weight = (behind < 1e-9).astype(float)
    weight /= weight.sum(axis=0)
    colour = np.zeros((away.shape[2], picture.shape[2]), np.float32)
    for copy, share in zip(away, weight, strict=True):
        used = np.flatnonzero(share)
        if not len(used):
            continue
        where = [copy[1, used] + at[1] - 0.5, copy[0, used] + at[0] - 0.5]
        for channel in range(picture.shape[2]):
            values = map_coordinates(picture[..., channel], where, order=1, mode="reflect")
            colour[used, channel] += values * share[used]
    return colour
