"""Every kind of pixel on the share of a texture that it has of the exemplar.

Patches never reach beyond an exemplar, so what lies along its borders belongs to few of them and shows less
often than its middle; and what fits nearly everywhere shows more often than what does not. So pixels are
sorted by their surroundings (the colours' two principal components and the contrast, in some steps each), and
places are penalised the more their kinds have shown against their share. Kaspar et al. (2015,
doi:10.1111/cgf.12565) keep the use of single pixels uniform; what makes two pictures alike is that of kinds,
which leaves more choice.
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

#: Deviation in px of the means in which pixels are seen.
_BLUR = 3.0
#: Number of steps, equally frequent in the exemplar, into which each property is quantised.
_STEPS = 16
#: How many principal components of the colours count.
_COMPONENTS = 2
#: Side of the blocks that have a kind, px; larger where there would be more blocks than this.
_BLOCK, _BLOCKS = 4, 10_000
#: The canvas counts as if this share of the exemplar had been shown on it once, so that the first patches do
#: not weigh too much.
_BEFORE = 0.25
#: Natural logarithm of the factor on a place: per unit of variety and of the sum, over the properties, of the
#: excess of its kinds; the same where there are objects on a ground, of which more would be cut else; and its
#: bound.
_STRENGTH, _GENTLE, _MOST = 16.0, 6.0, 5.0
#: Fixed-point scale: sums of whole numbers do not depend on their order.
_ONE = 256


class Kinds:
    """Tells which places are of kinds that have shown too often.

    Parameters
    ----------
    features : (AH, AW, F) float32 array
        0 where not usable.
    atlas : Atlas
    average : (AH, 1) array
        How often pixels should show, by the atlas's row.
    levelled : bool
        Whether light is levelled: then contrast, which goes with the light, is no property.
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
        self._strength = _GENTLE if objects else _STRENGTH
        self._step = max(_BLOCK, math.isqrt(atlas.usable.size // _BLOCKS))
        wanted = self._blocks((atlas.copied * average).astype(np.float32))
        known = np.flatnonzero(wanted)
        self._before = _BEFORE * int(atlas.copied.sum())
        #: For each property the blocks' kinds and what share of the canvas each kind should have.
        self._kinds: list[tuple[npt.NDArray[np.intp], npt.NDArray[np.float64]]] = []
        for plane in self._properties(features, atlas, levelled=levelled):
            values = plane.ravel()
            steps = np.unique(np.quantile(values[known], np.arange(1, _STEPS) / _STEPS))
            kind = np.searchsorted(steps, values, side="right")
            share = np.bincount(kind, wanted.ravel()) / max(float(wanted.sum()), 1e-12)
            self._kinds.append((kind, share))
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
        off = np.zeros(len(used))
        for kind, share in self._kinds:
            shown = np.bincount(kind, used, len(share))
            total = float(shown.sum()) + self._before
            often = (shown + self._before * share) / (total * np.where(share > 0, share, 1))
            off += np.where(share > 0, often - 1, 0)[kind]
        whole = np.rint(_ONE * off).astype(np.int32).reshape(self._copied.shape) * self._copied
        boxes = [
            min(max(1, round(length / self._step)), limit)
            for length, limit in zip(places.shape, whole.shape, strict=True)
        ]
        sums = box_sum(whole, (boxes[0], boxes[1])) / np.float32(_ONE * boxes[0] * boxes[1])
        power = np.clip(sums * np.float32(self._strength * variety), -_MOST, _MOST)
        factor = np.exp(power).astype(np.float32, copy=False)
        return places.from_blocks(factor, self._step, (self._step // 2,) * 2)

    def _properties(self, features: Floats32, atlas: Atlas, *, levelled: bool) -> list[Floats32]:
        """Compute what the surroundings of blocks look like, an array of blocks for each property."""
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
