"""Laying a patch: find where one fits, choose, cut it along the best seam, paint it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, OverlapError
from toposeam.images import Mask, box_of
from toposeam.seam.labels import seam_labels
from toposeam.texture.atlas import Atlas, Floats32, Ints32, values_at
from toposeam.texture.beside import Beside
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.keeping_step import Phase
from toposeam.texture.kinds import Kinds
from toposeam.texture.landmarks import guarded, landmarks
from toposeam.texture.lay_options import LayOptions
from toposeam.texture.nearby import Nearby, average_use
from toposeam.texture.repeats import Repeats
from toposeam.texture.search import Ints, PatchSearch, refined
from toposeam.texture.sites import Guide, Offers, Site
from toposeam.texture.turning import Turns
from toposeam.texture.twins import Twins
from toposeam.texture.use import Use

#: How much dearer a place is whose pixels have all shown as often as they should, where there is no other.
_USED_UP = 30
#: How much dearer a place is all of whose pixels show near by, per unit of variety; and, where there are
#: objects, a place of average pixels that would all show a second time within reach.
_NEAR, _TWICE = 1.0, 2.0
#: Share of what there is to copy up to which use is not counted.
_LITTLE = 0.05
#: Of what it overlaps, a patch shows on this share, about.
_WON = 0.5
#: An exemplar that shows on less counts as showing on this much of the canvas.
_LEAST_SHARE = 0.02
#: More often than any pixel shows.
_ENDLESS = 2**31 - 1
#: Added to every error, so that a perfect fit does not outweigh everything else; the square of 1 % of the
#: image's range.
_FLOOR = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class _Term:
    """One reason to prefer a place: a window of values that should be found there, and how much that
    counts.
    """

    search: PatchSearch
    values: Floats32
    weight: Floats32
    strength: float


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
        self.options, self.rng, self.guide, self.phase = options, rng, guide, phase
        self.search = PatchSearch(atlas, features)
        self._guides = None if guide is None else PatchSearch(atlas, guide.source)
        # Where little is laid, compared with what there is to copy, no place is used up.
        self._uses_up = area > _LITTLE * int(atlas.usable.sum())
        self._shares = None if shares is None else np.asarray(shares, float) / sum(shares)
        self._average = average_use(atlas, area, self._shares)
        self._limit = np.clip(np.floor(options.most * self._average), 1, _ENDLESS).astype(np.int32)
        #: What seams pay for each pixel of the atlas, flat, where there are objects to be kept.
        self.guard: Floats32 | None = None
        self._nearby, self._repeats, self._kinds = Nearby(atlas, canvas), None, None
        if self._uses_up and guide is None and options.variety:
            weight, self.guard = landmarks(features, atlas.usable, atlas.factor)
            objects = self.guard is not None
            if not canvas.patches:  # what shows already is continued as it is
                self._kinds = Kinds(features, atlas, self._average, levelled=lone, objects=objects)
            if lone or objects:
                self._repeats = Repeats(atlas, canvas, weight)
        self._twins = None if turns == "none" else Twins(atlas, canvas, turns)
        self.margin, self._copied = atlas.margin, int(atlas.copied.sum())

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
        source = self.patch(self.pick(site.at, shape, self.offers(site)), shape)
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

    def offers(self, site: Site, use: Use | None = None) -> Offers:
        """The best places for a patch in a window, given what shows; changes nothing, and draws nothing."""
        m, terms = self.margin, self._terms(site)
        h, w = site.shape
        new = int((site.weight[m : m + h, m : m + w] == 0).sum())
        none = np.zeros(0, np.intp)
        error: Floats32 | None = None
        for term in terms:
            part = term.search.fit(term.values, term.weight, (m, m), site.shape)
            part *= np.float32(term.strength)
            error = part if error is None else error + part
        if error is None:
            return Offers(rows=none, columns=none, errors=none.astype(np.float32), new=new, continued=[])
        error += np.float32(_FLOOR)
        copies = self.canvas.copies(site.at[0] - m, site.at[1] - m, *site.known.shape)
        row, column = np.divmod(copies.shown, np.int32(self.atlas.width))
        row, column = row - copies.y + m, column - copies.x + m
        continued = list(zip(row.tolist(), column.tolist(), copies.first, strict=True))
        limit = self.largest_copy(site.shape, new) - new
        joined: dict[tuple[int, int], set[int]] = {}
        for *place, first in continued:
            joined.setdefault((place[0], place[1]), set()).add(first)
        area = self.canvas.area_of
        large = [list(place) for place, firsts in joined.items() if sum(map(area, firsts)) > limit]
        rows, columns, errors = self._best(error, site, large, use)
        if not np.isfinite(errors).any():  # what room there is lies between the places of the reduced search
            rows, columns, errors = none, none, errors[:0]
        elif self.search.factor > 1:
            self._refine(site, terms, error, rows, columns, errors)
        return Offers(rows=rows, columns=columns, errors=errors, new=new, continued=continued)

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
        return self.margin if self._twins is None else max(self.margin, max(shape) // 2)

    def use(self) -> Use:
        """How often what shows on the canvas as it is."""
        variety = self.options.variety
        return Use(self.canvas, self.atlas, self._average, self._limit, variety, self._kinds)

    def beside(self) -> Beside:
        """Keeps patches that are picked at the same time apart."""
        near = self.options.variety if self._uses_up and self.guide is None else 0.0
        near *= _NEAR if self._repeats is None else _TWICE
        limit = self._limit if self._uses_up else None
        return Beside(self.canvas, self.atlas, self._nearby.reach, near, limit, self.largest_copy)

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

    def largest_copy(self, shape: tuple[int, int], new: int | None = None) -> int:
        """How many px of the canvas a connected copy may show on; with a patch more, which fills some new px
        and may win others.
        """
        pixels, options = shape[0] * shape[1], self.options
        won = 0 if new is None else _WON * (pixels - new)
        share = options.copy_share * self._copied - won
        return math.floor(max(min(options.copy_patches * pixels, share), pixels))

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
        rows, columns = np.nonzero(self.search.room(shape))
        if not len(rows):
            raise ImageError(
                f"nowhere is the picture opaque and free for a patch of {shape[1]} × {shape[0]} px; fill its "
                "holes first, or use smaller patches"
            )
        pick = int(self.rng.integers(len(rows)))
        return int(rows[pick]), int(columns[pick])

    def _terms(self, site: Site) -> list[_Term]:
        """What a place is judged by: how it fits what is known, and how it fits the guide."""
        terms = []
        share = 0.0 if self.guide is None else self.guide.weight
        if site.weight.any():
            terms.append(_Term(self.search, values_at(self.features, site.known), site.weight, 1.0 - share))
        if self.guide is not None and self._guides is not None:
            m, (top, left), (h, w) = self.margin, site.at, site.shape
            rows, columns, inside = self.canvas.window(top - m, left - m, *site.known.shape)
            wanted = np.zeros_like(site.weight)
            wanted[m : m + h, m : m + w] = inside[m : m + h, m : m + w]
            terms.append(_Term(self._guides, self.guide.target[rows, columns], wanted, share))
        return terms

    def _refine(
        self,
        site: Site,
        terms: list[_Term],
        error: Floats32,
        rows: Ints,
        columns: Ints,
        errors: Floats32,
    ) -> None:
        """Places and errors of the reduced search as they are at full size."""
        m, f, k = self.margin, self.search.factor, np.flatnonzero(np.isfinite(errors))
        compared = [
            (term.search, term.search.sample(term.values, term.weight, (m, m)), term.strength)
            for term in terms
        ]
        reduced = error[(rows[k] - m) // f, (columns[k] - m) // f]
        rows[k], columns[k], exact = refined(compared, rows[k], columns[k], (m, m), site.shape)
        errors[k] *= (exact.astype(float) + _FLOOR).astype(np.float32) / reduced

    def _best(
        self, error: Floats32, site: Site, large: list[list[int]], use: Use | None
    ) -> tuple[Ints, Ints, Floats32]:
        """The best places of the search's grid that lie apart, and their errors: raised where the source
        shows often or near by, and without those that would continue a large copy.
        """
        at, shape, raised = site.at, site.shape, error.copy()
        m, f, (n, columns_n) = self.margin, self.search.factor, raised.shape
        used_up: Floats32 | None = None
        if self._uses_up:
            dearer, used_up = (use or self.use()).of_places(shape, (m, f), raised.shape)
            raised *= dearer
            if self.options.variety and self.guide is None:
                if self._repeats is None:
                    near = self._nearby.share(*at, *shape)(m, f, raised.shape)
                else:
                    new = box_of(site.weight[m : m + shape[0], m : m + shape[1]] == 0)
                    (down, bottom), (right, end) = ((side.start, side.stop) for side in new)
                    on_grid = self._repeats.share(at[0] + down, at[1] + right, bottom - down, end - right)
                    near = on_grid(m + down, m + right, f, raised.shape)
                near *= np.float32((_NEAR if self._repeats is None else _TWICE) * self.options.variety)
                near += np.float32(1)
                raised *= near
        if self._shares is not None:
            often = self._too_often(self._shares)[self.atlas.owner_of_rows]
            raised *= often[m::f][:n, np.newaxis].astype(np.float32)
        if self.phase is not None:
            places = (m + f * np.arange(n), m + f * np.arange(columns_n))
            in_step = np.where(self.phase.allows(at, shape, *places), raised, np.float32(np.inf))
            raised = in_step if np.isfinite(in_step).any() else raised
        if self._twins is not None:
            twins = self._twins.blocked(at, shape, m, f, raised.shape)
            apart_from = np.where(twins, np.float32(np.inf), raised)
            raised = apart_from if np.isfinite(apart_from).any() else raised
        left = raised.copy()
        if used_up is not None:
            left[used_up > 0] = np.inf
        apart = max(3, min(shape) // 8)
        for row, column in large:
            _block(left, (row - m) / f, (column - m) / f, apart / f)
        rows: list[int] = []
        columns: list[int] = []
        errors: list[np.float32] = []
        for _ in range(self.options.candidates):
            i, j = divmod(int(left.argmin()), columns_n)
            if not rows and not np.isfinite(left[i, j]):
                # With few places to choose from, better a place that was used or a copy than none.
                left = raised if used_up is None else raised * (1 + np.float32(_USED_UP) * used_up)
                i, j = divmod(int(left.argmin()), columns_n)
            if rows and not np.isfinite(left[i, j]):
                break
            rows.append(m + f * i)
            columns.append(m + f * j)
            errors.append(left[i, j])
            _block(left, i, j, max(1.0, apart / f))
        return np.array(rows, np.intp), np.array(columns, np.intp), np.array(errors, np.float32)

    def _too_often(self, shares: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """How much dearer each exemplar's places are, from what it shows on against its share: steep, so
        that even unlike exemplars keep to it.
        """
        rows = self.canvas.usage.reshape(self.atlas.usable.shape).sum(axis=1)
        shown = np.add.reduceat(rows, self.atlas.corners[:, 0])
        part = shown / max(int(shown.sum()), 1)
        return np.asarray(((part + _LEAST_SHARE) / (shares + _LEAST_SHARE)) ** 6)


def _block(error: Floats32, row: float, column: float, reach: float) -> None:
    """Set a square to inf."""
    rows = slice(max(0, math.ceil(row - reach)), max(0, math.floor(row + reach) + 1))
    columns = slice(max(0, math.ceil(column - reach)), max(0, math.floor(column + reach) + 1))
    error[rows, columns] = np.inf
