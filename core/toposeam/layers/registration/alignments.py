"""The alignments of two pictures that show more than one plane, and the one that the seam prefers.

The homography with most matches need not be the one along which two pictures join best: where the
photographer walked, a seam can run in one plane only. So each plane of the scene
(:mod:`toposeam.layers.registration.planes`) and the other model, of a camera that turned, give an alignment;
each is cut at reduced size, and the cheapest seam decides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from toposeam.arrays import Floats
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.transforms import PlaneTransform, Transform
from toposeam.layers.mesh.trial import is_seen, reduced_copies, toned_copies, trial_seam
from toposeam.layers.registration.homography import least_squares_homography
from toposeam.layers.registration.pair_matching import Match
from toposeam.layers.registration.placement import Placement, Residual
from toposeam.seam.result.seam import Seam


def cheapest(
    pictures: Sequence[Layer],
    placement: Placement,
    others: Iterator[Placement],
    planes: Sequence[Match] = (),
    *,
    gain: float = 0.6,
    stretch: float = 2.0,
    near: float = 0.4,
) -> Placement:
    """Choose the placement of two pictures whose trial seam is cheapest, and bend them where that pays.

    Parameters
    ----------
    pictures : two of Layer
    placement : Placement
        The one that residuals prefer. Once a seam is invisible, that of bent pictures as well, no other
        placement is computed.
    others : iterator of Placement
    planes : sequence of Match
        Points of all planes; with none the pictures are not bent.
    gain : float
        Largest cost of another seam ÷ that of the seam of `placement`.
    stretch : float
        Another placement may not stretch a picture anywhere more in one direction than in the other by this
        factor, nor show less of it.
    near : float
        Likeness of the worst part of the seam of `placement` from which on it is bent before others are
        computed: most seams that differ so little are invisible then.
    """
    copies, scales = reduced_copies(pictures)
    copies = toned_copies(copies, scales, placement.transforms, max(scales))
    best, trial = placement, trial_seam(copies, scales, placement.transforms, max(scales))
    if trial is None or not is_seen(trial[0], max(scales)):
        return placement
    tried = None
    if trial[0].verdict is not None and trial[0].verdict.worst >= near:
        tried, seen = _bent(placement, trial[0], copies, scales, planes)
        if not seen:
            return tried
    least = gain * float(trial[0].cost)
    for other in (_in_view_of(placement, other) for other in others):
        if not is_seen(trial[0], max(scales)):
            break
        if _stretch(other) <= stretch:
            own = trial_seam(copies, scales, other.transforms, max(scales))
            if own is not None and float(own[0].cost) < least:
                best, trial, least = other, own, float(own[0].cost)
    if tried is not None and best is placement:
        return tried
    return _bent(best, trial[0], copies, scales, planes)[0]


def _bent(
    placement: Placement, seam: Seam, copies: Sequence[Layer], scales: Sequence[int], planes: Sequence[Match]
) -> tuple[Placement, bool]:
    """Bend the pictures of a placement where that pays; return also whether their trial seam may be seen."""
    if not planes or not is_seen(seam, max(scales)):
        return placement, True
    from toposeam.layers.mesh.bending import bent  # most pictures are not bent

    points = np.concatenate([one.first for one in planes]), np.concatenate([one.second for one in planes])
    transforms, seen = bent(copies, scales, placement.transforms, placement.sizes, points, float(seam.cost))
    if transforms == placement.transforms:
        return placement, True
    here, there = (one.to_canvas(own) for one, own in zip(transforms, points, strict=True))
    distances = np.hypot(*(there - here).T)
    residual = Residual.of(distances, here, placement.residuals[0, 1].features)
    bent_one = replace(placement, transforms=transforms, residuals={(0, 1): residual}, misfit=residual.median)
    return bent_one, seen


def _stretch(placement: Placement) -> float:
    """Compute how much more a placement stretches pictures in one direction than across it; infinite where it
    shows nothing of a part.
    """
    worst = 1.0
    for transform, (width, height) in zip(placement.transforms, placement.sizes, strict=True):
        grid = np.stack(np.meshgrid(np.linspace(0, width - 2, 9), np.linspace(0, height - 2, 9)), axis=-1)
        here, right, down = (transform.to_canvas(grid + step) for step in ((0, 0), (1, 0), (0, 1)))
        local = np.stack([right - here, down - here], axis=-1)
        if not np.isfinite(local).all():
            return np.inf
        longest, shortest = np.moveaxis(np.linalg.svd(local, compute_uv=False), -1, 0)
        worst = max(worst, float((longest / np.maximum(shortest, 1e-9)).max()))
    return worst


def _in_view_of(placement: Placement, other: Placement) -> Placement:
    """View the plane of another placement as a placement of the same pictures shows them, if that is flat."""
    planes = [one.matrix for one in other.transforms if isinstance(one, PlaneTransform)]
    if len(planes) < len(other.transforms):
        return other
    grids = [
        np.stack(np.meshgrid(np.linspace(0, width - 1, 5), np.linspace(0, height - 1, 5)), -1).reshape(-1, 2)
        for width, height in placement.sizes
    ]
    wanted = np.concatenate(_all_to_canvas(placement.transforms, grids))
    plain = np.concatenate(_all_to_canvas(other.transforms, grids))
    known = np.isfinite(wanted + plain).all(axis=1)
    view = least_squares_homography(wanted[known], plain[known])
    seen = [
        np.append(grid, np.ones((len(grid), 1)), 1) @ (view @ one)[2]
        for grid, one in zip(grids, planes, strict=True)
    ]
    if any(depths.min() <= 0 for depths in seen):
        return other
    # seen from the middle of each picture, its depth is 1
    viewed = [PlaneTransform(view @ one / depths[12]) for one, depths in zip(planes, seen, strict=True)]
    return replace(other, transforms=tuple(viewed))


def _all_to_canvas(transforms: Sequence[Transform], points: Sequence[Floats]) -> list[Floats]:
    return [one.to_canvas(own) for one, own in zip(transforms, points, strict=True)]
