"""From two files and where they lie to two layers on one canvas."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam_cli.parameters import Length
from toposeam_cli.picture import Picture, match_pictures, read_picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two pictures of one depth and colour space, placed."""

    pictures: tuple[Picture, Picture]
    layers: tuple[ts.Layer, ts.Layer]
    #: (H, W) bool on the canvas: where the seam must not run; None without a mask.
    avoid: npt.NDArray[np.bool_] | None

    @property
    def canvas(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Origin (x, y) and shape (H, W) of the canvas."""
        canvas = ts.common_canvas(self.layers, ts.MAX_PIXELS)
        return canvas.origin, canvas.shape


def read_pair(
    first: Path, second: Path, *, offset: tuple[int, int] | None, overlap: Length | None, side: str, avoid: Path | None,
    max_megapixels: float,
) -> Pair:  # fmt: skip
    """Read two pictures and place them.

    Raises
    ------
    OptionError
        When the placement is missing or given twice.
    ImageError
        When a file cannot be used.
    OverlapError
        When the pictures share no pixel.
    """
    if (offset is None) == (overlap is None):
        raise ts.OptionError("say where B lies: either --offset X,Y or --overlap N[%] with --side")
    limit = round(max_megapixels * 1e6)
    a, b = match_pictures([read_picture(first, max_pixels=limit), read_picture(second, max_pixels=limit)])
    x, y = offset if offset is not None else _shifted(a, b, overlap, side)
    layers = (
        ts.Layer(image=a.pixels, alpha=a.alpha, name=first.name),
        ts.Layer(image=b.pixels, alpha=b.alpha, offset=(x, y), name=second.name),
    )
    height, width = a.pixels.shape[:2]
    bottom, right = y + b.pixels.shape[0], x + b.pixels.shape[1]
    if x >= width or y >= height or right <= 0 or bottom <= 0:
        raise ts.OverlapError(
            f"{second.name} at {x},{y} lies beside {first.name}, which is {width} × {height} px; choose an offset at which they overlap"
        )
    pair = Pair(pictures=(a, b), layers=layers, avoid=None)
    if avoid is None:
        return pair
    return Pair(pictures=(a, b), layers=layers, avoid=_read_mask(avoid, pair.canvas[1], limit))


def _shifted(a: Picture, b: Picture, overlap: Length | None, side: str) -> tuple[int, int]:
    """The offset at which B overlaps A by a length at one side of A; the pictures are aligned at the top or left."""
    if overlap is None:
        raise ts.OptionError("--overlap is missing")
    across = 1 if side in ("right", "left") else 0
    whole, other = a.pixels.shape[across], b.pixels.shape[across]
    length = overlap.pixels(whole)
    if not 0 < length <= min(whole, other):
        raise ts.OptionError(
            f"--overlap comes to {length} px, but across that side A has {whole} px and B {other} px; choose 1 to {min(whole, other)} px"
        )
    shift = whole - length if side in ("right", "bottom") else length - other
    return (shift, 0) if across else (0, shift)


def _read_mask(path: Path, shape: tuple[int, int], limit: int) -> npt.NDArray[np.bool_]:
    """True where a mask picture is at least half white (and not transparent)."""
    mask = read_picture(path, max_pixels=limit)
    if mask.pixels.shape[:2] != shape:
        height, width = mask.pixels.shape[:2]
        raise ts.ImageError(f"the mask {path.name} is {width} × {height} px, but the canvas {shape[1]} × {shape[0]} px; make it that size")
    pixels = mask.pixels if mask.pixels.ndim == 2 else mask.pixels.mean(axis=2)
    top = np.iinfo(mask.pixels.dtype).max if np.issubdtype(mask.pixels.dtype, np.integer) else 1.0
    white: npt.NDArray[np.bool_] = pixels >= top / 2
    return white if mask.alpha is None else white & (mask.alpha > 0)
