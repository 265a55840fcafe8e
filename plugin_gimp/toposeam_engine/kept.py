"""What the asker keeps, packed, of layers that were joined: their label map and where they have pixels."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

import toposeam as ts
from toposeam.arrays import Labels, Mask
from toposeam.images import full_scale
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box
from toposeam_engine.job import EngineJob


class Kept(NamedTuple):
    """A label map on the asker's canvas, and layers without their colours."""

    #: (H, W) int16, the number of the layer that shows, -1 where none does.
    labels: Labels
    layers: list[ts.Layer]
    #: Where the label map begins, px of the asker's canvas.
    at: tuple[int, int]

    def box_of(self, canvas: Canvas) -> Box:
        """Return the box of a canvas on the label map."""
        (x, y), (height, width) = canvas.origin, canvas.shape
        top, left = y - self.at[1], x - self.at[0]
        return Box(top, left, top + height, left + width)

    def with_labels(self, box: Box, labels: Labels) -> Kept:
        """Return the same with other labels in a box."""
        changed = self.labels.copy()
        changed[box.slices] = labels
        return self._replace(labels=changed)

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
        about = {"width": width, "height": height, "dtype": str(np.dtype(dtype)), "at": list(self.at)}
        return {**job.write(np.frombuffer(packed, np.uint8)[None]), **about, "layers": layers}


def kept_of(layers: Sequence[ts.Layer], labels: Labels, canvas: Canvas) -> Kept:
    """Return what is kept of layers on their canvas."""
    return Kept(labels, list(layers), canvas.origin)


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
        empty = np.broadcast_to(np.uint8(0), cover.shape)
        alpha = None if cover.all() else np.where(cover, full_scale(empty.dtype), empty)
        layers.append(ts.Layer(empty, alpha=alpha, at=(x, y), name=name))
    return Kept(labels, layers, (int(about["at"][0]), int(about["at"][1])))
