"""Lay a patch: rank places, draw one, cut the patch along the best seam, paint it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toposeam.errors import ImageError, OverlapError
from toposeam.images import Mask
from toposeam.seam.labels import seam_labels
from toposeam.texture.atlas import Atlas, Floats32, Ints32, values_at
from toposeam.texture.beside import Beside
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.keeping_step import Phase
from toposeam.texture.kinds import Kinds
from toposeam.texture.landmarks import guarded, landmarks
from toposeam.texture.lay_options import LayOptions
from toposeam.texture.nearby import Nearby, near_reach
from toposeam.texture.ranking import Ranking
from toposeam.texture.repeats import Repeats
from toposeam.texture.sites import Guide, Offers, Penalty, Site
from toposeam.texture.turning import Turns
from toposeam.texture.twins import Twins
from toposeam.texture.use import Shares, Use, average_use

#: Share of the exemplars up to which the area to fill counts as small, so that use does not matter.
_LITTLE = 0.05


class PatchPlacer:
    """Lays patches of an atlas on a canvas.

    Parameters
    ----------
    atlas : Atlas
    features : (AH, AW, F) float32 array
        What overlapping patches are compared by, 0 where the atlas is not usable.
    canvas : IndexCanvas
    options : LayOptions
    rng : numpy.random.Generator
    area : int
        Number of canvas pixels that patches will fill, for the average use of a source pixel.
    guide : Guide, optional
        What the patches should look like.
    phase : Phase, optional
        Which places keep the texture's order in step with the canvas; others are not taken.
    shares : sequence of float, optional
        What part of the canvas each exemplar is to show on, in any unit; without it wherever it fits best.
    turns : str
        Which positions of every exemplar the atlas holds.
    lone : bool
        Whether light is levelled, and what catches the eye is kept apart also where it is no object on a
        ground: where light is even, a dark spot stands out.
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
        lone: bool = False,
    ) -> None:
        self.atlas, self.features, self.canvas = atlas, features, canvas
        self.options, self.rng, self.phase, self.margin = options, rng, phase, atlas.margin
        #: What seams pay for each pixel of the atlas, flat, where there are objects to be kept.
        self.guard: Floats32 | None = None
        part = None if shares is None else np.asarray(shares, float) / sum(shares)
        use, near, kinds, variety = None, None, None, options.variety
        if area > _LITTLE * int(atlas.usable.sum()):
            average = average_use(atlas, area, part)
            if guide is None and variety:
                near = Nearby(atlas, canvas, variety)
                weight, self.guard = landmarks(features, atlas.usable, atlas.factor)
                objects = self.guard is not None
                if not canvas.patches:  # what shows already is continued as it is
                    kinds = Kinds(features, atlas, average, levelled=lone, objects=objects)
                if lone or objects:
                    near = Repeats(atlas, canvas, weight, variety)
            use = Use(canvas, atlas, average, options.most, variety, kinds)
        self.ranking = Ranking(atlas, features, canvas, options, guide, use)
        self._near = 0.0 if near is None else near.strength
        self._turned = turns != "none"
        further: list[Penalty | None] = [
            near,
            None if part is None else Shares(canvas, atlas, part),
            phase,
            Twins(atlas, canvas, turns) if self._turned else None,
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
        """A window of the canvas as it is, None where nothing is empty; arguments as of :meth:`lay`."""
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
        self, at: tuple[int, int], shape: tuple[int, int], offers: Offers, beside: Beside | None = None
    ) -> tuple[int, int]:
        """Atlas row and column of the patch for a window, drawn from the best places.

        Parameters
        ----------
        at, shape : (int, int)
            The window.
        offers : Offers
        beside : Beside, optional
            What has been picked since these were looked for.
        """
        if len(offers.errors):
            errors = offers.errors if beside is None else beside.judged(at, shape, offers)
            good = np.flatnonzero(errors <= (1 + self.options.tolerance) * errors.min())
            pick = int(good[self.rng.integers(len(good))])
            place = int(offers.rows[pick]), int(offers.columns[pick])
        else:
            place = self._anywhere(shape)
        if beside is not None:
            beside.add(at, place, offers)
        if self.phase is not None:
            self.phase.begin(at, place, shape)
        return place

    def reach(self, shape: tuple[int, int]) -> int:
        """How many px round its window a patch must know before a place is picked for it."""
        return max(self.margin, max(shape) // 2) if self._turned else self.margin

    def beside(self) -> Beside:
        """Make what keeps patches that are picked at the same time apart."""
        use, largest = self.ranking.use, self.ranking.largest_copy
        limit = None if use is None else use.limit
        return Beside(self.canvas, self.atlas, near_reach(self.atlas), self._near, limit, largest)

    def refresh(self) -> None:
        """Discard what is known of the canvas, which has changed."""
        if self.ranking.use is not None:
            self.ranking.use.refresh()

    def patch(self, place: tuple[int, int], shape: tuple[int, int]) -> Ints32:
        """The (h, w) flat indices of the patch at an atlas row and column."""
        width = self.atlas.width
        grid = np.arange(shape[0])[:, np.newaxis] * width + np.arange(shape[1])
        return (place[0] * width + place[1] + grid).astype(np.int32)

    def shows(self, site: Site, source: Ints32) -> Mask:
        """Where a patch shows in a window: (h, w) bool."""
        m, (h, w) = self.margin, site.shape
        padded = site.known[m - 1 : m + h + 1, m - 1 : m + w + 1]
        return self.cut(padded, source, site.covers) | ((padded[1:-1, 1:-1] < 0) & site.covers)

    def cut(self, padded: Ints32, source: Ints32, covers: Mask, closed: bool = False) -> Mask:
        """Where a patch shows, given what is there.

        Parameters
        ----------
        padded : (h + 2, w + 2) int32 array
            What the canvas shows in the patch's window and one pixel round it; -1 where empty.
        source : (h, w) int32 array
            The patch.
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
        try:
            a, (method, cost) = values_at(self.features, padded), (self.options.method, self.options.cost)
            if self.guard is not None:
                a, b = guarded(self.guard, a, b, padded, source)
            labels = seam_labels(a, b, mask_a, mask_b, method, cost, closed=closed)
        except OverlapError:  # too thin to hold a seam
            return empty
        shows: Mask = labels[1:-1, 1:-1] & covers
        return shows

    def _anywhere(self, shape: tuple[int, int]) -> tuple[int, int]:
        rows, columns = np.nonzero(self.ranking.search.room(shape))
        if not len(rows):
            raise ImageError(
                f"nowhere is the picture opaque and free for a patch of {shape[1]} × {shape[0]} px; fill its "
                "holes first, or use smaller patches"
            )
        pick = int(self.rng.integers(len(rows)))
        return int(rows[pick]), int(columns[pick])
