"""Layers, masks and selections as raw files and back, in blocks of rows, in the image's own depth and colour
space.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any

from gi.repository import Babl, Gegl, Gimp

from toposeam_gimp.engine.folder import FolderError, RequestFolder, is_full, too_small
from toposeam_gimp.image.seen import as_seen

_ROWS = 256
#: Longest side of the reduced copy in which opacity is tested, px.
_LOOK = 512
#: Side of the tiles in which strokes are searched, px; by what they are reduced, so that a single pixel still
#: counts; and the longest side of a part that GIMP reduces, px.
_TILE, _DIVISOR, _LONGEST = 256, 4, 4096
_BYTES = {"uint8": 1, "uint16": 2, "float32": 4}


class Format(StrEnum):
    """The pixel formats that are used; a misspelt one would end the process."""

    RGB_U8 = "R'G'B' u8"
    RGB_U16 = "R'G'B' u16"
    RGB_FLOAT = "R'G'B' float"
    RGBA_U8 = "R'G'B'A u8"
    RGBA_U16 = "R'G'B'A u16"
    RGBA_FLOAT = "R'G'B'A float"
    GRAY_U8 = "Y' u8"
    GRAY_U16 = "Y' u16"
    GRAY_FLOAT = "Y' float"
    GRAYA_U8 = "Y'A u8"
    GRAYA_U16 = "Y'A u16"
    GRAYA_FLOAT = "Y'A float"
    MASK_U8 = "Y u8"
    MASK_FLOAT = "Y float"


#: Colour formats by the number of channels and their type.
_COLOR = {
    (1, "uint8"): Format.GRAY_U8,
    (1, "uint16"): Format.GRAY_U16,
    (1, "float32"): Format.GRAY_FLOAT,
    (2, "uint8"): Format.GRAYA_U8,
    (2, "uint16"): Format.GRAYA_U16,
    (2, "float32"): Format.GRAYA_FLOAT,
    (3, "uint8"): Format.RGB_U8,
    (3, "uint16"): Format.RGB_U16,
    (3, "float32"): Format.RGB_FLOAT,
    (4, "uint8"): Format.RGBA_U8,
    (4, "uint16"): Format.RGBA_U16,
    (4, "float32"): Format.RGBA_FLOAT,
}
_MASK = {"uint8": Format.MASK_U8, "float32": Format.MASK_FLOAT}


def depth(image: Gimp.Image) -> str:
    """Return the type of the pixels in a request: the image's own 8 or 16 bits, else single floats."""
    exact = {Gimp.Precision.U8_NON_LINEAR: "uint8", Gimp.Precision.U16_NON_LINEAR: "uint16"}
    return exact.get(image.get_precision(), "float32")


def color_format(drawable: Gimp.Drawable, dtype: str, channels: int) -> str:
    """Return the format of colours, and of opacity if there is any, in the drawable's own colour space."""
    space = Babl.format_get_space(drawable.get_format())
    return str(Babl.get_name(Babl.format_with_space(_COLOR[channels, dtype].value, space)))


def _channels(layer: Gimp.Layer) -> int:
    """Return the number of channels of a layer. An added opacity would briefly take 300 MiB in babl."""
    return (1 if layer.is_gray() else 3) + int(layer.has_alpha())


def size_of(image: Gimp.Image, drawable: Gimp.Drawable) -> int:
    """Return the size of a layer in a request, bytes."""
    channels = 2 if image.get_base_type() == Gimp.ImageBaseType.GRAY else 4
    return int(drawable.get_width() * drawable.get_height() * channels * _BYTES[depth(image)])


Box = tuple[int, int, int, int]


def box_of(raster: dict[str, Any]) -> Box:
    """Return the left, top, width and height of a raster on the canvas."""
    return (*raster["at"], raster["width"], raster["height"])


