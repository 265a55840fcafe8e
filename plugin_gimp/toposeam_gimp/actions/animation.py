"""Loop Animation: from the layers of an image, as frames, to a loop in a new image."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from gi.repository import Gimp

from toposeam_gimp.engine.call import Call
from toposeam_gimp.engine.folder import RequestFolder
from toposeam_gimp.image import pixels
from toposeam_gimp.image.layers import RefusedError, chosen_layers
from toposeam_gimp.texts import _

#: A frame's duration in the name of its layer, as GIMP and its exporters read it: "(100ms)".
_DELAY = re.compile(r"\(\s*(\d+)\s*ms\s*\)")
_USUAL_MS = 100
_LEAST_FRAMES = 4


def loop(call: Call) -> Gimp.Layer:
    """Return a clip whose end runs into its beginning."""
    image = call.image
    frames = frames_of(image)
    size = image.get_width(), image.get_height()
    needed = 2 * sum(pixels.size_of(image, frame) for frame in frames)
    with RequestFolder(needed=needed) as folder:
        rasters = [
            pixels.send_whole(folder, image, frame, f"frame-{index}") for index, frame in enumerate(frames)
        ]
        request = {"operation": "loop", "layers": rasters, "options": call.for_engine}
        answer = call.ask(folder, request)
        made = Gimp.Image.new_with_precision(*size, image.get_base_type(), image.get_precision())
        profile = image.get_color_profile()
        if profile is not None:
            made.set_color_profile(profile)
        made.undo_disable()
        for number, raster in enumerate(answer["frames"]):
            delay = _DELAY.search(frames[(answer["start"] + number) % len(frames)].get_name())
            name = _("Frame {number}").format(number=number + 1) + (f" {delay[0]}" if delay else "")
            layer = pixels.new_layer(made, name, raster)
            made.insert_layer(layer, None, 0)
            pixels.receive_colors(folder, layer, raster)
        made.undo_enable()
    if call.interactive:
        Gimp.Display.new(made)
    return layer


def frames_of(image: Gimp.Image) -> list[Gimp.Layer]:
    """Return the visible layers of an image, the lowest first, which must be the frames of a clip."""
    frames = chosen_layers(image, [layer for layer in reversed(image.get_layers()) if layer.get_visible()])
    whole = (image.get_width(), image.get_height(), 0, 0)
    for frame in frames:
        if (frame.get_width(), frame.get_height(), *list(frame.get_offsets())[1:]) != whole:
            raise RefusedError(
                _(
                    "“{name}” is not of the image's size; choose Filters → Animation → Unoptimize first, or "
                    "Layer → Layer to Image Size."
                ).format(name=frame.get_name())
            )
    if len(frames) < _LEAST_FRAMES:
        raise RefusedError(
            _("An animation has a layer for each frame; this image shows {count}. Open a clip first.").format(
                count=len(frames)
            )
        )
    return frames


def check_clip(image: Gimp.Image, _drawables: Sequence[Gimp.Drawable], _options: Mapping[str, Any]) -> None:
    """Refuse an image whose layers are no frames of a clip."""
    frames_of(image)


def delay_of(frames: Sequence[Gimp.Layer]) -> int:
    """Return the duration of the first frame, ms."""
    found = _DELAY.search(frames[0].get_name())
    return int(found[1]) if found else _USUAL_MS
