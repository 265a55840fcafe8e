"""Steps of all entries that join layers: the request, masks, paths, and the layer of blended pixels."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

from gi.repository import Gegl, Gimp

from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.engine.process import begin
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import draw_seam

Options = dict[str, Any]
#: Bytes of a pixel of four floats.
_WIDEST_PIXEL = 16


@contextmanager
def request_of(
    image: Gimp.Image,
    layers: Sequence[Gimp.Layer],
    *,
    with_masks: bool = True,
    of: str = "",
    window: pixels.Box | None = None,
) -> Iterator[tuple[RequestFolder, list[dict[str, Any]]]]:
    """Open a request's folder, start the engine, and write the layers' pixels, perhaps those within a window
    of the canvas; yield the folder and their descriptions.
    """
    needed = 2 * sum(pixels.size_of(image, layer) for layer in layers)
    if window is not None:
        needed = min(needed, 2 * len(layers) * _WIDEST_PIXEL * window[2] * window[3])
    with RequestFolder(needed=needed) as folder:
        begin(folder, of)
        yield (
            folder,
            [
                pixels.send_layer(folder, image, layer, f"layer-{index}", with_mask=with_masks, box=window)
                or pixels.send_nothing(folder, image, f"layer-{index}", window or (0, 0, 1, 1))
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


def put_mask_part(
    folder: RequestFolder, layer: Gimp.Layer, raster: Options, box: pixels.Box, tiles: Iterable[str]
) -> None:
    """Give a layer a new mask that differs from the one it may have in a box of the canvas. That one has
    pixels that are not white in some tiles.
    """
    (left, top), old = pixels.place_of(layer), layer.get_mask()
    at, name = (box[0] - left, box[1] - top), pixels.Format.MASK_U8.value
    content, place = (folder.path / raster["file"]).read_bytes(), Gegl.Rectangle.new(*at, *box[2:])
    before = old and old.get_buffer().get(place, 1.0, name, Gegl.AbyssPolicy.NONE)
    if content == (before or bytes([255]) * len(content)):
        return
    mask = layer.create_mask(Gimp.AddMaskType.WHITE)
    pixels.receive_onto(folder, raster, mask, name, at, old, tiles=tiles)
    if old is not None:
        layer.remove_mask(Gimp.MaskApplyMode.DISCARD)
    layer.add_mask(mask)
    layer.set_edit_mask(False)


def put_pixels(
    folder: RequestFolder,
    image: Gimp.Image,
    under: Gimp.Layer,
    name: str,
    raster: Options | None,
    old: Gimp.Layer | None = None,
) -> Gimp.Layer | None:
    """Add a layer of what blending has changed, or of what was filled, if there is any, on top of a group or
    right above a layer; with an old layer, the raster is what changes in it.
    """
    if raster is None:
        return None
    if old is not None:
        return _patched(folder, image, old, raster)
    layer = pixels.new_layer(image, name, raster)
    parent, position = (
        (under, 0) if under.is_group() else (under.get_parent(), image.get_item_position(under))
    )
    image.insert_layer(layer, parent, position)
    layer.set_offsets(*raster["at"])
    pixels.receive_colors(folder, layer, raster)
    return layer


def _patched(folder: RequestFolder, image: Gimp.Image, old: Gimp.Layer, raster: Options) -> Gimp.Layer:
    """Replace a layer by one that also covers the place of a raster, and shows that there."""
    box = pixels.around([pixels.layer_box(old), pixels.box_of(raster)])
    layer = pixels.new_layer(image, old.get_name(), {"width": box[2], "height": box[3]})
    image.insert_layer(layer, old.get_parent(), image.get_item_position(old))
    layer.set_offsets(box[0], box[1])
    at = raster["at"][0] - box[0], raster["at"][1] - box[1]
    (left, top), name = pixels.place_of(old), old.get_name()
    name_of_format = pixels.color_format(layer, raster["dtype"], raster["channels"])
    pixels.receive_onto(folder, raster, layer, name_of_format, at, old, (left - box[0], top - box[1]))
    layer.set_visible(old.get_visible())
    image.remove_layer(old)
    layer.set_name(name)
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
