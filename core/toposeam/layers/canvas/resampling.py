"""Turn and scale a layer onto the canvas."""

from __future__ import annotations

from toposeam.checks import check_kind, check_number, check_numbers
from toposeam.errors import OptionError, Term
from toposeam.layers.canvas.layer import FARTHEST, Layer
from toposeam.layers.canvas.transforms import similarity
from toposeam.layers.canvas.warping import on_canvas


def placed(layer: Layer, *, at: tuple[float, float], turn: float = 0.0, scale: float = 1.0) -> Layer:
    """Put a layer in its place; resample it by cubic splines if it is turned or scaled.

    Parameters
    ----------
    layer : Layer
    at : (float, float)
        x and y of the centre of its upper left pixel on the canvas, px. Rounded where nothing is turned or
        scaled: whole pixels are not resampled.
    turn : float
        Degrees clockwise, round that pixel.
    scale : float
        Factor.

    Returns
    -------
    Layer
        Where it was resampled, transparent beyond the edges of what it was.

    Raises
    ------
    ImageError, OptionError
        For numbers out of range; where a picture that is turned or scaled needs its `data_range`.

    Examples
    --------
    >>> import numpy as np
    >>> placed(Layer(np.zeros((20, 30))), at=(4.2, -1.7))
    Layer('layer', 30 × 20 px at 4,-2, float64)
    >>> placed(Layer(np.zeros((20, 30))), at=(0, 0), scale=1.5)
    Layer('layer', 45 × 30 px at 0,0, float64)
    """
    check_kind("layer", layer, Layer, "a Layer")
    place = check_numbers("at", at)
    if place.shape != (2,):
        raise OptionError(
            "{parameter} is of shape {shape!s}; pass two numbers, x and y in px",
            kind="shape",
            parameter=Term("at"),
            value=at,
            shape=place.shape,
        )
    u, v = place.tolist()
    check_number("turn", turn, -180, 180)
    check_number("scale", scale, 1e-6, 1e6)
    for side in (u, v):
        check_number("at", side, -FARTHEST, FARTHEST)
    return on_canvas(layer, similarity((u, v), turn, scale))
