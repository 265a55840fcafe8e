"""Panorama from Layers, Stitch Layers: ask the engine, and change the image after it has answered."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.actions.joining import Options, draw_seams, put_mask, put_pixels, request_of
from toposeam_gimp.engine.call import Call
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import (
    RefusedError,
    check_selection,
    chosen_layers,
    lowest_first,
    mark_place,
    one_undo_step,
    remember,
)
from toposeam_gimp.image.seen import is_plain, plain_copy
from toposeam_gimp.texts import _


def check_layers(image: Gimp.Image, drawables: Sequence[Gimp.Drawable], options: Mapping[str, Any]) -> None:
    """Refuse drawables that are no layers beside each other, and a selection while the layers' places are
    unknown.
    """
    layers_to_join(image, drawables)
    if "places" in options:
        check_selection(image, options)


def layers_to_join(image: Gimp.Image, drawables: Sequence[Gimp.Drawable]) -> list[Gimp.Layer]:
    """Return the selected layers, the lowest first."""
    layers = lowest_first(image, chosen_layers(image, drawables))
    if len(layers) < 2:
        raise RefusedError(_("Two or more layers are needed; select them in the Layers dialog (Ctrl-click)."))
    return layers


def panorama(call: Call) -> Gimp.Layer:
    """Place, warp and join layers on a canvas that holds them."""
    scans = call.options["pictures"] == "scans"
    blend = {"blend": "none", "blend-width": 0.0} if scans else {}
    return _joined(call, {**call.options, "places": "anywhere", **blend}, None)


def stitch_layers(call: Call) -> Gimp.Layer:
    """Stitch two or more layers into a group with masks and paths."""
    check_layers(call.image, call.drawables, call.options)
    return _joined(call, call.options, call.image)


def _joined(call: Call, options: Mapping[str, Any], selected: Gimp.Image | None) -> Gimp.Layer:
    """Join the selected layers, within the image's selection if the options ask for it."""
    image = call.image
    layers = layers_to_join(image, call.drawables)
    with request_of(image, layers) as (folder, rasters):
        request = {
            "layers": rasters,
            "selection": selected and pixels.send_selection(folder, image),
            "avoid": pixels.send_avoided(folder, options.get("avoid")),
            "options": {**call.for_engine, "places": options["places"]},
        }
        answer = call.ask(folder, {"operation": "stitch", **request})
        used = [layers[number] for number in answer["numbers"]]
        with one_undo_step(image) as undone:
            group, copies = _group_of(folder, image, used, layers[-1], answer, undone)
            if answer.get("canvas"):
                _resize(image, answer["canvas"], undone)
            elif options["places"] == "anywhere":
                _hold_all(image, copies, undone)
            blended = put_pixels(folder, image, group, _("Blended seams"), answer.get("blended"))
            put_pixels(folder, image, group, _("Filled corners"), answer.get("filled"))
            seams = draw_seams(image, answer["seams"], undone, visible=options["show-seam"])
            kept = {"blend": answer["blend"], **{name: options[name] for name in ("blend-width", "law")}}
            about = {"kind": "group", "options": kept, "names": [layer.get_name() for layer in used]}
            remember(folder, group, copies, seams, blended, about, answer)
            for layer in layers if options["keep-layers"] else _others(layers, used):
                undone.append(partial(layer.set_visible, layer.get_visible()))
                layer.set_visible(False)
            _tell(call, layers, used, answer)
            result = group.merge() if options["merge"] else group
            if not options["keep-layers"]:
                for layer in used:
                    image.remove_layer(layer)
                for copy, name in zip(() if options["merge"] else copies, about["names"], strict=False):
                    copy.set_name(name)
            image.set_selected_layers([result])
    return result


def _group_of(
    folder: RequestFolder,
    image: Gimp.Image,
    layers: Sequence[Gimp.Layer],
    above: Gimp.Layer,
    answer: Options,
    undone: list[Callable[[], Any]],
) -> tuple[Gimp.GroupLayer, list[Gimp.Layer]]:
    """Put a group of copies of the layers above a layer, in their places and with their masks."""
    group = Gimp.GroupLayer.new(image, _("Stitched"))
    image.insert_layer(group, above.get_parent(), image.get_item_position(above))
    undone.append(lambda: image.remove_layer(group))
    copies = [plain_copy(image, layer, group, 0) for layer in layers]
    for index, (layer, copy) in enumerate(zip(layers, copies, strict=True)):
        if answer.get("pixels") and answer["pixels"][index]:
            copy = copies[index] = pixels.replaced(folder, image, copy, answer["pixels"][index])
        if answer.get("places"):
            copy.set_offsets(*answer["places"][index])
        put_mask(folder, copy, answer["masks"][index])
        copy.set_name(_("{name} (stitched)").format(name=layer.get_name()))
    return group, copies


def _others(layers: Sequence[Gimp.Layer], used: Sequence[Gimp.Layer]) -> list[Gimp.Layer]:
    known = {layer.get_id() for layer in used}
    return [layer for layer in layers if layer.get_id() not in known]


def _tell(call: Call, layers: Sequence[Gimp.Layer], used: Sequence[Gimp.Layer], answer: Options) -> None:
    """Add remarks about the result to the call."""

    def named(numbers: Sequence[int]) -> str:
        return ", ".join(f"“{layers[number].get_name()}”" for number in numbers)

    if answer.get("strangers"):
        call.tell(
            _("Left out, since nothing that the other layers show can be seen there: {names}.").format(
                names=named(answer["strangers"])
            )
        )
    for group in answer.get("other_groups", ()):
        call.tell(
            _(
                "Left out, since they belong together but not to the others: {names}. Select them to join "
                "them on their own."
            ).format(names=named(group))
        )
    for doubt in answer.get("doubts", ()):
        call.tell(f"{doubt[0].upper()}{doubt[1:]}.")
    if noticed := answer.get("noticed"):
        (x, y), names = noticed["at"], named(noticed["between"])
        call.tell(
            _(
                "The seam between {names} may be noticed near {x},{y}, where guides cross; look there, and "
                "choose Paint Seam Hints if it shows."
            ).format(names=names, x=x, y=y)
        )
        if call.interactive:
            mark_place(call.image, (x, y))
    if answer.get("goes_round"):
        call.tell(
            _("The panorama goes all the way round; its left and right end show the same and are not joined.")
        )
    if not all(map(is_plain, used)):
        call.tell(_("The stitched copies are opaque and in Normal mode, unlike some of the layers."))
    if answer["hidden"]:
        call.tell(
            _(
                "Nothing shows of {names}: other layers cover it and join better without. “Stitch "
                "Selection as Patch” lays a layer on what is below."
            ).format(names=named(answer["hidden"]))
        )


def _hold_all(image: Gimp.Image, layers: Sequence[Gimp.Layer], undone: list[Callable[[], Any]]) -> None:
    """Enlarge the canvas to the right and downwards until it holds all layers."""
    width, height = image.get_width(), image.get_height()
    corners = [list(layer.get_offsets())[1:] for layer in layers]
    right = max(x + layer.get_width() for layer, (x, _y) in zip(layers, corners, strict=True))
    bottom = max(y + layer.get_height() for layer, (_x, y) in zip(layers, corners, strict=True))
    _resize(image, (max(width, right), max(height, bottom)), undone)


def _resize(image: Gimp.Image, size: Sequence[int], undone: list[Callable[[], Any]]) -> None:
    """Give the canvas another size; layers stay where they are."""
    before = image.get_width(), image.get_height()
    if before != tuple(size):
        image.resize(*size, 0, 0)
        undone.append(lambda: image.resize(*before, 0, 0))
