"""Laying a patch: find where one fits, choose, cut it along the heat seam, paint it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_choice, check_number, check_whole
from toposeam.errors import ImageError, OptionError, OverlapError
from toposeam.images import Mask
from toposeam.seam.find import METHODS, Method, find_seam
from toposeam.seam.match_cost import MatchCost
from toposeam.texture.atlas import Atlas, Floats32, Ints32, values_at
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.keeping_step import Phase
from toposeam.texture.nearby import Nearby
from toposeam.texture.search import Ints, PatchSearch, box_sum

#: How much dearer a place is whose pixels have all shown as often as they should, where there is no other.
_USED_UP = 30
#: How much dearer a place is all of whose pixels show near by, per unit of variety.
_NEAR = 1.0
#: Share of what there is to copy up to which use is not counted.
_LITTLE = 0.05
#: An exemplar that shows on less counts as showing on this much of the canvas.
_LEAST_SHARE = 0.02
#: Added to every error, so that a perfect fit does not outweigh everything else; the square of 1 % of the
#: image's range.
_FLOOR = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class LayOptions:
    """How patches are chosen and cut.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> sample = np.random.default_rng(0).random((48, 48))
    >>> ts.synthesize(sample, (60, 60), patch=20, options=ts.LayOptions(mend=0)).image.shape
    (60, 60)
    """

    #: A patch is drawn at random from those whose error is at most 1 + tolerance times the least.
    tolerance: float = 0.1
    #: How many different places are compared.
    candidates: int = 8
    #: px round the patch in which known pixels are compared too.
    context: int = 8
    #: What a pixel of the context counts, one of the overlap being 1.
    context_weight: float = 0.5
    #: No source pixel shows more often than this many times the average.
    most: float = 2.5
    #: How strongly places that show often already, or near by, are avoided.
    variety: float = 0.5
    #: How much a connected copy may cover: at most so many patches, and this share of what may be copied.
    copy_patches: float = 3.0
    copy_share: float = 0.2
    #: How many further patches are tried over the worst seams, as a share of the patches laid.
    mend: float = 0.2
    #: Whether ordered textures that repeat are laid twice, so that their order closes
    #: (:mod:`toposeam.texture.closing`).
    close: bool = True
    #: How the seam is found.
    method: Method = "heat"
    cost: MatchCost | None = None

    def __post_init__(self) -> None:
        for name, low, high in (
            ("tolerance", 0, 10),
            ("context_weight", 0, 1),
            ("most", 1, np.inf),
            ("variety", 0, 100),
            ("copy_patches", 0, np.inf),
            ("copy_share", 0, 1),
            ("mend", 0, 10),
        ):
            check_number(name, getattr(self, name), low, high, infinite=high == np.inf)
        check_whole("candidates", self.candidates, 1, 1000)
        check_whole("context", self.context, 0, 64)
        check_choice("method", self.method, METHODS)
        check_choice("close", self.close, (True, False))
        if self.cost is not None and not isinstance(self.cost, MatchCost):
            raise OptionError(f"cost is of class {type(self.cost).__name__}; pass a MatchCost")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Guide:
    """What a texture should look like, patch by patch."""

    #: (AH, AW, G) float32, what each pixel of the atlas stands for.
    source: Floats32
    #: (H, W, G) float32, what is wanted on the canvas.
    target: Floats32
    #: Its share in the choice, in [0, 1]; the rest is the overlap's.
    weight: float


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
    ) -> None:
        self.atlas, self.features, self.canvas = atlas, features, canvas
        self.options, self.rng, self.guide, self.phase = options, rng, guide, phase
        self.search = PatchSearch(atlas, features)
        self._guides = None if guide is None else PatchSearch(atlas, guide.source)
        # Where little is laid, compared with what there is to copy, no place is used up.
        self._uses_up = area > _LITTLE * int(atlas.usable.sum())
        self._shares = None if shares is None else np.asarray(shares, float) / sum(shares)
        self._average = _average_use(atlas, area, self._shares)
        self._limit = np.maximum(1, np.floor(options.most * self._average))
        self._nearby = Nearby(atlas, canvas)
        self.margin = atlas.margin

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
        m, (h, w) = self.margin, shape
        known = self.canvas.read(top - m, left - m, h + 2 * m, w + 2 * m)
        _, _, inside = self.canvas.window(top, left, h, w)
        inner = known[m : m + h, m : m + w]
        empty = (inner < 0) & inside
        if not empty.any():
            return False
        covers = inside if may_show is None else (may_show | empty) & inside
        weight = np.where(known >= 0, np.float32(self.options.context_weight), np.float32(0))
        weight[m : m + h, m : m + w] = inner >= 0
        source = self.choose(top, left, shape, known, weight)
        padded = self.canvas.read(top - 1, left - 1, h + 2, w + 2)
        self.canvas.paint(top, left, source, self.cut(padded, source, covers))
        return True

    def choose(self, top: int, left: int, shape: tuple[int, int], known: Ints32, weight: Floats32) -> Ints32:
        """A patch that fits a window, (h, w) flat indices.

        Parameters
        ----------
        top, left, shape
            The patch's window on the canvas.
        known : int32 array
            What the canvas shows there and in the margin round it; -1 where empty.
        weight : float32 array
            How much that counts.
        """
        terms = self._terms(top, left, shape, known, weight)
        row, column = self._choose(terms, shape, (top, left), known) if terms else self._anywhere(shape)
        if self.phase is not None:
            self.phase.begin((top, left), (row, column), shape)
        grid = np.arange(shape[0])[:, np.newaxis] * self.atlas.width + np.arange(shape[1])
        return (row * self.atlas.width + column + grid).astype(np.int32)

    def cut(self, padded: Ints32, source: Ints32, covers: Mask) -> Mask:
        """Where a patch shows, given what is there.

        Parameters
        ----------
        padded : (h + 2, w + 2) int32 array
            What the canvas shows in the patch's window and one pixel round it; -1 where empty.
        source : (h, w) int32 array
            The patch.
        covers : (h, w) bool array
            Where it may show; it must show where the canvas is empty there.
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
        b[1:-1, 1:-1] = values_at(self.features, source)
        try:
            seam = find_seam(
                values_at(self.features, padded),
                b,
                mask_a=mask_a,
                mask_b=mask_b,
                data_range=1.0,
                method=self.options.method,
                cost=self.options.cost,
            )
        except OverlapError:  # too thin to hold a seam
            return empty
        shows: Mask = seam.labels[1:-1, 1:-1] & covers
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

    def _terms(
        self, top: int, left: int, shape: tuple[int, int], known: Ints32, weight: Floats32
    ) -> list[_Term]:
        """What a place is judged by: how it fits what is known, and how it fits the guide."""
        terms = []
        share = 0.0 if self.guide is None else self.guide.weight
        if weight.any():
            terms.append(_Term(self.search, values_at(self.features, known), weight, 1.0 - share))
        if self.guide is not None and self._guides is not None:
            m = self.margin
            rows, columns, inside = self.canvas.window(top - m, left - m, *known.shape)
            wanted = np.zeros_like(weight)
            wanted[m : m + shape[0], m : m + shape[1]] = inside[m : m + shape[0], m : m + shape[1]]
            terms.append(_Term(self._guides, self.guide.target[rows, columns], wanted, share))
        return terms

    def _choose(
        self, terms: list[_Term], shape: tuple[int, int], at: tuple[int, int], known: Ints32
    ) -> tuple[int, int]:
        """Atlas row and column of the patch, drawn from the best places."""
        m, f = self.margin, self.search.factor
        error = sum(
            term.strength * term.search.fit(term.values, term.weight, (m, m), shape) for term in terms
        )
        error = np.asarray(error, np.float32)
        rows, columns, errors = self._best(error + np.float32(_FLOOR), shape, at, known)
        if not np.isfinite(errors).any():  # what room there is lies between the places of the reduced search
            return self._anywhere(shape)
        if f > 1:
            for k in np.flatnonzero(np.isfinite(errors)).tolist():
                found = self._exactly(terms, int(rows[k]), int(columns[k]), shape)
                errors[k] *= (found[2] + _FLOOR) / (error[(rows[k] - m) // f, (columns[k] - m) // f] + _FLOOR)
                rows[k], columns[k] = found[:2]
        good = np.flatnonzero(errors <= (1 + self.options.tolerance) * errors.min())
        pick = int(self.rng.choice(good))
        return int(rows[pick]), int(columns[pick])

    def _exactly(
        self, terms: list[_Term], row: int, column: int, shape: tuple[int, int]
    ) -> tuple[int, int, float]:
        """The best place at full size near one of the reduced search, in ever smaller steps, and its
        error.
        """
        step, error = self.search.factor // 2, math.inf
        while step:
            rows, columns, exact = np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(9, np.float32)
            for term in terms:
                rows, columns, part = term.search.around(
                    row, column, step, term.values, term.weight, (self.margin, self.margin), shape
                )
                exact = exact + term.strength * part
            least = int(exact.argmin())
            row, column, error = int(rows[least]), int(columns[least]), float(exact[least])
            step //= 2
        return row, column, error

    def _best(
        self, error: Floats32, shape: tuple[int, int], at: tuple[int, int], known: Ints32
    ) -> tuple[Ints, Ints, Floats32]:
        """The best places of the search's grid that lie apart, and their errors: raised where the source
        shows often or near by, and without those that would make a connected copy too large.
        """
        m, f, (n, columns_n) = self.margin, self.search.factor, error.shape
        raised, used_up = error.copy(), np.zeros(error.shape)
        if self._uses_up:
            usage = self.canvas.usage.reshape(self.atlas.usable.shape)
            on_grid = slice(m, None, f), slice(m, None, f)
            average = shape[0] * shape[1] * self._average[m::f][:n]
            mean = box_sum(usage, shape)[on_grid][:n, :columns_n] / average
            used_up = box_sum(usage >= self._limit, shape)[on_grid][:n, :columns_n] / (shape[0] * shape[1])
            raised *= 1 + self.options.variety * np.square(mean)
            if self.options.variety and self.guide is None:
                near = self._nearby.share(*at, *shape)
                raised *= 1 + np.float32(_NEAR * self.options.variety) * near(m, f, error.shape)
        if self._shares is not None:
            dearer = self._too_often(self._shares)[self.atlas.owner_of_rows]
            raised *= dearer[m::f][:n, np.newaxis].astype(np.float32)
        if self.phase is not None:
            places = (m + f * np.arange(n), m + f * np.arange(columns_n))
            in_step = np.where(self.phase.allows(at, shape, *places), raised, np.float32(np.inf))
            raised = in_step if np.isfinite(in_step).any() else raised
        free = raised.copy()
        free[used_up > 0] = np.inf
        apart = max(3, min(shape) // 8)
        for row, column in self._exhausted(at, shape, known):
            _block(free, (row - m) / f, (column - m) / f, apart / f)
        # With few places to choose from, better a place that was used or a copy than none.
        left = free if np.isfinite(free).any() else raised * (1 + _USED_UP * used_up).astype(np.float32)
        rows: list[int] = []
        columns: list[int] = []
        errors: list[np.float32] = []
        for _ in range(self.options.candidates):
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

    def _exhausted(self, at: tuple[int, int], shape: tuple[int, int], known: Ints32) -> list[tuple[int, int]]:
        """Atlas places at which the patch would continue a copy that is known, and make it too large."""
        m = self.margin
        y, x, index, areas = self.canvas.copies(at[0] - m, at[1] - m, *known.shape)
        row, column = np.divmod(index, np.int32(self.atlas.width))
        new = int((known[m : m + shape[0], m : m + shape[1]] < 0).sum())
        pixels = shape[0] * shape[1]
        limit = max(
            min(self.options.copy_patches * pixels, self.options.copy_share * int(self.atlas.copied.sum())),
            pixels,
        )
        return [
            (int(r - a + m), int(c - b + m))
            for r, c, a, b, area in zip(row, column, y, x, areas, strict=True)
            if area + new > limit
        ]


def _average_use(atlas: Atlas, area: int, shares: npt.NDArray[np.float64] | None) -> npt.NDArray[np.float64]:
    """(AH, 1): how often a usable pixel shows on average, by the atlas's row."""
    usable = atlas.usable.sum(axis=1)
    if shares is None:
        return np.full((len(usable), 1), max(area / max(int(usable.sum()), 1), 1.0))
    each = np.add.reduceat(usable, atlas.corners[:, 0])
    return np.maximum(area * shares / np.maximum(each, 1), 1.0)[atlas.owner_of_rows, np.newaxis]


def _block(error: Floats32, row: float, column: float, reach: float) -> None:
    """Set a square to inf."""
    rows = slice(max(0, math.ceil(row - reach)), max(0, math.floor(row + reach) + 1))
    columns = slice(max(0, math.ceil(column - reach)), max(0, math.floor(column + reach) + 1))
    error[rows, columns] = np.inf
