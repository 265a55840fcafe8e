"""Blends in which layers fade into each other: evenly across the seam, or as the label potential does."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from toposeam.arrays import Floats32, Labels, Mask
from toposeam.images import full_scale
from toposeam.layers.blending.mixing import SETTLED, Blending, Fading, Mix, channels_of, planes_of
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, cut

#: Computes the weights of the given layers, each on the common box of its place and a box.
Weights = Callable[[Box, Labels, list[int]], dict[int, Floats32]]


class Feather(Blending):
    """Layers fade into each other evenly across the seam, over the width."""

    name = "feather"
    takes_width = True
    usual_width = 7.0

    @property
    def _size(self) -> int:
        return max(2, round(self.width or 2))

    @property
    def changes_within(self) -> int:
        """The distance from a seam, px, up to which pixels change: twice the width."""
        return 2 * self._size + 2

    def mixer(self, canvas: Canvas, labels: Labels, fadings: Sequence[Fading]) -> Mix:
        """Mix by weights that change evenly across the seam, and reach 0 at the end of a layer."""
        return _faded(canvas, _even_weights(canvas, self._size))


class Soft(Blending):
    """Layers fade as the label potential does: over a wide band where they agree, a narrow one elsewhere."""

    name = "soft"
    needs_potential = True
    without_potential = "feather"
    #: Usual width of the band in which label potentials change, px.
    _POTENTIAL_REACH = 32.0

    @property
    def reach(self) -> float:
        """Usual width of the band in which label potentials change, px."""
        return self._POTENTIAL_REACH

    @property
    def changes_within(self) -> None:
        """None: the label potentials determine it."""
        return

    def mixer(self, canvas: Canvas, labels: Labels, fadings: Sequence[Fading]) -> Mix:
        """Mix by the label potential of each pair of layers."""
        return _faded(canvas, _potential_weights(canvas.places, fadings))


def _faded(canvas: Canvas, weights: Weights) -> Mix:
    """Mix layers, and their opacity, by weights."""

    def mix(box: Box, shows: Labels, index: list[int]) -> tuple[Floats32, Floats32 | None, Mask]:
        channels = channels_of(canvas)
        colour = np.zeros((channels, *box.shape), np.float32)
        opacity, total, own = (np.zeros(box.shape, np.float32) for _ in range(3))
        opaque = all(canvas.layers[k].alpha is None for k in index)
        for k, weight in weights(box, shows, index).items():
            common = canvas.places[k].shared(box)
            here = common.within(box)
            planes, present = planes_of(canvas, k, common, channels)
            weight = weight * present
            own[here] += weight * (shows[here] == k)
            total[here] += weight
            if (alpha := canvas.layers[k].alpha) is not None:
                opacities = np.where(present, cut(alpha, canvas.places[k], common), alpha.dtype.type(0))
                weight = weight * (opacities / full_scale(alpha.dtype)).astype(np.float32)
            opacity[here] += weight
            planes *= weight
            colour[:, *here] += planes
        colour /= np.maximum(opacity, np.float32(1e-9))
        changed = (own < (1 - SETTLED) * total) & (opacity > 0)
        opacity /= np.maximum(total, np.float32(1e-9))
        return np.moveaxis(colour, 0, 2), None if opaque else opacity, changed

    return mix


def _even_weights(canvas: Canvas, size: int) -> Weights:
    """Compute weights that change evenly across the seam, and reach 0 at the end of a layer."""

    def smooth(mask: Mask) -> Floats32:
        found: Floats32 = scipy.ndimage.uniform_filter(mask.astype(np.float32), size, mode="nearest")
        return found

    def weights(box: Box, shows: Labels, index: list[int]) -> dict[int, Floats32]:
        ground = shows >= 0
        # Divide by the share of covered pixels, as nothing is mixed in beyond the layers.
        reach: Floats32 = np.maximum(smooth(ground), np.float32(0.5 / size**2))
        result = {}
        for k in index:
            common = canvas.places[k].shared(box)
            around = common.grown(size).shared(box)  # its weights are 0 beyond
            near, inner = around.within(box), common.within(around)
            own = shows[near] == k
            if not own.any():
                continue
            share = smooth(own)[inner] / reach[common.within(box)]
            present = cut(canvas.covers[k], canvas.places[k], around) | ~ground[near]
            inside = np.clip(2 * smooth(present)[inner] - 1, 0, 1)
            result[k] = share * inside
        return result

    return weights


def _potential_weights(places: Sequence[Box], fadings: Sequence[Fading]) -> Weights:
    """Compute weights from the label potential of each pair of layers."""

    def weights(box: Box, shows: Labels, index: list[int]) -> dict[int, Floats32]:
        result = {k: (shows == k).astype(np.float32) for k in index}
        for fading in fadings:
            i, j = fading.pair
            common = fading.box.shared(box)
            if i not in result or j not in result or not all(common.shape):
                continue
            here, there = common.within(box), common.within(fading.box)
            potential, free = fading.potential[there], fading.shared[there]
            towards = np.clip(potential, 0, 1 - SETTLED)
            back = np.clip(1 - potential, 0, 1 - SETTLED)
            result[j][here] += np.where(free & (shows[here] == i), towards / (1 - towards), np.float32(0))
            result[i][here] += np.where(free & (shows[here] == j), back / (1 - back), np.float32(0))
        return {k: weight[places[k].shared(box).within(box)] for k, weight in result.items()}

    return weights
