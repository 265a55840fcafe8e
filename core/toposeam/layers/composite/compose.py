"""From placed layers to a composition."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Sequence
from typing import Any, Unpack

import numpy.typing as npt

from toposeam.errors import OptionError
from toposeam.layers.blending.blend import Blend
from toposeam.layers.canvas.layer import Extent, Layer, as_layers, check_layers, common_canvas
from toposeam.layers.canvas.tile_map import cover_of
from toposeam.layers.composite.composition import Composition
from toposeam.layers.composite.cylindrical import turned
from toposeam.layers.composite.label_maps import Labelled, SeamSearch, check_alike, labelled, masked
from toposeam.layers.composite.local_warp import give_way
from toposeam.layers.composite.options import StitchKeywords, StitchOptions, with_signature
from toposeam.layers.composite.two_layers import LayersOnCanvas, paths_by_pair
from toposeam.layers.composite.whole_turn import going_round, labelled_round
from toposeam.layers.exposure.gains import match_tones
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.find_places import find_places
from toposeam.seam.result.seam import Seam


@with_signature
def compose(
    layers: Sequence[Layer] | Sequence[npt.NDArray[Any]], **keywords: Unpack[StitchKeywords]
) -> Composition:
    """Decide which of placed layers shows where, for a picture that need not fit into memory.

    Parameters
    ----------
    layers : sequence of Layer
        As for :func:`toposeam.stitch`; their images may be :class:`toposeam.Windows`.
    **keywords
        Those of :func:`toposeam.stitch`.

    Returns
    -------
    Composition
        Its windows together are what :func:`toposeam.stitch` returns, pixel by pixel.

    Raises
    ------
    OverlapError
        When a layer shares no pixel with the others.
    ImageError, OptionError, PathError

    Examples
    --------
    >>> import numpy as np
    >>> whole = np.random.default_rng(0).random((30, 60))
    >>> compose([Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))])
    Composition(2 layers, 60 × 30 px, 1 seam)
    """
    placed, chosen = _with_places(layers, StitchOptions.of(keywords))
    if not chosen.give:
        return _composed(placed, chosen)
    first, second = (dataclasses.replace(chosen, progress=_half(chosen, start)) for start in (0.0, 0.5))
    again = dataclasses.replace(second, match_tones=False, match_shading=False)
    return give_way(_composed(placed, first), chosen.give, lambda bent: _composed(bent, again))


def _composed(layers: Sequence[Layer], options: StitchOptions) -> Composition:
    """Compose layers without bending them."""
    layers = check_layers(layers)
    check_alike(layers)
    paths = paths_by_pair(options.use_path, len(layers))
    canvas = common_canvas(layers, max_megapixels=options.max_megapixels)
    if options.match_tones or options.match_shading:
        layers = match_tones(layers, shading=options.match_shading, executor=options.executor)
    find = labelled if options.wrap is None else labelled_round
    found = find(layers, canvas, SeamSearch.of(options, len(layers)), paths)
    return found.composition(layers, options.blend, options.blend_width)


def _half(options: StitchOptions, start: float) -> Callable[[float], None] | None:
    """Report the progress of half of the work, which begins at a share of it."""
    progress = options.progress
    return None if progress is None else lambda share: progress(start + share / 2)


def _with_places(
    layers: Sequence[Layer] | Sequence[npt.NDArray[Any]], options: StitchOptions
) -> tuple[Sequence[Layer], StitchOptions]:
    """Find the places of images that are given without any, and the canvas's width if it goes round."""
    images = as_layers(layers)
    if (
        isinstance(images, tuple)
        and len(images) > 1
        and not any(image is layer for image, layer in zip(images, layers, strict=True))
    ):
        found = find_places(images, executor=options.executor)
        for reason in found.left_out.values():
            warnings.warn(f"left out: {reason}", stacklevel=4)
        wrap = found.wrap if options.wrap is None else options.wrap
        return found.layers, dataclasses.replace(options, wrap=wrap)
    return layers, options  # type: ignore[return-value]  # checked by the caller


def shown_as(
    layers: Sequence[Layer],
    masks: Sequence[npt.ArrayLike] | None,
    shape: tuple[int, int],
    *,
    blend: Blend = "none",
    blend_width: float | None = None,
    wrap: int | None = None,
) -> Composition:
    """A composition of which it is known where each layer shows.

    Parameters
    ----------
    layers : sequence of Layer
        At least one.
    masks : sequence of (H, W) array_like, or None
        Where each layer shows, on a canvas that begins at 0,0; later ones win, and None shows every layer
        wherever it has pixels. What no mask gives to anybody is the first layer's that has pixels there.
    shape : (int, int)
        Height and width of the canvas, px.
    blend, blend_width, wrap
        As for :func:`toposeam.stitch`; `wrap` is the canvas's width.
    """
    canvas = Extent(origin=(0, 0), shape=shape)
    parts = [turned(layer, wrap, 0) for layer in layers] if wrap is not None else list(layers)
    ground = LayersOnCanvas(parts, canvas, [canvas.place(part) for part in parts], list(map(cover_of, parts)))

    def nothing(pair: Pair, beside: bool) -> Seam:
        raise OptionError(
            "layers {first} and {second} were not divided by a seam",
            kind="no seam",
            layers=pair,
            first=pair[0],
            second=pair[1],
        )

    found = Labelled(canvas=canvas, placed=ground.showing(masked(ground, masks)), seam=nothing)
    if wrap is not None:
        found = going_round(found, layers, blend)
    return found.composition(layers, blend, blend_width)
