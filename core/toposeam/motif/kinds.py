"""The four kinds of pattern (thesis 4.5), measured: thick or thin strokes, and whether the base image
shows.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats
from toposeam.colours import LUMA
from toposeam.errors import ImageError, Term
from toposeam.images import as_float

#: Least width of thick strokes, as a share of the motif's shorter side: in some hundred motifs, wider lines
#: were seen as areas.
THICK = 0.09
#: Least overlap of the silhouettes of motif and base image at which the latter is recognised by people who do
#: not know it. Of 32 motifs of a leaf, the 16 with 0.60 and more were named at sight, those up to 0.50 not.
CLEAR = 0.55

#: Standard deviation of the blur before silhouettes are taken, as a share of the motif's shorter side: it
#: closes the gaps between strokes, as the eye does with a half-tone.
_BLUR = 0.02


class Kind(StrEnum):
    """The four kinds, in the thesis's order."""

    THICK_CLEAR = "A"
    THICK_HIDDEN = "B"
    THIN_CLEAR = "C"
    THIN_HIDDEN = "D"

    @property
    def words(self) -> str:
        """Description of the kind."""
        return _WORDS[self]


_WORDS = {
    Kind.THICK_CLEAR: "thick strokes, theme shows",
    Kind.THICK_HIDDEN: "thick strokes, theme hidden",
    Kind.THIN_CLEAR: "thin strokes, theme shows",
    Kind.THIN_HIDDEN: "thin strokes, theme hidden",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Character:
    """Measured stroke width and likeness of a motif."""

    #: Mean width of its strokes as a share of the shorter side.
    stroke: float
    #: Overlap of its silhouette with the base image's, in [0, 1]; 0 without a base image.
    likeness: float

    @property
    def kind(self) -> Kind:
        """The kind, by the thresholds `THICK` and `CLEAR`."""
        thick, clear = self.stroke > THICK, self.likeness >= CLEAR
        if thick:
            return Kind.THICK_CLEAR if clear else Kind.THICK_HIDDEN
        return Kind.THIN_CLEAR if clear else Kind.THIN_HIDDEN


def measure(image: npt.ArrayLike, base: npt.ArrayLike | None = None) -> Character:
    """Measure a motif's picture.

    Strokes are the pixels darker than Otsu's threshold (1979, doi:10.1109/TSMC.1979.4310076). Within a strip
    of width w the distance to its border is w / 4 on average, so the width is four times that average, with
    strokes weighted by their area.

    The likeness is Jaccard's index of two silhouettes: the area of their intersection divided by that of
    their union. Otsu's threshold divides each picture, the motif slightly blurred, into a dark and a light
    side. The base image's silhouette is its smaller side, the motif's the side that overlaps it better.

    Parameters
    ----------
    image : (H, W[, 3]) array_like
        The motif, taken to repeat by translation.
    base : (H, W[, 3]) array_like, optional
        The base image, of the same size.

    Raises
    ------
    ImageError
        When a picture cannot be used, or the two differ in size.
    """
    brightness = _brightness(as_float(image))
    height, width = brightness.shape
    strokes = _dark(brightness)
    # Half a copy on every side continues strokes across the border.
    around = np.pad(strokes, [(height // 2, height // 2), (width // 2, width // 2)], mode="wrap")
    distance = ndimage.distance_transform_edt(around)[
        height // 2 : height // 2 + height, width // 2 : width // 2 + width
    ]
    # Distances are measured to the centres of pixels outside, half a pixel beyond the border.
    stroke_px = 4.0 * float(np.maximum(distance[strokes] - 0.5, 0.25).mean()) if strokes.any() else 0.0
    likeness = 0.0
    if base is not None:
        other = _brightness(as_float(base, "base"))
        if other.shape != brightness.shape:
            raise ImageError(
                "{parameter} has shape {shape!s}, the motif {wanted!s}; resize it to the motif's size",
                kind="shape",
                parameter=Term("base"),
                shape=other.shape,
                wanted=brightness.shape,
            )
        blurred = ndimage.gaussian_filter(brightness, _BLUR * min(height, width), mode="wrap")
        likeness = _overlap(_dark(blurred), _dark(other))
    return Character(stroke=stroke_px / min(height, width), likeness=likeness)


def _brightness(image: npt.NDArray[np.float32]) -> Floats:
    values = image.astype(np.float64)
    brightness: Floats = values[..., 0] if values.shape[2] < 3 else values[..., :3] @ LUMA
    return brightness


def _dark(values: Floats) -> npt.NDArray[np.bool_]:
    """Threshold an image by Otsu's method: True where it is darker; False everywhere on an even image."""
    from skimage.filters import threshold_otsu

    if np.ptp(values) < 1e-9:
        return np.zeros(values.shape, bool)
    dark: npt.NDArray[np.bool_] = values <= float(threshold_otsu(values))  # type: ignore[no-untyped-call]
    return dark


def _overlap(dark: npt.NDArray[np.bool_], base: npt.NDArray[np.bool_]) -> float:
    """Compute Jaccard's index of the smaller side of a base image and the better side of a motif."""
    shape = base if base.mean() <= 0.5 else ~base
    if not shape.any():
        return 0.0
    return max(float((side & shape).sum() / (side | shape).sum()) for side in (dark, ~dark))
