"""Few objects on a ground: found in an exemplar, kept out of its patches, and laid last, each of them whole.

Patches of ground fill the texture first. Then each object that is whole in the exemplar is laid as often as
its share of the exemplar asks for, along a closed seam through the ground round it. What is cut by the
exemplar's border is nowhere whole, and never shown. A texture with so many objects that little bare ground is
left between them is laid otherwise (:mod:`toposeam.texture.objects.object_exchange`).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats, Floats32, Indices, Ints32, Mask
from toposeam.images import box_of
from toposeam.texture.exemplar.atlas import Atlas, values_at
from toposeam.texture.exemplar.patch_search import box_sum, reduced, whole
from toposeam.texture.objects.object_catalog import SEAM_RING, At
from toposeam.texture.placement.near_copies import NEAR
from toposeam.texture.placement.patch_placer import ClosedPatch, PatchPlacer

#: Standard deviation of the blur in which objects are looked for, px of the reduced exemplar.
_BLUR = 2.0
#: Number of rounds in which the ground's colours are estimated; what is farther from them than this multiple
#: of the median squared distance takes no part in the next round.
_ROUNDS, _OUTLIER = 8, 6.0
#: Least standard deviation of the ground along any axis of colour, as a share of the exemplar's.
_LEAST_SPREAD = 0.02
#: Distance from the ground, in its standard deviations, from which on a pixel is unlike it; and that which
#: the upper quartile of an object reaches: 50 to 1000 in stones, coins and flowers, 6 in leaves of grass.
_UNLIKE, _CLEAR = 3.0, 12.0
#: The same from which on a piece may be an object; there are none if such pieces cover more than this share
#: of what the clear ones cover.
_DOUBTFUL, _DOUBTFUL_SHARE = 6.5, 0.1
#: Least area of a piece, px, and of all, as a share of the exemplar.
_LEAST_PIECE, _LEAST_COVERED = 30, 0.01
#: By how many px blur makes objects larger, about. Pieces that are apart without these px are two objects,
#: and so are those that a neck narrower than this share of the widest place joins; but what is narrower than
#: that share of the widest place of all is a corner of one.
_HALO, _NECK, _PART = 3, 0.55, 0.4
#: Largest share of the exemplar that objects may cover, and their largest number.
_MOST_COVERED, _MOST_OBJECTS = 0.45, 24
#: Largest side of an object as a share of the exemplar's, and least share of the box round it that it covers.
_MOST_SIDE, _LEAST_COMPACT = 0.6, 0.25
#: Largest side of a cut object that may be one like the whole ones, as a share of the largest one's.
_ALIKE = 1.25
#: Patches of bare ground have places enough if they reach this share of what the smallest reach, at this
#: share of the exemplar's pixels; and the least side of one, px.
_LEAST_REACHED, _LEAST_PLACES, _LEAST_SIDE = 0.75, 0.02, 28
#: Number of places that are drawn for an object, and of those with room that are compared.
_DRAWN, _COMPARED = 256, 12
#: Least distance of two objects beyond their halos, px, and distance of the pixels at which room is tested.
_APART, _TESTED = 2, 3


@dataclass(frozen=True, slots=True, eq=False)
class _Lone:
    """A whole object of the atlas."""

    #: Row and column of its box on the atlas, which holds the seam round it.
    corner: At
    #: (h, w) bool: its pixels, with those that blur adds, and where a patch that holds it may show.
    core: Mask
    halo: Mask
    may: Mask


@dataclass(frozen=True, slots=True, eq=False)
class ScatteredObjects:
    """The objects of an atlas, and the ground between them."""

    #: Those that are whole.
    objects: list[_Lone]
    #: (AH, AW) bool: ground that may be copied, and pixels of objects, cut ones too.
    ground: Mask
    shown: Mask
    #: How often each whole object lies on a pixel.
    density: float

    def side_for(self, side: int) -> int | None:
        """Find the largest side of a patch, up to one, for which the ground has places enough; None where it
        has none.
        """
        most, least = (
            self._reached(_LEAST_SIDE)[0],
            _LEAST_PLACES * np.count_nonzero(self.ground | self.shown),
        )
        while side >= _LEAST_SIDE:
            reached, places = self._reached(side)
            if reached >= _LEAST_REACHED * most and places >= least:
                return side
            side = int(0.9 * side)
        return None

    def _reached(self, side: int) -> tuple[int, int]:
        """Count the pixels that patches of bare ground reach, and their places."""
        places = whole(self.ground, (side, side))
        reached = box_sum(np.pad(places, side - 1), (side, side)) > 0
        return int(np.count_nonzero(reached)), int(np.count_nonzero(places))


def atlas_without(scattered: ScatteredObjects | None, atlas: Atlas) -> Atlas:
    """Return the atlas of which only the ground between scattered objects may be copied, if there are any."""
    return atlas if scattered is None else dataclasses.replace(atlas, copied=scattered.ground)


def find_scattered(features: Floats32, atlas: Atlas) -> ScatteredObjects | None:
    """Find objects that are plainly unlike the ground between them; None where there are none, or where it is
    in doubt what is ground.

    Parameters
    ----------
    features : (AH, AW, F) float32 array
        0 where not usable.
    atlas : Atlas
    """
    values, mass = reduced(features, atlas.usable.astype(np.float32), atlas.factor)
    seen = mass > 0
    distance = _from_ground(values, mass)
    pieces, count = ndimage.label(distance > _UNLIKE)
    clear = np.zeros(count + 1, bool)
    covered = [0, 0]
    for number, box in enumerate(ndimage.find_objects(pieces), start=1):
        own = distance[box][pieces[box] == number]
        level = float(np.percentile(own, 75))
        if len(own) >= _LEAST_PIECE and level >= _DOUBTFUL:
            clear[number] = level >= _CLEAR
            covered[int(level >= _CLEAR)] += len(own)
    if covered[1] < _LEAST_COVERED * np.count_nonzero(seen) or covered[0] > _DOUBTFUL_SHARE * covered[1]:
        return None
    # What is thinner than blur is ground that touches an object, as a leaf.
    halo = ndimage.binary_opening(ndimage.binary_fill_holes(clear[pieces]) | ~seen, iterations=2) & seen
    if np.count_nonzero(halo & seen) > _MOST_COVERED * np.count_nonzero(seen):
        return None
    marks, halos = _divided(halo, ~seen)
    shorter = min(min(shape) for shape in (atlas.shapes // atlas.factor).tolist())
    boxes = ndimage.find_objects(halos)
    sides = [[side.stop - side.start for side in box] for box in boxes]
    areas = np.bincount(halos.ravel(), minlength=len(boxes) + 1)[1:]
    if len(boxes) > _MOST_OBJECTS * len(atlas.shapes) or not all(
        max(one) <= _MOST_SIDE * shorter and area >= _LEAST_COMPACT * one[0] * one[1]
        for one, area in zip(sides, areas.tolist(), strict=True)
    ):
        return None
    return _scattered(atlas, *(_enlarged(one, atlas) for one in (marks, halos)))


def _scattered(atlas: Atlas, marks: Ints32, halos: Ints32) -> ScatteredObjects:
    """Gather the objects, given the number of each pixel's, without and with its halo."""
    border = atlas.copied & ~ndimage.binary_erosion(atlas.copied)
    boxes, found, areas, sides, cut = ndimage.find_objects(halos), [], 0, [], []
    other = ndimage.binary_dilation(halos > 0)
    for number, box in enumerate(boxes, start=1):
        around = (
            slice(max(box[0].start - SEAM_RING - 1, 0), box[0].stop + SEAM_RING + 1),
            slice(max(box[1].start - SEAM_RING - 1, 0), box[1].stop + SEAM_RING + 1),
        )
        core, halo = marks[around] == number, halos[around] == number
        side = max(one.stop - one.start for one in box)
        if (core & (border[around] | ~atlas.copied[around])).any():
            cut.append((side, int(np.count_nonzero(halo))))
            continue
        halo &= atlas.copied[around]
        may = ndimage.binary_dilation(halo, iterations=SEAM_RING) & atlas.copied[around]
        may &= ~(other[around] & ~halo) | core
        found.append(_Lone((around[0].start, around[1].start), core, halo, may))
        areas += int(np.count_nonzero(halo))
        sides.append(side)
    alike = sum(area for side, area in cut if side <= _ALIKE * max(sides, default=0))
    return ScatteredObjects(
        objects=found,
        ground=atlas.copied & ~other,
        shown=halos > 0,
        density=(1 + alike / max(areas, 1)) / max(int(np.count_nonzero(atlas.copied)), 1),
    )


