"""A plan for ordered textures that repeat: what the texture should look like so that its order closes at the
border.

Rows of bricks or threads of cloth run on for ever, and patches that are laid one after another follow them:
where the texture meets its own beginning, they arrive out of step. So ordered textures are laid twice. The
first time the axis on which the order runs on stays open, and the texture grows beyond its border. How far,
and which way, its continuation has come out of step with its beginning is found at every place of the border
(the cheapest shifts that change by at most a step from place to place, by dynamic programming), and the first
texture is sheared by just that, a little at every row, so that it closes. Sheared pixels are no copies; they
serve as the guide by which the second texture is laid.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.images import Mask
from toposeam.texture.atlas import Atlas, Floats32, values_at
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.crew import Crew
from toposeam.texture.lay import PatchPlacer
from toposeam.texture.lay_options import LayOptions
from toposeam.texture.raster import lay_all, patches_on
from toposeam.texture.scale import autocorrelation
from toposeam.texture.search import reduced
from toposeam.texture.sites import Guide
from toposeam.texture.sources import Sources

#: Correlation with itself, beyond one element, from which on a texture counts as ordered.
ORDERED = 0.25
#: The plan's share in the choice of patches.
_WEIGHT = 0.7
#: px between the places of the border that get a shift of their own.
_STEP = 4
#: Patches of at least this side, px, are planned at half size.
_HALVED = 24

Floats = npt.NDArray[np.float64]


def order_axis(features: Floats32, usable: Mask) -> int | None:
    """The axis along which the order of a texture runs, None where there is none.

    Parameters
    ----------
    features : (H, W, F) float32 array
    usable : (H, W) bool array
    """
    slow = np.stack(
        [ndimage.gaussian_filter(features[..., c], 24.0) for c in range(features.shape[2])], axis=2
    )
    near = autocorrelation(features - slow, usable)
    height, width = (length // 2 for length in usable.shape)
    distance = np.hypot(*np.ogrid[-height : height + 1, -width : width + 1])
    # Beyond the first ring without correlation, whatever correlates is another element.
    ring = np.array([near[(distance >= r) & (distance < r + 1)].mean() for r in range(min(height, width))])
    ends = np.flatnonzero(ring < 0.05)
    if not len(ends) or near[distance > max(2 * int(ends[0]), 8)].max(initial=0) < ORDERED:
        return None
    middle_row, middle_column = near[height], near[:, width]
    return 0 if middle_column.clip(0).sum() >= middle_row.clip(0).sum() else 1


def closing_guide(
    sources: Sources,
    atlas: Atlas,
    options: LayOptions,
    size: tuple[int, int],
    wraps: tuple[bool, bool],
    axis: int,
    patch: int,
    overlap: int,
    seed: int,
    processes: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Guide:
    """What the texture should look like, planned at half size where patches are large enough.

    Parameters
    ----------
    sources, atlas
        The exemplars.
    options : LayOptions
    size, wraps : (int, int), (bool, bool)
        Of the texture that is to close.
    axis : int
        The axis on which its order runs.
    patch, overlap, seed, processes : int
    progress : callable, optional
        Called with the share of the work done.
    """
    factor = 2 if patch >= _HALVED and overlap >= 4 else 1
    small = [
        reduced(values, usable.astype(np.float32), factor)
        for values, usable in zip(sources.features, sources.present, strict=True)
    ]
    copied = [
        reduced(values, usable.astype(np.float32), factor)[1] == 1
        for values, usable in zip(sources.features, sources.usable, strict=True)
    ]
    side, lap = patch // factor, overlap // factor
    longer = [-(-length // factor) + (2 * side if k == axis else 0) for k, length in enumerate(size)]
    room = Atlas.of([share > 0 for _, share in small], options.context // factor, copied)
    features = room.spread([values for values, _ in small])
    canvas = IndexCanvas(
        (longer[0], longer[1]), (wraps[0] and axis != 0, wraps[1] and axis != 1), room.usable.size
    )
    placer = PatchPlacer(room, features, canvas, options, np.random.default_rng(seed), longer[0] * longer[1])
    if not placer.search.room((side, side)).any():
        return Guide(
            source=atlas.spread(sources.features),
            target=np.zeros((*size, features.shape[2]), np.float32),
            weight=0.0,
        )
    count = patches_on(canvas, side, lap)
    with Crew(processes, placer, lambda: canvas.share(count)) as crew:
        lay_all(placer, side, lap, crew, axis, progress)
    grown = values_at(features, canvas.index)
    if axis == 1:
        grown = grown.swapaxes(0, 1)
    closed = _sheared(grown, longer[axis] - 2 * side, side, wraps[1 - axis])
    target = _enlarged(closed if axis == 0 else closed.swapaxes(0, 1), factor)[: size[0], : size[1]]
    stands = [
        _enlarged(values, factor)[: usable.shape[0], : usable.shape[1]] * usable[..., np.newaxis]
        for (values, _), usable in zip(small, sources.present, strict=True)
    ]
    return Guide(source=atlas.spread(stands), target=np.ascontiguousarray(target), weight=_WEIGHT)


def _enlarged(values: Floats32, factor: int) -> Floats32:
    return (
        values
        if factor == 1
        else ndimage.zoom(values, (factor, factor, 1), order=1, grid_mode=True, mode="nearest")
    )


def _sheared(grown: Floats32, height: int, patch: int, wraps: bool) -> Floats32:
    """The (height, W, F) part of a texture grown to height + 2 patches, sheared so that its lower border
    meets its upper one.
    """
    sideways = "wrap" if wraps else "nearest"
    plane = ndimage.gaussian_filter(grown, (1.5, 1.5, 0), mode=["nearest", sideways, "nearest"])
    plane = plane - ndimage.gaussian_filter(
        plane, (patch / 2, patch / 2, 0), mode=["nearest", sideways, "nearest"]
    )
    start = patch // 2
    reach = np.arange(-patch, patch + 1)
    best: tuple[float, int, Floats] | None = None
    for down in range(-start, start + 1, 4):
        beginning, end = (
            plane[start : start + patch],
            plane[start + height + down : start + height + down + patch],
        )
        cost = np.stack([_mismatch(beginning, end, int(shift), patch, sideways) for shift in reach], axis=1)
        cost *= (1 + 0.3 * np.square(reach / patch)) * (1 + 0.3 * (down / patch) ** 2)
        total, path = _smoothest(cost, wraps)
        if best is None or total < best[0]:
            best = total, down, reach[path].astype(np.float64)
    assert best is not None  # noqa: S101 - there is at least one row
    _, down, shifts = best
    width = grown.shape[1]
    columns = np.arange(width)
    places = np.arange(0, width, _STEP)
    shift = np.interp(columns, places, shifts, period=width if wraps else None)
    shift = ndimage.gaussian_filter1d(shift, 2.0 * _STEP, mode=sideways)
    share = np.arange(height)[:, np.newaxis] / height
    rows = np.broadcast_to(start + np.arange(height)[:, np.newaxis] + share * down, (height, width))
    across = columns + share * shift
    mode = "grid-wrap" if wraps else "nearest"
    if wraps:
        across %= width
    made = [
        ndimage.map_coordinates(grown[..., c], [rows, across], order=1, mode=mode)
        for c in range(grown.shape[2])
    ]
    return np.stack(made, axis=2).astype(np.float32)


def _mismatch(beginning: Floats32, end: Floats32, shift: int, patch: int, mode: str) -> Floats:
    """Mean squared difference round every few columns when the end is shifted sideways."""
    moved = np.roll(end, -shift, axis=1)
    square = np.square(moved - beginning).sum(axis=2).mean(axis=0)
    if mode == "nearest" and shift:
        square[slice(-shift, None) if shift > 0 else slice(0, -shift)] = square.mean()
    result: Floats = ndimage.uniform_filter1d(square.astype(np.float64), patch, mode=mode)[::_STEP]
    return result


def _smoothest(cost: Floats, closed: bool) -> tuple[float, npt.NDArray[np.intp]]:
    """The cheapest path through an (n, m) cost that moves by at most one column a row; where closed, it ends
    where it began.
    """
    if not closed:
        return _path(cost, None)
    n = len(cost)
    _, thrice = _path(np.concatenate([cost, cost, cost]), None)
    total, path = _path(np.concatenate([cost, cost[:1]]), int(thrice[n]))
    return total, path[:n]


def _path(cost: Floats, start: int | None) -> tuple[float, npt.NDArray[np.intp]]:
    total = cost[0].copy()
    if start is not None:
        total[:] = np.inf
        total[start] = cost[0, start]
    came = np.zeros(cost.shape, np.intp)
    for row in range(1, len(cost)):
        padded = np.pad(total, 1, constant_values=np.inf)
        choices = np.stack([padded[:-2], padded[1:-1], padded[2:]])
        came[row] = choices.argmin(axis=0) - 1
        total = cost[row] + choices.min(axis=0)
    at = int(total.argmin()) if start is None else start
    value, path = float(total[at]), [at]
    for row in range(len(cost) - 1, 0, -1):
        at += int(came[row, at])
        path.append(at)
    return value, np.array(path[::-1], np.intp)
