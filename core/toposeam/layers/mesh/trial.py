"""Trial seams: two pictures cut at reduced size, to compare alignments before the pictures are warped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from toposeam.errors import TopoSeamError
from toposeam.images import all_of_squares, as_reduced
from toposeam.layers.canvas.canvas import extent_of
from toposeam.layers.canvas.layer import Box, Layer, cut
from toposeam.layers.canvas.transforms import ReducedTransform, Transform
from toposeam.layers.canvas.warping import warped, warped_box
from toposeam.layers.exposure.gains import toned_as
from toposeam.seam.find import find_seam
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.natural import CELL
from toposeam.seam.result.seam import Seam

#: Pixels of a reduced picture.
_PIXELS = 250_000
#: Least likeness of the worst part of a seam that is invisible at full size: reduction hides most of it.
_UNSEEN_REDUCED = 0.65
#: px of the canvas of trial seams per px of that on which tones are compared.
_TONES_SCALE = 2
#: How far the blend of photographs reaches, px.
_REACH = 32.0


def reduced_copies(pictures: Sequence[Layer]) -> tuple[list[Layer], list[int]]:
    """Reduce pictures to about 250,000 px for trial seams.

    Returns
    -------
    copies : list of Layer
        float32, transparent where a pixel is not all of the picture.
    scales : list of int
        px of each picture per px of its copy.
    """
    scales = [
        max(1, int(np.ceil(np.sqrt(one.image.shape[0] * one.image.shape[1] / _PIXELS)))) for one in pictures
    ]
    return [_reduced(*item) for item in zip(pictures, scales, strict=True)], scales


def _reduced(picture: Layer, scale: int) -> Layer:
    planes = as_reduced(np.asarray(picture.image), scale, picture.title, picture.data_range)
    alpha = None
    if picture.alpha is not None or picture.mask is not None:
        alpha = all_of_squares(picture.covered, scale).astype(np.float32)
    return Layer(planes, alpha=alpha, name=picture.name, data_range=1.0, exposure=picture.exposure)


def toned_copies(
    copies: Sequence[Layer], scales: Sequence[int], transforms: Sequence[Transform], canvas_scale: int
) -> list[Layer]:
    """Match the tones of reduced pictures by where an alignment lays them, once for all trial seams.

    Parameters
    ----------
    copies, scales, transforms, canvas_scale
        As for :func:`trial_seam`.

    Returns
    -------
    list of Layer
        The copies as they are where the pictures do not overlap.
    """
    reduced = [
        ReducedTransform(one, _TONES_SCALE * canvas_scale, scale)
        for one, scale in zip(transforms, scales, strict=True)
    ]
    try:
        return toned_as(copies, reduced, list(map(warped, copies, reduced)))
    except TopoSeamError:
        return list(copies)


def trial_seam(
    copies: Sequence[Layer], scales: Sequence[int], transforms: Sequence[Transform], canvas_scale: int
) -> tuple[Seam, list[Layer]] | None:
    """Cut two reduced pictures on a reduced canvas.

    Parameters
    ----------
    copies : two of Layer
        Of :func:`reduced_copies`, of the same tones.
    scales : two of int
    transforms : two of Transform
        From the pictures, not their copies, to the canvas.
    canvas_scale : int
        px of the canvas per px of the reduced one.

    Returns
    -------
    seam : Seam
        Of the second picture with the first, on the box that the layers fill.
    layers : two of Layer
        The warped pictures round their overlap. Both fill one box of the reduced canvas.

    None where there is no seam, as the pictures do not overlap.
    """
    try:
        reduced = [
            ReducedTransform(one, canvas_scale, scale) for one, scale in zip(transforms, scales, strict=True)
        ]
        boxes = list(map(warped_box, copies, reduced))
        common = boxes[0].shared(boxes[1])
        if min(common.shape) < 2 * CELL:
            return None
        part = common.grown(2 * CELL)  # more than a seam looks at
        layers = [warped(copy, one, part) for copy, one in zip(copies, reduced, strict=True)]
        canvas = extent_of(layers)
        box = canvas.seam_box(CELL)
        layers = [_window(one, canvas.place(one), box, canvas.origin) for one in layers]
        values = [np.asarray(one.image) for one in layers]
        match = MatchCost(reach=_REACH / canvas_scale)
        return find_seam(*values, *(one.covered for one in layers), cost=match, data_range=1.0), layers
    except TopoSeamError:
        return None


def _window(layer: Layer, place: Box, box: Box, origin: tuple[int, int]) -> Layer:
    """Cut the part of a layer in a box; transparent where it has no pixels."""
    image, alpha = (cut(np.asarray(one), place, box) for one in (layer.image, layer.alpha))
    return replace(layer, image=image, alpha=alpha, at=(box.left + origin[0], box.top + origin[1]))


def is_seen(seam: Seam, scale: int) -> bool:
    """Test whether a trial seam, on a canvas `scale` times smaller, says that the final one may be seen."""
    verdict = seam.verdict
    if verdict is None or scale == 1:
        return verdict is not None and not verdict.unseen
    return verdict.worst < _UNSEEN_REDUCED
