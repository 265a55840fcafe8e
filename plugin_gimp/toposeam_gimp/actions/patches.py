"""Stitch Selection as Patch: ask the engine, and change the image after it has answered."""

from __future__ import annotations

from gi.repository import Gimp

from toposeam_gimp.actions.below import picture_below
from toposeam_gimp.actions.joining import draw_seams, put_mask, put_pixels
from toposeam_gimp.engine.call import Call
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import RefusedError, chosen_layers, one_undo_step, remember
from toposeam_gimp.image.seen import plain_copy
from toposeam_gimp.texts import _


def patch_selection(call: Call) -> Gimp.Layer:
    """Join the selected part of a layer, or a floating selection, to the visible image below it along a
    closed seam.
    """
    image, options = call.image, call.options
    (layer,) = chosen_layers(image, call.drawables)
    floating = layer.is_floating_sel()
    with RequestFolder(needed=3 * pixels.size_of(image, layer)) as folder:
        selection = None if floating else pixels.send_selection(folder, image)
        box = None if selection is None else pixels.box_of(selection)
        patch = pixels.send_layer(folder, image, layer, "patch", box=box)
        if patch is None:
            raise RefusedError(
                _("The selection lies outside the layer “{name}”; select a part of it.").format(
                    name=layer.get_name()
                )
            )
        below = picture_below(folder, image, layer, pixels.box_of(patch))
        avoid = pixels.send_avoided(folder, options["avoid"])
        request = {
            "layers": [below, patch],
            "selection": selection,
            "avoid": avoid,
            "options": call.for_engine,
        }
        answer = call.ask(folder, {"operation": "patch", **request})
        with one_undo_step(image) as undone:
            if floating:
                Gimp.floating_sel_to_layer(layer)
                result = layer
            else:
                result = plain_copy(image, layer, layer.get_parent(), image.get_item_position(layer))
                undone.append(lambda: image.remove_layer(result))
                x, y, width, height = pixels.box_of(patch)
                _nothing, left, top = result.get_offsets()
                result.resize(width, height, left - x, top - y)
                result.set_name(_("Patch of {name}").format(name=layer.get_name()))
                layer.set_visible(False)
                undone.append(lambda: layer.set_visible(True))
            put_mask(folder, result, answer["masks"][1])
            blended = put_pixels(folder, image, result, _("Blended seams"), answer.get("blended"))
            if blended is not None:
                undone.append(lambda: image.remove_layer(blended))
            seams = draw_seams(image, answer["seams"], undone, visible=options["show-seam"])
            kept = {name: options[name] for name in ("blend", "blend-width", "law")}
            about = {"kind": "patch", "options": kept, "names": [patch["name"]]}
            remember(folder, result, [result], seams, blended, about, answer)
            image.set_selected_layers([result])
    return result
