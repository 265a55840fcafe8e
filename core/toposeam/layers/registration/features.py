"""Pictures as they are recognised: detail without slow light, and SIFT features of a reduced copy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import TypeVar

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats, Mask
from toposeam.images import as_float
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.registration.sift import find_features

Float = TypeVar("Float", np.float32, np.float64)

#: Features are looked for in as many pixels, and patches laid on each other in as many.
_REDUCED_PIXELS, _FINE_PIXELS = 200_000, 2_000_000
_CONTRAST = 0.004  # of features, three times as faint as usual
_BLUR = 8.0  # px; slower changes are exposure, not content
_CLEARLY = 0.85  # distance of a feature that matches, by that of the next one
_LEAST_CORNER = 0.1  # least of how much a patch changes along its straightest direction, by that across it


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A picture as it is compared: gray without slow changes, and what is seen of it reduced."""

    detail: npt.NDArray[np.float32]
    known: Mask
    scale: int
    keypoints: Floats  #: (K, 2) x and y at full size
    descriptors: npt.NDArray[np.uint8]  #: (K, 128)
    #: How many px of the picture a pixel of `detail` is wide.
    fine: int = 1
    #: Width and height of the picture, px, where `detail` does not say it.
    whole: tuple[int, int] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture, px."""
        if self.whole is not None:
            return self.whole
        return self.detail.shape[1] * self.fine, self.detail.shape[0] * self.fine

    def __post_init__(self) -> None:
        for values in (self.detail, self.known, self.descriptors):
            values.setflags(write=False)  # as those of costs


def look_at(picture: Layer) -> Look:
    """Detail and features of a picture."""
    height, width = picture.image.shape[:2]
    fine = max(1, int(np.ceil(np.sqrt(height * width / _FINE_PIXELS))))
    known = reduced(picture.covered.astype(np.float32), fine) == 1
    planes = as_float(np.asarray(picture.image), picture.title, picture.data_range)
    gray = reduced(gray_of(planes, np.float32), fine)
    gray[~known] = 0
    slow = scipy.ndimage.gaussian_filter(gray, _BLUR)
    if not known.all():
        slow /= np.maximum(scipy.ndimage.gaussian_filter(known.astype(np.float32), _BLUR), 1e-6)
    detail = np.where(known, gray - slow, np.float32(0)).astype(np.float32)
    scale = max(1, int(np.ceil(np.sqrt(gray.size / _REDUCED_PIXELS))))
    small = reduced(gray, scale)
    points, descriptors = find_features(small, _CONTRAST)
    points = (points + 0.5) * scale * fine - 0.5
    return Look(detail, known, scale * fine, points, descriptors, fine, (width, height))


def gray_of(planes: npt.NDArray[np.float32], dtype: type[Float]) -> npt.NDArray[Float]:
    """Average (H, W, C) channels in the precision of a type: by a product, which takes numpy a sixth of the
    time that the mean of an axis does.
    """
    channels = planes.shape[2]
    return np.asarray(planes @ np.full(channels, 1 / channels, dtype))


def reduced(plane: npt.NDArray[Float], scale: int) -> npt.NDArray[Float]:
    """Means of squares of so many px a side."""
    if scale == 1:
        return plane
    rows, columns = (size // scale for size in plane.shape)
    whole = plane[: rows * scale, : columns * scale]
    # Slices are added up in a fifth of the time that numpy takes for the mean of two of four axes.
    sums = reduce(np.add, (whole[at::scale] for at in range(scale)))
    return np.asarray(reduce(np.add, (sums[:, at::scale] for at in range(scale))) / scale**2, plane.dtype)


def shared_features(a: Look, b: Look) -> npt.NDArray[np.intp]:
    """Numbers of the features that are each other's nearest and clearly nearer than the next one.

    Returns
    -------
    (N, 2) int array
        In `a` and in `b`.
    """
    if not (len(a.descriptors) and len(b.descriptors)):
        return np.zeros((0, 2), np.intp)
    # Whole numbers up to 128 · 255² are exact in float32, so this is what skimage.feature.match_descriptors
    # gives, in a tenth of its time: |f|² - 2 f s + |s|² of all pairs as one product.
    first, second = (look.descriptors.astype(np.float32) for look in (a, b))
    squares = [np.square(one).sum(axis=1, keepdims=True) for one in (first, second)]
    distance = np.hstack([-2 * first, squares[0], np.ones_like(squares[0])]) @ (
        np.hstack([second, np.ones_like(squares[1]), squares[1]]).T
    )
    near = distance.argmin(axis=1)
    mine = np.arange(len(first))
    least = distance[mine, near]
    # Down the columns numpy finds the least in a tenth of the time that it takes to say where it is.
    mutual = least == distance.min(axis=0)[near]
    distance[mine, near] = np.inf
    next_one = np.maximum(distance.min(axis=1), np.finfo(float).eps ** 2) if len(second) > 1 else np.inf
    clear = np.sqrt(least.astype(float)) / np.sqrt(next_one) < _CLEARLY
    chosen = np.flatnonzero(mutual & clear)
    chosen = chosen[np.sort(np.unique(near[chosen], return_index=True)[1])]  # of those that are alike one
    return np.stack([mine[chosen], near[chosen]], axis=1)


def cornered(patch: npt.NDArray[np.float32]) -> bool:
    """Whether a patch can be told from itself moved in any direction: straight edges alone cannot."""
    smooth = scipy.ndimage.gaussian_filter(patch, 1.5)
    down, right = np.gradient(smooth)
    tensor = np.array(
        [[np.sum(down * down), np.sum(down * right)], [np.sum(down * right), np.sum(right * right)]]
    )
    least, most = np.linalg.eigvalsh(tensor)
    return bool(least > _LEAST_CORNER * most)
