"""A picture part of which has to go: read, checked, and laid on a canvas that shows the rest of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, Term
from toposeam.images import Mask, as_array, as_mask
from toposeam.texture.atlas import Atlas
from toposeam.texture.canvas import IndexCanvas
from toposeam.texture.lay import PatchPlacer
from toposeam.texture.lay_options import LayOptions
from toposeam.texture.sources import DataRange, Images, Sources, read_sources


def read_holed(
    image: npt.ArrayLike,
    hole: npt.ArrayLike,
    alpha: npt.ArrayLike | None,
    from_where: tuple[npt.ArrayLike | None, npt.ArrayLike | None],
    maps: Sequence[Images],
    weights: Sequence[float] | None,
    data_range: DataRange,
    *,
    empty: bool = False,
) -> tuple[Sources, Mask, Mask]:
    """The picture as a source, what has to go, and the pixels there are; `empty` where nothing has to go."""
    array = as_array(image)
    shape = (array.shape[0], array.shape[1])
    gone = as_mask(hole, shape, "mask")
    ground = np.ones(shape, bool) if alpha is None else as_array(alpha, "alpha") > 0
    if ground.shape == shape:
        gone = gone & ground
    source, avoid = from_where
    copied = ~gone
    if source is not None:
        copied = copied & as_mask(source, shape, "source")
    if avoid is not None:
        copied = copied & ~as_mask(avoid, shape, "avoid")
    if not gone.any() and not empty:
        raise ImageError(
            "{mask} is empty, or the picture transparent there, so there is nothing to "
            "replace; paint what has to go white",
            kind="nothing to replace",
            mask=Term("mask", "the mask"),
        )
    if (source is not None or avoid is not None) and not copied.any() and not gone.all():
        remedy = "more of what may" if source is not None else "less of what must not"
        raise ImageError(
            "nothing is left to copy from: outside {mask} nothing is allowed; paint {remedy} be copied white",
            kind="nothing to copy",
            mask=Term("mask", "the mask"),
            remedy=remedy,
        )
    if not copied.any():
        raise ImageError(
            "nothing is left to copy from: {mask} covers the whole picture; paint only what has to go white",
            kind="all to replace",
            mask=Term("mask", "the mask"),
        )
    if np.issubdtype(array.dtype, np.floating):  # whatever the hole holds
        array = np.where(gone[..., np.newaxis] if array.ndim == 3 else gone, 0, array).astype(array.dtype)
    sources = read_sources(
        array, alpha=alpha, mask=copied, maps=maps, weights=weights, data_range=data_range, name="image"
    )
    return sources, gone, ground


def canvas_over(
    sources: Sources, hole: Mask, ground: Mask, wraps: tuple[bool, bool], context: int
) -> tuple[Atlas, IndexCanvas]:
    """A canvas that shows the picture itself, but for the hole."""
    left = ground & ~hole
    atlas = Atlas.of([left], context, sources.usable)
    canvas = IndexCanvas(
        (hole.shape[0], hole.shape[1]), wraps, atlas.usable.size, None if ground.all() else ground
    )
    rows, columns = (np.arange(side.start, side.stop, dtype=np.int32) for side in atlas.places[0])
    itself = rows[:, np.newaxis] * np.int32(atlas.width) + columns
    np.copyto(itself, np.int32(-1), where=~left)
    canvas.begin(itself)
    return atlas, canvas


def placer_over(
    sources: Sources, hole: Mask, ground: Mask, wraps: tuple[bool, bool], options: LayOptions, seed: int
) -> PatchPlacer:
    """What lays patches on such a canvas."""
    atlas, canvas = canvas_over(sources, hole, ground, wraps, options.context)
    rng = np.random.default_rng(seed)
    return PatchPlacer(atlas, atlas.spread(sources.features), canvas, options, rng, int(hole.sum()))
