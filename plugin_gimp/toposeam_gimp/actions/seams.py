"""Stitch Layers, Re-stitch from Paths, Stitch Selection as Patch: ask the engine, and only when it has
answered change the image.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.actions.below import picture_below
from toposeam_gimp.engine import process as engine
from toposeam_gimp.engine.call import Call, renamed
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import path_choice as choosing
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import (
    RefusedError,
    check_selection,
    chosen_layers,
    draw_seam,
    lines_to_apply,
    lowest_first,
    one_undo_step,
    other_paths,
    remember,
    stitched_group,
)
from toposeam_gimp.image.seen import is_plain, plain_copy
from toposeam_gimp.texts import _

Options = dict[str, Any]


def stitch_layers(call: Call) -> Gimp.Layer:
    """Stitch two or more layers into a group with masks and paths."""
    image, options = call.image, call.options
    layers = lowest_first(image, chosen_layers(image, call.drawables))
    if len(layers) < 2:
        raise RefusedError(
            _(
                "Stitching needs two or more layers; select them in the Layers dialog (Ctrl-click) and try "
                "again."
            )
        )
    check_selection(image, options)
    with _request(image, layers) as (folder, rasters):
        request = {
            "layers": rasters,
            "selection": pixels.send_selection(folder, image),
            "options": call.for_engine,
        }
        answer = engine.ask(folder, {"operation": "stitch", **request}, Gimp.progress_update)
        with one_undo_step(image) as undone:
            parent, position = layers[-1].get_parent(), image.get_item_position(layers[-1])
            group = Gimp.GroupLayer.new(image, _("Stitched"))
            image.insert_layer(group, parent, position)
            undone.append(lambda: image.remove_layer(group))
            copies = [plain_copy(image, layer, group, 0) for layer in layers]
            for index, (layer, copy) in enumerate(zip(layers, copies, strict=True)):
                if answer.get("pixels") and answer["pixels"][index]:
                    copy = copies[index] = pixels.replaced(folder, image, copy, answer["pixels"][index])
                if answer.get("places"):
                    copy.set_offsets(*answer["places"][index])
                _put_mask(folder, copy, answer["masks"][index])
                copy.set_name(layer.get_name())
            if options["places"] == "anywhere":
                _hold_all(image, copies, undone)
            blended = _put_blended(folder, image, group, answer)
            seams = _draw_seams(call, answer, undone)
            remember(
                "group",
                group,
                copies,
                seams,
                blended,
                {name: options[name] for name in ("blend", "blend-width")},
            )
            for layer in layers if options["keep-layers"] else ():
                undone.append(partial(layer.set_visible, layer.get_visible()))
                layer.set_visible(False)
            if not all(map(is_plain, layers)):
                call.tell(_("The stitched copies are opaque and in Normal mode, unlike some of the layers."))
            if answer["hidden"]:
                names = ", ".join(f"“{layers[index].get_name()}”" for index in answer["hidden"])
                call.tell(
                    _(
                        "Nothing shows of {names}: other layers cover it and join better without. “Stitch "
                        "Selection as Patch” lays a layer on what is below."
                    ).format(names=names)
                )
            result = group.merge() if options["merge"] else group
            for layer in () if options["keep-layers"] else layers:
                image.remove_layer(layer)
            image.set_selected_layers([result])
    return result


def _hold_all(image: Gimp.Image, layers: Sequence[Gimp.Layer], undone: list[Callable[[], Any]]) -> None:
    """Let the canvas grow to the right and downwards until it holds all layers."""
    width, height = image.get_width(), image.get_height()
    corners = [list(layer.get_offsets())[1:] for layer in layers]
    right = max(x + layer.get_width() for layer, (x, _y) in zip(layers, corners, strict=True))
    bottom = max(y + layer.get_height() for layer, (_x, y) in zip(layers, corners, strict=True))
    if right > width or bottom > height:
        image.resize(max(width, right), max(height, bottom), 0, 0)
        undone.append(lambda: image.resize(width, height, 0, 0))


def restitch(call: Call) -> Gimp.Layer:
    """Return the masks of a stitched group, or of a patch, made anew from its paths."""
    image = call.image
    group, memory = stitched_group(chosen_layers(image, call.drawables))
    layers = [image.get_layer_by_tattoo(tattoo) for tattoo in memory["layers"]]
    if any(layer is None for layer in layers):
        raise RefusedError(_("A layer of this group was deleted or merged; stitch the layers again."))
    seams = _seams_to_apply(call, memory["seams"])
    with _request(image, layers, with_masks=False) as (folder, rasters):
        if memory["kind"] == "patch":
            rasters.insert(0, picture_below(folder, image, layers[0], pixels.box_of(rasters[0])))
            shown = []
        else:
            shown = [pixels.send_mask(folder, layer, f"shown-{index}") for index, layer in enumerate(layers)]
        request = {"layers": rasters, "shown": shown, "seams": seams, "options": renamed(memory["options"])}
        answer = engine.ask(folder, {"operation": "restitch", **request}, Gimp.progress_update)
        masks = answer["masks"][-len(layers) :]
        with one_undo_step(image):
            for layer, mask in zip(layers, masks, strict=True):
                _put_mask(folder, layer, mask)
            old = memory["blended"] and image.get_layer_by_tattoo(memory["blended"])
            if old:
                image.remove_layer(old)
            blended = _put_blended(folder, image, group, answer)
            remember(memory["kind"], group, layers, memory["seams"], blended, memory["options"])
            image.set_selected_layers([group])
    return group


def patch_selection(call: Call) -> Gimp.Layer:
    """Return the selected part of a layer, or a floating selection, laid on what is below it within a closed
    seam.
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
        request = {"layers": [below, patch], "selection": selection, "options": call.for_engine}
        answer = engine.ask(folder, {"operation": "patch", **request}, Gimp.progress_update)
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
            _put_mask(folder, result, answer["masks"][1])
            blended = _put_blended(folder, image, result, answer)
            if blended is not None:
                undone.append(lambda: image.remove_layer(blended))
            seams = _draw_seams(call, answer, undone)
            kept = {name: options[name] for name in ("blend", "blend-width")}
            remember("patch", result, [result], seams, blended, kept)
            image.set_selected_layers([result])
    return result


