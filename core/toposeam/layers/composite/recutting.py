"""Make a composition again, along paths that were bent and round strokes that say which layer shows."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Bytes, Labels, Mask
from toposeam.checks import check_items
from toposeam.errors import OptionError, PathError, Term
from toposeam.images import as_mask
from toposeam.layers.blending.blend import Blend, blending_of
from toposeam.layers.canvas.canvas import Canvas, common_canvas
from toposeam.layers.canvas.layer import MAX_MEGAPIXELS, Layer, check_layers, cut
from toposeam.layers.composite.composition import Composition
from toposeam.layers.composite.label_maps import check_alike, find_label_map, label_map_of_masks
from toposeam.layers.composite.options import SeamSearch, StitchOptions
from toposeam.layers.composite.seams import KnownSeams
from toposeam.layers.composite.seams_of_map import SeamsOfMap
from toposeam.layers.composite.summary import pair_name
from toposeam.layers.composite.two_layers import paths_by_pair
from toposeam.layers.labelling.label_map import Pair, as_labels
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.overlap import FREE, NONE, A, B
from toposeam.seam.result.apply import labels_from_paths
from toposeam.vector.svg import SvgSeam


def restitch(
    layers: Sequence[Layer],
    masks: Sequence[npt.ArrayLike],
    paths: Mapping[Pair, SvgSeam],
    *,
    fixed: npt.ArrayLike | None = None,
    cut_out: bool = False,
    cost: MatchCost | None = None,
    blend: Blend = "none",
    blend_width: float | None = None,
    max_megapixels: float = MAX_MEGAPIXELS,
) -> Composition:
    """Apply changed paths and strokes to layers that were stitched before.

    Each path divides the pixels that its two layers show, or, if there are only two layers, all pixels that
    both cover. Then, if strokes ask for layers that do not show there yet, a window round those pixels is
    searched again. All other pixels show what the masks say.

    Parameters
    ----------
    layers : sequence of Layer
        The layers as they were stitched.
    masks : sequence of (H, W) array_like
        One mask per layer on the canvas, True where it shows, as :attr:`Composition.masks`.
    paths : mapping of (int, int) to SvgSeam
        The changed seams by pair of layers, on the canvas, applied in this order.
    fixed : (H, W) int array, optional
        The number of the layer that must show, -1 where any may; ignored where that layer has no pixels.
    cut_out : bool
        Whether the layers are cut out of larger ones, which reach beyond each other. So what lies inside
        another layer here need not show.
    cost : MatchCost, optional
        As for :func:`toposeam.stitch`.
    blend, blend_width
        As for :func:`toposeam.stitch`. A path has no label potential: ``soft`` feathers.
    max_megapixels : float
        Refuse a larger canvas.

    Returns
    -------
    Composition

    Raises
    ------
    PathError
        When a path does not separate its two layers; the text names them.
    OptionError, ImageError, OverlapError

    Examples
    --------
    >>> from toposeam.layers.composite.stitching import stitch
    >>> from toposeam.vector.polyline import Polyline
    >>> whole = np.random.default_rng(0).random((30, 60))
    >>> layers = [Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))]
    >>> bent = SvgSeam((Polyline([(30, 0), (30, 30)]),), 60, 30, None, ("seam",))
    >>> joined = restitch(layers, stitch(layers).masks, {(0, 1): bent})
    >>> joined.masks[0].sum(axis=1).tolist() == [30] * 30
    True
    """
    layers = check_layers(layers)
    options = StitchOptions(cost=cost, blend=blend, blend_width=blend_width, max_megapixels=max_megapixels)
    masks = check_items("masks", masks, object, "one mask per layer")
    if len(masks) != len(layers):
        raise OptionError(
            "{count} masks were given for {wanted} layers; give each layer one",
            kind="count",
            parameter=Term("masks"),
            count=len(masks),
            wanted=len(layers),
        )
    check_alike(layers)
    canvas = common_canvas(layers, max_megapixels=options.max_megapixels)
    shown = [as_mask(mask, canvas.shape, f"masks[{index}]") for index, mask in enumerate(masks)]
    drawings = paths_by_pair(paths, len(layers), "paths")
    search = SeamSearch.of(options, len(layers))
    seams: KnownSeams | SeamsOfMap
    if len(layers) == 2 and drawings:
        found, seams = find_label_map(_with_kept_pixel(canvas, drawings[0, 1]), search, drawings)
    else:
        found = label_map_of_masks(canvas, shown)
        for pair, drawing in drawings.items():
            _divide(canvas, found.labels, pair, drawing)
        seams = SeamsOfMap(search.pose(canvas, cut_out=cut_out), found, tuple(drawings), search.recorded())
    if fixed is not None:
        wanted = _where_possible(canvas, as_labels(fixed, canvas.shape, "fixed"))
        again = search.recut(seams.labelling, found, fixed=wanted)
        if again is not found:
            found = again
            seams = SeamsOfMap(seams.labelling, found, tuple(drawings), search.recorded())
    blending = options.blending
    if blending.needs_potential:
        blending = blending_of(blending.without_potential, blend_width)
    return Composition(canvas=canvas, solution=found, blending=blending, _seams=seams)


def _where_possible(canvas: Canvas, wanted: Labels) -> Labels:
    """Return the (H, W) map of layers that strokes ask for, -1 where such a layer has no pixels."""
    result = np.full(canvas.shape, -1, np.int16)
    for index, (place, cover) in enumerate(zip(canvas.places, canvas.covers, strict=True)):
        here = result[place.slices]
        here[(wanted[place.slices] == index) & cover[:, :]] = index
    return result


def _divide(canvas: Canvas, labels: Labels, pair: Pair, drawing: SvgSeam) -> None:
    """Divide the pixels that a pair of layers shows along a path, in place."""
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
    box = canvas.places[pair[0]].around(canvas.places[pair[1]]).shared(canvas.box)
    shown = labels[box.slices]
    covers = [cut(canvas.covers[k], canvas.places[k], box) & np.isin(shown, pair) for k in pair]
    shared, side = _overlap_sides(*covers)
    if not shared.any():
        return
    shift = np.array([box.left, box.top], float)
    lines = [dataclasses.replace(line, points=line.points - shift) for line in drawing.polylines]
    try:
        second_shows = labels_from_paths(lines, shared, side)
    except PathError as error:
        name = pair_name(*(canvas.layers[index].name for index in pair))
        raise error.within("{name}: {error}", name=name) from None
    one, other = np.int16(pair[0]), np.int16(pair[1])
    labels[box.slices] = np.where(shared, np.where(second_shows, other, one), shown)


def _overlap_sides(first: Mask, second: Mask) -> tuple[Mask, Bytes]:
    """Return the (H, W) bool mask where both layers have pixels, and the (H, W) uint8 sides of a seam
    problem.
    """
    shared = first & second
    return shared, np.select([shared, first, second], [FREE, A, B], NONE).astype(np.uint8)


def _with_kept_pixel(canvas: Canvas, drawing: SvgSeam) -> Canvas:
    """Keep the innermost pixel that a closed path gives to a layer that lies wholly inside the other one.

    Without such a kept pixel the inner layer would have to show its core; so the path alone decides what it
    shows.
    """
    covers = [
        cut(cover, place, canvas.box) for cover, place in zip(canvas.covers, canvas.places, strict=True)
    ]
    shared, side = _overlap_sides(*covers)
    alone = [bool((side == A).any()), bool((side == B).any())]
    if all(alone) or not shared.any() or (drawing.width, drawing.height) != canvas.shape[::-1]:
        return canvas
    inner = 1 if alone[0] else 0
    second_shows = labels_from_paths(drawing.polylines, shared, side)
    shown = shared & (second_shows if inner else ~second_shows)
    if not shown.any():
        return canvas
    depth = scipy.ndimage.distance_transform_cdt(np.pad(shown, 1))[1:-1, 1:-1]
    kernel = np.zeros(canvas.shape, bool)
    kernel.flat[int(np.argmax(depth))] = True
    layers = list(canvas.layers)
    layers[inner] = dataclasses.replace(layers[inner], keep=kernel[canvas.places[inner].slices])
    return Canvas(layers=layers, origin=canvas.origin, shape=canvas.shape)
