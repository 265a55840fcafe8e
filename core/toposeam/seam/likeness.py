"""How like an uncut picture the surroundings of a seam are: what a person looks for, beside what the seam
costs.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy
from skimage.metrics import structural_similarity

from toposeam.checks import check_kind, check_whole
from toposeam.errors import OptionError
from toposeam.images import as_float, widen
from toposeam.seam.seam import Seam

#: Side of the windows that are compared, px.
_WINDOW = 7


def seam_likeness(
    seam: Seam, a: npt.ArrayLike, b: npt.ArrayLike, *, reach: int = 4, data_range: float | None = None
) -> float:
    """The structural similarity, along a seam, between the joined picture and whichever patch it is more
    like.

    A window that the seam does not show in looks like one of the two patches did. Where it looks like
    neither, the structure is broken.

    Parameters
    ----------
    seam : Seam
    a, b : (H, W) or (H, W, C) array_like
        The patches on the seam's canvas.
    reach : int
        Pixels to both sides of the seam that are looked at, px.
    data_range : float, optional
        As for :func:`toposeam.find_seam`.

    Returns
    -------
    float
        In [-1, 1]; 1 where no window differs from both. NaN without a seam, or where the overlap is narrower
        than a window (7 px).

    Raises
    ------
    OptionError, ImageError

    References
    ----------
    Wang, Bovik, Sheikh and Simoncelli, "Image quality assessment: from error visibility to structural
    similarity", IEEE Transactions on Image Processing 13(4), 2004, doi:10.1109/TIP.2003.819861.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a = np.random.default_rng(0).random((20, 16))
    >>> ts.seam_likeness(ts.find_seam(a, a), a, a)
    1.0
    """
    check_whole("reach", reach, 1)
    check_kind("seam", seam, Seam, "a Seam")
    first, second = widen(as_float(a, "a", data_range), as_float(b, "b", data_range))
    if not first.shape == second.shape == (*seam.labels.shape, first.shape[2]):
        raise OptionError(
            f"a has shape {first.shape[:2]}, b {second.shape[:2]} and the seam's canvas {seam.labels.shape}; "
            "pass the pictures it was found in"
        )
    top, left = seam.problem.overlap.start
    height, width = seam.problem.overlap.side.shape
    box = np.s_[max(top, 0) : top + height, max(left, 0) : left + width]
    first, second, labels = first[box], second[box], seam.labels[box]
    if min(labels.shape) < _WINDOW:
        return float("nan")
    edge = scipy.ndimage.morphological_gradient(labels.astype(np.uint8), footprint=np.ones((2, 2))) > 0
    rows, columns = (slice(max(top, 0) - top, None), slice(max(left, 0) - left, None))
    shared = seam.problem.overlap.shared[rows, columns][: labels.shape[0], : labels.shape[1]]
    looked_at = scipy.ndimage.binary_dilation(edge, iterations=reach) & shared
    if not looked_at.any():
        return float("nan")
    joined = np.where(labels[..., np.newaxis], second, first)
    most = np.maximum(*(_similarity(joined, patch) for patch in (first, second)))
    return float(most[looked_at].mean())


def _similarity(joined: npt.NDArray[np.float32], patch: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """(h, w) similarity of the windows round each pixel, the mean over the channels."""
    _, full = structural_similarity(
        joined, patch, win_size=_WINDOW, data_range=1.0, channel_axis=2, full=True
    )
    mean: npt.NDArray[np.float32] = full.mean(axis=2)
    return mean