def _draw_seams(call: Call, answer: Options, undone: list[Callable[[], Any]]) -> list[dict[str, Any]]:
    """Return the paths of all seams, those to bend selected; what has to be remembered of them."""
    seams, to_bend = [], []
    for seam in answer["seams"]:
        paths, memory = draw_seam(call.image, seam, visible=call.options["show-seam"])
        undone += [partial(call.image.remove_path, path) for path in paths]
        seams.append(memory)
        to_bend.append(paths[0])
    call.image.set_selected_paths(to_bend)
    return seams


def _seams_to_apply(call: Call, seams: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return each seam with the lines that the image's paths say for it."""
    image = call.image
    others = other_paths(image, seams)
    selected = {path.get_id() for path in image.get_selected_paths()}
    applied, used = [], set()
    for seam in seams:
        fitting = [
            path
            for path in others
            if choosing.fits(path.get_name(), seam["name"])
            or (len(seams) == 1 and (path.get_id() in selected or choosing.is_seam(path.get_name())))
        ]
        used |= {path.get_id() for path in fitting}
        lines, touched, remark = lines_to_apply(image, seam, fitting)
        if remark is not None:
            call.tell(remark)
        applied.append({"pair": seam["pair"], "name": seam["name"], "lines": lines, "touched": touched})
    for path in others:
        if path.get_id() in selected and path.get_id() not in used:
            raise RefusedError(
                _(
                    "It is not clear which seam the selected path “{path}” is for; give it the name of one: "
                    "{seams}."
                ).format(path=path.get_name(), seams=", ".join(f"“{seam['name']}”" for seam in seams))
            )
    return applied


@contextmanager
def _request(
    image: Gimp.Image, layers: Sequence[Gimp.Layer], *, with_masks: bool = True
) -> Iterator[tuple[RequestFolder, list[dict[str, Any]]]]:
    """Open a folder that holds the layers' pixels, and what describes them."""
    with RequestFolder(needed=2 * sum(pixels.size_of(image, layer) for layer in layers)) as folder:
        yield (
            folder,
            [
                pixels.send_whole(folder, image, layer, f"layer-{index}", with_mask=with_masks)
                for index, layer in enumerate(layers)
            ],
        )


def _put_mask(folder: RequestFolder, layer: Gimp.Layer, raster: dict[str, Any]) -> None:
    """Give a layer a new mask in place of the one it may have."""
    mask = pixels.new_mask(folder, raster, layer)
    if layer.get_mask() is not None:
        layer.remove_mask(Gimp.MaskApplyMode.DISCARD)
    layer.add_mask(mask)
    layer.set_edit_mask(False)


def _put_blended(
    folder: RequestFolder, image: Gimp.Image, under: Gimp.Layer, answer: Options
) -> Gimp.Layer | None:
    """Add a layer of what blending has changed, on top of a group or right above a layer."""
    if answer.get("blended") is None:
        return None
    layer = pixels.new_layer(image, _("Blended seams"), answer["blended"])
    parent, position = (
        (under, 0) if under.is_group() else (under.get_parent(), image.get_item_position(under))
    )
    image.insert_layer(layer, parent, position)
    layer.set_offsets(*answer["blended"]["at"])
    pixels.receive_colors(folder, image, layer, answer["blended"])
    return layer
