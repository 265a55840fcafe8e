"""A guide: what a texture should look like, and what its exemplars stand for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_number
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import as_array, as_float
from toposeam.texture.canvas.places import Guide
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.sources import Images, Sources, as_list
from toposeam.texture.exemplar.turns import Turns, count_of, turned

#: Largest share of a guide's variance within patches that are chosen for it, and their least side, px.
_MOST_WITHIN, _LEAST_PATCH = 0.1, 12


def guide_of(
    guide: npt.ArrayLike | None,
    guide_source: Images | None,
    weight: float,
    atlas: Atlas,
    sources: Sources,
    size: tuple[int, int],
    turns: Turns,
) -> Guide | None:
    """Check a caller's guide; arguments as of :func:`toposeam.synth`, `sources` and the atlas in all
    positions.

    Raises
    ------
    ImageError, OptionError
    """
    if guide is None and guide_source is None:
        return None
    if guide is None or guide_source is None:
        raise OptionError(
            "{guide} and {guide_source} belong together: what is wanted, and what the "
            "source's pixels stand for; give both",
            kind="conflict",
        )
    check_number("guide_weight", weight, 0, 1)
    target = _terms(guide, "guide")
    if target.shape[:2] != size:
        raise ImageError(
            "{array} is {width} × {height} px, but the texture {other_width} × {other_height}"
            " px; make them one size",
            kind="other size",
            array=Term("guide"),
            width=target.shape[1],
            height=target.shape[0],
            other_width=size[1],
            other_height=size[0],
        )
    stands: list[npt.NDArray[np.float32]] = []
    each = count_of(turns)
    shapes = sources.shapes[::each]
    for image, (height, width) in zip(
        as_list(guide_source, len(shapes), "guide_source"), shapes, strict=True
    ):
        values = _terms(image, "guide_source")
        if values.shape[:2] != (height, width):
            raise ImageError(
                "{array} is {width} × {height} px, but its source {other_width} × {other_height} "
                "px; make them one size",
                kind="other size",
                array=Term("guide_source"),
                width=values.shape[1],
                height=values.shape[0],
                other_width=width,
                other_height=height,
            )
        if values.shape[2] != target.shape[2]:
            raise ImageError(
                "{guide} has {channels} channels and {guide_source} {other_channels}; convert "
                "both to gray, or both to RGB",
                kind="channels",
                channels=target.shape[2],
                other_channels=values.shape[2],
            )
        stands.append(values)
    plane = atlas.spread(turned(stands, turns))
    plane[~atlas.usable] = 0
    return Guide(source=plane, target=target, weight=weight)


def patches_within(guide: Guide, patch: int) -> list[int]:
    """Find the sides, px, of patches that follow a drawing, largest first: large ones are laid where they
    follow it, and the last, within which it hardly changes in the mean, wherever these leave room.
    """
    least = patch
    while least > _LEAST_PATCH and _within(guide.target, least) > _MOST_WITHIN * guide.variance:
        least = max(_LEAST_PATCH, round(0.8 * least))
    sides = [patch]
    while sides[-1] > least:
        sides.append(max(sides[-1] // 2, least))
    return sides


def _within(target: npt.NDArray[np.float32], side: int) -> float:
    """Compute the variance within squares, in the mean."""
    side = min(side, *target.shape[:2])
    rows, columns = (length // side for length in target.shape[:2])
    squares = target[: rows * side, : columns * side].reshape(rows, side, columns, side, -1)
    return float(squares.var(axis=(1, 3)).sum(axis=2).mean())


def _terms(image: npt.ArrayLike, name: str) -> npt.NDArray[np.float32]:
    """Read a guide as floats; what counts as white does not matter, as long as both agree."""
    array = as_array(image, name)
    return as_float(array, name, 1.0 if np.issubdtype(array.dtype, np.floating) else None)
