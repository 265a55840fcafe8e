"""Shapes, guides and places of a motif's composition, from pictures and drawings.

Pictures keep their shape: they are fitted into the cell, in its middle.
"""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats
from toposeam.checks import check_pair
from toposeam.colours import LUMA
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import as_float
from toposeam.motif.ink.sampling import resample
from toposeam.motif.recipe.recipe import MAX_PACKED_SIDE, pack
from toposeam.vector.svg import read_svg

#: Outlines by name: a disc, a band from the left to the right, a frame along the border.
OUTLINES = ("disc", "band", "frame")
#: Radius of the disc, half the height of the band, and width of the frame, as shares of the shorter side.
_DISC, _BAND, _FRAME = 0.45, 0.25, 0.2
#: Half the width of a guide, as a share of the shorter side: it falls off like a Gaussian of that deviation.
_GUIDE_WIDTH = 0.015
#: Darkness from which on a pixel belongs to a shape, a line or a place; white has 0.
_DARK = 0.5
#: Closed lines up to this size, as a share of the shorter side, are places: their middle counts.
_DOT = 0.06
#: Distance of places along a line, as a share of the shorter side: about their diameter.
_ALONG = 0.025
#: Strength of each place along a line, so that a line as long as the cell is as strong as ten places.
_LINE_STRENGTH = 0.25
#: Largest number of places that a picture or a drawing becomes; more take long and make large files.
_MOST_PLACES = 600


def darkness(image: npt.ArrayLike, what: str) -> Floats:
    """Return how much a picture shows, (H, W) in [0, 1]: its opacity if it has transparent parts, else its
    darkness.

    Raises
    ------
    ImageError
    """
    array = as_float(image, what).astype(np.float64)
    if array.shape[2] in (2, 4) and array[..., -1].min() < _DARK:
        return np.clip(array[..., -1], 0.0, 1.0)
    array = array[..., :3] if array.shape[2] > 2 else array[..., :1]
    found: Floats = np.clip(1.0 - (array @ LUMA if array.shape[2] == 3 else array[..., 0]), 0.0, 1.0)
    return found


def pack_outline(source: str | npt.ArrayLike, cell: tuple[int, int]) -> str:
    """Pack a shape for the `outline` of a recipe.

    Parameters
    ----------
    source : str or (H, W) or (H, W, C) array_like
        One of `OUTLINES`, or a picture: the shape is what is opaque, or else what is dark.
    cell : (rows, columns)

    Raises
    ------
    OptionError, ImageError
    """
    if isinstance(source, str):
        shown = _named(source, cell)
    else:
        shown = _fitted(darkness(source, "the outline"), cell)
    share = float((shown >= _DARK).mean())
    if not 0.005 < share < 0.995:
        raise ImageError(
            "the outline covers {share:.1%} of the cell; give a shape that is dark on white, or opaque on "
            "transparent, and leaves room on both sides",
            kind="empty",
            parameter=Term("outline"),
            share=share,
        )
    return pack(shown, MAX_PACKED_SIDE)


def pack_guide(source: npt.ArrayLike, cell: tuple[int, int]) -> str:
    """Pack lines for the `guide` of a recipe: those that are dark, or opaque, in a picture.

    Raises
    ------
    ImageError
        Where the picture shows none.
    """
    shown = darkness(source, "the guide")
    # Thin lines would fade when they are made smaller; their distance does not.
    step = max(1.0, max(shown.shape) / MAX_PACKED_SIDE)
    lines = shown >= _DARK
    if not lines.any() or lines.all():
        raise ImageError(
            "the guide shows no line; draw dark lines on white, or opaque ones on transparent",
            kind="empty",
            parameter=Term("guide"),
        )
    away = ndimage.distance_transform_edt(~lines) / step
    field = np.exp(-0.5 * np.square(np.maximum(away, 0) / (_GUIDE_WIDTH * min(shown.shape) / step)))
    return pack(_fitted(field, cell), MAX_PACKED_SIDE)


def _named(name: str, cell: tuple[int, int]) -> Floats:
    if name not in OUTLINES:
        raise OptionError(
            "{parameter} {given} is not known; choose one of {allowed}, or give a picture",
            kind="choice",
            parameter=Term("outline"),
            value=name,
            given=repr(name),
            allowed=OUTLINES,
        )
    step = max(cell) / MAX_PACKED_SIDE
    rows, columns = (max(1, round(side / step)) for side in cell)
    side = min(rows, columns)
    y, x = np.ogrid[:rows, :columns]
    down, across = np.abs(y + 0.5 - rows / 2), np.abs(x + 0.5 - columns / 2)
    if name == "disc":
        inside = _DISC * side - np.hypot(down, across)
    elif name == "band":
        inside = np.broadcast_to(_BAND * side - down, (rows, columns))
    else:
        inside = _FRAME * side - np.minimum(rows / 2 - down, columns / 2 - across)
    found: Floats = np.clip(inside + 0.5, 0.0, 1.0)
    return found


def _fitted(shown: Floats, cell: tuple[int, int]) -> Floats:
    """Return a picture in the middle of a larger one of the cell's shape."""
    height, width = shown.shape
    scale = max(height / cell[0], width / cell[1])
    rows, columns = max(height, round(cell[0] * scale)), max(width, round(cell[1] * scale))
    above, left = (rows - height) // 2, (columns - width) // 2
    return np.pad(shown, ((above, rows - height - above), (left, columns - width - left)))


