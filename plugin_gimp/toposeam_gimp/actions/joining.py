"""Steps of all entries that join layers: the request, masks, paths, and the layer of blended pixels."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.engine.process import begin
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import draw_seam

Options = dict[str, Any]


@contextmanager
def request_of(
    image: Gimp.Image, layers: Sequence[Gimp.Layer], *, with_masks: bool = True, of: str = ""
) -> Iterator[tuple[RequestFolder, list[dict[str, Any]]]]:
    """Open a request's folder, start the engine, and write the layers' pixels; yield the folder and their
    descriptions.
    """
    with RequestFolder(needed=2 * sum(pixels.size_of(image, layer) for layer in layers)) as folder:
        begin(folder, of)
        yield (
            folder,
            [
                pixels.send_whole(folder, image, layer, f"layer-{index}", with_mask=with_masks)
                for index, layer in enumerate(layers)
            ],
        )


def put_mask(folder: RequestFolder, layer: Gimp.Layer, raster: dict[str, Any] | None) -> None:
    """Give a layer a new mask in place of the one it may have, or none."""
    mask = None if raster is None else pixels.new_mask(folder, raster, layer)
    if layer.get_mask() is not None:
        layer.remove_mask(Gimp.MaskApplyMode.DISCARD)
    if mask is not None:
        layer.add_mask(mask)
        layer.set_edit_mask(False)


def put_pixels(
    folder: RequestFolder, image: Gimp.Image, under: Gimp.Layer, name: str, raster: Options | None
) -> Gimp.Layer | None:
    """Add a layer of what blending has changed, or of what was filled, if there is any, on top of a group or
    right above a layer.
    """
    if raster is None:
        return None
    layer = pixels.new_layer(image, name, raster)
    parent, position = (
        (under, 0) if under.is_group() else (under.get_parent(), image.get_item_position(under))
    )
    image.insert_layer(layer, parent, position)
    layer.set_offsets(*raster["at"])
    pixels.receive_colors(folder, layer, raster)
    return layer


def draw_seams(
    image: Gimp.Image, seams: Sequence[Options], undone: list[Callable[[], Any]], *, visible: bool
) -> list[dict[str, Any]]:
    """Draw the paths of all seams and select them; return the record of each."""
    paths, memories = [], []
    for seam in seams:
        path, memory = draw_seam(image, seam, visible=visible)
        undone.append(partial(image.remove_path, path))
        paths.append(path)
        memories.append(memory)
    image.set_selected_paths(paths)
    return memories
