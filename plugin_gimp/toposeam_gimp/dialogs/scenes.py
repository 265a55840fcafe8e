"""Scenes of the previews: pixels of the selected layers at a reduced size, in the engine's request."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.actions.animation import delay_of, frames_of
from toposeam_gimp.actions.below import check_something
from toposeam_gimp.actions.motifs import colours_of, inks_of, motif_of
from toposeam_gimp.actions.seams import layers_to_join
from toposeam_gimp.actions.textures import check_fill, selected_rectangle, send_source
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import RefusedError, check_selection, chosen_layers
from toposeam_gimp.image.pixels import Box
from toposeam_gimp.texts import _

#: The engine's name of each entry's preview.
OF = {
    "panorama": "stitch",
    "stitch": "stitch",
    "patch": "patch",
    "sample": "synthesize",
    "tile": "make_tileable",
    "hole": "fill",
    "motif": "motif",
    "pattern": "repeat",
    "clip": "loop",
}
#: Most pixels of which a preview is made; that of seams is drawn smaller first.
MOST_PIXELS = 1_200_000
#: Most pixels of layers that are placed: of each, and of all together, which shows a panorama of a megapixel.
_MOST_PLACED, _MOST_TOGETHER = 800_000, 3_000_000
#: Most pixels where a preview takes longer than that of seams: of tiles and of samples, so that it takes at
#: most a second (benchmarks/gimp.py).
_MOST_TILED, _MOST_SAMPLED = 80_000, 50_000
_MOST_GROWN, _MOST_LOOPED = 32_000, 150_000
#: Surroundings of a hole that are shown on each side, as multiples of its size: in general, and where the
#: preview is the result; at least so many px then.
_SURROUNDINGS, _CLOSE, _LEAST_SHOWN = 1.2, 0.6, 250
#: Largest area, pixels, in which a hole is filled at full size. It reaches beyond the hole by the second
#: number, px, or by the third times the hole's longer side, whichever is more, and by the fourth, px.
_MOST_FILLED, _SEARCHED, _REACH, _BEYOND = 12_000_000, 512, 1.5, 64
#: Size up to which a layer is searched as a whole, pixels.
_SMALL = 1 << 20
#: Least side of a frame in a preview of an animation, px.
_LEAST_FRAME = 200

Scene = dict[str, Any]
Layers = Sequence[Gimp.Drawable]


def scene(name: str, folder: RequestFolder, image: Gimp.Image, drawables: Layers, options: Scene) -> Scene:
    """Build the engine's request for a preview, without the options.

    Raises
    ------
    RefusedError
        When there is nothing to show; the text gives the reason.
    """
    return _SCENES[name](folder, image, drawables, options)


def key(name: str, options: Scene) -> tuple[Any, ...]:
    """Return the options on which a scene's pixels depend."""
    if name == "sample":
        return options["width"], options["height"]
    if name in ("stitch", "patch"):
        return options.get("places") == "anywhere", options["avoid"] and options["avoid"].get_id()
    if name == "pattern":
        return options["rows"], options["columns"]
    if name == "hole":
        return options["from"], options["source"] and options["source"].get_id()
    return (options["use-layer"],) if name == "motif" else ()


def _panorama(folder: RequestFolder, image: Gimp.Image, drawables: Layers, _options: Scene) -> Scene:
    return {**_placed(folder, image, drawables), "places": "anywhere"}


def _placed(folder: RequestFolder, image: Gimp.Image, drawables: Layers) -> Scene:
    """Send layers of unknown place, large enough that their places can be found."""
    layers = layers_to_join(image, drawables)
    most = min(_MOST_PLACED * len(layers), _MOST_TOGETHER)
    scale = _scale(sum(_area(pixels.layer_box(layer)) for layer in layers), most)
    rasters = _rasters(folder, image, layers, scale)
    return {"of": "stitch", "scale": scale, "layers": rasters, "selection": None}


