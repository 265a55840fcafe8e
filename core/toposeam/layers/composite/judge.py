"""The verdict on any picture that was joined along any label map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_kind, check_whole_array
from toposeam.errors import ImageError, OptionError
from toposeam.images import as_array, full_scale
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.composite.recutting import restitch
from toposeam.seam.result.verdict import Verdict, steps_beside, worst_of


def verdict(
    image: npt.ArrayLike,
    label_map: npt.ArrayLike,
    pictures: Sequence[npt.ArrayLike] | None = None,
    *,
    data_range: float | None = None,
) -> Verdict:
    """Judge how likely the seams of a joined picture are to be seen, whoever made it.

    Parameters
    ----------
    image : (H, W) or (H, W, C) array_like
        The joined picture, blended or not.
    label_map : (H, W) int array_like
        The number of the picture that each pixel shows.
    pictures : sequence of (H, W) or (H, W, C) array_like, optional
        The pictures that were joined, numbered as in `label_map`, each on the whole canvas, with the dtype
        of `image`. Without them only steps of tone, hue and grain are judged, and an edge of the scene that
        runs along a seam counts as one.
    data_range : float, optional
        As for :func:`toposeam.find_seam`.

    Returns
    -------
    Verdict
        On the most visible seam; its places are (x, y) of the picture, px.

    Raises
    ------
    ImageError
        When sizes differ.
    OptionError
        When the label map numbers a picture that is not there.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> image = np.full((64, 96), 128, np.uint8)
    >>> image[:, 48:] += 6
    >>> str(ts.verdict(image, np.tile(np.arange(96) // 48, (64, 1))))
    'look at 47,15'
    """
    joined, labels = as_array(image, "image"), check_whole_array("label_map", label_map)
    layers = None
    if pictures is not None:
        check_kind("pictures", pictures, (list, tuple), "a list of pictures")
        layers = [Layer(as_array(one, "picture"), data_range=data_range) for one in pictures]
    if labels.shape != joined.shape[:2] or any(one.image.shape[:2] != labels.shape for one in layers or ()):
        raise ImageError(
            "the picture has {shape!s} px, and its label map or one of its pictures has not; pass all on one "
            "canvas",
            kind="shape",
            shape=joined.shape[:2],
        )
    labels = labels.astype(np.int16)
    numbers = np.unique(labels)
    if layers is None:
        white = float(full_scale(joined.dtype)) if data_range is None else data_range
        found = [
            Verdict(mean=1.0, worst=1.0, where=None).with_steps(
                steps_beside(joined, (), (), (labels == i, labels == j), white)
            )
            for k, i in enumerate(numbers)
            for j in numbers[k + 1 :]
        ]
    else:
        if numbers[0] < 0 or numbers[-1] >= len(layers):
            raise OptionError(
                "the label map numbers pictures {least} to {most}, and there are {count}, numbered from 0",
                kind="label map",
                least=int(numbers[0]),
                most=int(numbers[-1]),
                count=len(layers),
            )
        masks = [labels == index for index in range(len(layers))]
        found = list(restitch(layers, masks, {}).verdicts(window=lambda *at: joined[at]).values())
    return worst_of(found) or Verdict(mean=1.0, worst=1.0, where=None)
