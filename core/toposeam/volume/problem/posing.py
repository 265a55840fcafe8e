"""Posing of surface problems: from two volumes, masks and options to an overlap and costs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Mask, Volume
from toposeam.checks import check_choice, check_number
from toposeam.errors import ImageError, OptionError, OverlapError, Term
from toposeam.heat.bricks import along
from toposeam.images import as_mask
from toposeam.seam.problem.match_cost import MatchCost, match_cost
from toposeam.seam.problem.overlap import FREE, A, B, Overlap
from toposeam.seam.problem.posing import as_weights, forbid, placed
from toposeam.volume.problem.arrays import as_shares, as_volume
from toposeam.volume.problem.cells import add_prices
from toposeam.volume.problem.surface_problem import SurfaceProblem

#: Size of the blocks, in voxels, about, by which the match cost is computed, to bound memory.
_BLOCK_VOXELS = 1 << 18
AXES = (0, 1, 2)


def surface_problem(
    a: npt.ArrayLike,
    b: npt.ArrayLike,
    mask_a: npt.ArrayLike | None,
    mask_b: npt.ArrayLike | None,
    axis: int,
    cost: MatchCost,
    spacing: Sequence[float] = (1.0, 1.0, 1.0),
    weight: npt.ArrayLike | None = None,
    avoid: npt.ArrayLike | None = None,
    core: float = 0.5,
    speck: float | None = None,
    channel_axis: int | None = None,
    data_range: float | None = None,
    cells: npt.NDArray[Any] | None = None,
) -> tuple[SurfaceProblem, Mask]:
    """Pose the problem of :func:`toposeam.find_surface`; `cells` are those of :mod:`.cells`, on the canvas.

    Returns
    -------
    problem : SurfaceProblem
    only_b : (D, H, W) bool array
        True on voxels that only ``b`` covers.
    """
    volume_a, volume_b = as_volume(a, "a", channel_axis), as_volume(b, "b", channel_axis)
    canvas = volume_a.shape[:3]
    if canvas != volume_b.shape[:3]:
        raise ImageError(
            "{a} has {size_a!s} voxels and {b} has {size_b!s}; put both on one canvas of the "
            "same size (toposeam.volume does)",
            kind="shape",
            size_a=canvas,
            size_b=volume_b.shape[:3],
        )
    channels = {volume_a.shape[3], volume_b.shape[3]}
    if len(channels) > 1 and 1 not in channels:
        raise ImageError(
            "{a} has {channels_a} channels and {b} has {channels_b}; convert them to the same"
            " number, or one of them to gray",
            kind="channels",
            channels_a=volume_a.shape[3],
            channels_b=volume_b.shape[3],
        )
    overlap, on_a, on_b, only_b = placed(
        canvas, mask_a, mask_b, core, speck, lambda: end_to_end(canvas, axis)
    )
    factor = None if weight is None else overlap.window(as_weights(weight, canvas)).astype(np.float32)
    costs = match_costs(
        overlap.window(volume_a), overlap.window(volume_b), overlap, on_a, on_b, cost, factor, data_range
    )
    if cells is not None:
        add_prices(costs, overlap.window(cells))
    for part, area in zip(costs, face_areas(spacing), strict=True):
        part *= area
    forbidden = float("inf")
    if avoid is not None:
        forbidden = forbid(costs, overlap.window(as_mask(avoid, canvas, "avoid")))
    return SurfaceProblem(overlap, costs, forbidden), only_b


def end_to_end(shape: tuple[int, ...], axis: int) -> Overlap:
    """Return an overlap that fills the whole canvas, with ``b`` continuing beyond it along an axis.

    Raises
    ------
    OptionError
        For another axis.
    OverlapError
        When no surface fits between the two ends.
    """
    check_choice("axis", axis, AXES)
    if shape[axis] < 2:
        raise OverlapError(
            "the overlap is {count} voxel long along axis {axis}; a surface needs at least 2 between the two "
            "volumes",
            kind="narrow",
            count=shape[axis],
            axis=axis,
        )
    side = np.full(shape, FREE, np.uint8)
    side[along(axis, slice(1))] = A
    side[along(axis, slice(-1, None))] = B
    return Overlap(side, np.ones(shape, bool), (0, 0, 0), tuple(shape))


def face_areas(spacing: Sequence[float]) -> tuple[np.float32, ...]:
    """Return the area of a voxel's faces across each axis, relative to the face of a cube of the same volume.

    Examples
    --------
    Voxels that are eight times as deep as they are wide have two faces of a quarter, and four of twice the
    cube's:

    >>> [float(area) for area in face_areas((8, 1, 1))]
    [0.25, 2.0, 2.0]
    """
    side = float(np.prod(spacing)) ** (1 / 3)
    return tuple(np.float32(side / length) for length in spacing)


def check_spacing(spacing: Sequence[float]) -> tuple[float, float, float]:
    """Check and return the depth, height and width of a voxel.

    Raises
    ------
    OptionError
        Unless it is three positive numbers.
    """
    try:
        lengths = [check_number("spacing", length, 0, above=True) for length in spacing]
    except TypeError as error:
        raise OptionError(
            "{parameter} is {value!r}; pass one length per axis, like (2.0, 0.5, 0.5)",
            kind="type",
            parameter=Term("spacing"),
            value=spacing,
        ) from error
    if len(lengths) != 3:
        raise OptionError(
            "{parameter} has {count} lengths; pass three: depth, height, width of a voxel",
            kind="type",
            parameter=Term("spacing"),
            value=spacing,
            count=len(lengths),
        )
    depth, height, width = lengths
    return depth, height, width


def match_costs(
    a: Volume,
    b: Volume,
    overlap: Overlap,
    on_a: Mask,
    on_b: Mask,
    cost: MatchCost,
    factor: Floats32 | None,
    data_range: float | None,
) -> tuple[Floats32, ...]:
    """Compute the match cost along three axes, by blocks of slices: only one is in memory as float32."""
    shape = overlap.side.shape
    result = tuple(
        np.empty([length - (place == axis) for place, length in enumerate(shape)], np.float32)
        for axis in AXES
    )
    step = max(1, _BLOCK_VOXELS // (shape[1] * shape[2]))
    for start in range(0, shape[0], step):
        stop = min(start + step, shape[0])
        # Add the slice after the last one, and at both ends the slices that the cost looks at.
        low, high = max(start - cost.look, 0), min(stop + 1 + cost.look, shape[0])
        part = slice(low, high)
        block = Overlap(overlap.side[part], overlap.shared[part], (low, 0, 0), overlap.canvas)
        one, other = (
            _shares(volume[part], present[part], name, data_range)
            for volume, present, name in ((a, on_a, "a"), (b, on_b, "b"))
        )
        channels = max(one.shape[3], other.shape[3])
        found = match_cost(
            np.broadcast_to(one, (*one.shape[:3], channels)),
            np.broadcast_to(other, (*other.shape[:3], channels)),
            block,
            on_a[part],
            on_b[part],
            cost,
            None if factor is None else factor[part],
            AXES,
        )
        for whole, piece in zip(result, found, strict=True):
            whole[start:stop] = piece[start - low : stop - low]
    return result


def _shares(volume: Volume, present: Mask, name: str, data_range: float | None) -> Floats32:
    """Return a block of a volume as float32 shares of white, 0 where its mask has no voxels."""
    if not present.all():
        volume = np.where(present[..., np.newaxis], volume, volume.dtype.type(0))
    return as_shares(volume, name, data_range)
