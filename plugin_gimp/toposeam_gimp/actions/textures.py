"""Synthesize Texture, Make Seamless Tile, Heal Selection: from the pixels of one layer to a new layer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.engine.call import Call
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import RefusedError, chosen_layers, one_undo_step
from toposeam_gimp.texts import _


def synthesize(call: Call) -> Gimp.Layer:
    """Return a texture grown from a layer, in a new image or a new layer."""
    (layer,) = chosen_layers(call.image, call.drawables)
    made = call.options["width"] * call.options["height"] * 16
    with RequestFolder(needed=pixels.size_of(call.image, layer) + made) as folder:
        request = _sample(call, folder, layer)
        picture = call.ask(folder, {"operation": "synthesize", **request})["picture"]
        name = _("Texture of {name}").format(name=layer.get_name())
        if call.options["destination"] == "layer":
            return _add(call, folder, layer, {**picture, "at": [0, 0]}, name)
        image = Gimp.Image.new_with_precision(
            picture["width"], picture["height"], call.image.get_base_type(), call.image.get_precision()
        )
        profile = call.image.get_color_profile()
        if profile is not None:
            image.set_color_profile(profile)
        image.undo_disable()
        result = pixels.new_layer(image, name, picture)
        image.insert_layer(result, None, 0)
        pixels.receive_colors(folder, result, picture)
        image.undo_enable()
    if call.interactive:
        Gimp.Display.new(image)
    return result


def check_tile(image: Gimp.Image, drawables: Sequence[Gimp.Drawable], _options: Mapping[str, Any]) -> None:
    """Refuse a selection that is no rectangle, as it cannot be laid side by side."""
    chosen_layers(image, drawables)
    selected_rectangle(image)


def make_tileable(call: Call) -> Gimp.Layer:
    """Return a copy of a layer, or of the selected rectangle of it, that repeats."""
    (layer,) = chosen_layers(call.image, call.drawables)
    with RequestFolder(needed=2 * pixels.size_of(call.image, layer)) as folder:
        request = _sample(call, folder, layer, rectangle=True)
        picture = call.ask(folder, {"operation": "make_tileable", **request})["picture"]
        name = _("Seamless {name}").format(name=layer.get_name())
        return _add(call, folder, layer, {**picture, "at": request["layer"]["at"]}, name)


def check_fill(image: Gimp.Image, drawables: Sequence[Gimp.Drawable], options: Mapping[str, Any]) -> None:
    """Refuse an empty selection, and a missing source."""
    (layer,) = chosen_layers(image, drawables)
    if Gimp.Selection.is_empty(image):
        raise RefusedError(_("Nothing is selected; select what is to be replaced."))
    source = options["source"]
    if options["from"] == "other" and (
        source is None or source.get_image().get_id() != image.get_id() or source.get_id() == layer.get_id()
    ):
        raise RefusedError(_("Choose another layer of this image, a mask or a channel to copy from."))


def fill(call: Call) -> Gimp.Layer:
    """Return a layer that covers the selection by pixels like the rest of the layer."""
    check_fill(call.image, call.drawables, call.options)
    (layer,) = call.drawables
    with RequestFolder(needed=2 * pixels.size_of(call.image, layer)) as folder:
        request = _sample(call, folder, layer)
        request["source"] = send_source(folder, call.image, layer, call.options)
        picture = call.ask(folder, {"operation": "fill", **request})["picture"]
        return _add(call, folder, layer, picture, _("Fill of {name}").format(name=layer.get_name()))


def send_source(
    folder: RequestFolder,
    image: Gimp.Image,
    layer: Gimp.Layer,
    options: Mapping[str, Any],
    scale: float | None = None,
) -> dict[str, Any] | None:
    """Send the source to be copied into a hole if it is not the layer itself: another layer, or a mask."""
    if options["from"] != "other":
        return None
    source = options["source"]
    if scale is not None:
        return pixels.send_reduced(folder, image, source, "source", scale)
    if isinstance(source, Gimp.Layer):
        return pixels.send_whole(folder, image, source, "source")
    return pixels.send_channel(folder, source, "source")


def _sample(
    call: Call, folder: RequestFolder, layer: Gimp.Layer, *, rectangle: bool = False
) -> dict[str, Any]:
    """Write the layer and the selection on it; with `rectangle` only the part of the layer within the
    selection's bounds.
    """
    something = not Gimp.Selection.is_empty(call.image)
    box = selected_rectangle(call.image) if rectangle else None
    raster = pixels.send_layer(folder, call.image, layer, "layer", box=box)
    selection = None
    if something and not rectangle and raster is not None:
        selection = pixels.send_selection_on(folder, call.image, pixels.box_of(raster))
    if raster is None or (something and not rectangle and selection is None):
        raise RefusedError(
            _("The selection lies outside the layer “{name}”; select a part of it.").format(
                name=layer.get_name()
            )
        )
    return {"layer": raster, "selection": selection, "options": call.for_engine}


def selected_rectangle(image: Gimp.Image) -> pixels.Box | None:
    """Return the box of the selection, which must be a rectangle; None without a selection."""
    something, left, top, right, bottom = Gimp.Selection.bounds(image)[1:]
    if not something:
        return None
    box = (left, top, right - left, bottom - top)
    if not pixels.is_rectangle(image, box):
        raise RefusedError(
            _(
                "The selection is not a rectangle, and only rectangles can be laid side by side. Select a "
                "rectangle with the Rectangle Select tool, or nothing for the whole layer."
            )
        )
    return box


def _add(
    call: Call, folder: RequestFolder, layer: Gimp.Layer, picture: dict[str, Any], name: str
) -> Gimp.Layer:
    """Return a new layer above another one, in one undo step."""
    with one_undo_step(call.image) as undone:
        result = pixels.new_layer(call.image, name, picture)
        call.image.insert_layer(result, layer.get_parent(), call.image.get_item_position(layer))
        undone.append(lambda: call.image.remove_layer(result))
        result.set_offsets(*picture["at"])
        pixels.receive_colors(folder, result, picture)
        call.image.set_selected_layers([result])
    return result
