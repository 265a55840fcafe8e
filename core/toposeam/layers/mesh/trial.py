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
from toposeam.layers.canvas.warping import warped
from toposeam.layers.exposure.gains import match_tones
from toposeam.seam.find import find_seam
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.natural import CELL
from toposeam.seam.result.seam import Seam

#: Pixels of a reduced picture.
_PIXELS = 250_000
#: Least likeness of the worst part of a seam that is invisible at full size: reduction hides most of it.
_UNSEEN_REDUCED = 0.65
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


def trial_seam(
    copies: Sequence[Layer], scales: Sequence[int], transforms: Sequence[Transform], canvas_scale: int
) -> tuple[Seam, list[Layer]] | None:
    """Cut two reduced pictures on a reduced canvas.

    Parameters
    ----------
    copies : two of Layer
    scales : two of int
        Of :func:`reduced_copies`.
    transforms : two of Transform
        From the pictures, not their copies, to the canvas.
    canvas_scale : int
        px of the canvas per px of the reduced one.

    Returns
    -------
    seam : Seam
        Of the second picture with the first, on the box that the layers fill.
    layers : two of Layer
        The warped pictures round their overlap, of the same tones. Both fill one box of the reduced canvas.

    None where there is no seam, as the pictures do not overlap.
    """
    try:
        layers = match_tones(
            [
                warped(copy, ReducedTransform(one, canvas_scale, scale))
                for copy, scale, one in zip(copies, scales, transforms, strict=True)
            ],
            shading=True,
        )
        canvas = extent_of(layers)
        box = canvas.seam_box(CELL)
        if min(box.shape) < 2 * CELL:
            return None
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
