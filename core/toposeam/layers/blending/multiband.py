"""Multiband blending: coarse shades are mixed over a wide band, fine detail over a narrow one.

Each layer is decomposed into a Laplacian pyramid, its mask into a Gaussian pyramid. The bands are mixed by
the masks of their level, and the pyramid is collapsed (Burt and Adelson 1983, doi:10.1145/245.247).

Pyramids are linear, so the result is the hard cut plus the mixture of each layer's difference from it. The
difference is 0 where the layer shows, and nearly constant where only the exposure differs; so it can be
extended to where the layer has no pixels, which the layer itself cannot. Known pixels are averaged down the
pyramid. On the way up, missing pixels are interpolated from the next coarser level. The band of a level is
its excess over that, 0 where nothing is known.

At full size each pixel is that of the layer that shows, with difference 0. So the finest band needs no sums,
and all mixing is done at half the size and less, for all layers together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Floats32, Labels, Mask
from toposeam.layers.blending.mixing import SETTLED, Blending, Fading, Mix, channels_of, planes_of
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box
from toposeam.seam.problem.pyramid import expand, expand_part, gaussian, in_runs, reduce

#: Weight of interpolated pixels of a band, so that they count only where no layer is known; and a small
#: number that keeps sums of weights above 0.
_INTERPOLATED_WEIGHT, _LEAST_SUM = np.float32(1e-3), np.float32(1e-9)
#: Lower bound of the fraction of known pixels in divisions.
_LEAST_KNOWN = np.float32(1e-3)
#: Distance, px, from which known pixels contribute to a reduced pixel: the reach of the reduction filter.
_FILTER_REACH = 2


class Multiband(Blending):
    """Coarse shades fade over the width, fine detail over a few px."""

    name = "multiband"
    takes_width = True
    usual_width = 32.0

    @property
    def _levels(self) -> int:
        return max(1, round(math.log2(self.width or 1.0)))

    @property
    def reach(self) -> float:
        """The width, px."""
        return self.width or 0.0

    @property
    def grid(self) -> int:
        """Side of the coarsest pixels, px."""
        return int(2**self._levels)

    @property
    def changes_within(self) -> int:
        """Four of the coarsest pixels, px."""
        return 4 * self.grid

    def mixer(self, canvas: Canvas, labels: Labels, fadings: Sequence[Fading]) -> Mix:
        """Mix band by band."""

        def mix(box: Box, shows: Labels, index: list[int]) -> tuple[Floats32, None, Mask]:
            return _mixed_bands(canvas, self._levels, box, shows, index)

        return mix


def _mixed_bands(
    canvas: Canvas, levels: int, box: Box, shows: Labels, index: list[int]
) -> tuple[Floats32, None, Mask]:
    """Mix the layers of a box band by band."""
    channels = channels_of(canvas)
    mixed = np.zeros((channels, *box.shape), np.float32)
    found = []
    for k in index:
        common = canvas.places[k].shared(box)
        # The reduction takes pairs of pixels, so the box's edges are even.
        part = Box(*(edge // 2 * 2 for edge in common[:2]), *(-(-edge // 2) * 2 for edge in common[2:]))
        here = part.within(box)
        own = shows[here] == k
        if not own.any():
            continue
        planes, present = planes_of(canvas, k, part, channels)
        np.copyto(mixed[:, *here], planes, where=own)
        found.append((part, here, own, planes, present & (shows[here] >= 0)))
    pieces = []
    for part, here, own, planes, known in found:
        planes -= mixed[:, *here]
        if not known.all():
            planes *= known
        pieces.append(
            Contribution(box=part.moved(-box.top, -box.left), difference=planes, known=known, shows=own)
        )
    changed = Mixture(pieces, box.shape, levels, SETTLED).onto(mixed)
    return np.moveaxis(mixed, 0, 2), None, changed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contribution:
    """The part of a layer that contributes to a tile."""

    #: The box of the tile that the arrays fill; all edges are even.
    box: Box
    #: (C, h, w) float32: the layer minus the hard cut; 0 where the layer has no pixels.
    difference: Floats32
    #: (h, w) bool masks: where the difference is known, and where the layer shows.
    known: Mask
    shows: Mask


class Mixture:
    """The difference between the multiband mixture of some layers and their hard cut.

    Parameters
    ----------
    parts : sequence of Contribution
        At most one layer shows at a pixel.
    shape : (int, int)
        Height and width of the tile, multiples of 2 ** levels px.
    levels : int
        Halvings of the resolution, at least one. The coarsest band is mixed over about 2 ** levels px on
        either side of the seam.
    settled : float
        A pixel does not change if the layer that shows has all but this fraction of the coarsest band.
    """

    def __init__(
        self, parts: Sequence[Contribution], shape: tuple[int, int], levels: int, settled: float
    ) -> None:
        self._parts = parts
        count, channels = len(parts), len(parts[0].difference)
        half = shape[0] // 2, shape[1] // 2
        # Per layer: its difference, the mask where that is known, and the mask where it shows.
        reduced = np.zeros((count, channels + 2, *half), np.float32)
        whole = Box(0, 0, *shape)
        for target, part in zip(reduced, parts, strict=True):
            around = part.box.grown(_FILTER_REACH).shared(whole)
            at, inside = around.halved().slices, part.box.within(around)
            planes = *part.difference, part.known, part.shows
            for run in in_runs(len(planes), math.prod(around.shape)):  # a few planes at a time: memory
                wide = np.zeros((run.stop - run.start, *around.shape), np.float32)
                for plane, values in zip(wide, planes[run], strict=True):
                    plane[inside] = values
                target[run, *at] = reduce(wide)
        #: (K, C, h / 2, w / 2), the difference of each layer, and (C, h / 2, w / 2), the mixture of all.
        self._layers, self._mixed, share = _mixed(reduced, levels)
        for _ in range(levels - 1):
            share = expand(share)
        self._changes = share < (1 - settled) * share.sum(axis=0)

    def onto(self, colours: Floats32) -> Mask:
        """Add the difference to (C, H, W) colours in place; return the (H, W) bool mask of changed pixels."""
        changed = np.zeros(colours.shape[1:], bool)
        for part, layer, changes in zip(self._parts, self._layers, self._changes, strict=True):
            here, reduced = part.box.slices, part.box.halved()
            if not changes[reduced.slices].any():
                continue
            wide = reduced.grown(1).shared(Box(0, 0, *changes.shape))
            more = self._mixed[:, *wide.slices] - layer[:, *wide.slices]
            rows, columns = (slice(2 * side.start, 2 * side.stop) for side in reduced.within(wide))
            more = expand_part(more, rows, columns)
            more *= part.shows
            colours[:, *here] += more
            changed[here] |= part.shows & changes[reduced.slices].repeat(2, axis=0).repeat(2, axis=1)
        return changed


def _mixed(reduced: Floats32, levels: int) -> tuple[Floats32, Floats32, Floats32]:
    """Collapse all bands but the finest, from the coarsest to that of half the size.

    Returns each layer, the mixture, and the fraction of the coarsest pixels that each layer shows.
    """
    count, channels = len(reduced), reduced.shape[1] - 2
    pyramid = gaussian(reduced.reshape(-1, *reduced.shape[2:]), levels - 1)
    layers = mixed = np.zeros(0, np.float32)
    for every in reversed(pyramid):
        planes = every.reshape(count, -1, *every.shape[1:])
        weight, mask = planes[:, -2], planes[:, -1]
        band = planes[:, :channels]
        band /= np.maximum(weight, _LEAST_KNOWN)[:, np.newaxis]
        # Interpolated pixels count next to nothing, unless no layer is known there.
        part = mask * np.maximum(2 * weight - 1, _INTERPOLATED_WEIGHT)
        part /= part.sum(axis=0) + _LEAST_SUM
        if not layers.size:
            layers, mixed = band, (band * part[:, np.newaxis]).sum(axis=0)
            continue
        finer = expand(np.concatenate([layers.reshape(-1, *layers.shape[2:]), mixed]))
        coarser, mixed = finer[:-channels].reshape(band.shape), finer[-channels:]
        band -= coarser
        # Where few pixels were averaged, the coarser level prevails.
        band *= np.minimum(weight, 1)[:, np.newaxis]
        mixed += (band * part[:, np.newaxis]).sum(axis=0)
        band += coarser
        layers = band
    return layers, mixed, pyramid[-1][channels + 1 :: channels + 2]
