"""What each menu entry does: read layers, ask the engine, and only when it has answered change the image, in one undo step."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from gi.repository import Gimp

from toposeam_gimp import curves, engine, pixels
from toposeam_gimp.folder import RequestFolder
from toposeam_gimp.procedures import Procedure
from toposeam_gimp.texts import _

#: Name of the parasite on a stitched group: how it was made, and its seams exactly.
PARASITE = "toposeam-seam"
_PARASITE_VERSION = 1
_FLATNESS_PX = 0.1


class RefusedError(Exception):
    """The request makes no sense for this image; the text says what to do."""


def stitch_layers(image: Gimp.Image, drawables: Sequence[Gimp.Drawable], options: dict[str, Any], entry: Procedure) -> Gimp.Layer:
    """Two or more layers into a group with masks and paths."""
    layers = _lowest_first(image, _as_layers(image, drawables))
    if len(layers) < 2:
        raise RefusedError(_("Stitching needs two or more layers; select them in the Layers dialog (Ctrl-click) and try again."))
    with _request(image, layers) as (folder, rasters):
        request = {
            "operation": "stitch",
            "layers": rasters,
            "selection": pixels.send_selection(folder, image),
            "options": _for_engine(entry, options),
        }
        answer = engine.ask(folder, request, Gimp.progress_update)
        with _one_undo_step(image) as undone:
            parent, position = layers[-1].get_parent(), image.get_item_position(layers[-1])
            group = Gimp.GroupLayer.new(image, _("Stitched"))
            image.insert_layer(group, parent, position)
            undone.append(lambda: image.remove_layer(group))
            copies = [_copy(image, layer, group) for layer in layers]
            for layer, copy, mask in zip(layers, copies, answer["masks"], strict=True):
                copy.add_mask(pixels.new_mask(folder, mask, copy))
                copy.set_edit_mask(False)
                copy.set_name(layer.get_name())
            records = []
            for seam in answer["seams"]:
                path, record = _draw(image, seam, visible=options["show-seam"])
                undone.append(lambda path=path: image.remove_path(path))
                records.append(record)
            _remember(group, copies, records)
            for layer in layers:
                if options["keep-layers"]:
                    layer.set_visible(False)
                    undone.append(lambda layer=layer: layer.set_visible(True))
            result = group.merge() if options["merge"] else group
            if not options["keep-layers"]:
                for layer in layers:
                    image.remove_layer(layer)
            image.set_selected_layers([result])
    return result


def restitch(image: Gimp.Image, drawables: Sequence[Gimp.Drawable], _options: dict[str, Any], _entry: Procedure) -> Gimp.Layer:
    """The masks of a stitched group made anew from its paths."""
    group, memory = _stitched_group(image, _as_layers(image, drawables))
    layers = [image.get_layer_by_tattoo(tattoo) for tattoo in memory["layers"]]
    if any(layer is None for layer in layers):
        raise RefusedError(_("A layer of this group was deleted or merged; stitch the layers again."))
    seams = []
    for seam in memory["seams"]:
        path = image.get_path_by_tattoo(seam["path"]) or image.get_path_by_name(seam["name"])
        if path is None:
            raise RefusedError(_("The path “{name}” is gone; undo its deletion, or stitch the layers again.").format(name=seam["name"]))
        lines = curves.lines_of(_strokes(path), seam["lines"])
        if not lines:
            raise RefusedError(
                _("The path “{name}” is empty; draw the seam from border to border of the overlap.").format(name=path.get_name())
            )
        seams.append({**seam, "lines": lines})
    with _request(image, layers, with_masks=False) as (folder, rasters):
        answer = engine.ask(folder, {"operation": "stitch", "layers": rasters, "seams": seams}, Gimp.progress_update)
        with _one_undo_step(image):
            for layer, raster in zip(layers, answer["masks"], strict=True):
                mask = pixels.new_mask(folder, raster, layer)
                if layer.get_mask() is not None:
                    layer.remove_mask(Gimp.MaskApplyMode.DISCARD)
                layer.add_mask(mask)
                layer.set_edit_mask(False)
    return group


def _as_layers(image: Gimp.Image, drawables: Sequence[Gimp.Drawable]) -> list[Gimp.Layer]:
    """The selected drawables, which must be layers of an image that is not indexed."""
    if image.get_base_type() == Gimp.ImageBaseType.INDEXED:
        raise RefusedError(
            _("This image has a palette (Indexed mode), in which new colours cannot be mixed. Choose Image → Mode → RGB first.")
        )
    if not all(isinstance(drawable, Gimp.Layer) for drawable in drawables):
        raise RefusedError(_("A mask or channel is selected; click on the layers themselves in the Layers dialog."))
    return list(drawables)


def _lowest_first(image: Gimp.Image, layers: Sequence[Gimp.Layer]) -> list[Gimp.Layer]:
    chosen = {layer.get_id() for layer in layers}
    ordered: list[Gimp.Layer] = []

    def visit(level: Sequence[Gimp.Layer], inside: bool) -> None:
        for layer in level:
            picked = layer.get_id() in chosen
            if picked and inside:
                raise RefusedError(
                    _("“{name}” is inside a group that is selected too; select either of them.").format(name=layer.get_name())
                )
            if picked:
                ordered.append(layer)
            if layer.is_group():
                visit(layer.get_children(), inside or picked)

    visit(image.get_layers(), False)
    return ordered[::-1]


@contextmanager
def _request(
    image: Gimp.Image, layers: Sequence[Gimp.Layer], *, with_masks: bool = True
) -> Iterator[tuple[RequestFolder, list[dict[str, Any]]]]:
    """A folder that holds the layers' pixels, and what describes them."""
    with RequestFolder(needed=2 * sum(pixels.size_of(image, layer) for layer in layers)) as folder:
        rasters = [pixels.send_layer(folder, image, layer, f"layer-{index}", with_masks) for index, layer in enumerate(layers)]
        yield folder, rasters


