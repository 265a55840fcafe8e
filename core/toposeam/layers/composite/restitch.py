"""A composite made anew from its seams' paths, some of which were changed by hand."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Labels
from toposeam.checks import check_items
from toposeam.errors import OptionError, PathError, Term
from toposeam.images import as_mask
from toposeam.layers.blending.blend import Blend
from toposeam.layers.canvas.layer import (
    MAX_MEGAPIXELS,
    Extent,
    Layer,
    check_layers,
    common_canvas,
    extent_of,
)
from toposeam.layers.canvas.tile_map import blocks, cover_of, dense
from toposeam.layers.composite.label_maps import Labelled, SeamSearch, check_alike, labelled, masked
from toposeam.layers.composite.options import StitchOptions
from toposeam.layers.composite.stitch import Stitched, pair_name, stitched
from toposeam.layers.composite.two_layers import LayersOnCanvas, moved_seam, paths_by_pair
from toposeam.layers.labelling.problem import Pair
from toposeam.seam.problem.overlap import FREE, NONE, A, B
from toposeam.seam.result.apply import labels_from_paths
from toposeam.seam.result.seam import Seam
from toposeam.vector.svg import SvgSeam


def restitch(
    layers: Sequence[Layer],
    masks: Sequence[npt.ArrayLike],
    paths: Mapping[Pair, SvgSeam],
    *,
    blend: Blend = "none",
    blend_width: float | None = None,
    max_megapixels: float = MAX_MEGAPIXELS,
) -> Stitched:
    """Apply changed paths to layers that were stitched.

    Each pair with a path divides anew what its two layers show together; all else stays as the masks say. Of
    two layers that is everything both cover.

    Parameters
    ----------
    layers : sequence of Layer
        As they were stitched.
    masks : sequence of (H, W) array_like
        Where each layer shows on the canvas, as :attr:`Stitched.masks`.
    paths : mapping of (int, int) to SvgSeam
        The changed seams by pair of layers, on the canvas, applied in this order.
    blend, blend_width
        As for :func:`toposeam.stitch`. A path has no label potential: ``soft`` feathers.
    max_megapixels : float
        Refuse a larger canvas.

    Returns
    -------
    Stitched
        Its seams are those of the pairs in `paths`.

    Raises
    ------
    PathError
        When a path does not separate its two layers; the text names them.
    OptionError, ImageError, OverlapError

    Examples
    --------
    >>> from toposeam.layers.composite.stitch import stitch
    >>> from toposeam.vector.polyline import Polyline
    >>> whole = np.random.default_rng(0).random((30, 60))
    >>> layers = [Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))]
    >>> bent = SvgSeam((Polyline([(30, 0), (30, 30)]),), 60, 30, None, ("seam",))
    >>> joined = restitch(layers, stitch(layers).masks, {(0, 1): bent})
    >>> joined.masks[0].sum(axis=1).tolist() == [30] * 30
    True
    """
    layers = check_layers(layers)
    options = StitchOptions(blend=blend, blend_width=blend_width, max_megapixels=max_megapixels)
    masks = check_items("masks", masks, object, "one mask per layer")
    if len(masks) != len(layers):
        raise OptionError(
            "{count} masks were given for {wanted} layers; give each layer one",
            kind="count",
            parameter=Term("masks"),
            count=len(masks),
            wanted=len(layers),
        )
    canvas = common_canvas(layers, max_megapixels=options.max_megapixels)
    places, covered = [canvas.place(layer) for layer in layers], list(map(cover_of, layers))
    ground = LayersOnCanvas(layers, canvas, places, covered)
    shown = [as_mask(mask, canvas.shape, f"masks[{index}]") for index, mask in enumerate(masks)]
    label_map = masked(ground, shown)
    drawings = paths_by_pair(paths, len(layers), "paths")
    seams = {pair: _divide(ground, label_map, pair, drawing) for pair, drawing in drawings.items()}
    found = Labelled(
        canvas=canvas,
        placed=ground.showing(label_map),
        seam=lambda pair, beside: seams[pair],
        pairs=list(seams),
    )
    return stitched(found.composition(layers, "feather" if blend == "soft" else blend, blend_width))


def _divide(ground: LayersOnCanvas, label_map: Labels, pair: Pair, drawing: SvgSeam) -> Seam:
    """Divide what a pair shows along a path, in place."""
    layers, canvas = ground.layers, ground.canvas
    both = []
    for index in pair:
        place, cover = ground.places[index], dense(ground.covered[index])
        theirs = np.isin(label_map[place.slices], pair) if len(layers) > 2 else True
        both.append(dataclasses.replace(layers[index], mask=cover & theirs))
    part = extent_of(both)
    shift = np.subtract(part.origin, canvas.origin)
    height, width = canvas.shape
    if (drawing.width, drawing.height) != (width, height):
        raise PathError(
            "the path belongs to a canvas of {own_width:g} × {own_height:g} px, but the "
            "layers make one of {width} × {height}; place them as when it was exported",
            kind="other canvas",
            own_width=drawing.width,
            own_height=drawing.height,
            width=width,
            height=height,
        )
    lines = tuple(dataclasses.replace(line, points=line.points - shift) for line in drawing.polylines)
    there = SvgSeam(lines, part.shape[1], part.shape[0], None, drawing.names)
    try:
        check_alike(both)
        search = SeamSearch.of(StitchOptions(), 2)
        joined = labelled(_with_kernel(both, there, part), part, search, {(0, 1): there})
    except PathError as error:
        name = pair_name(*(layers[index].name for index in pair))
        raise (error.within("{name}: {error}", name=name) if len(layers) > 2 else error) from None
    box = part.box.moved(int(shift[1]), int(shift[0]))
    for tile in blocks(box):
        labels = joined.placed.label_map[tile.within(box)]
        before = label_map[tile.slices]
        label_map[tile.slices] = np.where(labels < 0, before, np.array(pair, np.int16)[labels])
    return moved_seam(joined.seam((0, 1), False), box, canvas, label_map, pair[1])


def _with_kernel(both: Sequence[Layer], drawing: SvgSeam, canvas: Extent) -> list[Layer]:
    """Two layers, of which one that lies wholly inside the other is told to show at the innermost pixel of
    what a closed path gives it; what else of it must show, the path alone decides.
    """
    covers = []
    for layer in both:
        cover = np.zeros(canvas.shape, bool)
        cover[canvas.place(layer).slices] = layer.covered
        covers.append(cover)
    shared = covers[0] & covers[1]
    alone = [cover & ~shared for cover in covers]
    if all(ground.any() for ground in alone) or not shared.any():
        return list(both)
    side = np.select([alone[0], alone[1], shared], [A, B, FREE], NONE).astype(np.uint8)
    shows_b = labels_from_paths(drawing.polylines, shared, side)
    inner = 0 if not alone[0].any() else 1
    shown = shared & (shows_b if inner else ~shows_b)
    if not shown.any():
        return list(both)
    kernel = np.zeros(canvas.shape, bool)
    kernel.flat[int(np.argmax(scipy.ndimage.distance_transform_cdt(np.pad(shown, 1))[1:-1, 1:-1]))] = True
    kept = dataclasses.replace(both[inner], keep=kernel[canvas.place(both[inner]).slices])
    return [kept, both[1]] if inner == 0 else [both[0], kept]