def send_layer(
    folder: RequestFolder,
    image: Gimp.Image,
    layer: Gimp.Layer,
    name: str,
    *,
    with_mask: bool = True,
    box: Box | None = None,
) -> dict[str, Any] | None:
    """Write the visible pixels of a layer, filters included, or their part within a box of the canvas, and
    perhaps its mask.

    Returns
    -------
    dict or None
        The description for the request; None if box and layer do not overlap.
    """
    dtype = depth(image)
    with as_seen(image, layer) as seen:
        _nothing, left, top = seen.get_offsets()
        part = common((left, top, seen.get_width(), seen.get_height()), box)
        if part is None:
            return None
        x, y, width, height = part
        own = (x - left, y - top, width, height)
        channels = _channels(seen)
        raster = _send(folder, seen, f"{name}.raw", color_format(seen, dtype, channels), dtype, channels, own)
        mask = seen.get_mask()
        if with_mask and mask is not None and seen.get_apply_mask():
            raster["mask"] = _send(folder, mask, f"{name}-mask.raw", Format.MASK_U8.value, "uint8", 1, own)
    return {**raster, "name": layer.get_name(), "at": [x, y]}


def send_whole(
    folder: RequestFolder, image: Gimp.Image, layer: Gimp.Layer, name: str, *, with_mask: bool = True
) -> dict[str, Any]:
    """Write all pixels of a layer; see :func:`send_layer`."""
    raster = send_layer(folder, image, layer, name, with_mask=with_mask)
    if raster is None:
        raise RuntimeError("a layer has always something in common with itself")
    return raster


def layer_box(layer: Gimp.Layer) -> Box:
    """Return the left, top, width and height of a layer on the canvas."""
    return (*place_of(layer), layer.get_width(), layer.get_height())


def in_own_pixels(layer: Gimp.Layer, box: Box | None) -> Box | None:
    """Return a box of the canvas in the pixels of a layer; None for None."""
    left, top = place_of(layer)
    return box and (box[0] - left, box[1] - top, box[2], box[3])


def around(boxes: Sequence[Box]) -> Box:
    """Return the box round all boxes."""
    left, top = (min(box[axis] for box in boxes) for axis in (0, 1))
    right, bottom = (max(box[axis] + box[axis + 2] for box in boxes) for axis in (0, 1))
    return left, top, right - left, bottom - top


def grown(box: Box, margin: int) -> Box:
    """Return a box that reaches some px farther on all sides."""
    return box[0] - margin, box[1] - margin, box[2] + 2 * margin, box[3] + 2 * margin


def common(first: Box, second: Box | None) -> Box | None:
    """Return the intersection of two boxes; None if it is empty."""
    if second is None:
        return first
    left, top = max(first[0], second[0]), max(first[1], second[1])
    right, bottom = (min(first[axis] + first[axis + 2], second[axis] + second[axis + 2]) for axis in (0, 1))
    return (left, top, right - left, bottom - top) if right > left and bottom > top else None


def send_mask(
    folder: RequestFolder, layer: Gimp.Layer, name: str, window: Box | None = None
) -> dict[str, Any] | None:
    """Write the mask of a layer, perhaps its part within a window of the canvas; None without one."""
    mask, own = layer.get_mask(), in_own_pixels(layer, common(layer_box(layer), window))
    if mask is None or own is None:
        return None
    return _send(folder, mask, f"{name}.raw", Format.MASK_U8.value, "uint8", 1, own)


def send_nothing(folder: RequestFolder, image: Gimp.Image, name: str, box: Box) -> dict[str, Any]:
    """Write a transparent pixel in the place of a layer that lies outside a box."""
    channels, dtype = (2 if image.get_base_type() == Gimp.ImageBaseType.GRAY else 4), depth(image)
    (folder.path / f"{name}.raw").write_bytes(bytes(channels * _BYTES[dtype]))
    shape = {"width": 1, "height": 1, "channels": channels, "dtype": dtype}
    return {"file": f"{name}.raw", **shape, "name": name, "at": [box[0], box[1]]}


def send_channel(folder: RequestFolder, channel: Gimp.Channel, name: str) -> dict[str, Any]:
    """Write a channel or a mask, with its place."""
    box = (0, 0, channel.get_width(), channel.get_height())
    raster = _send(folder, channel, f"{name}.raw", Format.MASK_U8.value, "uint8", 1, box)
    return {**raster, "at": list(place_of(channel)), "is_mask": True}


def send_avoided(folder: RequestFolder, channel: Gimp.Drawable | None) -> dict[str, Any] | None:
    """Write the channel or mask of pixels that seams avoid, if there is one."""
    return None if channel is None else send_channel(folder, channel, "avoid")


