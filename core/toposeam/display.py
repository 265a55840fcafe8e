"""Results as pictures for notebooks, and as PIL pictures. Pillow is loaded at the first use."""

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

#: Longer side of pictures in notebooks, px at most: larger ones would bloat the notebook's file.
_MAX_NOTEBOOK_PX = 800


def to_rgba8(image: Image, alpha: Image | None = None) -> Image:
    """Convert a picture to (H, W, 3) uint8, or to (H, W, 4) if it has an opacity.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array
        Of one or two channels the first one becomes gray; of three or more the first three are the colour.
        The last one of two or four channels is the opacity, unless `alpha` is given.
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
    """Return a result, or an array, as a PIL picture of 8 bits.

    Parameters
    ----------
    result : array, or a result with an ``image`` (and an ``alpha``), or with labels

    Raises
    ------
    OptionError
        When the result has no picture.

    Examples
    --------
    >>> to_pil(np.zeros((2, 3))).size
    (3, 2)
    """
    from PIL import Image as Pillow

    return Pillow.fromarray(_pixels(result))


def to_png(image: Image, alpha: Image | None = None) -> bytes:
    """Return a picture as PNG for a notebook, reduced if it is large."""
    from PIL import Image as Pillow

    picture = Pillow.fromarray(to_rgba8(image, alpha))
    picture.thumbnail((_MAX_NOTEBOOK_PX, _MAX_NOTEBOOK_PX))
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()


def line_svg(drawing: str, points: npt.NDArray[np.float64]) -> str:
    """Return a line as SVG for a notebook.

    Parameters
    ----------
    drawing : str
        The attribute ``d`` of the SVG path.
    points : (N, 2) array
        x and y of points; their bounding box is shown.
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
