"""From a canvas to what the caller gets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.images import full_scale
from toposeam.texture.atlas import Atlas
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.lay_options import LayOptions
from toposeam.texture.rendering import Lift, render, render_seen
from toposeam.texture.search import box_of
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
    lift: Callable[[int], Lift] | None = None,
) -> Synthesis:
    """Every map, made of what the canvas shows; the first one, the picture, may be given light, channel by
    channel.
    """
    made: list[npt.NDArray[Any]] = []
    box = (slice(None), slice(None)) if changed is None or any(canvas.wrap) else box_of(changed, smooth + 1)
    index = canvas.index[box]
    for images, gray in zip(sources.planes, sources.gray, strict=True):
        plane = atlas.spread(images)
        if sources.transparent and sources.has_alpha and len(made) + 1 < len(sources.planes):
            opacity = atlas.spread(sources.planes[-1])
            picture = render_seen(index, plane, opacity, atlas.usable, canvas.wrap, smooth)
        elif lift is None or made:
            picture = render(index, plane, atlas.usable, canvas.wrap, smooth)
        else:
            picture = np.empty((*index.shape, plane.shape[2]), plane.dtype)
            for channel in range(plane.shape[2]):
                one = np.s_[..., channel : channel + 1]
                picture[one] = render(index, plane[one], atlas.usable, canvas.wrap, smooth, lift(channel))
        if changed is not None:
            whole = images[0].copy()
            np.copyto(whole[box], picture, where=changed[box][..., np.newaxis])
            picture = whole
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