def shows(layer: Gimp.Layer, box: Box | None = None) -> bool:
    """Test whether a layer is not wholly transparent, anywhere or within a box, in a reduced copy."""
    left, top = place_of(layer)
    part = common((left, top, layer.get_width(), layer.get_height()), box)
    if part is None:
        return False
    scale = min(1.0, _LOOK / max(part[2:]))
    x, y, width, height = (round(value * scale) for value in (part[0] - left, part[1] - top, *part[2:]))
    small = Gegl.Rectangle.new(x, y, max(width, 1), max(height, 1))
    content = layer.get_buffer().get(small, scale, Format.GRAYA_U8.value, Gegl.AbyssPolicy.CLAMP)
    return any(content[1::2])


def send_strokes(
    folder: RequestFolder, layer: Gimp.Layer | None, sums: Mapping[str, int], window: Box | None
) -> dict[str, Any] | None:
    """Write colours and opacity of a layer's strokes, 8 bits, and the place of the box round their tiles,
    perhaps within a window of the canvas; None if there are none.
    """
    if layer is None or not sums:
        return None
    box = common(box_of_tiles(layer, sums), in_own_pixels(layer, window))
    if box is None:
        return None
    left, top = place_of(layer)
    raster = _send(folder, layer, "hints.raw", Format.RGBA_U8.value, "uint8", 4, box)
    return {**raster, "at": [left + box[0], top + box[1]]}


def tile_sums(
    drawable: Gimp.Drawable | None, known: Mapping[str, int] | None = None, box: Box | None = None
) -> dict[str, int]:
    """Return the checksum of each tile of strokes or of a mask that is not blank, transparent black or white,
    by the tile's corner in its own pixels, ``left,top``; empty without a drawable. Beyond a box of its pixels
    the known ones are kept. Strokes are large and mostly blank: they are read reduced, which GIMP does fast.
    """
    if drawable is None:
        return {}
    is_mask = isinstance(drawable, Gimp.LayerMask)
    name, blank = (Format.MASK_U8.value, 255) if is_mask else (Format.RGBA_U8.value, 0)
    sums, buffer = dict(known or {}), drawable.get_buffer()
    reduced = {} if is_mask else _reduced_tiles(drawable)
    width, height = drawable.get_width(), drawable.get_height()
    for top in range(0, height, _TILE):
        for left in range(0, width, _TILE):
            tile = left, top, min(_TILE, width - left), min(_TILE, height - top)
            if common(tile, box) is None:
                continue
            corner = f"{left},{top}"
            content = reduced.get(corner)
            if content is None:
                content = buffer.get(Gegl.Rectangle.new(*tile), 1.0, name, Gegl.AbyssPolicy.NONE)
            found = zlib.crc32(content)
            sums.pop(corner, None)
            if found != _sum_of_blank(blank, len(content)):
                sums[corner] = found
    return sums


