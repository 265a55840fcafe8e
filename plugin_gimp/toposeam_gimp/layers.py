"""Layers and paths of an image: which are meant, and how results are put beside them in one undo step."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from gi.repository import Gimp

from toposeam_gimp import curves
from toposeam_gimp.texts import _

#: Name of the parasite on a stitched group: its layers, and its seams exactly.
PARASITE = "toposeam-seam"
_PARASITE_VERSION = 1
_FLATNESS_PX = 0.1


class RefusedError(Exception):
    """The request makes no sense for this image; the text says what to do."""


def chosen_layers(image: Gimp.Image, drawables: Sequence[Gimp.Drawable]) -> list[Gimp.Layer]:
    """The selected drawables, which must be layers of an image that is not indexed."""
    if image.get_base_type() == Gimp.ImageBaseType.INDEXED:
        raise RefusedError(
            _("This image has a palette (Indexed mode), in which new colours cannot be mixed. Choose Image → Mode → RGB first.")
        )
    if not all(isinstance(drawable, Gimp.Layer) for drawable in drawables):
        raise RefusedError(_("A mask or channel is selected; click on the layers themselves in the Layers dialog."))
    return list(drawables)


def lowest_first(image: Gimp.Image, layers: Sequence[Gimp.Layer]) -> list[Gimp.Layer]:
    """Layers in the order of the stack, from below; a group together with what is in it is refused."""
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
def one_undo_step(image: Gimp.Image) -> Iterator[list[Callable[[], Any]]]:
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


def insert_copy(image: Gimp.Image, layer: Gimp.Layer, parent: Gimp.Layer | None, position: int) -> Gimp.Layer:
    """A visible copy of a layer with transparency, its own mask applied, nothing locked."""
    copy = layer.copy()
    for unlock in (copy.set_lock_content, copy.set_lock_position, copy.set_lock_visibility, copy.set_lock_alpha):
        unlock(False)
    image.insert_layer(copy, parent, position)
    if copy.get_mask() is not None:
        copy.remove_mask(Gimp.MaskApplyMode.APPLY if copy.get_apply_mask() else Gimp.MaskApplyMode.DISCARD)
    if not copy.has_alpha() and not copy.is_group():
        copy.add_alpha()
    copy.set_visible(True)
    return copy


def draw_seam(image: Gimp.Image, seam: dict[str, Any], *, visible: bool) -> tuple[Gimp.Path, dict[str, Any]]:
    """A GIMP path for a seam, and what has to be remembered of it."""
    path = Gimp.Path.new(image, _("Seam {name}").format(name=seam["name"]))
    image.insert_path(path, None, 0)
    for line in seam["lines"]:
        path.stroke_new_from_points(Gimp.PathStrokeType.BEZIER, curves.to_stroke(line["editable"]), line["closed"])
    path.set_visible(visible)
    lines = [
        {"stroke": stroke, "closed": closed, "points": line["points"]}
        for (stroke, closed, _flat), line in zip(strokes_of(path), seam["lines"], strict=True)
    ]
    return path, {"name": path.get_name(), "path": path.get_tattoo(), "pair": seam["pair"], "lines": lines}


def strokes_of(path: Gimp.Path) -> Iterator[tuple[list[float], bool, list[float]]]:
    """Control points, whether it is closed, and the flattened line of each stroke of a path."""
    for stroke in path.get_strokes():
        _kind, points, closed = path.stroke_get_points(stroke)
        flattened, _closed = path.stroke_interpolate(stroke, _FLATNESS_PX)
        yield list(points), closed, list(flattened)


def remember(
    group: Gimp.GroupLayer,
    layers: Sequence[Gimp.Layer],
    seams: Sequence[dict[str, Any]],
    blended: Gimp.Layer | None,
    options: dict[str, Any],
) -> None:
    """Attach to a stitched group what Re-stitch from Paths needs; it is saved with the file."""
    tattoos = {"layers": [layer.get_tattoo() for layer in layers], "blended": None if blended is None else blended.get_tattoo()}
    memory = {"version": _PARASITE_VERSION, **tattoos, "seams": seams, "options": options}
    flags = Gimp.PARASITE_PERSISTENT | Gimp.PARASITE_UNDOABLE
    group.attach_parasite(Gimp.Parasite.new(PARASITE, flags, list(json.dumps(memory, separators=(",", ":")).encode())))


def stitched_group(layers: Sequence[Gimp.Layer]) -> tuple[Gimp.GroupLayer, dict[str, Any]]:
    """The stitched group that is meant by the selected layers, and what it remembers."""
    for layer in layers:
        item = layer
        while item is not None:
            parasite = item.get_parasite(PARASITE)
            if parasite is not None:
                return item, _memory(parasite)
            item = item.get_parent()
    raise RefusedError(_("Select a group that Stitch Layers has made (or a layer in it), then choose Re-stitch from Paths again."))


def _memory(parasite: Gimp.Parasite) -> dict[str, Any]:
    try:
        memory: dict[str, Any] = json.loads(bytes(parasite.get_data()))
        if memory["version"] == _PARASITE_VERSION:
            return memory
    except (ValueError, KeyError, TypeError):
        pass
    raise RefusedError(_("This group was stitched by another version of TopoSeam; stitch its layers again."))
