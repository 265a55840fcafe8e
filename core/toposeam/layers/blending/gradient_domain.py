"""Gradient-domain blending: the step at the seam is taken out and spread smoothly.

The composite's gradients are kept wherever one layer shows; across a seam the mean of the two layers' own
gradients is wanted instead of the step between them (Pérez, Gangnet and Blake 2003,
doi:10.1145/882262.882269). The composite plus a correction c has these gradients as nearly as can be when c
minimises Σ (c(q) - c(p) + d(p, q))² over neighbouring pixels, d being the excess step: 0 but on seams. That
is Poisson's equation with sources on the seams only. On the whole rectangle of the canvas, pixels without a
layer included, cosine transforms solve it directly, in O(n log n) and to rounding error.

With a width, c² / width² is added per pixel: the correction fades from the seam, exp(-distance / width), and
colours far away stay.

Layers that lie inside another one, as a patch on a picture, take over its tones: the picture is corrected as
if they were not there, and they are, with c = 0 beside them (*seamless cloning*, ibid.).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Image, Labels, Mask
from toposeam.heat.poisson import add_steps, spread, spread_within
from toposeam.images import box_of, in_dtype
from toposeam.layers.blending.mixing import Blending
from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.canvas.tile_map import dense


class GradientDomain(Blending):
    """The step between layers is spread over the whole picture, or over the width."""

    name = "gradient"
    takes_width = True
    needs_whole = True
    #: Even differences of layers over this many px from a seam are removed by the correction.
    _EVEN_REACH = 8.0

    @property
    def reach(self) -> float:
        """Distance from a seam, px, over which even differences of the layers are removed."""
        return self._EVEN_REACH

    def spread(self, canvas: Canvas, labels: Labels, image: Image, *, goes_round: bool) -> None:
        """Blend a whole composite in place."""
        labels = dense(labels)
        ground = labels >= 0
        planes = [image] if image.ndim == 2 else [image[..., channel] for channel in range(image.shape[2])]
        inner = lying_inside(canvas.covers, canvas.places)
        for channel, plane in enumerate(planes):
            values = correction(canvas, labels, channel, self.width, goes_round, inner)
            values += plane
            np.copyto(plane, in_dtype(values, plane.dtype), where=ground)


def correction(
    canvas: Canvas,
    label_map: Labels,
    channel: int,
    width: float | None,
    goes_round: bool = False,
    inner: Mask | None = None,
) -> Floats:
    """Compute the correction to add to one channel of the composite, (H, W), in the layers' units.

    Parameters
    ----------
    canvas : Canvas
    label_map : (H, W) int16 array
        The layer that shows at each pixel.
    channel : int
    width : float or None
        Distance, px, over which the correction fades; None keeps all gradients and the mean.
    goes_round : bool
        Whether the canvas's left edge adjoins its right one.
    inner : (n,) bool array, optional
        Which layers lie inside another one, if it is known (:func:`lying_inside`).
    """
    columns, covered, places = label_map.shape[1], canvas.covers, canvas.places
    source, onto = np.zeros((2, *label_map.shape))
    flat = label_map.ravel()
    inner = lying_inside(covered, places) if inner is None else inner
    borders = [(np.flatnonzero(_differ(label_map, axis)), stride) for axis, stride in ((1, 1), (0, columns))]
    if goes_round:
        end, begin = label_map[:, -1], label_map[:, 0]
        rows = np.flatnonzero((end != begin) & (end >= 0) & (begin >= 0))
        borders.append((rows * columns + columns - 1, 1 - columns))
    for p, stride in borders:
        q = p + stride
        step = np.zeros(len(p))
        for i, j in {(int(a), int(b)) for a, b in zip(flat[p], flat[q], strict=True)}:
            mine = (flat[p] == i) & (flat[q] == j)
            at_p, at_q = p[mine], q[mine]
            first, second = ((canvas.layers[k], places[k], covered[k], channel, columns) for k in (i, j))
            (i_p, has_i_p), (i_q, has_i_q) = _values(*first, at_p), _values(*first, at_q)
            (j_p, has_j_p), (j_q, has_j_q) = _values(*second, at_p), _values(*second, at_q)
            both_p, both_q = has_i_p & has_j_p, has_i_q & has_j_q
            excess = np.where(both_p, j_p - i_p, 0.0) + np.where(both_q, j_q - i_q, 0.0)
            number = both_p.astype(int) + both_q
            step[mine] = np.where(number > 0, excess / np.maximum(number, 1), j_q - i_p)
        patch = inner[flat[p]] | inner[flat[q]]
        for target, kind in ((source, ~patch), (onto, patch)):
            add_steps(target.ravel(), p[kind], q[kind], step[kind])
    result: Floats = spread(source, width, (False, goes_round))
    if onto.any():
        free = (label_map >= 0) & inner[label_map]
        around = tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in box_of(free))
        result[around] += spread_within(onto[around], free[around], width)
    return result


def lying_inside(covered: Sequence[Mask], places: Sequence[Box]) -> Mask:
    """(n,) bool: test which layers lie wholly inside another one; of two equal layers the later one does."""
    size = [np.count_nonzero(dense(cover)) for cover in covered]
    inside = np.zeros(len(covered), bool)
    for i, j in itertools.permutations(range(len(covered)), 2):
        if (size[i], -i) < (size[j], -j) and places[i].shared(places[j]) == places[i]:
            inside[i] |= bool(dense(covered[j])[places[i].within(places[j])][dense(covered[i])].all())
    return inside


def _differ(label_map: Labels, axis: int) -> Mask:
    """(H, W) bool mask of pixels whose right (axis 1) or lower (axis 0) neighbour shows another layer."""
    result = np.zeros(label_map.shape, bool)
    s, t = ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]))[1 - axis]
    result[s] = (label_map[s] != label_map[t]) & (label_map[s] >= 0) & (label_map[t] >= 0)
    return result


def _values(
    layer: Layer, place: Box, covered: Mask, channel: int, columns: int, pixels: npt.NDArray[np.intp]
) -> tuple[Floats, Mask]:
    """Return a layer's values at pixels of the canvas, given by flat indices, and the mask where it has any;
    0 elsewhere.
    """
    row, column = np.divmod(pixels, columns)
    row, column = row - place.top, column - place.left
    known = (row >= 0) & (column >= 0) & (row < place.shape[0]) & (column < place.shape[1])
    known[known] = dense(covered)[row[known], column[known]]
    image = np.asarray(layer.image)
    plane: Image = image if image.ndim == 2 else image[..., min(channel, image.shape[2] - 1)]
    values = np.zeros(len(pixels))
    values[known] = plane[row[known], column[known]]
    return values, known