@contextmanager
def _one_undo_step(image: Gimp.Image) -> Iterator[list[Callable[[], Any]]]:
    """Everything within is one step of the undo history; if it fails, what was put on the list is called, last first."""
    undone: list[Callable[[], Any]] = []
    image.undo_group_start()
    try:
        yield undone
    except BaseException:
        for step in reversed(undone):
            step()
        raise
    finally:
        image.undo_group_end()


def _for_engine(entry: Procedure, options: dict[str, Any]) -> dict[str, Any]:
    return {option.name.replace("-", "_"): options[option.name] for option in entry.options if option.engine}


def _copy(image: Gimp.Image, layer: Gimp.Layer, group: Gimp.GroupLayer) -> Gimp.Layer:
    """A visible copy of a layer on top of a group, its mask applied, nothing locked."""
    copy = layer.copy()
    for unlock in (copy.set_lock_content, copy.set_lock_position, copy.set_lock_visibility, copy.set_lock_alpha):
        unlock(False)
    image.insert_layer(copy, group, 0)
    if copy.get_mask() is not None:
        copy.remove_mask(Gimp.MaskApplyMode.APPLY if copy.get_apply_mask() else Gimp.MaskApplyMode.DISCARD)
    if not copy.has_alpha() and not copy.is_group():
        copy.add_alpha()
    copy.set_visible(True)
    return copy


def _draw(image: Gimp.Image, seam: dict[str, Any], *, visible: bool) -> tuple[Gimp.Path, dict[str, Any]]:
    """A GIMP path for a seam, and what has to be remembered of it."""
    path = Gimp.Path.new(image, _("Seam of {name}").format(name=seam["name"]))
    image.insert_path(path, None, 0)
    for line in seam["lines"]:
        path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, curves.to_stroke(line["editable"]), line["closed"])
    path.set_visible(visible)
    lines = [
        {"stroke": stroke, "closed": closed, "points": line["points"]}
        for (stroke, closed, _flat), line in zip(_strokes(path), seam["lines"], strict=True)
    ]
    return path, {"name": path.get_name(), "path": path.get_tattoo(), "lines": lines}


def _strokes(path: Gimp.Path) -> Iterator[tuple[list[float], bool, list[float]]]:
    """Control points, whether it is closed, and the flattened line of each stroke of a path."""
    for stroke in path.get_strokes():
        _kind, points, closed = path.stroke_get_points(stroke)
        flattened, _closed = path.stroke_interpolate(stroke, _FLATNESS_PX)
        yield list(points), closed, list(flattened)


def _remember(group: Gimp.GroupLayer, layers: Sequence[Gimp.Layer], seams: Sequence[dict[str, Any]]) -> None:
    memory = {"version": _PARASITE_VERSION, "layers": [layer.get_tattoo() for layer in layers], "seams": seams}
    flags = Gimp.PARASITE_PERSISTENT | Gimp.PARASITE_UNDOABLE
    group.attach_parasite(Gimp.Parasite.new(PARASITE, flags, list(json.dumps(memory, separators=(",", ":")).encode())))


def _stitched_group(image: Gimp.Image, layers: Sequence[Gimp.Layer]) -> tuple[Gimp.GroupLayer, dict[str, Any]]:
    """The stitched group that is meant by the selected layers, and what it remembers."""
    for layer in layers:
        item = layer
        while item is not None:
            parasite = item.get_parasite(PARASITE)
            if parasite is not None:
                try:
                    memory = json.loads(bytes(parasite.get_data()))
                    if memory["version"] == _PARASITE_VERSION:
                        return item, memory
                except (ValueError, KeyError, TypeError):
                    pass
                raise RefusedError(_("This group was stitched by another version of TopoSeam; stitch its layers again."))
            item = item.get_parent()
    raise RefusedError(_("Select a group that Stitch Layers has made (or a layer in it), then choose Re-stitch from Paths again."))
