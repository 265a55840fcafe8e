"""Patches laid row by row over a whole canvas."""

from __future__ import annotations

import math
from collections.abc import Callable

from toposeam.errors import OptionError, Term
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.scheduling.process_pool import Crew
from toposeam.texture.scheduling.wavefronts import Laying, LayingGuided, lay_wave, waves_of

#: Least side of a texture that repeats, px.
SMALLEST_TILE = 16


def lay_all(
    placer: PatchPlacer,
    patch: int,
    overlap: int,
    crew: Crew,
    progress: Callable[[float], None] | None = None,
    *,
    guided: bool = False,
) -> tuple[int, int]:
    """Fill the canvas.

    Parameters
    ----------
    placer : PatchPlacer
    patch, overlap : int
        Side of the patches and least overlap, px.
    crew : Crew
        The processes that lay them; its tool is the placer.
    progress : callable, optional
        Called with the share of the patches laid.
    guided : bool
        Whether they are laid only where they follow the guide.

    Returns
    -------
    (int, int)
        Height and width of the patches: the texture's own where it is smaller than they.
    """
    canvas = placer.canvas
    rows, columns = _patches(canvas, patch, overlap)
    shape = rows[0], columns[0]
    round_length = canvas.shape[1] if canvas.wrap[1] else None
    waves = waves_of(rows[1], columns[1], shape[1] + placer.reach(shape), round_length)
    done, count = 0, len(rows[1]) * len(columns[1])
    for wave in waves:
        lay_wave(placer, crew, LayingGuided if guided else Laying, wave, shape)
        done += len(wave)
        if progress is not None:
            progress(done / count)
    return shape


def patches_on(canvas: IndexCanvas, patch: int, overlap: int) -> int:
    """Count the patches that :func:`lay_all` lays."""
    return math.prod(len(starts) for _, starts in _patches(canvas, patch, overlap))


def shape_on(canvas: IndexCanvas, patch: int, overlap: int) -> tuple[int, int]:
    """Compute the height and width of these patches."""
    rows, columns = _patches(canvas, patch, overlap)
    return rows[0], columns[0]


def _patches(canvas: IndexCanvas, patch: int, overlap: int) -> list[tuple[int, list[int]]]:
    """Divide both axes of a canvas into patches."""
    return [
        patches_along(length, patch, overlap, wraps)
        for length, wraps in zip(canvas.shape, canvas.wrap, strict=True)
    ]


def patches_along(length: int, patch: int, overlap: int, wraps: bool) -> tuple[int, list[int]]:
    """Divide an axis into patches: their side, and where each begins, spread evenly, so that all overlap by
    at least the overlap.

    Raises
    ------
    OptionError
        When a texture that repeats is too small for two patches.
    """
    if not wraps:
        if length <= patch:
            return length, [0]
        count = 1 + math.ceil((length - patch) / (patch - overlap))
        return patch, [round(k * (length - patch) / (count - 1)) for k in range(count)]
    if length < SMALLEST_TILE:
        raise OptionError(
            "a side of the texture is {value} px; a texture that repeats needs at least {least} px",
            kind="small texture",
            parameter=Term("size"),
            value=length,
            least=SMALLEST_TILE,
        )
    if length <= patch:
        patch = max(2 * length // 3, length // 2 + 2)
        overlap = patch - length // 2
    count = max(2, math.ceil(length / (patch - overlap)))
    return patch, [round(k * length / count) for k in range(count)]
