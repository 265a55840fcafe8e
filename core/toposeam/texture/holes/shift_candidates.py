"""Candidate shifts to fill a hole: those by which the picture repeats itself, and those that fit the hole's
surroundings.

*Repetition of the picture.* Each small window has its best match at some distance. Over many windows the
shifts between windows and matches pile up at a few, by which most of the picture can be laid on itself (He
and Sun 2012, doi:10.1007/978-3-642-33709-3_2).

*Level shifts.* Pixels at the same height are more likely alike, as along a horizon. So shifts along the rows,
and along the columns, are chosen that bring as much of the hole as possible.

*Fitting surroundings.* The ring round the whole hole, and windows on its rim, are searched for in the rest of
the picture (:mod:`toposeam.texture.exemplar.patch_search`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.fft as sf
from scipy import ndimage

from toposeam.arrays import Floats32, Indices, Mask
from toposeam.images import box_of
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.patch_search import PatchSearch, box_sum, reduced, refined

#: Largest picture, px, on which statistics of shifts are taken; larger ones are reduced.
_MOST_PIXELS = 40_000
#: Side of the windows that are matched, px.
_WINDOW = 8
#: Largest number of windows that are matched, and number of matches among which each may choose.
_QUERIES, _MATCHES = 3000, 8
#: Number of principal components by which windows are compared.
_DIMENSIONS = 16
#: Relative error allowed of the nearest match: its shift is one of thousands that vote.
_MATCH_ERROR = 0.5
#: Least distance of a match that counts, as a share of the longer side: pictures are smooth near by.
_LEAST_DISTANCE = 1 / 15
#: Number of windows on the rim of a hole, and of places that each contributes.
_RIM_WINDOWS, _PLACES_PER_WINDOW = 10, 2
#: Number of places that the ring round the whole hole contributes.
_RING_PLACES = 8
#: Largest number of shifts along the rows, and along the columns.
_LEVEL_SHIFTS = 6
#: Least share of the hole that such a shift brings.
_LEAST_BROUGHT = 0.03
#: Number of places tried for a pixel that no shift reaches.
_PLACES_TRIED = 40


def candidate_shifts(
    atlas: Atlas, features: Floats32, hole: Mask, missing: Mask, count: int, rng: np.random.Generator
) -> Indices:
    """Find shifts that could bring what a hole lacks.

    Parameters
    ----------
    atlas : Atlas
        Of one exemplar, the picture.
    features : (AH, AW, F) float32 array
    hole, missing : (H, W) bool array
        The hole, and all of the picture that has to go.
    count : int
        Largest number of shifts from the picture's own statistics.
    rng : numpy.random.Generator

    Returns
    -------
    (K, 2) int array
        Rows and columns to go from a pixel of the hole to the pixel to copy; no two alike.
    """
    place = atlas.places[0]
    picture, copied = features[place], atlas.copied[place]
    found = [
        _fitting(atlas, features, hole, missing),
        _dominant(picture, copied, hole, count, rng),
        _level(copied, hole),
    ]
    shifts = np.concatenate(found)
    shifts = np.concatenate([shifts, _covering(copied, hole, shifts, rng)])
    _, first = np.unique(shifts, axis=0, return_index=True)
    return shifts[np.sort(first)]


def _level(copied: Mask, hole: Mask) -> Indices:
    """Find shifts along the rows, and along the columns; each brings most of the hole that those before it do
    not bring.
    """
    found: list[tuple[int, int]] = []
    for axis in (0, 1):
        lines = box_of(hole)[axis]
        missing, given = (hole[lines], copied[lines]) if axis == 0 else (hole[:, lines].T, copied[:, lines].T)
        width = missing.shape[1]
        size = sf.next_fast_len(2 * width, real=True)
        there = sf.rfft(given, size, axis=1)
        left = missing.copy()
        for _ in range(_LEVEL_SHIFTS):
            wanted = np.conj(sf.rfft(left, size, axis=1))
            count = sf.irfft((there * wanted).sum(axis=0), size)
            step = int(count.argmax())
            if count[step] < _LEAST_BROUGHT * np.count_nonzero(missing):
                break
            step = step if step < width else step - size
            found.append((0, step) if axis == 0 else (step, 0))
            here = np.zeros_like(left)
            low, high = max(-step, 0), min(width - step, width)
            here[:, low:high] = given[:, low + step : high + step]
            left &= ~here
    return np.array(found, np.intp).reshape(-1, 2)


def _covering(copied: Mask, hole: Mask, shifts: Indices, rng: np.random.Generator) -> Indices:
    """Find further shifts, so that every pixel of the hole has one that brings it a pixel."""
    y, x = np.nonzero(hole)

    def covered(shift: npt.NDArray[np.intp], pixels: npt.NDArray[np.intp]) -> npt.NDArray[np.bool_]:
        row, column = y[pixels] + shift[0], x[pixels] + shift[1]
        inside = (row >= 0) & (row < copied.shape[0]) & (column >= 0) & (column < copied.shape[1])
        reached: npt.NDArray[np.bool_] = inside.copy()
        reached[inside] = copied[row[inside], column[inside]]
        return reached

    left = np.arange(len(y))
    for shift in shifts:
        left = left[~covered(shift, left)]
    more: list[npt.NDArray[np.intp]] = []
    rows, columns = np.nonzero(copied) if len(left) else (left, left)
    while len(left):
        pick = left[rng.integers(len(left))]
        # Near places first: what is near is more likely alike.
        near = np.argsort(np.hypot(rows - y[pick], columns - x[pick]), kind="stable")
        tried = near[np.unique(np.geomspace(1, len(near), _PLACES_TRIED).astype(int)) - 1]
        places = np.stack([rows[tried] - y[pick], columns[tried] - x[pick]], axis=1)
        counts = np.array([covered(place, left).sum() for place in places])
        more.append(places[int(np.argmax(2 * counts >= counts.max()))])
        left = left[~covered(more[-1], left)]
    return np.array(more, np.intp).reshape(-1, 2)


def _dominant(picture: Floats32, copied: Mask, hole: Mask, count: int, rng: np.random.Generator) -> Indices:
    """Return the shifts by which windows near the hole most often find their match."""
    factor = 1
    while picture.shape[0] * picture.shape[1] / factor**2 > _MOST_PIXELS:
        factor *= 2
    small, share = reduced(picture, copied.astype(np.float32), factor)
    if min(small.shape[:2]) < 3 * _WINDOW:
        return np.zeros((0, 2), np.intp)
    whole = box_sum(share < 1, (_WINDOW, _WINDOW)) == 0
    rows, columns = np.nonzero(whole)
    if len(rows) < 4 * _MATCHES:
        return np.zeros((0, 2), np.intp)
    windows = np.lib.stride_tricks.sliding_window_view(small, (_WINDOW, _WINDOW), axis=(0, 1))
    flat = windows[rows, columns].reshape(len(rows), -1)
    some = flat[rng.choice(len(flat), min(len(flat), 2000), replace=False)]
    mean = some.mean(axis=0)
    _, directions = np.linalg.eigh((some - mean).T @ (some - mean))
    points = (flat - mean) @ directions[:, -_DIMENSIONS:]
    # Near the hole matters most; far from it the picture may be another one.
    missing = ndimage.zoom(hole, 1 / factor, order=0) if factor > 1 else hole
    distance = ndimage.distance_transform_edt(~missing)
    middle = (
        np.minimum(rows + _WINDOW // 2, distance.shape[0] - 1),
        np.minimum(columns + _WINDOW // 2, distance.shape[1] - 1),
    )
    reach = 2 * np.sqrt(max(int(np.count_nonzero(missing)), 1))
    near = np.flatnonzero(distance[middle] <= max(reach, 3 * _WINDOW))
    asked = near if len(near) <= _QUERIES else rng.choice(near, _QUERIES, replace=False)
    if not len(asked):
        return np.zeros((0, 2), np.intp)
    from scipy.spatial import cKDTree  # a tenth of a second that textures do not need

    _, match = cKDTree(points).query(points[asked], k=min(_MATCHES, len(points)), eps=_MATCH_ERROR)
    dy, dx = rows[match] - rows[asked, np.newaxis], columns[match] - columns[asked, np.newaxis]
    far = np.hypot(dy, dx) > _LEAST_DISTANCE * max(small.shape[:2])
    first = far.argmax(axis=1)
    kept = far.any(axis=1)
    line = np.arange(len(asked))[kept]
    dy, dx = dy[line, first[kept]], dx[line, first[kept]]
    height, width = small.shape[:2]
    votes = np.zeros((2 * height + 1, 2 * width + 1))
    np.add.at(votes, (dy + height, dx + width), 1)
    smooth = ndimage.gaussian_filter(votes, 1.4)
    peaks = (smooth == ndimage.maximum_filter(smooth, 5)) & (smooth > 0)
    y, x = np.nonzero(peaks)
    order = np.argsort(-smooth[y, x], kind="stable")[:count]
    shifts = np.stack([y[order] - height, x[order] - width], axis=1) * factor
    return _refined(picture, copied, hole, shifts, factor)


def _refined(picture: Floats32, copied: Mask, hole: Mask, shifts: Indices, factor: int) -> Indices:
    """Refine shifts that were found on a smaller picture, to the pixel: by how well they continue what is
    round the hole.
    """
    band = ndimage.binary_dilation(hole, iterations=8) & copied
    rows, columns = np.nonzero(band)
    step = max(1, len(rows) // 600)
    rows, columns = rows[::step], columns[::step]
    result = shifts.copy()
    if not len(rows):
        return result
    here = picture[rows, columns]
    reach = factor // 2
    while reach:
        best = np.full(len(result), np.inf)
        chosen = result.copy()
        for dy in (-reach, 0, reach):
            for dx in (-reach, 0, reach):
                tried = result + np.array([dy, dx])
                y, x = rows + tried[:, :1], columns + tried[:, 1:]
                inside = (y >= 0) & (y < copied.shape[0]) & (x >= 0) & (x < copied.shape[1])
                y, x = np.clip(y, 0, copied.shape[0] - 1), np.clip(x, 0, copied.shape[1] - 1)
                inside &= copied[y, x]
                error = np.minimum(np.square(picture[y, x] - here).sum(axis=2), 0.05)
                mean = (error * inside).sum(axis=1) / np.maximum(inside.sum(axis=1), 1)
                mean[~inside.any(axis=1)] = np.inf
                better = mean < best
                best[better], chosen[better] = mean[better], tried[better]
        result = chosen
        reach //= 2
    return result


def _fitting(atlas: Atlas, features: Floats32, hole: Mask, missing: Mask) -> Indices:
    """Return the shifts to the places that look most like the ring round the hole, and like windows on its
    rim.
    """
    search, place = PatchSearch(atlas, features), atlas.places[0]
    picture, known = features[place], atlas.usable[place]
    down, across = box_of(hole)
    extent = down.stop - down.start, across.stop - across.start
    ring = int(np.clip(max(extent) // 4, 8, 48))
    windows = [
        (down.start - ring, across.start - ring, extent[0] + 2 * ring, extent[1] + 2 * ring, _RING_PLACES)
    ]
    side = int(np.clip(max(extent) // 2, 16, 64))
    rim = hole & ndimage.binary_dilation(~hole)
    y, x = np.nonzero(rim)
    angle = np.argsort(np.arctan2(y - y.mean(), x - x.mean()), kind="stable")
    windows += [
        (int(y[k]) - side // 2, int(x[k]) - side // 2, side, side, _PLACES_PER_WINDOW)
        for k in angle[np.linspace(0, len(angle), _RIM_WINDOWS, endpoint=False).astype(int)].tolist()
    ]
    found = []
    for top, left, height, width, most in windows:
        top, left = max(top, 0), max(left, 0)
        bottom, right = min(top + height, hole.shape[0]), min(left + width, hole.shape[1])
        part = slice(top, bottom), slice(left, right)
        weight = (known[part] & ~missing[part]).astype(np.float32)
        shape = bottom - top, right - left
        if not weight.any() or not search.room(shape).any():
            continue
        error = search.fit(picture[part], weight, (0, 0), shape)
        apart = max(2, min(shape) // (4 * search.factor))
        best: list[tuple[int, int]] = []
        for _ in range(most):
            i, j = divmod(int(error.argmin()), error.shape[1])
            if not np.isfinite(error[i, j]):
                break
            best.append((search.factor * i, search.factor * j))
            error[max(i - apart, 0) : i + apart + 1, max(j - apart, 0) : j + apart + 1] = np.inf
        rows, columns = np.array(best, np.intp).reshape(-1, 2).T
        if search.factor > 1 and best:
            sample = search.sample(picture[part], weight, (0, 0))
            rows, columns, _ = refined([(search, sample, 1.0)], rows, columns, (0, 0), shape)
        found.append(np.stack([rows - place[0].start - top, columns - place[1].start - left], axis=1))
    return np.concatenate(found) if found else np.zeros((0, 2), np.intp)
