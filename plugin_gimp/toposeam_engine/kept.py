"""What the asker keeps, packed, of layers that were joined, on the box in which they overlap: their label map
and where they have pixels. Beyond it each pixel shows the only layer that has one there.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from functools import reduce
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

import toposeam as ts
from toposeam.arrays import Labels, Mask
from toposeam.images import full_scale
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, cut
from toposeam_engine.job import EngineJob

#: What is kept beyond the pixels that layers share, px, so that each layer still reaches beyond the others.
_MARGIN = 8


class Kept(NamedTuple):
    """A label map on the asker's canvas, and layers without their colours."""

    #: (H, W) int16, the number of the layer that shows, -1 where none does.
    labels: Labels
    layers: list[ts.Layer]
    #: Where the label map begins, px of the asker's canvas.
    at: tuple[int, int]
    #: The box round the whole layers, there.
    whole: Box

    def on(self, canvas: Canvas) -> Labels:
        """(H, W) int16: the label map on a canvas that may reach beyond what is kept."""
        labels: Labels = np.full(canvas.shape, -1, np.int16)
        for index, (place, cover) in enumerate(zip(canvas.places, canvas.covers, strict=True)):
            labels[place.slices][cover[:, :]] = index
        common, here = self._common(canvas)
        labels[here] = self.labels[common.slices]
        return labels

    def with_labels(self, canvas: Canvas, labels: Labels) -> Kept:
        """Return the same with other labels on a canvas, which differ only in what is kept."""
        common, here = self._common(canvas)
        changed = self.labels.copy()
        changed[common.slices] = labels[here]
        return self._replace(labels=changed)

    def _common(self, canvas: Canvas) -> tuple[Box, tuple[slice, slice]]:
        """Return what the label map and a canvas share, and its slices on the canvas."""
        box = canvas.frame.moved(-self.at[1], -self.at[0])
        common = box.shared(Box(0, 0, *self.labels.shape))
        return common, common.within(box)

    def traced(self) -> ts.layers.Composition:
        """Return a composition with the seams of the label map; its pixels are empty."""
        masks = [self.labels == index for index in range(len(self.layers))]
        cheap = ts.seam.MatchCost(law="colour")  # it is not looked at
        return ts.layers.restitch(self.layers, masks, {}, cost=cheap)

    def pack(self, job: EngineJob) -> dict[str, Any]:
        """Write it; return its description for the asker, who gives it back with the next request."""
        dtype = np.uint8 if len(self.layers) < 255 else np.uint16
        counted = np.add(self.labels, 1, dtype=dtype, casting="unsafe")
        covers = (np.packbits(layer.covered) for layer in self.layers)
        packed = zlib.compress(b"".join([counted.tobytes(), *(cover.tobytes() for cover in covers)]), 1)
        height, width = self.labels.shape
        layers = [[*layer.at, *layer.image.shape[1::-1], layer.name] for layer in self.layers]
        whole = [self.whole.left, self.whole.top, *self.whole.shape[::-1]]
        about = {"width": width, "height": height, "dtype": str(np.dtype(dtype)), "at": list(self.at)}
        return {**job.write(np.frombuffer(packed, np.uint8)[None]), **about, "layers": layers, "whole": whole}


def kept_of(layers: Sequence[ts.Layer], labels: Labels, canvas: Canvas) -> Kept:
    """Return what is kept of layers on their canvas."""
    pairs = [one.shared(other) for one, other in combinations(canvas.places, 2)]
    overlaps = [box for box in pairs if all(box.shape)] or [canvas.box]
    near = reduce(Box.around, overlaps).grown(_MARGIN).shared(canvas.box)
    parts = [part for place in canvas.places if all((part := place.shared(near)).shape)]
    box = reduce(Box.around, parts)
    (left, top), inside = canvas.origin, []
    for layer, place, cover in zip(layers, canvas.places, canvas.covers, strict=True):
        part = place.shared(box)
        if not all(part.shape):  # a transparent pixel keeps its number
            part = Box(box.top, box.left, box.top + 1, box.left + 1)
        inside.append(_empty(cut(cover, place, part), (left + part.left, top + part.top), layer.name))
    return Kept(labels[box.slices], inside, (left + box.left, top + box.top), canvas.frame)


def unpacked(job: EngineJob, about: Mapping[str, Any]) -> Kept:
    """Read what :meth:`Kept.pack` wrote, with the layers it described."""
    content = np.frombuffer(zlib.decompress(job.read_bytes(str(about["file"]))), np.uint8)
    shape, dtype = (int(about["height"]), int(about["width"])), np.dtype(about["dtype"])
    end = shape[0] * shape[1] * dtype.itemsize
    counted = content[:end].view(dtype).reshape(shape)
    labels: Labels = np.subtract(counted, 1, dtype=np.int16, casting="unsafe")
    layers = []
    for x, y, width, height, name in about.get("layers", ()):
        begin, end = end, end + -(-width * height // 8)
        cover: Mask = np.unpackbits(content[begin:end], count=width * height).reshape(height, width) > 0
        layers.append(_empty(cover, (x, y), name))
    at = int(about["at"][0]), int(about["at"][1])
    left, top, width, height = about.get("whole", [*at, *shape[::-1]])
    return Kept(labels, layers, at, Box(top, left, top + height, left + width))


def _empty(cover: Mask, at: tuple[int, int], name: str) -> ts.Layer:
    """Return a layer without colours that has pixels where a mask says."""
    empty = np.broadcast_to(np.uint8(0), cover.shape)
    alpha = None if cover.all() else np.where(cover, full_scale(empty.dtype), empty)
    return ts.Layer(empty, alpha=alpha, at=at, name=name)
