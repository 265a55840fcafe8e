"""Describe the places that were found, for people and for programs."""

from __future__ import annotations

from typing import Any

import numpy as np

import toposeam as ts
from toposeam.layers.canvas.canvas import extent_of
from toposeam.layers.registration.placement import Residual
from toposeam.sentence import counted
from toposeam_cli.media.pictures.lens import equivalent_mm
from toposeam_cli.stitching.inputs import PlacedPictures

#: Residual, px, above which a pair of pictures is reported, as a step of 2 px in an edge is visible; and the
#: largest number of pairs that are named.
_VISIBLE_PX, _MOST_NAMED = 2.0, 4


def describe_placement(layers: tuple[ts.Layer, ...], placement: ts.layers.Placement | None) -> list[str]:
    """Describe the places that were found, in lines of text."""
    if placement is None:
        return []
    if placement.model in ("shift", "similarity"):
        return [_moved(layers, placement, index) for index in range(len(layers))]
    pairs = counted(len(placement.residuals), "pair")
    left = f"{placement.misfit:.2f} px" if placement.misfit < 10 else f"{placement.misfit:.0f} px"
    if placement.model == "plane" or placement.focal is None:
        return [f"{len(layers)} pictures of one plane by {pairs}, at most {left} left in the median of one"]
    several = zip(placement.focals, placement.sizes, strict=True)
    lengths = sorted({round(equivalent_mm(focal, size)) for focal, size in several})
    length = f"length {lengths[0]}" if len(lengths) == 1 else f"lengths {lengths[0]} to {lengths[-1]}"
    bent = f", distortion {placement.distortion:+.4f}" if placement.distortion else ""
    wide = ", all the way round" if placement.wrap else ""
    return [
        f"{len(layers)} pictures of a camera that turned, by {pairs}, at most {left} left in the median of "
        f"one; focal {length} mm of 24 × 36{bent}, projection {placement.projection}{wide}"
    ]


def best_correlation(correlations: dict[tuple[int, int], float], index: int) -> float | None:
    """Return the best correlation of a picture with another one; None if none is known."""
    found = [value for pair, value in correlations.items() if index in pair and np.isfinite(value)]
    return max(found) if found else None


def _moved(layers: tuple[ts.Layer, ...], placement: ts.layers.Placement, index: int) -> str:
    x, y = placement.places[index]
    correlation = best_correlation(placement.correlations, index)
    how = "by given points" if correlation is None else f"correlation {correlation:.2f}"
    text = f"{layers[index].name}: found at {x:.1f},{y:.1f} ({how}"
    if placement.turns.any():
        text += f", turned by {placement.turns[index]:.2f}°, scaled by {placement.scales[index]:.4f}"
    return f"{text})"


def misfits(job: PlacedPictures, at: tuple[int, int] | None) -> list[str]:
    """Describe the residuals between pictures at their common points, in sentences.

    `at` is the pixel of the canvas at which the joined picture begins; coordinates are those of that picture.
    """
    placement = job.placement
    if placement is None:
        return []
    left, top = np.array(extent_of(job.layers).origin) + (at or (0, 0))
    worst = sorted(placement.residuals.items(), key=lambda item: -item[1].farthest)
    worth = [(pair, residual) for pair, residual in worst if residual.farthest > _VISIBLE_PX]
    sentences = [
        f"up to {residual.farthest:.0f} px are left between {job.layers[i].name} and {job.layers[j].name} "
        f"near {residual.near[0] - left:.0f},{residual.near[1] - top:.0f}; look whether the seam runs there"
        for (i, j), residual in worth[:_MOST_NAMED]
    ]
    if len(worth) > _MOST_NAMED:
        sentences.append(f"more than {_VISIBLE_PX:g} px are left in {len(worth) - _MOST_NAMED} more pairs")
    return sentences


def placement_summary(job: PlacedPictures) -> dict[str, Any] | None:
    """Summarise the places that were found, for ``--json``; None if they were given.

    What is not known of a camera is None.
    """
    placement = job.placement
    if placement is None:
        return None
    names = [layer.name for layer in job.layers]
    camera = dict.fromkeys(("focal_px", "focal_mm", "distortion", "projection", "wrap"))
    if placement.focal is not None:
        camera = {
            "focal_px": placement.focal,
            "focal_mm": equivalent_mm(placement.focal, placement.sizes[0]),
            "distortion": placement.distortion,
            "projection": placement.projection,
            "wrap": placement.wrap,
        }
    pairs = [
        {"between": [names[i], names[j]], **_pair_summary(residual, placement.correlations[i, j])}
        for (i, j), residual in placement.residuals.items()
    ]
    found = {"model": placement.model, "misfit_px": placement.misfit, **camera, "pairs": pairs}
    return found | {"used": len(names), "left_out": list(placement.left_out.values())}


def _pair_summary(residual: Residual, correlation: float) -> dict[str, Any]:
    return {
        "features": residual.features,
        "points": residual.points,
        "median_px": residual.median,
        "farthest_px": residual.farthest,
        "correlation": correlation if np.isfinite(correlation) else None,
    }