def _stitch(folder: RequestFolder, image: Gimp.Image, drawables: Layers, options: Scene) -> Scene:
    check_selection(image, options)
    if options["places"] == "anywhere":
        return _placed(folder, image, drawables)
    layers = layers_to_join(image, drawables)
    boxes = [pixels.layer_box(layer) for layer in layers]
    canvas = pixels.around(boxes)
    scale = _scale(max(_area(canvas), sum(map(_area, boxes))))
    rasters = _rasters(folder, image, layers, scale)
    about = {"selection": _selection(folder, image, scale, canvas), **_avoided(folder, image, scale, options)}
    return {"of": "stitch", "scale": scale, "layers": rasters, **about}


def _avoided(folder: RequestFolder, image: Gimp.Image, scale: float, options: Scene) -> Scene:
    """Send the channel of pixels that seams avoid."""
    channel = options["avoid"]
    return {"avoid": channel and pixels.send_reduced(folder, image, channel, "avoid", scale)}


def _patch(folder: RequestFolder, image: Gimp.Image, drawables: Layers, options: Scene) -> Scene:
    (layer,) = chosen_layers(image, drawables)
    if layer.is_floating_sel() or layer.get_parent() is not None:
        raise RefusedError(_("There is no preview of a floating selection, nor within a group."))
    selected = _bounds(image) or pixels.layer_box(layer)
    around = pixels.grown(selected, max(selected[2:]) // 4)
    scale = _scale(_area(around))
    scratch = image.duplicate()
    try:
        for above, copy in zip(image.get_layers(), scratch.get_layers(), strict=True):
            copy.set_visible(False)
            if above.get_id() == layer.get_id():
                break
        seen = Gimp.Layer.new_from_visible(scratch, scratch, "below")
        check_something(seen, selected)
        below = pixels.send_reduced(folder, image, seen, "below", scale, around)
    finally:
        scratch.delete()
    patch = pixels.send_reduced(folder, image, layer, "patch", scale, selected)
    about = {
        "selection": _selection(folder, image, scale, selected),
        **_avoided(folder, image, scale, options),
    }
    return {"of": "patch", "scale": scale, "layers": [below, patch], **about}


def _sample(folder: RequestFolder, image: Gimp.Image, drawables: Layers, options: Scene) -> Scene:
    made = _texture("synthesize", folder, image, drawables, most=_MOST_SAMPLED)
    # A part of the texture, not all of it reduced: its patches would be too small to be patches.
    grown = options["width"] * options["height"] * made["scale"] ** 2
    return {**made, "extent": _scale(grown, _MOST_GROWN)}


def _tile(folder: RequestFolder, image: Gimp.Image, drawables: Layers, _options: Scene) -> Scene:
    box = selected_rectangle(image)
    return _texture("make_tileable", folder, image, drawables, box=box, most=_MOST_TILED)


def _hole(folder: RequestFolder, image: Gimp.Image, drawables: Layers, options: Scene) -> Scene:
    check_fill(image, drawables, options)
    layer = drawables[0]
    whole, selected = pixels.layer_box(layer), _bounds(image) or pixels.layer_box(layer)
    # The hole and its surroundings, as large as they can be shown.
    shown = pixels.common(whole, pixels.grown(selected, round(_SURROUNDINGS * max(selected[2:]))))
    reach = round(max(selected[2:]) * (1 if options["from"] == "around" else _REACH))
    searched = pixels.common(whole, pixels.grown(selected, max(reach, _SEARCHED) + _BEYOND))
    if shown is None or searched is None:
        raise RefusedError(
            _("The selection lies outside the layer “{name}”; select a part of it.").format(
                name=layer.get_name()
            )
        )
    box, about = shown, {}
    if options["from"] != "other" and _area(searched) <= _MOST_FILLED:
        # Small enough that the preview is the result.
        box = whole if _area(whole) <= _SMALL else pixels.around([searched, shown])
        near = max(round(_CLOSE * max(selected[2:])), _LEAST_SHOWN)
        shown = pixels.common(whole, pixels.grown(selected, near)) or shown
        about = {"shown": [shown[0] - box[0], shown[1] - box[1], *shown[2:]]}
    most = _area(box) if about else _MOST_GROWN
    made = _texture("fill", folder, image, drawables, box=box, most=most)
    if about:
        made["layer"]["cut_from"] = _area(whole)
    made["selection"] = _selection(folder, image, made["scale"], box)
    return {**made, **about, "source": send_source(folder, image, layer, options, made["scale"])}


def _motif(folder: RequestFolder, image: Gimp.Image | None, drawables: Layers, options: Scene) -> Scene:
    base = None
    if options["use-layer"]:
        if image is None or not drawables:
            raise RefusedError(_("There is no layer to shape the strokes after."))
        (layer,) = chosen_layers(image, drawables)
        base = pixels.send_reduced(folder, image, layer, "base", _scale(_area(pixels.layer_box(layer))))
    return {"of": "motif", "scale": 1.0, "layer": base}


def _pattern(folder: RequestFolder, image: Gimp.Image, drawables: Layers, options: Scene) -> Scene:
    group, memory = motif_of(image, drawables)
    inks = inks_of(group)
    scale = _scale(_area(pixels.layer_box(inks[0])) * options["rows"] * options["columns"])
    densities = _rasters(folder, image, [ink.get_mask() for ink in inks], scale)
    about = {"repeat": memory["repeat"], **colours_of(group)}
    return {"of": "repeat", "scale": 1.0, "densities": densities, **about}


def _clip(folder: RequestFolder, image: Gimp.Image, _drawables: Layers, _options: Scene) -> Scene:
    frames = frames_of(image)
    area = image.get_width() * image.get_height()
    if _LEAST_FRAME * len(frames) > _MOST_LOOPED:
        raise RefusedError(_("There is no preview of so many frames."))
    scale = _scale(area * len(frames), _MOST_LOOPED)
    rasters = _rasters(folder, image, frames, scale)
    return {"of": "loop", "scale": scale, "layers": rasters, "delay": delay_of(frames)}


def _rasters(folder: RequestFolder, image: Gimp.Image, drawables: Layers, scale: float) -> list[Scene]:
    return [
        pixels.send_reduced(folder, image, one, f"layer-{index}", scale)
        for index, one in enumerate(drawables)
    ]


def _texture(
    of: str,
    folder: RequestFolder,
    image: Gimp.Image,
    drawables: Layers,
    *,
    box: Box | None = None,
    most: int = MOST_PIXELS,
) -> Scene:
    (layer,) = chosen_layers(image, drawables)
    scale = _scale(_area(box or pixels.layer_box(layer)), most)
    raster = pixels.send_reduced(folder, image, layer, "layer", scale, box)
    selection = None if box is not None else _selection(folder, image, scale, pixels.layer_box(layer))
    return {"of": of, "scale": scale, "layer": raster, "selection": selection}


def _selection(folder: RequestFolder, image: Gimp.Image, scale: float, box: Box) -> Scene | None:
    """Send the selection on a box of the canvas; None without a selection."""
    if _bounds(image) is None:
        return None
    width, height = image.get_width(), image.get_height()
    if box[0] < 0 or box[1] < 0 or box[0] + box[2] > width or box[1] + box[3] > height:
        raise RefusedError(
            _("There is no preview for layers that reach over the canvas while something is selected.")
        )
    return pixels.send_reduced(folder, image, image.get_selection(), "selection", scale, box)


def _bounds(image: Gimp.Image) -> Box | None:
    _done, something, left, top, right, bottom = Gimp.Selection.bounds(image)
    return (left, top, right - left, bottom - top) if something else None


def _area(box: Box) -> int:
    return box[2] * box[3]


def _scale(area: float, most: int = MOST_PIXELS) -> float:
    return min(1.0, math.sqrt(most / max(area, 1)))


_SCENES: dict[str, Callable[..., Scene]] = {
    "panorama": _panorama,
    "stitch": _stitch,
    "patch": _patch,
    "sample": _sample,
    "tile": _tile,
    "hole": _hole,
    "motif": _motif,
    "pattern": _pattern,
    "clip": _clip,
}
