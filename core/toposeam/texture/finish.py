"""From a canvas to what the caller gets."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.images import full_scale
from toposeam.texture.atlas import Atlas
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.holed import box_of
from toposeam.texture.lay_options import LayOptions
from toposeam.texture.rendering import Lift, render, render_seen
from toposeam.texture.sources import Sources
from toposeam.texture.synthesis import Synthesis


def finish(
    sources: Sources,
    atlas: Atlas,
    canvas: IndexCanvas,
    patch: tuple[int, int],
    settings: dict[str, Any],
    smooth: int,
    changed: npt.NDArray[np.bool_] | None = None,
    lift: Lift | None = None,
) -> Synthesis:
    """Every map, made of what the canvas shows; the first one, the picture, may be given light."""
    made: list[npt.NDArray[Any]] = []
    for images, gray in zip(sources.planes, sources.gray, strict=True):
        light = lift if not made else None
        plane = atlas.spread(images)
        if sources.transparent and sources.has_alpha and len(made) + 1 < len(sources.planes):
            opacity = atlas.spread(sources.planes[-1])
            picture = render_seen(canvas.index, plane, opacity, atlas.usable, canvas.wrap, smooth)
        elif changed is None or any(canvas.wrap):
            picture = render(canvas.index, plane, atlas.usable, canvas.wrap, smooth, light)
            if changed is not None:
                np.copyto(picture, images[0], where=~changed[..., np.newaxis])
        else:
            box = box_of(changed, smooth + 1)
            if light is not None:
                light = dataclasses.replace(light, gain=light.gain[box], offset=light.offset[box])
            part = render(canvas.index[box], plane, atlas.usable, canvas.wrap, smooth, light)
            picture = images[0].copy()
            np.copyto(picture[box], part, where=changed[box][..., np.newaxis])
        made.append(picture[..., 0] if gray else picture)
    alpha = made.pop() if sources.has_alpha else None
    if alpha is None and canvas.ground is not None:
        alpha = canvas.ground * full_scale(made[0].dtype)
    exemplar, place = atlas.locate(canvas.index)
    return Synthesis(
        image=made[0],
        alpha=alpha,
        maps=tuple(made[1:]),
        labels=canvas.copy_labels(),
        source=place,
        exemplar=exemplar,
        wraps=canvas.wrap,
        patch=patch,
        settings=settings,
        smooth=smooth,
        changed=changed,
        atlas=atlas,
    )


def settings_of(options: LayOptions) -> dict[str, Any]:
    """The options as numbers and texts."""
    return {name: getattr(options, name) for name in LayOptions.__dataclass_fields__ if name != "cost"}
