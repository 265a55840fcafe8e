"""From a canvas to what the caller gets."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Ints32, Mask
from toposeam.images import box_of, full_scale
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.rendering import Lift, near_seams, render, render_normals, render_seen
from toposeam.texture.canvas.synthesis import Synthesis
from toposeam.texture.canvas.visible_joints import JointSteps, JointVerdict, busyness, middle_of
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.sources import Sources
from toposeam.texture.placement.request import TextureRequest

#: Distance, px, round a changed part in which the picture's own steps are counted.
_NEAR = 64


def finish(
    sources: Sources,
    atlas: Atlas,
    canvas: IndexCanvas,
    patch: tuple[int, int],
    settings: dict[str, Any],
    request: TextureRequest,
    changed: npt.NDArray[np.bool_] | None = None,
    lift: Callable[[int], Lift] | None = None,
    windows: Sequence[tuple[int, int, tuple[int, int]]] | None = None,
) -> Synthesis:
    """Render every map from what the canvas shows: copies are mixed at seams in the picture, its opacity and
    normals; further maps, whose values may be heights or numbers of things, keep them. The picture may be
    given light, channel by channel. Of a picture that was given only what changed is drawn anew, in the box
    round it or in windows.
    """
    made: list[npt.NDArray[Any]] = []
    smooth = request.smooth
    box = np.s_[:, :] if changed is None or windows is not None else box_of(changed, smooth + 1)
    steps = JointSteps(canvas.index[box], atlas, canvas.wrap)
    normals = len(sources.planes) - 1 - sources.has_alpha if sources.has_normal else 0
    maps = range(1, normals or len(sources.planes) - sources.has_alpha)
    for images, gray in zip(sources.planes, sources.gray, strict=True):
        plane = atlas.spread(images)
        light = None if made else _watched(lift, steps, plane, request.white_of(sources))

        def drawn(
            index: Ints32,
            wrap: tuple[bool, bool],
            plane: npt.NDArray[Any] = plane,
            light: Callable[[int], Lift] | None = light,
        ) -> npt.NDArray[Any]:
            if len(made) in maps:
                return render(index, plane, atlas.usable, wrap, 0)
            if normals and len(made) == normals:
                return render_normals(index, plane, atlas.usable, wrap, smooth)
            if sources.transparent and sources.has_alpha and len(made) + 1 < len(sources.planes):
                opacity = atlas.spread(sources.planes[-1])
                return render_seen(index, plane, opacity, atlas.usable, wrap, smooth)
            if light is None:
                return render(index, plane, atlas.usable, wrap, smooth)
            picture = np.empty((*index.shape, plane.shape[2]), plane.dtype)
            near = near_seams(index, atlas.width, wrap, smooth) if smooth else []
            for channel in range(plane.shape[2]):
                one = np.s_[..., channel : channel + 1]
                picture[one] = render(index, plane[one], atlas.usable, wrap, smooth, light(channel), near)
            return picture

        if changed is None:
            picture = drawn(canvas.index, canvas.wrap)
        elif windows is None:
            picture = images[0].copy()
            np.copyto(
                picture[box], drawn(canvas.index[box], canvas.wrap), where=changed[box][..., np.newaxis]
            )
        else:
            picture, reach = images[0].copy(), smooth + 1
            for top, left, (h, w) in windows:
                wide = canvas.read(top - reach, left - reach, h + 2 * reach, w + 2 * reach)
                part = drawn(wide, (False, False))[reach:-reach, reach:-reach]
                rows, columns, _ = canvas.window(top, left, h, w)
                y, x = np.nonzero(changed[rows, columns])
                picture[rows[y, 0], columns[0, x]] = part[y, x]
        made.append(picture[..., 0] if gray else picture)
    alpha = made.pop() if sources.has_alpha else None
    normal = made.pop() if sources.has_normal else None
    if alpha is None and canvas.ground is not None:
        alpha = canvas.ground * full_scale(made[0].dtype)
    return Synthesis(
        image=made[0],
        alpha=alpha,
        maps=tuple(made[1:]),
        normal=normal,
        labels=canvas.copy_labels(),
        index=canvas.index,
        wraps=canvas.wrap,
        verdict=_verdict(steps, sources, request.white_of(sources), atlas, canvas, changed, box),
        patch=patch,
        settings=settings,
        smooth=smooth,
        changed=changed,
        atlas=atlas,
    )


def _watched(
    lift: Callable[[int], Lift] | None, steps: JointSteps, plane: npt.NDArray[Any], white: float
) -> Callable[[int], Lift] | None:
    """Gather the steps of a picture as it is, or as it is given light, channel by channel."""
    if lift is not None:
        return steps.lit(lift, plane, white)
    steps.add_all(plane, white)
    return None


def _verdict(
    steps: JointSteps,
    sources: Sources,
    white: float,
    atlas: Atlas,
    canvas: IndexCanvas,
    changed: Mask | None,
    box: tuple[slice, slice],
) -> JointVerdict:
    """Judge what was laid on some rows and columns; what is near a changed part, or else the largest
    exemplar, tells which steps hide joints.
    """
    number = max(range(len(sources.shapes)), key=lambda one: math.prod(sources.shapes[one]))
    near = np.s_[:, :] if changed is None or not changed.any() else box_of(changed, _NEAR)
    usable, image = sources.usable[number][near], sources.planes[0][number][near]
    middle = middle_of(usable)
    busy = busyness(image[middle].astype(np.float32) / np.float32(white), usable[middle])
    if changed is None:
        return steps.verdict(busy, canvas.index.size, canvas.shown(atlas.copied))
    corner = box[1].start or 0, box[0].start or 0
    return steps.verdict(busy, int(np.count_nonzero(changed)), None, corner)
