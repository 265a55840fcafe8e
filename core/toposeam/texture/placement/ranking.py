"""Rank the places from which a patch may be taken: by how they fit, times the penalties."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Indices
from toposeam.errors import ImageError
from toposeam.images import box_of
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import Guide, Offers, Penalty, PlaceGrid, Site
from toposeam.texture.exemplar.atlas import Atlas, values_at
from toposeam.texture.exemplar.patch_search import PatchSearch, refined
from toposeam.texture.placement.options import LayOptions
from toposeam.texture.placement.usage_penalty import UsagePenalty

#: Factor on places whose pixels have all reached their limit of usage, where there is no other place.
_USED_UP_FACTOR = 30
#: Rough share of its overlap that a patch wins.
_WON_SHARE = 0.5
#: Added to every error, so that a perfect fit does not outweigh all penalties: the square of 1 % of the
#: image's range.
_ERROR_FLOOR = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class _Term:
    """A window of values that a place should show, and the strength of their difference."""

    search: PatchSearch
    values: Floats32
    weight: Floats32
    strength: float


class Ranking:
    """Ranks places of an atlas for windows of a canvas.

    Parameters
    ----------
    atlas : Atlas
    features : (AH, AW, F) float32 array
        Values by which overlapping patches are compared, 0 where the atlas is not usable.
    canvas : IndexCanvas
    options : LayOptions
    guide : Guide, optional
        The wanted look of the patches.
    usage : UsagePenalty, optional
        The first penalty, which also excludes places whose pixels are used up.
    """

    def __init__(
        self,
        atlas: Atlas,
        features: Floats32,
        canvas: IndexCanvas,
        options: LayOptions,
        guide: Guide | None,
        usage: UsagePenalty | None,
    ) -> None:
        self._atlas, self._features, self._canvas, self._options = atlas, features, canvas, options
        self.search, self._guide, self.usage = PatchSearch(atlas, features), guide, usage
        self._guides = None if guide is None else PatchSearch(atlas, guide.source)
        #: Further penalties, in order. One that would exclude all places that are left is ignored.
        self.penalties: list[Penalty] = [] if usage is None else [usage]
        self._copied = int(atlas.copied.sum())

    def offers(self, site: Site) -> Offers:
        """Find the best places for a patch in a window, without changing anything."""
        m, (h, w) = self._atlas.margin, site.shape
        terms, empty = self._terms(site), site.weight[m : m + h, m : m + w] == 0
        new, none = int(empty.sum()), np.zeros(0, np.intp)
        error: Floats32 | None = None
        for term in terms:
            part = term.search.fit(term.values, term.weight, (m, m), site.shape)
            part *= np.float32(term.strength)
            error = part if error is None else error + part
        if error is None:
            return Offers(rows=none, columns=none, errors=none.astype(np.float32), new=new, continued=[])
        error += np.float32(_ERROR_FLOOR)
        copies = self._canvas.copies(site.at[0] - m, site.at[1] - m, *site.known.shape)
        row, column = np.divmod(copies.shown, np.int32(self._atlas.width))
        row, column = row - copies.y + m, column - copies.x + m
        continued = list(zip(row.tolist(), column.tolist(), copies.first, strict=True))
        limit = self.largest_copy(site.shape, new) - new
        joined: dict[tuple[int, int], set[int]] = {}
        for *place, first in continued:
            joined.setdefault((place[0], place[1]), set()).add(first)
        area = self._canvas.area_of
        large = [place for place, firsts in joined.items() if sum(map(area, firsts)) > limit]
        rows, columns, errors = self._best(error, self._places(site, empty, error), large)
        if not np.isfinite(errors).any():  # what room there is lies between the places of the reduced search
            rows, columns, errors = none, none, errors[:0]
        elif self.search.factor > 1:
            self._refine(site, terms, error, rows, columns, errors)
        return Offers(rows=rows, columns=columns, errors=errors, new=new, continued=continued)

    def anywhere(self, shape: tuple[int, int], rng: np.random.Generator) -> tuple[int, int]:
        """Draw the atlas row and column of any place with room for a patch, however badly it fits.

        Raises
        ------
        ImageError
            When there is none.
        """
        rows, columns = np.nonzero(self.search.room(shape))
        if not len(rows):
            raise ImageError(
                "nowhere is the picture opaque and free for a patch of {width} × {height} px; "
                "fill its holes first, or use smaller patches",
                kind="no opaque room",
                width=shape[1],
                height=shape[0],
            )
        pick = int(rng.integers(len(rows)))
        return int(rows[pick]), int(columns[pick])

    def largest_copy(self, shape: tuple[int, int], new: int | None = None) -> int:
        """Compute how many px of the canvas a connected copy may cover; with a patch more, which fills `new`
        px and may win others.
        """
        pixels, options = shape[0] * shape[1], self._options
        won = 0 if new is None else _WON_SHARE * (pixels - new)
        share = options.copy_share * self._copied - won
        return math.floor(max(min(options.copy_patches * pixels, share), pixels))

    def _terms(self, site: Site) -> list[_Term]:
        """List the terms of a place's error: the known pixels, and the guide."""
        terms, guide = [], self._guide
        if site.weight.any() and (guide is None or guide.weight < 1):
            strength = 1.0 if guide is None else 1.0 - guide.weight
            terms.append(_Term(self.search, values_at(self._features, site.known), site.weight, strength))
        if guide is not None and self._guides is not None:
            m, (top, left), (h, w) = self._atlas.margin, site.at, site.shape
            rows, columns, inside = self._canvas.window(top - m, left - m, *site.known.shape)
            wanted = np.zeros_like(site.weight)
            wanted[m : m + h, m : m + w] = inside[m : m + h, m : m + w]
            terms.append(_Term(self._guides, guide.target[rows, columns], wanted, guide.weight))
        return terms

    def _places(self, site: Site, empty: npt.NDArray[np.bool_], error: Floats32) -> PlaceGrid:
        (rows, columns), (n, m) = box_of(empty), error.shape
        return PlaceGrid(
            at=site.at,
            shape=site.shape,
            first=self._atlas.margin,
            step=self.search.factor,
            size=(n, m),
            empty=((rows.start, rows.stop), (columns.start, columns.stop)),
        )

    def _best(
        self, error: Floats32, places: PlaceGrid, large: Sequence[tuple[int, int]]
    ) -> tuple[Indices, Indices, Floats32]:
        """Select the best places, some px apart, with their errors times the penalties; without those that
        are used up or would continue a large copy.
        """
        judged = error
        for penalty in self.penalties:
            raised = judged * penalty.factor(places)
            judged = raised if np.isfinite(raised).any() else judged
        used_up = None if self.usage is None else self.usage.used_up(places)
        left = judged.copy()
        if used_up is not None:
            left[used_up > 0] = np.inf
        m, f, apart = places.first, places.step, max(3, min(places.shape) // 8)
        for row, column in large:
            _block(left, (row - m) / f, (column - m) / f, apart / f)
        found: list[tuple[int, int]] = []
        errors: list[np.float32] = []
        while len(found) < self._options.candidates:
            i, j = divmod(int(left.argmin()), places.size[1])
            if not found and not np.isfinite(left[i, j]):
                # With few places to choose from, better a place that was used or a copy than none.
                left = judged if used_up is None else judged * (1 + np.float32(_USED_UP_FACTOR) * used_up)
                i, j = divmod(int(left.argmin()), places.size[1])
            if found and not np.isfinite(left[i, j]):
                break
            found.append((m + f * i, m + f * j))
            errors.append(left[i, j])
            _block(left, i, j, max(1.0, apart / f))
        rows, columns = np.array(found, np.intp).T
        return rows, columns, np.array(errors, np.float32)

    def _refine(
        self,
        site: Site,
        terms: list[_Term],
        error: Floats32,
        rows: Indices,
        columns: Indices,
        errors: Floats32,
    ) -> None:
        """Replace places and errors of the reduced search by those at full size."""
        m, f, k = self._atlas.margin, self.search.factor, np.flatnonzero(np.isfinite(errors))
        compared = [
            (term.search, term.search.sample(term.values, term.weight, (m, m)), term.strength)
            for term in terms
        ]
        reduced = error[(rows[k] - m) // f, (columns[k] - m) // f]
        rows[k], columns[k], exact = refined(compared, rows[k], columns[k], (m, m), site.shape)
        errors[k] *= (exact.astype(float) + _ERROR_FLOOR).astype(np.float32) / reduced


def _block(error: Floats32, row: float, column: float, reach: float) -> None:
    """Set a square to inf."""
    rows = slice(max(0, math.ceil(row - reach)), max(0, math.floor(row + reach) + 1))
    columns = slice(max(0, math.ceil(column - reach)), max(0, math.floor(column + reach) + 1))
    error[rows, columns] = np.inf
