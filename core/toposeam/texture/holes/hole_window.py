"""A picture part of which has to go: read, checked, and laid on a canvas that shows the rest of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Mask
from toposeam.errors import ImageError, Term
from toposeam.images import as_array, as_mask
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.sources import Sources
from toposeam.texture.periodicity.phase import Phase
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.placement.request import TextureRequest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Holed:
    """A picture part of which has to go."""

    sources: Sources
    #: (H, W) bool: what has to go, and the pixels there are.
    hole: Mask
    ground: Mask

    def canvas(self, request: TextureRequest) -> tuple[Atlas, IndexCanvas]:
        """Make a canvas that shows the picture itself, but for the hole."""
        left, ground = self.ground & ~self.hole, None if self.ground.all() else self.ground
        atlas = Atlas.of([left], request.options.context, self.sources.usable)
        shape = left.shape[0], left.shape[1]
        canvas = IndexCanvas(shape, request.wraps, atlas.usable.size, ground)
        rows, columns = (np.arange(side.start, side.stop, dtype=np.int32) for side in atlas.places[0])
        itself = rows[:, np.newaxis] * np.int32(atlas.width) + columns
        np.copyto(itself, np.int32(-1), where=~left)
        canvas.begin(itself)
        return atlas, canvas

    def placer(
        self, request: TextureRequest, atlas: Atlas, canvas: IndexCanvas, phase: Phase | None = None
    ) -> PatchPlacer:
        """Make the placer that lays patches on such a canvas."""
        features, pixels = atlas.spread(self.sources.features), int(self.hole.sum())
        return PatchPlacer(atlas, features, canvas, request.options, request.rng, pixels, phase=phase)


def read_holed(
    request: TextureRequest,
    image: npt.ArrayLike,
    hole: npt.ArrayLike,
    source: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    *,
    empty: bool = False,
    features: bool = True,
) -> Holed:
    """Read a picture and what has to go.

    Parameters
    ----------
    request : TextureRequest
    image, hole, source, avoid : array_like
        As for :func:`toposeam.fill`.
    empty : bool
        Whether nothing may have to go.
    features : bool
        Whether the sources hold all their features.

    Raises
    ------
    ImageError
    """
    array = as_array(image)
    shape = (array.shape[0], array.shape[1])
    gone = as_mask(hole, shape, "mask")
    ground = np.ones(shape, bool) if request.alpha is None else as_array(request.alpha, "alpha") > 0
    if ground.shape == shape:
        gone = gone & ground
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
    return Holed(sources=request.read(array, copied, "image", features=features), hole=gone, ground=ground)
