"""The window of an image that strokes and painted masks concern."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import permutations
from typing import Any, NamedTuple

from gi.repository import Gimp

from toposeam_gimp.image import pixels

#: Blends of which a window can be made on its own.
_NEAR = ("none", "feather", "multiband")
#: What the engine searches beyond pixels that must change: half their own extent, and at least so many px.
_LEAST_MARGIN = 160
#: What costs look at beyond an interface, px; and the width of their cells, with which windows begin.
_LOOK, _CELL = 64, 2
#: Largest share of the canvas that is sent as a window.
_LARGEST = 0.5


class Window(NamedTuple):
    """Two boxes of the canvas."""

    #: What is sent.
    sent: pixels.Box
    #: What may change.
    within: pixels.Box


def window_of(
    layers: Sequence[Gimp.Layer],
    strokes: Gimp.Layer | None,
    memory: Mapping[str, Any],
    now: Mapping[str, Any],
) -> Window | None:
    """Return the window round what was painted since the layers were joined; None if everything has to be
    sent, or nothing was painted. `now` holds the checksums of masks and strokes.
    """
    before, margin = memory["masks"], memory.get("margin")
    if memory["kind"] == "patch" or not margin or memory["options"]["blend"] not in _NEAR:
        return None
    if [one[:2] for one in before] != [one[:2] for one in now["masks"]]:  # moved
        return None
    sums: list[tuple[Gimp.Drawable, Any, Any]] = [
        (layer.get_mask() or layer, old[2], new[2])
        for layer, old, new in zip(layers, before, now["masks"], strict=True)
    ]
    if strokes is not None:
        sums.append((strokes, memory.get("strokes", {}), now["strokes"]))
    boxes = [pixels.layer_box(layer) for layer in layers]
    if any(pixels.common(one, other) == one for one, other in permutations(boxes, 2)):  # keeps its middle
        return None
    news = [box for one in sums if (box := pixels.changed_box(*one)) is not None]
    if not news:
        return None
    whole, box = pixels.around(boxes), pixels.around(news)
    depends, grid = margin
    within = pixels.grown(box, max(_LEAST_MARGIN, max(box[2:]) // 2) + 2 + depends)
    left, top, width, height = pixels.grown(within, depends + _LOOK)
    step = math.lcm(grid, _CELL)
    right, bottom = left + width, top + height
    left, top = left - (left - whole[0]) % step, top - (top - whole[1]) % step
    sent = pixels.common((left, top, right - left, bottom - top), whole)
    if sent is None or sent[2] * sent[3] > _LARGEST * whole[2] * whole[3]:
        return None
    return Window(sent, within)
