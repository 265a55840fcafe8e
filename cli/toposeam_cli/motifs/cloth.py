"""A pattern on cloth: laid over folds, which shift and shade it.

The height of the cloth, in mm, is the sum of drawn folds, fine waves of the cloth itself, and rounded edges.
Where it slopes, less of the pattern is seen from above, so the pattern is shifted down the slope. Light from
the upper left shades surfaces that face away from it (Lambert), and a weave glitters a little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

Floats = np.ndarray

#: Height of a fold drawn in full white, mm per 1000 mm of the product's width.
_FOLD = 26.0
#: Height of the cloth's own waves, mm per 1000 mm of the product's width.
_UNREST = 3.0
#: Shift of the pattern by a slope of 1, mm per 1000 mm of the product's width, besides that by the height.
_SHIFT = 3.0
#: Direction of the light: components from the left, from above, and towards the eye.
_LIGHT = np.array([-0.42, -0.50, 0.757])
#: Least and greatest brightness, as multiples of that of flat cloth.
_DARKEST, _BRIGHTEST = 0.42, 1.22


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Piece:
    """One piece of a product."""

    #: (H, W) float in [0, 1]: the area that it covers.
    mask: Floats
    #: Direction of the pattern, degrees.
    angle: float = 0.0
    #: Height and width of the rounding at its edges, mm.
    puff: float = 0.0
    edge: float = 10.0
    #: Brightness as a whole, its decrease to the lower right, and the strengths of the weave and of a gloss.
    shade: float = 1.0
    light: float = 0.0
    weave: float = 0.0
    gloss: float = 0.0
    #: Darkness of the shadow that it casts.
    shadow: float = 1.0
    #: Transform from the pattern's mm to the picture's, (a, b, c, d, e, f) as in SVG; the piece is flat then.
    matrix: tuple[float, ...] | None = None


def lay(
    picture: Floats,
    piece: Piece,
    folds: Floats,
    pattern: tuple[Floats, float],
    px_per_mm: float,
    width_mm: float,
) -> None:
    """Lay a piece on a picture, in place.

    Parameters
    ----------
    picture : (H, W, 3) float array
    piece : Piece
    folds : (H, W) float array
        Drawn folds, -1 to 1.
    pattern : (h, w, 3) float array in [0, 1], float
        The part of the pattern that repeats by translation, and its px per mm.
    px_per_mm : float
        Of the picture.
    width_mm : float
        Of the product.
    """
    margin = int(0.06 * width_mm * px_per_mm)
    rows, columns = (np.flatnonzero(piece.mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return
    at = max(rows[0] - margin, 0), max(columns[0] - margin, 0)
    part = slice(at[0], rows[-1] + margin), slice(at[1], columns[-1] + margin)
    cut = replace(piece, mask=piece.mask[part])
    view = picture[part]
    if piece.shadow:
        view *= 1 - _shadow(cut, px_per_mm, width_mm)[..., np.newaxis] * np.array([0.86, 0.9, 0.94])
    whole = picture.shape[0], picture.shape[1]
    view += cut.mask[..., np.newaxis] * (
        _dressed(cut, folds[part], pattern, px_per_mm, width_mm, at, whole) - view
    )


def _shadow(piece: Piece, px_per_mm: float, width_mm: float) -> Floats:
    """Compute the shadow beside a piece."""
    far = 0.012 * width_mm * px_per_mm
    soft = np.roll(ndimage.gaussian_filter(piece.mask, far), (round(far), round(0.7 * far)), (0, 1))
    near = np.roll(
        ndimage.gaussian_filter(piece.mask, 0.3 * far), (round(0.25 * far), round(0.2 * far)), (0, 1)
    )
    dark: Floats = piece.shadow * np.maximum(0.42 * soft, 0.35 * near)
    return dark


def _dressed(
    piece: Piece,
    folds: Floats,
    pattern: tuple[Floats, float],
    px_per_mm: float,
    width_mm: float,
    at: tuple[int, int],
    whole: tuple[int, int],
) -> Floats:
    """Return the pattern as it looks on a piece, (H, W, 3) float, also outside of the mask. `at` is the row
    and column of the piece's first pixel in the whole picture.
    """
    height = _height(piece, folds, px_per_mm, width_mm)
    slope_y, slope_x = (slope * px_per_mm for slope in np.gradient(height))
    down, across = np.asarray(np.indices(folds.shape, np.float32))
    y, x = (down + at[0]) / px_per_mm, (across + at[1]) / px_per_mm
    # From above one sees 1 / √(1 + s²) of the length of a slope s; the pattern moves down by the rest.
    shift = _SHIFT * width_mm / 1000 + 0.3 * np.abs(height)
    x, y = x - slope_x * shift, y - slope_y * shift
    u, v = _on_pattern(piece, x, y, (whole[1] / px_per_mm / 2, whole[0] / px_per_mm / 2))
    colour = np.empty((*folds.shape, 3), np.float32)
    swatch, per_mm = pattern
    rows, columns = swatch.shape[:2]
    # Wrapped by hand: "grid-wrap" leaves holes where a coordinate rounds up to the period.
    where = np.stack([np.mod(v * per_mm - 0.5, rows), np.mod(u * per_mm - 0.5, columns)])
    wider = np.pad(swatch, ((0, 1), (0, 1), (0, 0)), mode="wrap")
    for channel in range(3):
        ndimage.map_coordinates(
            wider[..., channel], where, order=1, mode="nearest", output=colour[..., channel]
        )
    place: tuple[Floats, Floats] = (across + at[1]) / whole[1], (down + at[0]) / whole[0]
    shaded: Floats = colour * _brightness(piece, slope_x, slope_y, place)[..., np.newaxis]
    if piece.gloss:
        shaded += _gloss(piece, place)[..., np.newaxis]
    return shaded


def _height(piece: Piece, folds: Floats, px_per_mm: float, width_mm: float) -> Floats:
    if piece.matrix is not None:
        return np.zeros(folds.shape, np.float32)
    soft = 1.0 if piece.weave or piece.puff else 0.0
    noise = _unrest(folds.shape, width_mm * px_per_mm)
    height = folds * _FOLD * width_mm / 1000 + soft * noise * _UNREST * width_mm / 1000
    if piece.puff:
        depth = ndimage.distance_transform_edt(piece.mask > 0.5) / px_per_mm
        round_ = np.sqrt(np.clip(1 - (1 - np.clip(depth / piece.edge, 0, 1)) ** 2, 0, 1))
        height = height + piece.puff * ndimage.gaussian_filter(round_, 0.08 * piece.edge * px_per_mm)
    result: Floats = height.astype(np.float32)
    return result


def _on_pattern(piece: Piece, x: Floats, y: Floats, middle: tuple[float, float]) -> tuple[Floats, Floats]:
    """Map points of the product to the pattern, mm."""
    if piece.matrix is not None:
        a, b, c, d, e, f = piece.matrix
        x, y = x - e, y - f
        scale = a * d - b * c
        return (d * x - c * y) / scale, (a * y - b * x) / scale
    turn = np.deg2rad(piece.angle)
    x, y = x - middle[0], y - middle[1]
    return np.cos(turn) * x + np.sin(turn) * y, np.cos(turn) * y - np.sin(turn) * x


def _unrest(shape: tuple[int, ...], width_px: float) -> Floats:
    """Return fine waves along the cloth, of standard deviation 1."""
    coarse = 8
    small = [side // coarse + 4 for side in shape]
    noise = np.random.default_rng(7).standard_normal(small)
    noise = ndimage.gaussian_filter(noise, (0.05 * width_px / coarse, 0.022 * width_px / coarse), mode="wrap")
    fine = ndimage.zoom(noise / max(noise.std(), 1e-9), coarse, order=3)
    result: Floats = fine[: shape[0], : shape[1]]
    return result


def _brightness(piece: Piece, slope_x: Floats, slope_y: Floats, place: tuple[Floats, Floats]) -> Floats:
    facing = (_LIGHT[2] - _LIGHT[0] * slope_x - _LIGHT[1] * slope_y) / np.sqrt(1 + slope_x**2 + slope_y**2)
    bright = 1 + 0.75 * (facing / _LIGHT[2] - 1)
    if piece.weave:
        rng = np.random.default_rng(3)
        warp, weft = (rng.standard_normal(slope_x.shape).astype(np.float32) for _ in range(2))
        fine = ndimage.gaussian_filter(warp, (0.5, 1.2)) + ndimage.gaussian_filter(weft, (1.2, 0.5))
        bright = bright + 0.035 * piece.weave * fine / fine.std()
    away = (place[0] + place[1]) / 2
    result: Floats = np.clip(bright, _DARKEST, _BRIGHTEST) * piece.shade * (1 + piece.light * (0.35 - away))
    return result


def _gloss(piece: Piece, place: tuple[Floats, Floats]) -> Floats:
    """Return two bands of reflected light."""
    across = place[0] + 0.45 * place[1]
    result: Floats = piece.gloss * 0.28 * np.exp(-(((across - 0.52) / 0.05) ** 2))
    return result + piece.gloss * 0.12 * np.exp(-(((across - 0.66) / 0.02) ** 2))
