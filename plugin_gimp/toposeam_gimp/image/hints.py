"""The layer of hints, on which people paint where each layer of a stitched group shall show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gi.repository import Gegl, Gimp

from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import HINTS_PARASITE, KEPT
from toposeam_gimp.image.reach import draw_reach
from toposeam_gimp.image.seam_colours import COLOURS as COLOURS
from toposeam_gimp.image.seam_colours import colours_in as colours_in
from toposeam_gimp.texts import _

#: Opacity of the layer of strokes, %, so that the picture is seen through it.
OPACITY = 60.0
#: Name of the parasite on a layer of strokes: the tattoo of the layer with the outlines.
_REACH_PARASITE = "toposeam-reach"


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
    layer.set_opacity(OPACITY)
    mark = list(str(group.get_tattoo()).encode())
    layer.attach_parasite(Gimp.Parasite.new(HINTS_PARASITE, KEPT, mark))
    return layer


def replace_hints(
    folder: RequestFolder,
    image: Gimp.Image,
    group: Gimp.Layer,
    old: Gimp.Layer | None,
    raster: dict[str, Any],
    layers: Sequence[Gimp.Layer],
) -> Gimp.Layer:
    """Replace the layer of strokes by one with those of a raster, too; the undo step keeps the old layer."""
    box = pixels.around([pixels.layer_box(layer) for layer in (*layers, *([old] if old else []))])
    layer = new_hints(image, group, box)
    at = raster["at"][0] - box[0], raster["at"][1] - box[1]
    left, top = box[:2] if old is None else pixels.place_of(old)
    shift = left - box[0], top - box[1]
    pixels.receive_onto(folder, raster, layer, pixels.Format.RGBA_U8.value, at, old, shift)
    layer.set_visible(False)
    if old is not None:
        layer.set_opacity(old.get_opacity())
        name = old.get_name()
        image.remove_layer(old)
        layer.set_name(name)
    return layer


def show_reach(image: Gimp.Image, strokes: Gimp.Layer, layers: Sequence[Gimp.Layer], first: int) -> None:
    """Outline the pixels of each layer in its colour, on a layer above the strokes; `first` is the number of
    the first colour.
    """
    hide_reach(image, strokes)
    raster = {"width": image.get_width(), "height": image.get_height()}
    outlines = pixels.new_layer(image, _("How far layers reach"), raster)
    image.insert_layer(outlines, strokes.get_parent(), image.get_item_position(strokes))
    draw_reach(outlines, layers, first)
    outlines.set_lock_content(True)
    mark = list(str(outlines.get_tattoo()).encode())
    strokes.attach_parasite(Gimp.Parasite.new(_REACH_PARASITE, KEPT, mark))


def hide_reach(image: Gimp.Image, strokes: Gimp.Layer) -> None:
    """Remove the outlines of layers."""
    mark = strokes.get_parasite(_REACH_PARASITE)
    outlines = mark and image.get_layer_by_tattoo(int(bytes(mark.get_data())))
    if outlines is not None:
        image.remove_layer(outlines)
        strokes.detach_parasite(_REACH_PARASITE)


def colour(image: Gimp.Image, index: int) -> Gegl.Color:
    """Return the colour of strokes for a layer of an image, counted from the lowest."""
    return Gegl.Color.new("#" + bytes(colours_in(image)[index]).hex())
