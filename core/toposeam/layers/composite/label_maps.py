"""Find the label map of a canvas: by one seam for two layers, by rounds of expansions for more, or from
masks.

Two layers are left to the engines of :mod:`toposeam.seam`, the best of which find the optimal seam.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Labels
from toposeam.errors import ImageError, Term
from toposeam.images import as_mask
from toposeam.layers.canvas.canvas import Canvas, channel_count
from toposeam.layers.canvas.layer import Layer, cut
from toposeam.layers.canvas.tile_map import blocks, new_map
from toposeam.layers.composite.options import SeamSearch
from toposeam.layers.composite.seams import KnownSeams
from toposeam.layers.composite.two_layers import join
from toposeam.layers.labelling.label_map import LabelMap, Pair
from toposeam.seam.problem.posing import as_weights

if TYPE_CHECKING:
    from toposeam.layers.composite.seams_of_map import SeamsOfMap
    from toposeam.vector.svg import SvgSeam


def check_alike(layers: Sequence[Layer]) -> None:
    """Refuse layers that differ in dtype, white level or number of channels.

    Raises
    ------
    ImageError
    """
    dtypes = {layer.image.dtype for layer in layers}
    if len(dtypes) > 1:
        raise ImageError(
            "the layers have dtypes {dtypes}; convert them to one",
            kind="dtype",
            dtypes=tuple(sorted(map(str, dtypes))),
        )
    if len({layer.data_range for layer in layers}) > 1:
        raise ImageError(
            "the layers have different values of {parameter}; give them the same white",
            kind="white",
            parameter=Term("data_range"),
        )
    channel_count(layers)


def find_label_map(
    canvas: Canvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam]
) -> tuple[LabelMap, KnownSeams | SeamsOfMap]:
    """Find the label map of a canvas and its seams; `paths` are seams that are given.

    Raises
    ------
    OverlapError
        When a layer shares no pixel with the others.
    ImageError, OptionError, PathError
    """
    options = search.options
    # A kept stroke is an island, round which several seams may run.
    two = len(canvas.layers) == 2 and not options.strokes and options.preview is None
    if canvas.period is not None:
        from toposeam.layers.composite.many_layers import by_cutting_open

        return by_cutting_open(canvas, search, paths)
    maps = {
        "weight": None if options.weight is None else as_weights(options.weight, canvas.shape),
        "avoid": None if options.avoid is None else as_mask(options.avoid, canvas.shape, "avoid"),
    }
    if two:
        return _by_one_seam(canvas, search, paths, maps)
    from toposeam.layers.composite.many_layers import by_rounds

    return by_rounds(canvas, search, paths, maps)


def _by_one_seam(
    canvas: Canvas, search: SeamSearch, paths: Mapping[Pair, SvgSeam], maps: Mapping[str, Any]
) -> tuple[LabelMap, KnownSeams]:
    pair, options = (0, 1), search.options
    settings = {
        "method": search.method,
        "record_frames": options.record_frames,
        "progress": options.progress,
        **search.settings,
    }
    seam, labels = join(canvas, {**search.common(canvas), **maps}, settings, paths.get(pair))
    found = LabelMap(labels=labels, method=seam.method, seconds=seam.seconds)
    return found, KnownSeams({pair: seam}, partial(search.pose, canvas, **maps))


def label_map_of_masks(canvas: Canvas, masks: Sequence[npt.ArrayLike] | None) -> LabelMap:
    """Compute the label map of given masks, of which later ones win.

    `masks` are on the canvas; None stands for masks that are True everywhere. A pixel that no mask claims
    shows the first layer that has pixels there.
    """
    flat = canvas.cut_open()
    labels: Labels = new_map(flat.shape, -1, np.int16)
    for box in blocks(flat.box):
        shows = np.full(box.shape, -1, np.int16)
        for index, (place, cover) in enumerate(zip(flat.places, flat.covers, strict=True)):
            here = cut(cover, place, box)
            wanted = True if masks is None else np.asarray(masks[index])[box.slices] != 0
            shows[here & (wanted | (shows < 0))] = index
        labels[box.slices] = shows
    return LabelMap(labels=labels, method="masks")
