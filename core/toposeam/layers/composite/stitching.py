"""Stitch layers into one picture with its seams."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Collection, Sequence
from typing import Any

import numpy.typing as npt

from toposeam.images import Windows, full_scale
from toposeam.layers.blending.blend import Blend, blending_of
from toposeam.layers.canvas.canvas import Canvas, common_canvas
from toposeam.layers.canvas.largest_rectangle import largest_full
from toposeam.layers.canvas.layer import Layer, as_layers, check_layers
from toposeam.layers.canvas.transforms import is_move
from toposeam.layers.composite.composition import Composition
from toposeam.layers.composite.label_maps import check_alike, find_label_map, label_map_of_masks
from toposeam.layers.composite.options import SeamSearch, StitchOptions, with_signature
from toposeam.layers.composite.seams import KnownSeams
from toposeam.layers.composite.two_layers import paths_by_pair


@with_signature
def stitch(layers: Sequence[Layer] | Sequence[npt.NDArray[Any]], **keywords: Any) -> Composition:
    """Join placed layers.

    Two layers are joined along one seam. More are stacked in several orders of their places; from each of
    these starts, expansion moves let one layer after another show at more pixels until the total cost no
    longer falls, and the cheapest parts of the results are combined
    (:mod:`toposeam.layers.search.local_search`). The labelling problem and its cost are defined in
    :mod:`toposeam.layers.labelling.problem`.

    Parameters
    ----------
    layers : sequence of Layer, or list of (H, W) or (H, W, C) arrays
        At least two, of one dtype; gray layers are widened to the others' channels. Their images may be
        :class:`toposeam.Windows`: the picture is computed when it is read, whole or by windows. The places
        of plain arrays are found first, by :func:`toposeam.find_places`; arrays that match none of the
        others are left out with a warning. Photographs among them, which have to be turned or bent, are
        joined as ``toposeam stitch`` joins them: with ``blend="auto"`` and ``match_shading=True``
        unless these are given, and fitted to a rectangle (:func:`toposeam.layers.fitted`; ``result.canvas``
        has all). Arrays that only have to be moved, and layers, stay as they are.
    **keywords
        The fields of :class:`toposeam.layers.StitchOptions`, and those of the options of its method.

    Returns
    -------
    Composition

    Raises
    ------
    OverlapError
        When a layer shares no pixel with the others.
    ImageError, OptionError, PathError

    Examples
    --------
    >>> import numpy as np
    >>> from toposeam.layers.canvas.layer import Layer
    >>> whole = np.random.default_rng(0).random((30, 60))
    >>> stitch([Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))])
    Composition(2 layers, 60 × 30 px, 1 seam)
    >>> from skimage import data
    >>> whole = data.camera()[100:260, :300]
    >>> stitch([whole[:, :180], whole[:, 120:]], blend="feather").image.shape
    (160, 300)
    """
    placed, options, bent = _with_places(layers, StitchOptions.of(keywords), keywords)
    if not options.give:
        joined = _joined(placed, options)
    else:
        from toposeam.layers.composite.local_warp import give_way

        first, second = (dataclasses.replace(options, progress=_half(options, start)) for start in (0.0, 0.5))
        again = dataclasses.replace(second, match_tones=False, match_shading=False)
        joined = give_way(_joined(placed, first), options.give, lambda bent: _joined(bent, again))
    if bent:
        from toposeam.layers.composite.fitting import fitted  # layers that are placed stay as they are

        joined = _without_rims(fitted(joined))
    if options.progress is not None:
        options.progress(1.0)
    return joined


def _joined(layers: Sequence[Layer], options: StitchOptions) -> Composition:
    """Join layers without bending them."""
    layers = check_layers(layers)
    check_alike(layers)
    paths = paths_by_pair(options.use_path, len(layers))
    canvas = common_canvas(layers, max_megapixels=options.max_megapixels, wrap=options.wrap)
    blending = options.blending
    if options.match_tones or options.match_shading:
        from toposeam.layers.exposure.gains import burnt_apart, match_tones

        stored = any(isinstance(layer.image, Windows) for layer in layers)
        burnt = options.blend == "auto" and not stored and burnt_apart(layers, canvas.places)
        toned = match_tones(layers, shading=options.match_shading, gray=burnt, executor=options.executor)
        canvas = canvas.with_layers(toned)
        blending = blending_of("gradient", options.blend_width) if burnt else blending
    canvas.check_covers()
    label_map, seams = find_label_map(canvas, SeamSearch.of(options, len(layers)), paths)
    return Composition(canvas=canvas, solution=label_map, blending=blending, _seams=seams)


def _half(options: StitchOptions, start: float) -> Callable[[float], None] | None:
    """Report progress of one half of the work, which begins at the fraction `start`."""
    progress = options.progress
    return None if progress is None else lambda share: progress(start + share / 2)


def _with_places(
    layers: Sequence[Layer] | Sequence[npt.NDArray[Any]], options: StitchOptions, given: Collection[str]
) -> tuple[Sequence[Layer], StitchOptions, bool]:
    """Find the places of plain arrays, and the canvas's width if it goes round.

    Also returns the options, for photographs with their defaults where none are `given`, and whether they are
    photographs.
    """
    images = as_layers(layers)
    if (
        isinstance(images, tuple)
        and len(images) > 1
        and not any(image is layer for image, layer in zip(images, layers, strict=True))
    ):
        from toposeam.layers.boundary.fit import laid_in_memory
        from toposeam.layers.registration.find_places import PlaceOptions, found_places

        found = found_places(images, PlaceOptions(), None, options.executor, laid_in_memory)
        for reason in found.left_out.values():
            warnings.warn(f"left out: {reason}", stacklevel=3)
        wrap = found.wrap if options.wrap is None else options.wrap
        bent = not all(map(is_move, found.transforms))
        if bent and "blend" not in given:
            options = dataclasses.replace(options, blend="auto")
        if bent and not {"match_tones", "match_shading"} & set(given):
            options = dataclasses.replace(options, match_shading=True)
        return found.layers, dataclasses.replace(options, wrap=wrap), bent
    return layers, options, False  # type: ignore[return-value]  # checked by the caller


def _without_rims(joined: Composition) -> Composition:
    """Crop a picture to the largest rectangle in which every pixel is opaque."""
    alpha = joined.alpha
    box = None if alpha is None else largest_full(alpha == full_scale(alpha.dtype))
    return joined if box is None else joined.crop(box)


def composed_of_masks(
    layers: Sequence[Layer],
    masks: Sequence[npt.ArrayLike] | None,
    shape: tuple[int, int],
    *,
    blend: Blend = "none",
    blend_width: float | None = None,
    wrap: int | None = None,
) -> Composition:
    """Compose layers whose masks are given, without searching for seams.

    Parameters
    ----------
    layers : sequence of Layer
        At least one.
    masks : sequence of (H, W) array_like, or None
        True where each layer shows, on a canvas that begins at 0,0; later masks win, and None shows every
        layer wherever it has pixels. A pixel that no mask claims shows the first layer that has pixels there.
    shape : (int, int)
        Height and width of the canvas, px.
    blend, blend_width, wrap
        As for :func:`toposeam.stitch`; `wrap` is the canvas's width.
    """
    bare = [dataclasses.replace(layer, keep=None) for layer in layers]
    canvas = Canvas(layers=bare, origin=(0, 0), shape=shape, period=wrap)
    return Composition(
        canvas=canvas,
        solution=label_map_of_masks(canvas, masks),
        blending=blending_of(blend, blend_width),
        _seams=KnownSeams({}, lambda: SeamSearch.of(StitchOptions(), len(layers)).pose(canvas.cut_open())),
    )
