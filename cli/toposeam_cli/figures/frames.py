"""The densities of one iteration as a picture, and the choice of the most informative iterations."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy import ndimage

import toposeam as ts

#: Interfaces less dense than this are not drawn (thesis, Figure 3.12).
LEAST_DENSITY = 0.1
#: Colour of the seam and the heat, sRGB.
INK = (230, 30, 40)
#: Colour of the overlap behind them, sRGB.
PAPER = (243, 242, 238)

Floats32 = npt.NDArray[np.float32]


def film_frame(
    frame: ts.optimize.Frame, shared: npt.NDArray[np.bool_] | None = None, size: tuple[int, int] | None = None
) -> npt.NDArray[np.uint8]:
    """Draw one frame: each interface of pixels as a short line, the redder the denser.

    Parameters
    ----------
    frame : Frame
    shared : (h, w) bool array, optional
        The overlap within the frame's window; the rest stays white.
    size : (int, int), optional
        Height and width to fit into. A smaller picture is enlarged by a whole factor; in a larger one every
        line keeps a width of 2 px.

    Returns
    -------
    (H, W, 3) uint8 array
        Without a size (2h + 1, 2w + 1, 3): corners lie at even rows and columns, pixels at odd ones.
    """
    height, width = frame.right.shape[0], frame.right.shape[1] + 1
    strength = np.zeros((2 * height + 1, 2 * width + 1), np.float32)
    strength[1::2, 2:-1:2] = frame.right
    strength[2:-1:2, 1::2] = frame.down
    strength[strength < LEAST_DENSITY] = 0
    # A corner takes the strength of the lines that meet there.
    corners = strength[::2, ::2]
    lines_y, lines_x = strength[1::2, ::2], strength[::2, 1::2]
    corners[1:] = np.maximum(corners[1:], lines_y)
    corners[:-1] = np.maximum(corners[:-1], lines_y)
    corners[:, 1:] = np.maximum(corners[:, 1:], lines_x)
    corners[:, :-1] = np.maximum(corners[:, :-1], lines_x)
    ground = np.ones(strength.shape, np.float32)
    if shared is not None:
        ground[:] = 0
        ground[1::2, 1::2] = shared
        ground = ndimage.maximum_filter(ground, 3)
    if size is not None:
        strength, ground = _fit(strength, size, thicken=True), _fit(ground, size, thicken=False)
    paper = 255.0 + ground[..., np.newaxis] * (np.array(PAPER, np.float32) - 255.0)
    share = np.where(strength > 0, 0.2 + 0.8 * np.sqrt(np.clip(strength, 0, 1)), 0)[..., np.newaxis]
    return np.asarray(np.rint(paper + share * (np.array(INK, np.float32) - paper)), np.uint8)


def choose_frames(frames: tuple[ts.optimize.Frame, ...], count: int) -> list[ts.optimize.Frame]:
    """Choose informative frames: the last of every stage, and others that differ most from those chosen."""
    drawn = [np.concatenate([frame.right.ravel(), frame.down.ravel()]) for frame in frames]
    for values in drawn:
        values[values < LEAST_DENSITY] = 0
    if not drawn:
        return []
    amount = np.array([values.sum() for values in drawn])
    lines = np.array([np.count_nonzero(values) for values in drawn])
    visible = np.flatnonzero(lines >= 0.5 * lines[-1])
    if len(visible) <= count:
        return [frames[index] for index in visible]
    # Share of the heat that moves from each frame to the next; a common factor of all densities moves none.
    # The last term, for time, keeps frames apart that hardly differ.
    shares = [values / max(total, 1e-9) for values, total in zip(drawn, amount, strict=True)]
    steps = [0.5 * np.abs(after - before).sum() for before, after in pairwise(shares)]
    position = np.concatenate([[0.0], np.cumsum(steps)]) + 0.02 * np.arange(len(frames))
    last_of_stage = {frame.stage: index for index, frame in enumerate(frames) if index in visible}
    chosen = sorted(last_of_stage.values())[-count:]
    while len(chosen) < count:
        distance = np.abs(position[visible, np.newaxis] - position[chosen]).min(axis=1)
        chosen.append(int(visible[distance.argmax()]))
    return [frames[index] for index in sorted(chosen)]


def fitted(shape: tuple[int, int], size: tuple[int, int]) -> tuple[int, int]:
    """Return the largest shape within a size: a whole multiple of the picture's, or if that does not fit a
    smaller one of the same proportions.
    """
    scale = min(size[0] / shape[0], size[1] / shape[1])
    if scale >= 1:
        return shape[0] * int(scale), shape[1] * int(scale)
    return max(1, int(shape[0] * scale)), max(1, int(shape[1] * scale))


def _fit(values: Floats32, size: tuple[int, int], *, thicken: bool) -> Floats32:
    shape = fitted((values.shape[0], values.shape[1]), size)
    factor = shape[0] // values.shape[0]
    if factor >= 1:
        values = np.repeat(np.repeat(values, factor, axis=0), factor, axis=1)
    else:
        for axis in (0, 1):
            values = np.maximum.reduceat(
                values, np.arange(shape[axis]) * values.shape[axis] // shape[axis], axis=axis
            )
    return ndimage.maximum_filter(values, 2) if thicken and factor < 2 else values