def places_in_picture(image: npt.ArrayLike, cell: tuple[int, int] = (1, 1)) -> Floats:
    """Return places for sources or sinks where a picture is dark, or opaque.

    Dots become one place each, strong in proportion to their area; larger areas are filled with places.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
    cell : (rows, columns)
        Size of the cell, or its proportions.

    Returns
    -------
    (n, 3) float array
        x and y in [0, 1] of the cell, and strength, 1 in the mean.

    Raises
    ------
    ImageError
        Where the picture shows nothing.

    Examples
    --------
    >>> dot = np.ones((40, 40))
    >>> dot[11:13, 21:23] = 0
    >>> places_in_picture(dot).round(2).tolist()
    [[0.55, 0.3, 1.0]]
    """
    cell = check_pair("cell", cell, 1)
    shown = _fitted(darkness(image, "the picture of places"), cell)
    step = max(1.0, max(shown.shape) / MAX_PACKED_SIDE)
    if step > 1:
        rows, columns = (max(1, round(length / step)) for length in shown.shape)
        shown = resample(shown, "none", (rows, columns)).astype(np.float64)
    rows, columns = shown.shape
    shown[shown < 0.1] = 0.0
    side = min(rows, columns)
    labels, count = ndimage.label(shown > 0, np.ones((3, 3)))
    found: list[tuple[float, float, float]] = []
    for number, part in enumerate(ndimage.find_objects(labels), 1):
        own = np.where(labels[part] == number, shown[part], 0.0)
        y, x = (np.arange(each.start, each.stop) + 0.5 for each in part)
        if max(own.shape) <= _DOT * side or count > _MOST_PLACES:
            weight = own.sum()
            middle = (own.sum(axis=0) @ x / weight, own.sum(axis=1) @ y / weight)
            found.append((*middle, float(weight)))
            continue
        step = max(1, round(_ALONG * side))
        for top in range(0, own.shape[0], step):
            for left in range(0, own.shape[1], step):
                square = own[top : top + step, left : left + step]
                weight = float(square.sum())
                if weight > 0:
                    at = square.sum(axis=0) @ x[left : left + step], square.sum(axis=1) @ y[top : top + step]
                    found.append((float(at[0] / weight), float(at[1] / weight), weight))
    if not found:
        raise ImageError(
            "the picture of places shows none; draw dark dots on white, or opaque ones on transparent",
            kind="empty",
            parameter=Term("sources"),
        )
    return _listed(np.array(found) / np.array([columns, rows, 1.0]))


def places_in_drawing(source: str | os.PathLike[str], cell: tuple[int, int] = (1, 1)) -> Floats:
    """Return places for sources or sinks along the lines of an SVG drawing, and in the middle of its dots.

    Parameters
    ----------
    source : path-like or str
        As :func:`toposeam.vector.read_svg` takes it.
    cell : (rows, columns)
        Size of the cell, or its proportions.

    Returns
    -------
    (n, 3) float array
        As of :func:`places_in_picture`.

    Raises
    ------
    PathError
    OptionError
        Where all lie beyond the drawing's edge.

    Examples
    --------
    >>> page = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{}</svg>'
    >>> places_in_drawing(page.format('<circle cx="25" cy="50" r="2"/>')).round(2).tolist()
    [[0.25, 0.5, 1.0]]
    """
    rows, columns = check_pair("cell", cell, 1)
    drawing = read_svg(source)
    scale = max(drawing.width / columns, drawing.height / rows)
    size = np.array([columns, rows]) * scale
    moved = (size - np.array([drawing.width, drawing.height])) / 2
    side = float(min(size))
    found: list[npt.NDArray[np.float64]] = []
    for line in drawing.polylines:
        points = np.asarray(line.points, np.float64) + moved
        extent = points.max(axis=0) - points.min(axis=0)
        if line.closed:
            points = np.concatenate([points, points[:1]])
        if (line.closed and extent.max() <= _DOT * side) or extent.max() <= _ALONG * side:
            middle = (points.max(axis=0) + points.min(axis=0)) / 2
            found.append(np.array([[*(middle / size), 1.0]]))
            continue
        run = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
        count = max(2, round(run[-1] / (_ALONG * side)))
        at = np.linspace(0.0, run[-1], count, endpoint=not line.closed)
        along = np.column_stack([np.interp(at, run, points[:, axis]) for axis in (0, 1)]) / size
        found.append(np.column_stack([along, np.full(count, _LINE_STRENGTH)]))
    places = np.concatenate(found)
    places = places[((places[:, :2] >= 0) & (places[:, :2] <= 1)).all(axis=1)]
    if not len(places):
        raise OptionError(
            "all lines lie beyond the drawing's edge; draw them on its page",
            kind="outside",
            parameter=Term("sources"),
        )
    return _listed(places)


def _listed(places: Floats) -> Floats:
    """Return at most `_MOST_PLACES` of the places, evenly chosen, with a mean strength of 1."""
    if len(places) > _MOST_PLACES:
        places = places[np.linspace(0, len(places) - 1, _MOST_PLACES).round().astype(int)]
    places = places.copy()
    places[:, 2] /= places[:, 2].mean()
    return places.round(4)
