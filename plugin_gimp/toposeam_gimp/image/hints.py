"""The layer of hints, on which people paint where each layer of a stitched group shall show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gi.repository import Gegl, Gimp

from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import HINTS_PARASITE, KEPT
from toposeam_gimp.texts import _

#: Colours of strokes, 8 bits, and the equal colour tags in the Layers dialog, from the lowest layer on.
COLOURS = (
    ((51, 108, 222), Gimp.ColorTag.BLUE),
    ((240, 140, 20), Gimp.ColorTag.ORANGE),
    ((60, 170, 60), Gimp.ColorTag.GREEN),
    ((140, 70, 200), Gimp.ColorTag.VIOLET),
    ((235, 210, 40), Gimp.ColorTag.YELLOW),
    ((215, 40, 50), Gimp.ColorTag.RED),
    ((120, 75, 35), Gimp.ColorTag.BROWN),
    ((128, 128, 128), Gimp.ColorTag.GRAY),
)
#: Opacity of the layer of strokes, %, so that the picture is seen through it.
_OPACITY = 60.0


def hints_of(image: Gimp.Image, memory: dict[str, Any]) -> Gimp.Layer | None:
    """Return the layer with the strokes for a stitched group; None without one."""
    return memory["hints"] and image.get_layer_by_tattoo(memory["hints"])


def new_hints(image: Gimp.Image, group: Gimp.Layer, box: pixels.Box) -> Gimp.Layer:
    """Put an empty layer for strokes above a stitched group, or above a patch and its blended pixels."""
    raster = {"width": box[2], "height": box[3]}
    layer = pixels.new_layer(image, _("Seam hints"), raster)
    position = image.get_item_position(group)
    image.insert_layer(layer, group.get_parent(), position if group.is_group() else max(position - 1, 0))
    layer.set_offsets(box[0], box[1])
    layer.set_opacity(_OPACITY)
    mark = list(str(group.get_tattoo()).encode())
    layer.attach_parasite(Gimp.Parasite.new(HINTS_PARASITE, KEPT, mark))
    return layer


def canvas_of(layers: Sequence[Gimp.Layer]) -> pixels.Box:
    """Return the box of the canvas that layers cover."""
    boxes = [(*pixels.place_of(layer), layer.get_width(), layer.get_height()) for layer in layers]
    left, top = min(box[0] for box in boxes), min(box[1] for box in boxes)
    right, bottom = max(box[0] + box[2] for box in boxes), max(box[1] + box[3] for box in boxes)
    return left, top, right - left, bottom - top


def send_hints(folder: RequestFolder, layer: Gimp.Layer | None) -> dict[str, Any] | None:
    """Write the strokes into a folder."""
    return None if layer is None else pixels.send_strokes(folder, layer, "hints")


def replace_hints(
    folder: RequestFolder,
    image: Gimp.Image,
    group: Gimp.Layer,
    old: Gimp.Layer | None,
    raster: dict[str, Any],
    box: pixels.Box,
) -> Gimp.Layer:
    """Replace the layer of strokes by that of a raster; the undo step keeps the old layer."""
    layer = new_hints(image, group, box)
    pixels.receive_strokes(folder, layer, raster)
    if old is not None:
        layer.set_visible(old.get_visible())
        layer.set_opacity(old.get_opacity())
        image.remove_layer(old)
    return layer


def colour(index: int) -> Gegl.Color:
    """Return the colour of strokes for a layer, counted from the lowest."""
    return Gegl.Color.new("#" + bytes(COLOURS[index][0]).hex())
