"""Results as pictures: for notebooks, and as PIL pictures. Pillow is loaded when it is wanted."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Image
from toposeam.errors import OptionError
from toposeam.images import as_array, as_float, full_scale, in_dtype

if TYPE_CHECKING:
    import PIL.Image

#: Notebooks are shown at most so many px on the longer side.
_SHOWN_PX = 800


def to_rgba8(image: Image, alpha: Image | None = None) -> Image:
    """Any picture as (H, W, 3) uint8, or (H, W, 4) with an opacity.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array
        Of other numbers of channels than three the first one, or the first three, are seen.
    alpha : (H, W) array, optional
    """
    values = as_float(image, data_range=float(full_scale(as_array(image).dtype)))
    colour = values[..., :3] if values.shape[2] >= 3 else values[..., :1]
    planes = [np.broadcast_to(colour, (*colour.shape[:2], 3))]
    if alpha is not None:
        planes.append(as_float(alpha, data_range=float(full_scale(as_array(alpha).dtype))))
    elif values.shape[2] in (2, 4):
        planes.append(values[..., -1:])
    return in_dtype(np.concatenate(planes, axis=2) * 255, np.dtype(np.uint8))


def to_pil(result: Any) -> PIL.Image.Image:
    """A result, or an array, as a PIL picture of 8 bits.

    Parameters
    ----------
    result : array, or a result with an ``image`` (and an ``alpha``), or with labels

    Raises
    ------
    OptionError
        When it cannot be shown as a picture.

    Examples
    --------
    >>> to_pil(np.zeros((2, 3))).size
    (3, 2)
    """
    from PIL import Image as Pillow

    return Pillow.fromarray(_pixels(result))


def to_png(image: Image, alpha: Image | None = None) -> bytes:
    """A picture as PNG for a notebook, made smaller where it is large."""
    from PIL import Image as Pillow

    picture = Pillow.fromarray(to_rgba8(image, alpha))
    picture.thumbnail((_SHOWN_PX, _SHOWN_PX))
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()


def line_svg(drawing: str, points: npt.NDArray[np.float64]) -> str:
    """A line as SVG for a notebook.

    Parameters
    ----------
    drawing : str
        The ``d`` of its path.
    points : (N, 2) array
        What it has to show: x and y.
    """
    (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
    edge = 0.02 * max(right - left, bottom - top, 1.0)
    box = f"{left - edge:g} {top - edge:g} {right - left + 2 * edge:g} {bottom - top + 2 * edge:g}"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="400" viewBox="{box}">'
        f'<path d="{drawing}" fill="none" '
        'stroke="#c00" stroke-width="2" vector-effect="non-scaling-stroke"/></svg>'
    )


def _pixels(result: Any) -> Image:
    if isinstance(result, np.ndarray):
        return to_rgba8(result)
    image = getattr(result, "image", None)
    image = image() if callable(image) else image
    if image is not None:
        return to_rgba8(image, getattr(result, "alpha", None))
    labels = getattr(result, "labels", None)
    if labels is not None and np.ndim(labels) == 2:
        return to_rgba8(labels)
    raise OptionError(
        "a {type} is no picture; pass {allowed}",
        kind="type",
        value=result,
        type=type(result).__name__,
        allowed="an array, or a result that has an image",
    )
