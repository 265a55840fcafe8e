"""Colours that stand for layers."""

from __future__ import annotations

from gi.repository import Gimp

#: Colours of strokes, 8 bits, and the equal colour tags in the Layers dialog, from the lowest layer on.
COLOURS = (
    ((51, 108, 222), Gimp.ColorTag.BLUE),
    ((240, 140, 20), Gimp.ColorTag.ORANGE),
    ((60, 170, 60), Gimp.ColorTag.GREEN),
    ((140, 70, 200), Gimp.ColorTag.VIOLET),
    ((235, 210, 40), Gimp.ColorTag.YELLOW),
    ((215, 40, 50), Gimp.ColorTag.RED),
    ((120, 75, 35), Gimp.ColorTag.BROWN),
    ((128, 128, 128), Gimp.ColorTag.GRAY),
)
#: What stands for the same layers in gray images.
_GRAYS = (40, 220, 130, 85, 175, 255, 0, 155)


def colours_in(image: Gimp.Image) -> list[tuple[int, int, int]]:
    """Return the colours of strokes in an image, from the lowest layer on: grays if it has no others."""
    if image.get_base_type() == Gimp.ImageBaseType.GRAY:
        return [(gray, gray, gray) for gray in _GRAYS]
    return [colour for colour, _tag in COLOURS]
