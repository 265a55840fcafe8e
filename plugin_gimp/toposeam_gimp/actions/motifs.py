"""Generate Motif, Repeat Motif: every ink a layer in Multiply mode under a mask, so that colours and strokes
stay editable.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

from gi.repository import Babl, Gegl, Gimp

from toposeam_gimp.engine.call import Call
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import RefusedError, chosen_layers
from toposeam_gimp.texts import _

#: Name of the parasite on the group of inks: the rule by which the motif repeats, and its recipe.
PARASITE = "toposeam-motif"


def generate(call: Call) -> Gimp.Layer:
    """Return a motif in a new image."""
    size = call.options["size"]
    with RequestFolder(needed=size * size * 4 * call.options["layers"]) as folder:
        base = None
        if call.options["use-layer"]:
            if call.image is None or not call.drawables:
                raise RefusedError(
                    _(
                        "There is no layer to shape the strokes after; open the picture first, or switch "
                        "that option off."
                    )
                )
            (layer,) = chosen_layers(call.image, call.drawables)
            base = pixels.send_layer(folder, call.image, layer, "base")
        request = {"operation": "motif", "layer": base, "options": call.for_engine}
        answer = call.ask(folder, request)
        colours = [Gegl.Color.new(ink) for ink in answer["inks"]]
        memory = {"repeat": answer["recipe"]["repeat"], "recipe": answer["recipe"]}
        return _image_of(call, folder, answer["densities"], colours, Gegl.Color.new(answer["paper"]), memory)


def repeat(call: Call) -> Gimp.Layer:
    """Return a pattern of motifs in a new image."""
    group, memory = motif_of(call.image, call.drawables)
    inks = inks_of(group)
    width, height = inks[0].get_width(), inks[0].get_height()
    needed = width * height * 4 * len(inks) * (1 + call.options["rows"] * call.options["columns"])
    with RequestFolder(needed=needed) as folder:
        densities = [pixels.send_density(folder, ink, f"ink-{index}") for index, ink in enumerate(inks)]
        request = {"operation": "repeat", "densities": densities, "repeat": memory["repeat"]}
        answer = call.ask(folder, {**request, "options": call.for_engine})
        colours, paper = [_colour(ink) for ink in inks], _colour(group.get_children()[-1])
        if call.options["palette"] != "own":
            colours = [Gegl.Color.new(ink) for ink in answer["inks"]]
            paper = Gegl.Color.new(answer["paper"])
        memory = {**memory, "repeat": answer["repeat"]}
        return _image_of(call, folder, answer["densities"], colours, paper, memory)


def inks_of(group: Gimp.GroupLayer) -> list[Gimp.Layer]:
    """Return the layers of ink, the first one printed first."""
    inks = [layer for layer in reversed(group.get_children()) if layer.get_mask() is not None]
    if not inks or len({(ink.get_width(), ink.get_height()) for ink in inks}) > 1:
        raise RefusedError(
            _("The layers of ink have no masks, or masks of different sizes; generate the motif again.")
        )
    return inks


def colours_of(group: Gimp.GroupLayer) -> dict[str, Any]:
    """Return the colours of inks and paper for a request for a preview."""
    return {
        "inks": [_hexadecimal(_colour(ink)) for ink in inks_of(group)],
        "paper": _hexadecimal(_colour(group.get_children()[-1])),
    }


def check_motif(image: Gimp.Image, drawables: Sequence[Gimp.Drawable], _options: Mapping[str, Any]) -> None:
    """Refuse an image without a motif."""
    motif_of(image, drawables)


def motif_of(image: Gimp.Image, drawables: Sequence[Gimp.Drawable]) -> tuple[Gimp.GroupLayer, dict[str, Any]]:
    """Return the selected group of inks, or the image's only one, and its record."""
    item: Any
    for item in [*chosen_layers(image, drawables), *image.get_layers()]:
        while item is not None:
            parasite = item.get_parasite(PARASITE)
            if parasite is not None:
                return item, json.loads(bytes(parasite.get_data()))
            item = item.get_parent()
    raise RefusedError(_("This image has no motif; make one with Generate Motif, then repeat it."))


def _image_of(
    call: Call,
    folder: RequestFolder,
    densities: Sequence[dict[str, Any]],
    inks: Sequence[Gegl.Color],
    paper: Gegl.Color,
    memory: dict[str, Any],
) -> Gimp.Layer:
    """Return a new image: a group of paper and inks."""
    width, height = densities[0]["width"], densities[0]["height"]
    image = Gimp.Image.new_with_precision(
        width, height, Gimp.ImageBaseType.RGB, Gimp.Precision.U16_NON_LINEAR
    )
    image.undo_disable()
    group = Gimp.GroupLayer.new(image, _("Motif"))
    image.insert_layer(group, None, 0)
    _solid(image, group, _("Paper"), paper, Gimp.LayerMode.NORMAL)
    for number, (density, ink) in enumerate(zip(densities, inks, strict=True), start=1):
        layer = _solid(image, group, _("Ink {number}").format(number=number), ink, Gimp.LayerMode.MULTIPLY)
        layer.add_mask(pixels.new_mask(folder, density, layer))
        layer.set_edit_mask(False)
    flags = Gimp.PARASITE_PERSISTENT | Gimp.PARASITE_UNDOABLE
    group.attach_parasite(
        Gimp.Parasite.new(PARASITE, flags, list(json.dumps(memory, separators=(",", ":")).encode()))
    )
    image.undo_enable()
    image.set_selected_layers([group])
    if call.interactive:
        Gimp.Display.new(image)
    return group


def _solid(
    image: Gimp.Image, group: Gimp.GroupLayer, name: str, colour: Gegl.Color, mode: Gimp.LayerMode
) -> Gimp.Layer:
    """Add a layer of one colour on top of the group. Inks mix by products of their encoded values, as printed
    samples do.
    """
    layer = Gimp.Layer.new(
        image, name, image.get_width(), image.get_height(), Gimp.ImageType.RGBA_IMAGE, 100.0, mode
    )
    image.insert_layer(layer, group, 0)
    if mode != Gimp.LayerMode.NORMAL:
        layer.set_blend_space(Gimp.LayerColorSpace.RGB_NON_LINEAR)
        layer.set_composite_space(Gimp.LayerColorSpace.RGB_NON_LINEAR)
    Gimp.context_push()
    try:
        Gimp.context_set_foreground(colour)
        layer.fill(Gimp.FillType.FOREGROUND)
    finally:
        Gimp.context_pop()
    return layer


def _colour(layer: Gimp.Layer) -> Gegl.Color:
    return layer.get_pixel(layer.get_width() // 2, layer.get_height() // 2)


def _hexadecimal(colour: Gegl.Color) -> str:
    content: bytes = colour.get_bytes(Babl.format("R'G'B' u8")).get_data()
    return "#" + content.hex()