def _from_ground(values: Floats32, mass: Floats32) -> Floats32:
    """Compute the distance of each blurred pixel's colour from the ground's, in standard deviations of the
    latter (Mahalanobis), which are those of the pixels that are near it, found again and again.
    """
    seen, count = mass > 0, values.shape[2]
    below = np.maximum(ndimage.gaussian_filter(mass, _BLUR), np.float32(1e-6))
    colours = np.stack(
        [ndimage.gaussian_filter(values[..., c] * mass, _BLUR) / below for c in range(count)], axis=2
    )[seen].astype(float)
    middle = np.median(colours, axis=0)
    spread = np.median(np.abs(colours - middle), axis=0) + _LEAST_SPREAD * colours.std(axis=0) + 1e-9
    squares: Floats = np.square((colours - middle) / spread).sum(axis=1)
    least = np.square(_LEAST_SPREAD * colours.std(axis=0) + 1e-9)
    for _ in range(_ROUNDS):
        kept = colours[squares <= _OUTLIER * np.median(squares)]
        away = colours - kept.mean(axis=0)
        covariance = np.cov(kept.T).reshape(count, count) + np.diag(least)
        squares = np.einsum("nc,nc->n", away @ np.linalg.inv(covariance), away)
    found = np.zeros(seen.shape, np.float32)
    found[seen] = np.sqrt(squares)
    return found


