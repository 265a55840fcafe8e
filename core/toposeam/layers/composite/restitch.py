"""A composite made anew from its seams' paths, some of which were changed by hand."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.checks import check_items
from toposeam.errors import OptionError, PathError, Term
from toposeam.images import as_mask, full_scale
from toposeam.layers.blending.blend import Blend, Blender, Placed, check_blend
from toposeam.layers.canvas.layer import MAX_MEGAPIXELS, Extent, Layer, check_layers, common_canvas
from toposeam.layers.canvas.painting import LabelMap, channel_count, paint
from toposeam.layers.canvas.tile_map import blocks
from toposeam.layers.composite.stitch import Stitched, pair_name, stitch
from toposeam.layers.composite.two_layers import moved_seam, paths_by_pair
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
    >>> from toposeam.vector.polyline import Polyline
    >>> whole = np.random.default_rng(0).random((30, 60))
    >>> layers = [Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))]
    >>> bent = SvgSeam((Polyline([(30, 0), (30, 30)]),), 60, 30, None, ("seam",))
    >>> joined = restitch(layers, stitch(layers).masks, {(0, 1): bent})
    >>> joined.masks[0].sum(axis=1).tolist() == [30] * 30
    True
    """
    layers = check_layers(layers)
    check_blend(blend, blend_width)
    masks = check_items("masks", masks, object, "one mask per layer")
    if len(masks) != len(layers):
        raise OptionError(
            "{count} masks were given for {wanted} layers; give each layer one",
            kind="count",
            parameter=Term("masks"),
            count=len(masks),
            wanted=len(layers),
        )
    canvas = common_canvas(layers, max_megapixels=max_megapixels)
    places = [canvas.place(layer) for layer in layers]
    covered = [layer.covered for layer in layers]
    label_map: LabelMap = np.full(canvas.shape, -1, np.int16)
    for index, (place, mask) in enumerate(zip(places, masks, strict=True)):
        shown = as_mask(mask, canvas.shape, f"masks[{index}]")[place.slices]
        here = label_map[place.slices]
        here[covered[index] & (shown | (here < 0))] = index
    seams: dict[Pair, Seam] = {}
    for pair, drawing in paths_by_pair(paths, len(layers), "paths").items():
        seams[pair] = _divide(layers, canvas, label_map, pair, drawing)
    image, alpha = paint(layers, places, label_map, canvas.box, channel_count(layers))
    placed = Placed(layers=layers, places=places, covered=covered, label_map=label_map)
    blender = Blender(placed, lambda: (), "feather" if blend == "soft" else blend, blend_width)
    if blend == "gradient":
        blender.spread(image)
    for tile in blocks(canvas.box):
        blender.blend(tile, image[tile.slices], alpha[tile.slices])
    return Stitched(
        image=image,
        alpha=None if bool((alpha == full_scale(image.dtype)).all()) else alpha,
        label_map=label_map,
        _seams=tuple(seams.values()),
        pairs=tuple(seams),
        names=tuple(layer.name for layer in layers),
        rounds=0,
        origin=canvas.origin,
    )


def _divide(
    layers: Sequence[Layer], canvas: Extent, label_map: LabelMap, pair: Pair, drawing: SvgSeam
) -> Seam:
    """Divide what a pair shows along a path, in place."""
    both = []
    for index in pair:
        theirs = np.isin(label_map[canvas.place(layers[index]).slices], pair)
        allowed = theirs if len(layers) > 2 else True
        both.append(dataclasses.replace(layers[index], mask=layers[index].covered & allowed))
    part = common_canvas(both)
    shift = np.subtract(part.origin, canvas.origin).astype(float)
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
        joined = stitch(_with_kernel(both, there, part), use_path=there)
    except PathError as error:
        name = pair_name(*(layers[index].name for index in pair))
        raise (error.within("{name}: {error}", name=name) if len(layers) > 2 else error) from None
    box = canvas.place(Layer(joined.image, at=joined.origin))
    for index, mask in zip(pair, joined.masks, strict=True):
        label_map[box.slices][mask] = index
    return moved_seam(joined.seams[0], box, canvas, label_map, pair[1])


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