def _reduced_tiles(layer: Gimp.Layer) -> dict[str, bytes]:
    """Return the reduced pixels of each tile of a layer, in GIMP's format, by its corner; without tiles at
    the edges whose sides are no multiples of the divisor.
    """
    tiles, side = {}, _TILE // _DIVISOR
    size = [length // _DIVISOR * _DIVISOR for length in (layer.get_width(), layer.get_height())]
    whole = size == [layer.get_width(), layer.get_height()]
    for top in range(0, size[1], _LONGEST):
        for left in range(0, size[0], _LONGEST):
            box = left, top, min(_LONGEST, size[0] - left), min(_LONGEST, size[1] - top)
            seen, wide, high, depth = layer.get_sub_thumbnail_data(*box, *(n // _DIVISOR for n in box[2:]))
            content, stride = seen.get_data(), wide * depth
            for row in range(0, high, side):
                lines = [content[at * stride : (at + 1) * stride] for at in range(row, min(row + side, high))]
                for begin in range(0, stride, side * depth):
                    tile = b"".join(line[begin : begin + side * depth] for line in lines)
                    corner = left + begin // depth * _DIVISOR, top + row * _DIVISOR
                    if whole or all(at + _TILE <= end for at, end in zip(corner, size, strict=True)):
                        tiles[f"{corner[0]},{corner[1]}"] = tile
    return tiles


def tiles_of(strokes: Gimp.Layer) -> dict[str, bytes]:
    """Return the pixels of each tile of strokes that is not transparent, RGBA in 8 bits."""
    buffer, name, tiles = strokes.get_buffer(), Format.RGBA_U8.value, {}
    for corner in tile_sums(strokes):
        place = Gegl.Rectangle.new(*box_of_tiles(strokes, [corner]))
        tiles[corner] = buffer.get(place, 1.0, name, Gegl.AbyssPolicy.NONE)
    return tiles


def put_tiles(strokes: Gimp.Layer, tiles: Mapping[str, bytes]) -> None:
    """Give tiles of strokes other pixels, empty ones for transparent ones; undo takes it back."""
    size = strokes.get_width(), strokes.get_height()
    whole = Gegl.Rectangle.new(0, 0, *size)
    shadow, name = strokes.get_shadow_buffer(), Format.RGBA_U8.value
    strokes.get_buffer().copy(whole, Gegl.AbyssPolicy.NONE, shadow, whole)
    for corner, content in tiles.items():
        box = box_of_tiles(strokes, [corner])
        shadow.set(Gegl.Rectangle.new(*box), name, content or bytes(4 * box[2] * box[3]))
    shadow.flush()
    strokes.merge_shadow(True)
    strokes.update(0, 0, *size)


@cache
def _sum_of_blank(value: int, size: int) -> int:
    return zlib.crc32(bytes([value]) * size)


def changed_box(drawable: Gimp.Drawable, before: Mapping[str, int], now: Mapping[str, int]) -> Box | None:
    """Return a box of the canvas round the tiles of a mask whose checksums differ, or round the strokes in
    such tiles; None if there are none.
    """
    changed = [tile for tile in {**before, **now} if before.get(tile) != now.get(tile)]
    boxes = [box_of_tiles(drawable, [tile]) for tile in changed]
    if isinstance(drawable, Gimp.Layer):
        boxes = [box for tile in boxes if (box := _painted_in(drawable, tile)) is not None]
    if not boxes:
        return None
    (left, top), box = place_of(drawable), around(boxes)
    return left + box[0], top + box[1], box[2], box[3]


def _painted_in(layer: Gimp.Layer, box: Box) -> Box | None:
    """Return the part of a box, in the layer's own pixels, that is not transparent; None if all is."""
    place, name = Gegl.Rectangle.new(*box), Format.GRAYA_U8.value
    opacity = layer.get_buffer().get(place, 1.0, name, Gegl.AbyssPolicy.NONE)[1::2]
    lines = [opacity[row * box[2] : (row + 1) * box[2]] for row in range(box[3])]
    rows = [row for row, line in enumerate(lines) if any(line)]
    if not rows:
        return None
    together = 0
    for row in rows:
        together |= int.from_bytes(lines[row])
    columns = [column for column, value in enumerate(together.to_bytes(box[2])) if value]
    left, top = columns[0], rows[0]
    return box[0] + left, box[1] + top, columns[-1] + 1 - left, rows[-1] + 1 - top


def box_of_tiles(layer: Gimp.Drawable, corners: Iterable[str]) -> Box:
    """Return the box round tiles, in the drawable's own pixels."""
    places = [tuple(map(int, corner.split(","))) for corner in corners]
    left, top = (min(place[axis] for place in places) for axis in (0, 1))
    right = min(max(place[0] for place in places) + _TILE, layer.get_width())
    bottom = min(max(place[1] for place in places) + _TILE, layer.get_height())
    return left, top, right - left, bottom - top


def receive_onto(
    folder: RequestFolder,
    raster: dict[str, Any],
    new: Gimp.Drawable,
    format_name: str,
    at: tuple[int, int],
    old: Gimp.Drawable | None = None,
    shift: tuple[int, int] = (0, 0),
    tiles: Iterable[str] | None = None,
) -> None:
    """Fill a new drawable with the pixels of an old one, or some tiles of it, moved by px, if there is one,
    and then a box that begins at some px with those of a raster.
    """
    buffer = new.get_buffer()
    if old is not None:
        whole = [(0, 0, old.get_width(), old.get_height())]
        for x, y, *size in whole if tiles is None else (box_of_tiles(old, [tile]) for tile in tiles):
            own, moved = (Gegl.Rectangle.new(x + right, y + down, *size) for right, down in ((0, 0), shift))
            old.get_buffer().copy(own, Gegl.AbyssPolicy.NONE, buffer, moved)
    box = Gegl.Rectangle.new(*at, raster["width"], raster["height"])
    buffer.set(box, format_name, (folder.path / raster["file"]).read_bytes())
    buffer.flush()
    new.update(0, 0, new.get_width(), new.get_height())


def place_of(drawable: Gimp.Drawable) -> tuple[int, int]:
    """Return the position of a layer, a mask or a channel on the canvas."""
    owner = Gimp.Layer.from_mask(drawable) if isinstance(drawable, Gimp.LayerMask) else drawable
    _nothing, left, top = owner.get_offsets()
    return left, top


def send_selection(folder: RequestFolder, image: Gimp.Image) -> dict[str, Any] | None:
    """Write the selection into the folder, cut to its bounds; None if there is none."""
    _, something, left, top, right, bottom = Gimp.Selection.bounds(image)
    if not something:
        return None
    raster = _send(
        folder,
        image.get_selection(),
        "selection.raw",
        Format.MASK_U8.value,
        "uint8",
        1,
        (left, top, right - left, bottom - top),
    )
    return {**raster, "at": [left, top]}


def send_selection_on(folder: RequestFolder, image: Gimp.Image, box: Box) -> dict[str, Any] | None:
    """Write the selection within a box, which may extend beyond the canvas; None if it is empty."""
    _nothing, _something, left, top, right, bottom = Gimp.Selection.bounds(image)
    if common(box, (left, top, right - left, bottom - top)) is None:
        return None
    raster = _send(folder, image.get_selection(), "selection.raw", Format.MASK_U8.value, "uint8", 1, box)
    return {**raster, "at": [box[0], box[1]]}


def send_reduced(
    folder: RequestFolder,
    image: Gimp.Image,
    drawable: Gimp.Drawable,
    name: str,
    scale: float,
    box: Box | None = None,
) -> dict[str, Any]:
    """Write the visible pixels of a layer, or their part within a box of the canvas, at a reduced size, in 8
    bits; or the part of a selection, a mask or a channel within the box.
    """
    if not isinstance(drawable, Gimp.Layer):
        raster = _send_reduced(
            folder, drawable, name, scale, box, Format.MASK_U8.value, 1, place_of(drawable)
        )
        return {**raster, "is_mask": True}
    with as_seen(image, drawable) as seen:
        place, channels = place_of(seen), _channels(seen)
        format_name = color_format(seen, "uint8", channels)
        raster = _send_reduced(folder, seen, name, scale, box, format_name, channels, place)
        mask = seen.get_mask()
        if mask is not None and seen.get_apply_mask():
            own = None if box is None else (box[0] - place[0], box[1] - place[1], *box[2:])
            raster["mask"] = _send_reduced(folder, mask, f"{name}-mask", scale, own, Format.MASK_U8.value, 1)
    return raster


def _send_reduced(
    folder: RequestFolder,
    drawable: Gimp.Drawable,
    name: str,
    scale: float,
    box: Box | None,
    format_name: str,
    channels: int,
    place: tuple[int, int] = (0, 0),
) -> dict[str, Any]:
    left, top = place
    part = common((left, top, drawable.get_width(), drawable.get_height()), box) or (left, top, 1, 1)
    x, y = round((part[0] - left) * scale), round((part[1] - top) * scale)
    width, height = max(round(part[2] * scale), 1), max(round(part[3] * scale), 1)
    content = drawable.get_buffer().get(
        Gegl.Rectangle.new(x, y, width, height), scale, format_name, Gegl.AbyssPolicy.CLAMP
    )
    (folder.path / f"{name}.raw").write_bytes(content)
    shape = {"width": width, "height": height, "channels": channels, "dtype": "uint8"}
    at = [round(part[0] * scale), round(part[1] * scale)]
    return {"file": f"{name}.raw", **shape, "name": drawable.get_name(), "at": at}


def is_rectangle(image: Gimp.Image, box: Box) -> bool:
    """Test whether a box of the canvas is selected nearly completely."""
    x, y, width, height = box
    buffer = image.get_selection().get_buffer()
    for row in range(0, height, _ROWS):
        part = Gegl.Rectangle.new(x, y + row, width, min(_ROWS, height - row))
        if min(buffer.get(part, 1.0, Format.MASK_U8.value, Gegl.AbyssPolicy.NONE)) < 128:
            return False
    return True


def send_density(folder: RequestFolder, layer: Gimp.Layer, name: str) -> dict[str, Any]:
    """Write a layer's mask unchanged, in single floats."""
    box = (0, 0, layer.get_width(), layer.get_height())
    return _send(folder, layer.get_mask(), f"{name}.raw", Format.MASK_FLOAT.value, "float32", 1, box)


def _send(
    folder: RequestFolder,
    drawable: Gimp.Drawable,
    file: str,
    format_name: str,
    dtype: str,
    channels: int,
    box: Box,
) -> dict[str, Any]:
    x, y, width, height = box
    buffer = drawable.get_buffer()
    try:
        with (folder.path / file).open("xb") as out:
            for row in range(0, height, _ROWS):
                rows = min(_ROWS, height - row)
                out.write(
                    buffer.get(
                        Gegl.Rectangle.new(x, y + row, width, rows), 1.0, format_name, Gegl.AbyssPolicy.NONE
                    )
                )
                folder.touch()
    except OSError as error:
        if is_full(error):
            raise FolderError(too_small(folder.path.parent)) from error
        raise
    return {"file": file, "width": width, "height": height, "channels": channels, "dtype": dtype}


def receive(folder: RequestFolder, raster: dict[str, Any], drawable: Gimp.Drawable, format_name: str) -> None:
    """Fill a new layer or mask from a file of the folder.

    Raises
    ------
    ValueError
        When the file's size is not that of the result.
    """
    width, height = raster["width"], raster["height"]
    stride = width * raster["channels"] * _BYTES[raster["dtype"]]
    if (width, height) != (drawable.get_width(), drawable.get_height()):
        raise ValueError(
            f"the engine sent {width} × {height} pixels for {drawable.get_width()} × {drawable.get_height()}"
        )
    buffer = drawable.get_buffer()
    with Path(folder.path, raster["file"]).open("rb") as source:
        for row in range(0, height, _ROWS):
            rows = min(_ROWS, height - row)
            block = source.read(rows * stride)
            if len(block) != rows * stride:
                raise ValueError("the engine sent fewer pixels than it said")
            buffer.set(Gegl.Rectangle.new(0, row, width, rows), format_name, block)
            folder.touch()
    buffer.flush()
    drawable.update(0, 0, width, height)


def new_layer(image: Gimp.Image, name: str, raster: dict[str, Any]) -> Gimp.Layer:
    """Return an empty layer of a raster's size, which is not inserted yet."""
    kind = (
        Gimp.ImageType.GRAYA_IMAGE
        if image.get_base_type() == Gimp.ImageBaseType.GRAY
        else Gimp.ImageType.RGBA_IMAGE
    )
    return Gimp.Layer.new(
        image, name, raster["width"], raster["height"], kind, 100.0, image.get_default_new_layer_mode()
    )


def receive_colors(folder: RequestFolder, layer: Gimp.Layer, raster: dict[str, Any]) -> None:
    """Fill an inserted layer with colours and opacity."""
    receive(folder, raster, layer, color_format(layer, raster["dtype"], raster["channels"]))


def replaced(
    folder: RequestFolder, image: Gimp.Image, layer: Gimp.Layer, raster: dict[str, Any]
) -> Gimp.Layer:
    """Give a layer new pixels and return it. A group, a text, or a layer of another size is replaced by an
    ordinary layer.
    """
    fresh = layer
    resized = (raster["width"], raster["height"]) != (layer.get_width(), layer.get_height())
    if resized or layer.is_group() or layer.is_text_layer():
        fresh = new_layer(image, layer.get_name(), raster)
        image.insert_layer(fresh, layer.get_parent(), image.get_item_position(layer))
        fresh.set_offsets(*list(layer.get_offsets())[1:])
        image.remove_layer(layer)
    receive_colors(folder, fresh, raster)
    return fresh


def new_mask(folder: RequestFolder, raster: dict[str, Any], layer: Gimp.Layer) -> Gimp.LayerMask:
    """Return a filled mask for a layer, which is not attached yet, so that undo reverts attaching it."""
    mask = layer.create_mask(Gimp.AddMaskType.WHITE)
    receive(folder, raster, mask, _MASK[raster["dtype"]].value)
    return mask