def _divided(halo: Mask, beyond: Mask) -> tuple[Ints32, Ints32]:
    """Number the objects: (H, W) int32 each, without and with their halos; those that only halos or a narrow
    neck join are several. What lies beyond the exemplar takes nothing from them.
    """
    depth = ndimage.distance_transform_edt(halo | beyond) * halo
    pieces, count = ndimage.label(halo)
    least = np.asarray(ndimage.maximum(depth, pieces, range(count + 1)))
    apart = ndimage.label(depth > _HALO)[0]
    deepest = np.asarray(ndimage.maximum(depth, apart, range(apart.max() + 1)))[apart]
    marks = ndimage.label((deepest > _PART * least[pieces]) & (depth > np.maximum(_HALO, _NECK * deepest)))[0]
    if not marks.any():
        return np.zeros_like(marks), np.zeros_like(marks)
    rows, columns = ndimage.distance_transform_edt(marks == 0, return_distances=False, return_indices=True)
    nearest = marks[rows, columns]
    of = np.asarray(ndimage.maximum(pieces, marks, range(marks.max() + 1)))
    halos = np.where(halo & (pieces == of[nearest]), nearest, 0).astype(np.int32)
    return np.where(depth > _HALO - 1, halos, np.int32(0)), halos


def _enlarged(marks: Ints32, atlas: Atlas) -> Ints32:
    """Bring a reduced plane to the atlas's size."""
    rows, columns = (
        np.minimum(np.arange(length) // atlas.factor, most - 1)
        for length, most in zip(atlas.usable.shape, marks.shape, strict=True)
    )
    found: Ints32 = marks[np.ix_(rows, columns)]
    return found


def lay_scattered(placer: PatchPlacer, scattered: ScatteredObjects) -> int:
    """Lay the objects on a canvas full of ground, the largest first; return how many have been laid.

    Parameters
    ----------
    placer : PatchPlacer
        Of the ground.
    scattered : ScatteredObjects
    """
    laying = _Laying(placer, scattered)
    order = sorted(scattered.objects, key=lambda one: -int(np.count_nonzero(one.halo)))
    return sum(map(laying.lay, order))


class _Laying:
    """Objects laid one after another."""

    def __init__(self, placer: PatchPlacer, scattered: ScatteredObjects) -> None:
        self._placer, self._canvas, self._scattered = placer, placer.canvas, scattered
        self._taken = np.zeros(self._canvas.shape, bool)
        self._near = NEAR * int(placer.atlas.shapes.min(axis=1).max())
        #: Part of an object that the share of those laid so far asks for beyond them.
        self._part = float(placer.rng.random()) - 0.5

    def lay(self, one: _Lone) -> int:
        """Lay an object as often as its share asks for."""
        reach = [length // 4 for length in one.core.shape]
        extent = [
            length + 2 * far * (not wraps)
            for length, far, wraps in zip(self._canvas.shape, reach, self._canvas.wrap, strict=True)
        ]
        self._part += self._scattered.density * extent[0] * extent[1]
        wanted = round(self._part)
        self._part -= wanted
        tested = np.argwhere(one.halo)
        tested = tested[(tested % _TESTED == 0).all(axis=1)]
        ring = np.argwhere(one.may & ~one.halo)[::2]
        placed: list[At] = []
        for _ in range(wanted):
            at = self._place(one, tested, ring, placed, reach)
            if at is not None:
                self._paint(one, at)
                placed.append(at)
        return len(placed)

    def _place(
        self, one: _Lone, tested: Indices, ring: Indices, placed: list[At], reach: list[int]
    ) -> At | None:
        """Draw a place with room for an object's box, far from where it lies already, as well as can be,
        where the ground fits.
        """
        rng, (height, width) = self._placer.rng, one.core.shape
        lines = []
        for length, side, far, wraps in zip(
            self._canvas.shape, (height, width), reach, self._canvas.wrap, strict=True
        ):
            low, high = (0, length) if wraps else (-far, length + far)
            lines.append(rng.integers(low, high, _DRAWN) - side // 2)
        places = np.stack(lines, axis=1)
        free = ~self._seen(places, tested, self._taken)
        if not free.any():
            return None
        places = places[free]
        if placed:
            away = [
                self._canvas.distance(axis, places[:, axis, np.newaxis] - np.array(placed)[:, axis])
                for axis in (0, 1)
            ]
            nearest = np.hypot(*away).min(axis=1)
            farthest = np.sort(nearest)[-min(_COMPARED, len(nearest))]
            places = places[nearest >= min(self._near, float(farthest))]
        places = places[:_COMPARED]
        row, column = places[int(np.argmin(self._errors(one, places, ring)))].tolist()
        return row, column

    def _at(self, places: Indices, pixels: Indices) -> tuple[Indices, Indices, Mask]:
        """Compute rows and columns of an object's pixels at some places, and where these are on the canvas,
        (places, pixels) each.
        """
        lines = []
        inside: Mask = np.ones((len(places), len(pixels)), bool)
        for axis, (limit, wraps) in enumerate(zip(self._canvas.shape, self._canvas.wrap, strict=True)):
            line = places[:, axis, np.newaxis] + pixels[:, axis]
            if not wraps:
                np.logical_and(inside, (line >= 0) & (line < limit), out=inside)
            lines.append(line % limit if wraps else np.clip(line, 0, limit - 1))
        return lines[0], lines[1], inside

    def _seen(self, places: Indices, pixels: Indices, mask: Mask) -> Mask:
        """Test at which places any of the pixels lies on a mask."""
        rows, columns, inside = self._at(places, pixels)
        return np.asarray((mask[rows, columns] & inside).any(axis=1))

    def _errors(self, one: _Lone, places: Indices, ring: Indices) -> Floats32:
        """Compare the ground round an object with that at some places: mean squared differences."""
        rows, columns, inside = self._at(places, ring)
        features = self._placer.features
        there = values_at(features, self._canvas.index[rows, columns])
        own = features[ring[:, 0] + one.corner[0], ring[:, 1] + one.corner[1]]
        squares = np.square(there - own).sum(axis=2)
        # Beyond the canvas it counts as it does elsewhere in the mean, so that no place there is preferred.
        errors: Floats32 = squares.mean(axis=1, where=inside | ~inside.any(axis=1, keepdims=True))
        share = inside.mean(axis=1)
        found: Floats32 = share * errors + (1 - share) * np.mean(squares, where=inside)
        return found

    def _paint(self, one: _Lone, at: At) -> None:
        """Lay an object with its box at a place."""
        canvas, (height, width) = self._canvas, one.core.shape
        rows, columns, inside = canvas.window(*at, height, width)
        before = canvas.read(at[0] - 1, at[1] - 1, height + 2, width + 2)
        shown = self._scattered.shown.ravel().take(np.maximum(before[1:-1, 1:-1], 0))
        core = one.core & inside
        may = (one.may & inside & ~shown) | core
        if not may.any():
            return
        box = box_of(may)
        (top, left), (h, w) = (box[0].start, box[1].start), may[box].shape
        patch = ClosedPatch(
            at=(at[0] + top, at[1] + left),
            source=self._placer.patch((one.corner[0] + top, one.corner[1] + left), (h, w)),
            before=before[top : top + h + 2, left : left + w + 2],
            must=core[box],
            may=may[box],
        )
        (shows,) = self._placer.cut_closed([patch])
        canvas.paint(*patch.at, patch.source, shows)
        wide = ndimage.binary_dilation(np.pad(one.halo, _APART), iterations=_APART)
        rows, columns, inside = canvas.window(
            at[0] - _APART, at[1] - _APART, height + 2 * _APART, width + 2 * _APART
        )
        y, x = np.nonzero(wide & inside)
        self._taken[rows[y, 0], columns[0, x]] = True
