"""Lay a patch: rank places, draw one, cut the patch along the best seam, paint it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Floats32, Ints32, Mask
from toposeam.errors import OverlapError
from toposeam.seam.labels import seam_labels
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import Guide, Offers, Penalty, Site
from toposeam.texture.exemplar.atlas import Atlas, values_at
from toposeam.texture.exemplar.landmarks import add_guard, find_landmarks
from toposeam.texture.exemplar.turns import Turns
from toposeam.texture.periodicity.phase import Phase
from toposeam.texture.placement.feature_shares import FeatureShares
from toposeam.texture.placement.mirror_copies import MirrorCopyPenalty
from toposeam.texture.placement.near_copies import NearCopyPenalty, ObjectRepeatPenalty, near_reach
from toposeam.texture.placement.options import LayOptions
from toposeam.texture.placement.ranking import Ranking
from toposeam.texture.placement.usage_penalty import SharePenalty, UsagePenalty, average_usage, guided_usage
from toposeam.texture.placement.wave_conflicts import WaveConflicts

#: Largest area to fill, as a share of the exemplars, that counts as small: there usage does not matter.
_SMALL_AREA = 0.05
#: Where the patch and what is there differ from a guide by squares less apart than this, the seam decides.
_GUIDE_TOLERANCE = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosedPatch:
    """A patch before it is cut along a closed seam round the part that it has to show."""

    #: First row and column on the canvas.
    at: tuple[int, int]
    #: (h, w) flat indices of the patch, and (h + 2, w + 2) those of the canvas, one pixel more all round.
    source: Ints32
    before: Ints32
    #: (h, w) bool: where it has to show, and where it may.
    must: Mask
    may: Mask

    def changes(self, shows: Mask) -> int:
        """Count the pixels that it changes where it shows."""
        return int(np.count_nonzero(shows & (self.before[1:-1, 1:-1] != self.source)))


class PatchPlacer:
    """Lays patches of an atlas on a canvas.

    Parameters
    ----------
    atlas : Atlas
    features : (AH, AW, F) float32 array
        Values by which overlapping patches are compared, 0 where the atlas is not usable.
    canvas : IndexCanvas
    options : LayOptions
    rng : numpy.random.Generator
    area : int
        Number of canvas pixels that patches will fill, for the average usage of a source pixel.
    guide : Guide, optional
        The wanted look of the patches.
    phase : Phase, optional
        Excludes places that are out of step with the texture's order.
    shares : sequence of float, optional
        Share of the canvas that each exemplar is to show on, in any unit; without it wherever it fits best.
    turns : str
        Positions of every exemplar that the atlas holds.
    levelled : bool
        Whether light is levelled. Then landmarks are kept apart even where they are no objects on a ground:
        where light is even, a dark spot stands out.
    """

    def __init__(
        self,
        atlas: Atlas,
        features: Floats32,
        canvas: IndexCanvas,
        options: LayOptions,
        rng: np.random.Generator,
        area: int,
        guide: Guide | None = None,
        phase: Phase | None = None,
        shares: Sequence[float] | None = None,
        turns: Turns = "none",
        levelled: bool = False,
    ) -> None:
        self.atlas, self.features, self.canvas = atlas, features, canvas
        self.options, self.rng, self.phase, self.margin = options, rng, phase, atlas.margin
        self._guide = guide
        #: Cost of each pixel of the atlas to seams, flat; None where there are no objects to be kept.
        self.guard: Floats32 | None = None
        part = None if shares is None else np.asarray(shares, float) / sum(shares)
        usage, near, feature_shares, variety = None, None, None, options.variety
        if area > _SMALL_AREA * int(atlas.usable.sum()):
            average = average_usage(atlas, area, part) if guide is None else guided_usage(atlas, guide, area)
            if variety:
                near = NearCopyPenalty(atlas, canvas, variety)
            if guide is None and variety:
                weight, self.guard = find_landmarks(features, atlas.copied, atlas.factor)
                objects = self.guard is not None
                if not canvas.patches:  # visible pixels are continued unchanged
                    feature_shares = FeatureShares(
                        features, atlas, average, levelled=levelled, objects=objects
                    )
                if levelled or objects:
                    near = ObjectRepeatPenalty(atlas, canvas, weight, variety)
            # A guide asks for some pixels often, and for none beside them: usage is penalised, not limited.
            most = options.most if guide is None else math.inf
            usage = UsagePenalty(canvas, atlas, average, most, variety, feature_shares)
        self.ranking = Ranking(atlas, features, canvas, options, guide, usage)
        self._near_strength = 0.0 if near is None else near.strength
        self._turned = turns != "none"
        further: list[Penalty | None] = [
            near,
            None if part is None else SharePenalty(canvas, atlas, part),
            phase,
            MirrorCopyPenalty(atlas, canvas, turns) if self._turned else None,
        ]
        self.ranking.penalties += [one for one in further if one is not None]

    def lay(self, top: int, left: int, shape: tuple[int, int], may_show: Mask | None = None) -> bool:
        """Lay one patch on a window of the canvas; False where nothing there is empty.

        Parameters
        ----------
        top, left : int
            Its first pixel on the canvas.
        shape : (int, int)
            Its height and width.
        may_show : (h, w) bool array, optional
            Where the patch may replace what is there; it always fills what is empty.
        """
        site = self.site(top, left, shape, may_show)
        if site is None:
            return False
        self.refresh()
        source = self.patch(self.pick(site.at, shape, self.ranking.offers(site)), shape)
        self.canvas.paint(top, left, source, self.shows(site, source))
        return True

    def site(self, top: int, left: int, shape: tuple[int, int], may_show: Mask | None = None) -> Site | None:
        """Read a window of the canvas, None where nothing is empty; arguments as of :meth:`lay`."""
        m, (h, w) = self.margin, shape
        known = self.canvas.read(top - m, left - m, h + 2 * m, w + 2 * m)
        _, _, inside = self.canvas.window(top, left, h, w)
        inner = known[m : m + h, m : m + w]
        empty = (inner < 0) & inside
        if not empty.any():
            return None
        covers = inside if may_show is None else (may_show | empty) & inside
        return Site.of((top, left), shape, known, inner >= 0, covers, self.options.context_weight)

    def pick(
        self,
        at: tuple[int, int],
        shape: tuple[int, int],
        offers: Offers,
        conflicts: WaveConflicts | None = None,
    ) -> tuple[int, int]:
        """Draw the atlas row and column of the patch for a window from the best places.

        Parameters
        ----------
        at, shape : (int, int)
            The window.
        offers : Offers
        conflicts : WaveConflicts, optional
            Places that have been picked since these were looked for.
        """
        if len(offers.errors):
            errors = offers.errors if conflicts is None else conflicts.judged(at, shape, offers)
            good = np.flatnonzero(errors <= (1 + self.options.tolerance) * errors.min())
            pick = int(good[self.rng.integers(len(good))])
            place = int(offers.rows[pick]), int(offers.columns[pick])
        else:
            place = self.ranking.anywhere(shape, self.rng)
        if conflicts is not None:
            conflicts.add(at, place, offers)
        if self.phase is not None:
            self.phase.begin(at, place, shape)
        return place

    def follows(self, at: tuple[int, int], source: Ints32) -> bool:
        """Test whether a patch, (h, w) flat indices, follows the guide, if there is one."""
        rows, columns, _ = self.canvas.window(*at, *source.shape)
        return self._guide is None or self._guide.followed(rows, columns, source)

    def reach(self, shape: tuple[int, int]) -> int:
        """Compute the distance, px, round a patch's window that must be laid before a place is picked."""
        return max(self.margin, max(shape) // 2) if self._turned else self.margin

    def wave_conflicts(self) -> WaveConflicts:
        """Make the conflicts of a new wave, of which nothing has been picked yet."""
        usage, largest = self.ranking.usage, self.ranking.largest_copy
        limit = None if usage is None else usage.limit
        return WaveConflicts(
            self.canvas, self.atlas, near_reach(self.atlas), self._near_strength, limit, largest
        )

    def refresh(self) -> None:
        """Discard values that were computed before the canvas changed."""
        if self.ranking.usage is not None:
            self.ranking.usage.refresh()

    def patch(self, place: tuple[int, int], shape: tuple[int, int]) -> Ints32:
        """Compute the (h, w) flat indices of the patch at an atlas row and column."""
        width = self.atlas.width
        grid = np.arange(shape[0])[:, np.newaxis] * width + np.arange(shape[1])
        return (place[0] * width + place[1] + grid).astype(np.int32)

    def shows(self, site: Site, source: Ints32) -> Mask:
        """Find where a patch shows in a window: (h, w) bool."""
        m, (h, w) = self.margin, site.shape
        padded = site.known[m - 1 : m + h + 1, m - 1 : m + w + 1]
        empty = (padded[1:-1, 1:-1] < 0) & site.covers
        shows = self.cut(padded, source, site.covers) | empty
        if self._guide is None or not self._guide.weight:
            return shows
        # Where the guide clearly favours one side, that is not left to the seam.
        rows, columns, _ = self.canvas.window(*site.at, h, w)
        wanted, stands = self._guide.target[rows, columns], self._guide.source
        comes, there = (
            np.square(values_at(stands, index) - wanted).sum(axis=2) for index in (source, padded[1:-1, 1:-1])
        )
        shows |= site.covers & (comes < there - _GUIDE_TOLERANCE)
        kept: Mask = shows & (empty | (comes <= there + _GUIDE_TOLERANCE))
        return kept

    def cut(self, padded: Ints32, source: Ints32, covers: Mask, closed: bool = False) -> Mask:
        """Find where a patch shows along the best seam between it and the canvas.

        Parameters
        ----------
        padded : (h + 2, w + 2) int32 array
            Flat indices that the canvas shows in the patch's window and one pixel round it; -1 where empty.
        source : (h, w) int32 array
            Flat indices of the patch.
        covers : (h, w) bool array
            Where it may show; it must show where the canvas is empty there.
        closed : bool
            Whether its seam is likely to run all round it.
        """
        mask_a = padded >= 0
        mask_b = np.zeros_like(mask_a)
        mask_b[1:-1, 1:-1] = covers
        inner = padded[1:-1, 1:-1]
        empty = (inner < 0) & covers
        if not (mask_a & mask_b).any():
            return covers
        if (inner == source)[(inner >= 0) & covers].all():  # it continues what is there; there is no seam
            return empty
        b = np.zeros((*mask_a.shape, self.features.shape[2]), np.float32)
        row, column = divmod(int(source[0, 0]), self.atlas.width)
        b[1:-1, 1:-1] = self.features[row : row + source.shape[0], column : column + source.shape[1]]
        labels = self._labels(padded, b, source, mask_b, closed)
        return empty if labels is None else labels[1:-1, 1:-1] & covers

    def cut_closed(self, patches: Sequence[ClosedPatch]) -> list[Mask]:
        """Find where each of some patches shows, along the best seam round what it has to show: (h, w) bool
        each. They must not touch on the canvas, and are cut in one array, one below the other: most of the
        time of a small seam goes into calls.
        """
        width = max(patch.before.shape[1] for patch in patches)
        tops = np.cumsum([0, *(len(patch.before) for patch in patches)]).tolist()
        there, comes = (np.full((tops[-1], width), -1, np.int32) for _ in range(2))
        covers, inner = np.zeros(there.shape, bool), []
        for top, patch in zip(tops, patches, strict=False):
            h, w = patch.source.shape
            inner.append(np.s_[top + 1 : top + 1 + h, 1 : 1 + w])
            there[top : top + h + 2, : w + 2] = patch.before
            there[inner[-1]][patch.must] = -1
            covers[inner[-1]], comes[inner[-1]] = patch.may, patch.source
            known = patch.may & (there[inner[-1]] >= 0)
            if (patch.before[1:-1, 1:-1] == patch.source)[known].all():  # nothing is to be seen of a seam
                covers[inner[-1]] = patch.must
        b = values_at(self.features, comes)
        labels = self._labels(there, b, comes[1:-1, 1:-1], covers, closed=True)
        if labels is None:
            return [patch.must for patch in patches]
        return [(labels[box] & patch.may) | patch.must for box, patch in zip(inner, patches, strict=True)]

    def _labels(self, there: Ints32, b: Floats32, source: Ints32, covers: Mask, closed: bool) -> Mask | None:
        """Find the best seam between the canvas and new values: True where these show; None where the overlap
        is too thin to hold a seam.
        """
        a, options = values_at(self.features, there), self.options
        if self.guard is not None:
            a, b = add_guard(self.guard, a, b, there, source)
        try:
            return seam_labels(a, b, there >= 0, covers, options.method, options.cost, closed=closed)
        except OverlapError:
            return None
