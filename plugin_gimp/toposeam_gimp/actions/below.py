"""The visible image below a layer."""

from __future__ import annotations

from typing import Any

from gi.repository import Gimp

from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import RefusedError
from toposeam_gimp.texts import _

#: Width of the ground beside the patch that the seam needs, px.
_MARGIN_PX = 2


def picture_below(
    folder: RequestFolder, image: Gimp.Image, layer: Gimp.Layer, box: tuple[int, int, int, int]
) -> dict[str, Any]:
    """Write the visible image below a layer, within a box of the canvas and a margin; return its description
    for a request.
    """
    x, y, width, height = box
    left, top = max(x - _MARGIN_PX, 0), max(y - _MARGIN_PX, 0)
    right, bottom = (
        min(x + width + _MARGIN_PX, image.get_width()),
        min(y + height + _MARGIN_PX, image.get_height()),
    )
    if right <= left or bottom <= top:
        raise RefusedError(
            _("“{name}” lies outside the canvas; move it onto the picture it shall be joined to.").format(
                name=layer.get_name()
            )
        )
    way = _way_to(image, layer)
    scratch = image.duplicate()
    try:
        floating = scratch.get_floating_sel()
        if floating is not None:
            Gimp.floating_sel_remove(floating)
        else:
            level = scratch.get_layers()
            for place in way:
                for above in level[:place]:
                    above.set_visible(False)
                last = level[place]
                level = last.get_children() if last.is_group() else []
            last.set_visible(False)
        scratch.crop(right - left, bottom - top, left, top)
        seen = Gimp.Layer.new_from_visible(scratch, scratch, _("picture below"))
        check_something(seen)
        raster = pixels.send_whole(folder, image, seen, "below")
    finally:
        scratch.delete()
    return {**raster, "at": [left, top]}


def check_something(seen: Gimp.Layer, box: pixels.Box | None = None) -> None:
    """Refuse a picture below that shows nothing, at all or within a box."""
    if not pixels.shows(seen, box):
        raise RefusedError(
            _("Nothing lies below this layer; put it above the picture that it shall be laid on.")
        )


def _way_to(image: Gimp.Image, layer: Gimp.Layer) -> list[int]:
    """Return the positions from the image's uppermost level down to a layer."""
    way: list[int] = []
    item: Gimp.Item | None = layer
    while item is not None:
        way.insert(0, image.get_item_position(item))
        item = item.get_parent()
    return way
