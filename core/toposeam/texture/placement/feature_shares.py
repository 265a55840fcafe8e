"""A penalty that keeps the share of every feature in a texture as it is in the exemplar.

Patches never reach beyond an exemplar, so pixels along its borders belong to few of them and show less often
than those of its middle; and what fits nearly everywhere shows more often than what does not. So blocks of
pixels are classified by their surroundings (the colours' two principal components and the contrast, quantised
in steps of equal frequency), and places are penalised the more, the more often their classes have shown in
proportion to their shares of the exemplar. Kaspar et al. (2015, doi:10.1111/cgf.12565) keep the use of single
pixels uniform. Two pictures look alike if these classes have equal shares, which leaves more choice.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Ints32
from toposeam.texture.canvas.places import PlaceGrid
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.patch_search import box_sum, reduced

#: Standard deviation, px, of the Gaussian in which surroundings are averaged.
_BLUR = 3.0
#: Number of steps, equally frequent in the exemplar, into which each property is quantised.
_STEPS = 16
#: Number of principal components of the colours that are properties.
_COMPONENTS = 2
#: Least side of the blocks that are classified, px, and largest number of blocks: blocks of large exemplars
#: are larger.
_BLOCK, _MOST_BLOCKS = 4, 10_000
#: The canvas counts as if this share of the exemplar had been shown once, so that the first patches do not
#: weigh too much.
_PRIOR_SHARE = 0.25
#: Natural logarithm of the factor on a place, per unit of variety and of the excess of its classes, summed
#: over the properties. It is less where there are objects on a ground, as more of them would be cut.
_STRENGTH, _OBJECTS_STRENGTH = 16.0, 6.0
#: Largest absolute value of that logarithm: no place is excluded.
_MOST_LOGARITHM = 5.0
#: Fixed-point scale: sums of whole numbers do not depend on their order.
_FIXED_POINT = 256


class FeatureShares:
    """Penalise places with features that have shown on more than their share.

    Parameters
    ----------
    features : (AH, AW, F) float32 array
        0 where not usable.
    atlas : Atlas
    average : (AH, 1) array
        How often pixels should show, by the atlas's row.
    levelled : bool
        Whether light is levelled: then contrast, which depends on the light, is no property.
    objects : bool
        Whether there are objects on a ground.
    """

    def __init__(
        self,
        features: Floats32,
        atlas: Atlas,
        average: npt.NDArray[np.float64],
        *,
        levelled: bool = False,
        objects: bool = False,
    ) -> None:
        self._strength = _OBJECTS_STRENGTH if objects else _STRENGTH
        self._step = max(_BLOCK, math.isqrt(atlas.usable.size // _MOST_BLOCKS))
        wanted = self._blocks((atlas.copied * average).astype(np.float32))
        known = np.flatnonzero(wanted)
        self._prior = _PRIOR_SHARE * int(atlas.copied.sum())
        #: For each property the class of each block, and the share of the canvas that each class should have.
        self._classes: list[tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]] = []
        for plane in self._properties(features, atlas, levelled=levelled):
            values = plane.ravel()
            steps = np.unique(np.quantile(values[known], np.arange(1, _STEPS) / _STEPS))
            which = np.searchsorted(steps, values, side="right")
            share = np.bincount(which, wanted.ravel()) / max(float(wanted.sum()), 1e-12)
            self._classes.append((which, share))
        self._copied = wanted > 0

    def factor(self, places: PlaceGrid, usage: Ints32, variety: float) -> Floats32:
        """Compute the factor on the error of places, (n, m) float32.

        Parameters
        ----------
        places : PlaceGrid
        usage : (AH, AW) int32 array
            How often each pixel shows.
        variety : float
        """
        used = self._blocks(usage).ravel()
        excess = np.zeros(len(used))
        for which, share in self._classes:
            shown = np.bincount(which, used, len(share))
            total = float(shown.sum()) + self._prior
            often = (shown + self._prior * share) / (total * np.where(share > 0, share, 1))
            excess += np.where(share > 0, often - 1, 0)[which]
        whole = np.rint(_FIXED_POINT * excess).astype(np.int32).reshape(self._copied.shape) * self._copied
        boxes = [
            min(max(1, round(length / self._step)), limit)
            for length, limit in zip(places.shape, whole.shape, strict=True)
        ]
        sums = box_sum(whole, (boxes[0], boxes[1])) / np.float32(_FIXED_POINT * boxes[0] * boxes[1])
        power = np.clip(sums * np.float32(self._strength * variety), -_MOST_LOGARITHM, _MOST_LOGARITHM)
        factor = np.exp(power).astype(np.float32, copy=False)
        return places.from_blocks(factor, self._step, (self._step // 2,) * 2)

    def _properties(self, features: Floats32, atlas: Atlas, *, levelled: bool) -> list[Floats32]:
        """Compute the properties of the blocks' surroundings: an array with a value per block for each."""
        values, mass = reduced(features, atlas.usable.astype(np.float32), self._step)
        square = np.einsum("yxc,yxc->yx", features, features)[..., np.newaxis]
        squares, _ = reduced(square, atlas.usable.astype(np.float32), self._step)
        blur = _BLUR / self._step
        below = np.maximum(ndimage.gaussian_filter(mass, blur), np.float32(1e-6))
        both = np.concatenate([values, squares], axis=2) * mass[..., np.newaxis]
        seen = ndimage.gaussian_filter(both, (blur, blur, 0)) / below[..., np.newaxis]
        means, squares = seen[..., :-1], seen[..., -1]
        known = means[mass > 0]
        middle = known.mean(axis=0)
        _, axes = np.linalg.eigh((known - middle).T @ (known - middle))
        planes = [(means - middle) @ axes[:, -1 - k] for k in range(min(_COMPONENTS, axes.shape[1]))]
        if not levelled:
            planes.append(np.sqrt(np.maximum(squares - np.square(means).sum(axis=2), 0)))
        return planes

    def _blocks(self, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        """Sum an (AH, AW) array over blocks."""
        step = self._step
        rows, columns = (-(-length // step) for length in values.shape)
        room = (0, rows * step - values.shape[0]), (0, columns * step - values.shape[1])
        whole = np.pad(values, room) if room[0][1] or room[1][1] else values
        lines = np.einsum("rsc->rc", whole.reshape(rows, step, columns * step))
        result: npt.NDArray[Any] = lines[:, ::step].copy()
        for part in range(1, step):  # a sum along the rows, which are short, takes three times as long
            result += lines[:, part::step]
        return result
