"""Outlines of what layers cover, drawn while somebody paints strokes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from gi.repository import Gegl, Gimp

from toposeam_gimp.image import pixels
from toposeam_gimp.image.seam_colours import colours_in

#: Longer side of the picture ÷ width of the outlines.
_THIN = 1500
#: Side of the tiles in which outlines are drawn, px.
_TILE = 256
_ONES = bytes([0, *[1] * 255])
_FULL = bytes([0, *[255] * 255])


def draw_reach(outlines: Gimp.Layer, layers: Sequence[Gimp.Layer], first: int) -> None:
    """Draw on a layer that begins at 0,0 the outline of the pixels of each other layer, inside of them, in
    its colour; `first` is the number of the first colour.
    """
    whole = (0, 0, outlines.get_width(), outlines.get_height())
    buffer, width = outlines.get_buffer(), max(whole[2:]) // _THIN + 1
    colours = colours_in(outlines.get_image())[first:]
    for (red, green, blue), layer in zip(colours, layers, strict=False):
        left, top = pixels.place_of(layer)
        for (x, y, columns, rows), line in _outline(layer, width):
            box = pixels.common((left + x, top + y, columns, rows), whole)
            if box is None:
                continue
            kept = b"".join(
                line[begin : begin + box[2]]
                for row in range(box[3])
                for begin in [(box[1] - top - y + row) * columns + box[0] - left - x]
            )
            place = Gegl.Rectangle.new(*box)
            name, none = pixels.Format.RGBA_U8.value, Gegl.AbyssPolicy.NONE
            mask = bytearray(4 * len(kept))
            for channel in range(4):
                mask[channel::4] = kept.translate(_FULL)
            drawn = int.from_bytes(mask)
            colour = drawn & int.from_bytes(bytes([red, green, blue, 255]) * len(kept))
            seen = int.from_bytes(buffer.get(place, 1.0, name, none))
            buffer.set(place, name, (seen & ~drawn | colour).to_bytes(len(mask)))
    buffer.flush()
    outlines.update(*whole)


def _outline(layer: Gimp.Layer, width: int) -> Iterator[tuple[pixels.Box, bytes]]:
    """Yield the tiles of a layer, in its own pixels, that hold a part of its outline, and a byte per pixel:
    1 on the outline, 0 elsewhere.
    """
    buffer, columns = layer.get_buffer(), layer.get_width()
    stride = columns + 2 * width
    for top in range(0, layer.get_height(), _TILE):
        rows = min(_TILE, layer.get_height() - top)
        place = Gegl.Rectangle.new(-width, top - width, stride, rows + 2 * width)
        opacity = buffer.get(place, 1.0, pixels.Format.GRAYA_U8.value, Gegl.AbyssPolicy.NONE)[1::2]
        covers = int.from_bytes(opacity.translate(_ONES))
        inside = covers
        for shift in (8 * width, 8 * width * stride):
            inside &= (covers >> shift) & (covers << shift)
        line = (covers ^ inside).to_bytes(len(opacity))
        for left in range(0, columns, _TILE):
            wide = min(_TILE, columns - left)
            tile = b"".join(
                line[begin : begin + wide]
                for row in range(rows)
                for begin in [(row + width) * stride + width + left]
            )
            if any(tile):
                yield (left, top, wide, rows), tile
