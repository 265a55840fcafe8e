"""Re-stitch: seams follow bent paths, strokes, and painted masks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.actions.below import picture_below
from toposeam_gimp.actions.joining import draw_seams, put_mask, put_mask_part, put_pixels, request_of
from toposeam_gimp.actions.windows import window_of
from toposeam_gimp.engine.call import Call, renamed
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.engine.process import keep
from toposeam_gimp.image import curves, hints, pixels
from toposeam_gimp.image import path_choice as choosing
from toposeam_gimp.image.layers import (
    RefusedError,
    chosen_layers,
    lines_to_apply,
    one_undo_step,
    other_paths,
    remember,
    send_shown,
    stitched_group,
    sums_of,
    under_masks,
)
from toposeam_gimp.texts import _


def restitch(call: Call) -> Gimp.Layer:
    """Update a stitched group, or a patch, so that its seams follow its paths, the strokes of its hints, and
    its painted masks. Strokes are hidden then, but for somebody who goes on painting (option "painting"); a
    mask that is selected stays so. With the option "news-only" nothing happens if the strokes are as they
    were.
    """
    image = call.image
    selected = chosen_layers(image, under_masks(call.drawables))
    group, memory = stitched_group(image, selected)
    layers, strokes = layers_of(image, memory), hints.hints_of(image, memory)
    now: dict[str, Any] = {"masks": sums_of(layers), "strokes": pixels.tile_sums(strokes)}
    if call.options.get("news-only") and now["strokes"] == memory.get("strokes", {}):
        return group
    applied = _seams_to_apply(call, memory["seams"])
    bent = any(seam["touched"] for seam in applied)
    window = None if bent else window_of(layers, strokes, memory, now)
    for part in (window, None) if window else (None,):
        sent = part and part.sent
        with joined_again(call, group, layers, memory, now["masks"], sent) as (folder, known):
            before, rasters = memory.get("strokes", {}), known["layers"]
            request = {
                **known,
                "within": part and part.within,
                "hints": pixels.send_strokes(folder, strokes, now["strokes"], sent),
                "news": strokes and pixels.changed_box(strokes, before, now["strokes"]),
                "colours": hints.colours_in(image)[: len(rasters)],
                "seams": applied,
            }
            answer = call.ask(folder, {"operation": "restitch", **request})
            if answer.get("again"):
                continue
            with one_undo_step(image) as undone:
                blended = _put(folder, call, group, layers, memory, answer, sent, now["masks"])
                seams = memory["seams"]
                if answer["seams"] is not None:
                    seams = _redrawn(call, seams, answer["seams"], undone)
                paints = strokes is not None and strokes.get_id() in {layer.get_id() for layer in selected}
                if strokes is not None and not call.options.get("painting"):
                    hints.hide_reach(image, strokes)
                    strokes.set_visible(False)
                if answer["hints"] is not None:
                    if strokes is None:
                        call.tell(
                            _("What you painted on masks is kept as strokes on the layer “Seam hints”.")
                        )
                    strokes = hints.replace_hints(folder, image, group, strokes, answer["hints"], layers)
                    now["strokes"] = pixels.tile_sums(strokes)
                now["masks"] = sums_of(layers, now["masks"] if sent else None, sent)
                names = names_of(memory, layers)
                about = {"kind": memory["kind"], "options": memory["options"], "names": names, **now}
                remember(folder, group, layers, seams, blended, about, answer, strokes)
                _select_again(call, strokes if paints else group)
            _tell_beyond(call, [raster["name"] for raster in rasters], answer["beyond"])
            break
    keep()
    return group


@contextmanager
def joined_again(
    call: Call,
    group: Gimp.Layer,
    layers: Sequence[Gimp.Layer],
    memory: Mapping[str, Any],
    sums: Sequence[Any],
    window: pixels.Box | None = None,
) -> Iterator[tuple[RequestFolder, dict[str, Any]]]:
    """Open a request's folder and write what is known of a stitched group, perhaps within a window of the
    canvas; yield the folder and the request. `sums` holds the checksums of the masks.
    """
    image = call.image
    with request_of(image, layers, with_masks=False, of="restitch", window=window) as (folder, rasters):
        for raster, name in zip(rasters, names_of(memory, layers), strict=True):
            raster["name"] = name
        shown = [pixels.send_mask(folder, layer, f"shown-{n}", window) for n, layer in enumerate(layers)]
        if memory["kind"] == "patch":
            rasters.insert(0, picture_below(folder, image, layers[0], pixels.box_of(rasters[0])))
            shown.insert(0, None)
        about = {"masks_kept": memory["masks"] == sums, "written": send_shown(folder, group, memory)}
        yield (
            folder,
            {"layers": rasters, "shown": shown, **about, "seams": [], "options": renamed(memory["options"])},
        )


def names_of(memory: Mapping[str, Any], layers: Sequence[Gimp.Layer]) -> list[str]:
    """Return the names that the layers had before they were joined."""
    names = list(memory.get("names") or [])
    return names if len(names) == len(layers) else [layer.get_name() for layer in layers]


def _put(
    folder: RequestFolder,
    call: Call,
    group: Gimp.Layer,
    layers: Sequence[Gimp.Layer],
    memory: Mapping[str, Any],
    answer: Mapping[str, Any],
    sent: pixels.Box | None,
    sums: Sequence[Any],
) -> Gimp.Layer | None:
    """Give the layers of a group their new masks, and it its blended pixels; or those within the box of the
    canvas that was sent. `sums` holds the checksums of the old masks. Return the layer of blended pixels, if
    there is one.
    """
    for layer, mask, old_mask in zip(layers, answer["masks"][-len(layers) :], sums, strict=True):
        box = pixels.common(pixels.layer_box(layer), sent)
        if sent is None:
            put_mask(folder, layer, mask)
        elif box is not None:
            put_mask_part(folder, layer, mask, box, old_mask[2])
    old = memory["blended"] and call.image.get_layer_by_tattoo(memory["blended"])
    if sent is None and old:
        call.image.remove_layer(old)
        old = None
    name = _("Blended seams")
    return put_pixels(folder, call.image, group, name, answer.get("blended"), old) or old or None


def _select_again(call: Call, usual: Gimp.Layer) -> None:
    """Select the layers whose masks were selected, and these masks; or another layer if there were none."""
    painted = [
        layer
        for layer, drawable in zip(under_masks(call.drawables), call.drawables, strict=True)
        if layer is not drawable and layer.get_mask() is not None
    ]
    call.image.set_selected_layers(painted or [usual])
    for layer in painted:
        layer.set_edit_mask(True)


def _tell_beyond(call: Call, names: Sequence[str], beyond: Sequence[int]) -> None:
    """Say where strokes ask for a layer that has no pixels there."""
    lost = [f"“{name}”" for name, count in zip(names, beyond, strict=True) if count]
    if lost:
        call.tell(
            _(
                "A part of your strokes lies where {names} has no pixels, so something else shows there; "
                "Paint Seam Hints outlines how far each layer reaches."
            ).format(names=", ".join(lost))
        )


def layers_of(image: Gimp.Image, memory: Mapping[str, Any]) -> list[Gimp.Layer]:
    """Return the layers of a stitched group by its record, the lowest first."""
    layers = [image.get_layer_by_tattoo(tattoo) for tattoo in memory["layers"]]
    if any(layer is None for layer in layers):
        raise RefusedError(_("A layer of this group was deleted or merged; stitch the layers again."))
    return layers


def _redrawn(
    call: Call, before: Sequence[dict[str, Any]], seams: Sequence[dict[str, Any]], undone: list[Any]
) -> list[dict[str, Any]]:
    """Draw new seams and remove the old ones."""
    paths = [path for seam in before if (path := call.image.get_path_by_tattoo(seam["path"])) is not None]
    visible = any(path.get_visible() for path in paths)
    for path in paths:
        call.image.remove_path(path)
    return draw_seams(call.image, seams, undone, visible=visible)


def _seams_to_apply(call: Call, seams: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return each seam with the lines of the image's paths, its record, and a note whether they differ from
    it.
    """
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
        # It also changes where a path was bent back, or another one took its place.
        changes = touched or seam.get("applied", False)
        seam["applied"] = touched
        known = [
            {**line, "curves": curves.curves_of(line["stroke"], line["closed"])} for line in seam["lines"]
        ]
        about = {"pair": seam["pair"], "name": seam["name"], "known": known}
        applied.append({**about, "lines": lines, "touched": changes})
    for path in others:
        if path.get_id() in selected and path.get_id() not in used:
            raise RefusedError(
                _(
                    "It is not clear which seam the selected path “{path}” is for; give it the name of one: "
                    "{seams}."
                ).format(path=path.get_name(), seams=", ".join(f"“{seam['name']}”" for seam in seams))
            )
    return applied
