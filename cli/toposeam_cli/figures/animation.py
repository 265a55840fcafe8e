"""The densities over the iterations of a search as an animated picture."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt
from PIL import Image

import toposeam as ts
from toposeam_cli.figures.frames import PAPER, film_frame

#: The two sides, sRGB.
_A, _B = (214, 231, 245), (255, 236, 205)
#: Length of the longer side, px.
_SIZE = 720
#: Aimed duration of the whole search, bounds of a frame's, and duration of the last frame, ms.
_WHOLE_MS, _FRAME_MS, _HELD_MS = 4000, (60, 400), 2000


def animate(seam: ts.seam.Seam, suffix: str) -> bytes:
    """Draw the densities of a seam found with ``record_frames=True``, one frame an iteration, in an endless
    loop.

    Parameters
    ----------
    seam : Seam
    suffix : {".gif", ".webp"}

    Returns
    -------
    bytes
        The file's content, the same for the same seam.

    Raises
    ------
    OptionError
        When no frames were recorded.
    """
    if not seam.frames:
        raise ts.OptionError("the seam has no frames; find it with record_frames=True")
    height, width = seam.frames[0].down.shape[0] + 1, seam.frames[0].right.shape[1] + 1
    scale = _SIZE / max(height, width)
    size = max(1, round(height * scale)), max(1, round(width * scale))
    pictures = [film_frame(frame, size=size) for frame in seam.frames]
    pictures.append(_with_sides(pictures[-1], seam))
    each = round(np.clip(_WHOLE_MS / len(seam.frames), *_FRAME_MS))
    durations = [each] * len(seam.frames) + [_HELD_MS]
    first, *rest = [Image.fromarray(picture) for picture in pictures]
    buffer = io.BytesIO()
    options = {"lossless": True} if suffix == ".webp" else {"optimize": False, "disposal": 1}
    first.save(buffer, suffix[1:], save_all=True, append_images=rest, duration=durations, loop=0, **options)
    return buffer.getvalue()


def _with_sides(picture: npt.NDArray[np.uint8], seam: ts.seam.Seam) -> npt.NDArray[np.uint8]:
    """Return the last frame with the two sides of the seam tinted."""
    top, left = seam.problem.overlap.start
    height, width = seam.problem.overlap.side.shape
    rows = top + np.linspace(0, height - 1, picture.shape[0]).round().astype(int)
    columns = left + np.linspace(0, width - 1, picture.shape[1]).round().astype(int)
    labels = np.pad(seam.labels, 1, mode="edge")[np.ix_(rows + 1, columns + 1)]
    ground = (picture == PAPER).all(axis=2)
    tinted = picture.copy()
    tinted[ground & labels], tinted[ground & ~labels] = _B, _A
    return tinted
