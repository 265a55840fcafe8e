"""Penalties by how often a canvas shows the pixels of exemplars."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Ints32
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import Guide, PlaceGrid
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.patch_search import box_sum
from toposeam.texture.placement.feature_shares import FeatureShares

#: Share of the canvas that is added to both shares of an exemplar, so that their ratio stays bounded.
_SHARE_FLOOR = 0.02
#: Power to which ratios of shares are raised: steep, so that even unlike exemplars keep to their shares.
_SHARE_POWER = 6
#: Fixed-point scale: sums of whole numbers do not depend on their order.
_FIXED_POINT = 16
#: Number of steps, over all channels of a guide together, into which it is quantised.
_GUIDE_STEPS = 16
#: Largest usage that a guide may ask of a pixel, in multiples of the average, lest one stone be a whole sky.
_MOST_GUIDED = 4.0
#: Upper bound of the limit of usage, which a canvas cannot reach.
_UNLIMITED = 2**31 - 1


class UsagePenalty:
    """Penalise pixels, and features, that show often already.

    The factor is 1 + variety × (usage / average usage)², times that of the feature shares. It is the same for
    all patches of one shape until the canvas changes, so it is kept until :meth:`refresh`.

    Parameters
    ----------
    canvas : IndexCanvas
    atlas : Atlas
    average : (AH, 1) or (AH, AW) float array
        How often pixels should show, by the atlas's row or each.
    most : float
        Limit of usage, in multiples of the average.
    variety : float
        Strength.
    feature_shares : FeatureShares, optional
        Penalty on features that have shown on more than their share.
    """

    def __init__(
        self,
        canvas: IndexCanvas,
        atlas: Atlas,
        average: npt.NDArray[np.float64],
        most: float,
        variety: float,
        feature_shares: FeatureShares | None = None,
    ) -> None:
        self._canvas, self._atlas, self._average = canvas, atlas, average
        self._variety, self._feature_shares = variety, feature_shares
        #: How often pixels may show, as `average`.
        self.limit: Ints32 = np.clip(np.floor(most * average), 1, _UNLIMITED).astype(np.int32)
        self._cache: dict[tuple[object, ...], tuple[Floats32, Floats32 | None]] = {}

    def refresh(self) -> None:
        """Discard what was computed before the canvas changed."""
        self._cache.clear()

    def factor(self, places: PlaceGrid) -> Floats32:
        """Compute the factor on the error of places, (n, m) float32."""
        return self._known(places)[0]

    def used_up(self, places: PlaceGrid) -> Floats32 | None:
        """Compute the share of each place's pixels that have reached their limit, (n, m) float32; None where
        no pixel has.
        """
        return self._known(places)[1]

    def _known(self, places: PlaceGrid) -> tuple[Floats32, Floats32 | None]:
        key = places.shape, places.first, places.step, places.size
        if key not in self._cache:
            self._cache[key] = self._compute(places)
        return self._cache[key]

    def _compute(self, places: PlaceGrid) -> tuple[Floats32, Floats32 | None]:
        usage = self._canvas.usage.reshape(self._atlas.usable.shape)
        shape, (n, m), grid = places.shape, places.size, slice(places.first, None, places.step)
        pixels = shape[0] * shape[1]
        if self._average.shape[1] == 1:
            average = (pixels * self._average[grid][:n]).astype(np.float32)
        else:
            whole = np.rint(_FIXED_POINT * self._average).astype(np.int32)
            average = box_sum(whole, shape)[grid, grid][:n, :m].astype(np.float32) / np.float32(_FIXED_POINT)
        factor: Floats32 = np.divide(box_sum(usage, shape)[grid, grid][:n, :m], average, dtype=np.float32)
        np.square(factor, out=factor)
        factor *= np.float32(self._variety)
        factor += np.float32(1)
        if self._feature_shares is not None:
            factor *= self._feature_shares.factor(places, usage, self._variety)
        over = usage >= self.limit
        if not over.any():
            return factor, None
        used_up: Floats32 = box_sum(over, shape)[grid, grid][:n, :m].astype(np.float32)
        used_up /= np.float32(pixels)
        return factor, used_up


class SharePenalty:
    """Penalise exemplars that show on more than their share of the canvas.

    Parameters
    ----------
    canvas : IndexCanvas
    atlas : Atlas
    shares : (E,) float array
        Wanted shares of the exemplars, of sum 1.
    """

    def __init__(self, canvas: IndexCanvas, atlas: Atlas, shares: npt.NDArray[np.float64]) -> None:
        self._canvas, self._atlas, self._shares = canvas, atlas, shares
        self._owner = atlas.owner_of_rows

    def factor(self, places: PlaceGrid) -> Floats32:
        """Compute the factor on the error of places, (n, 1) float32."""
        rows = self._canvas.usage.reshape(self._atlas.usable.shape).sum(axis=1)
        shown = np.add.reduceat(rows, self._atlas.corners[:, 0])
        part = shown / max(int(shown.sum()), 1)
        often = ((part + _SHARE_FLOOR) / (self._shares + _SHARE_FLOOR)) ** _SHARE_POWER
        factor: Floats32 = often[self._owner[places.axes[0]], np.newaxis].astype(np.float32)
        return factor


def average_usage(atlas: Atlas, area: int, shares: npt.NDArray[np.float64] | None) -> npt.NDArray[np.float64]:
    """Compute how often a usable pixel shows on average, by the atlas's row: (AH, 1), 1 at least."""
    usable = atlas.usable.sum(axis=1)
    if shares is None:
        return np.full((len(usable), 1), max(area / max(int(usable.sum()), 1), 1.0))
    each = np.add.reduceat(usable, atlas.corners[:, 0])
    return np.maximum(area * shares / np.maximum(each, 1), 1.0)[atlas.owner_of_rows, np.newaxis]


def guided_usage(atlas: Atlas, guide: Guide, area: int) -> npt.NDArray[np.float64]:
    """Compute how often each pixel has to show for a guide: (AH, AW), 1 at least.

    A value that the guide asks for on much of the canvas, and that few pixels of the exemplars stand for,
    shows often; so no pixel is used up that is still asked for.
    """
    stands = guide.source[atlas.usable]
    low = np.minimum(stands.min(axis=0), guide.target.min(axis=(0, 1)))
    high = np.maximum(stands.max(axis=0), guide.target.max(axis=(0, 1)))
    each = max(2, round(_GUIDE_STEPS ** (1 / stands.shape[1])))

    def steps(values: Floats32) -> npt.NDArray[np.intp]:
        share = (values - low) / np.maximum(high - low, 1e-12)
        found: npt.NDArray[np.intp] = np.minimum((share * each).astype(np.intp), each - 1)
        return found

    there, places, count = np.unique(steps(stands), axis=0, return_inverse=True, return_counts=True)
    asked, wanted = np.unique(steps(guide.target).reshape(-1, stands.shape[1]), axis=0, return_counts=True)
    apart = np.square(asked[:, np.newaxis] - there).sum(axis=2)
    demand = np.bincount(apart.argmin(axis=1), wanted, len(there)) * (area / max(int(wanted.sum()), 1))
    average = area / max(int(count.sum()), 1)
    often = np.maximum(np.minimum(demand / count, _MOST_GUIDED * average), 1.0)
    result = np.ones(atlas.usable.shape)
    result[atlas.usable] = often[places.ravel()]
    return result
