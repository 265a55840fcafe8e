"""`join_volumes`: join two stacks, of which the second continues the first."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Mask, Volume
from toposeam.checks import check_function, check_number, check_numbers, check_whole
from toposeam.display import to_png
from toposeam.errors import ImageError
from toposeam.seam.problem.match_cost import MatchCost, check_no_reach, match_options
from toposeam.volume.find import find_surface
from toposeam.volume.heat.method import SurfaceKeywords, SurfaceOptions
from toposeam.volume.mesh import Mesh, mesh_of
from toposeam.volume.problem.arrays import as_volume
from toposeam.volume.problem.canvas import Places, place_stacks
from toposeam.volume.problem.posing import check_spacing
from toposeam.volume.surface import Surface


@dataclass(frozen=True, kw_only=True, eq=False)
class JoinedVolume:
    """Two stacks joined along a surface; of dask arrays the volume is a dask array, not computed yet.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 8, 10, 10))
    >>> ts.join_volumes(a, b, offset=(4, 0, 0)).volume.shape
    (12, 10, 10)
    """

    #: (D, H, W[, C]) array of the stacks' dtype; 0 where neither has voxels.
    volume: Any = field(repr=False)
    #: Labels of the box that both cover, True where ``b`` shows.
    labels: Any = field(repr=False)
    #: Boxes of the stacks on the canvas, and their common box.
    places: Places
    #: The surface, unless it was found by blocks. Its window is the common box with a margin of one voxel
    #: within the canvas.
    surface: Surface | None = None
    #: The settings that make it again.
    settings: dict[str, Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        shape = " × ".join(map(str, self.places.canvas))
        cost = "in blocks" if self.surface is None else f"cost {self.surface.cost:.6g}"
        return f"JoinedVolume({shape} voxels, {cost})"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> Volume:
        """Return the voxels, for NumPy."""
        return np.array(self.volume, dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        """Return the middle slice, for notebooks."""
        middle = np.asarray(self.volume[len(self.volume) // 2])
        return to_png((255 * (middle / max(float(middle.max()), 1e-12))).astype(np.uint8))

    def mesh(self, smooth: float = 1.0) -> Mesh:
        """Return the surface inside the common box as triangles, by marching cubes (scikit-image).

        Vertices are in coordinates of the canvas.

        Parameters
        ----------
        smooth : float
            As for :meth:`Surface.mesh`.

        Raises
        ------
        OverlapError
            When one stack covers all of the common box.
        """
        check_number("smooth", smooth, 0, 100)
        start = [part.start for part in self.places.overlap]
        return mesh_of(np.asarray(self.labels), self.settings["spacing"], smooth, start)


def join_volumes(
    a: Any,
    b: Any,
    *,
    offset: Sequence[int],
    spacing: Sequence[float] = (1.0, 1.0, 1.0),
    gradient: bool | None = None,
    cost: MatchCost | None = None,
    core: float = 0.5,
    block: int | None = None,
    keep: str | Path | None = None,
    data_range: float | None = None,
    options: SurfaceOptions | None = None,
    progress: Callable[[float], None] | None = None,
    **given: Unpack[SurfaceKeywords],
) -> JoinedVolume:
    """Join two overlapping stacks along the surface that shows least.

    Parameters
    ----------
    a, b : (D, H, W) or (D, H, W, C) arrays of one dtype and number of channels
        NumPy arrays, or dask arrays, which are joined by blocks and may be larger than memory.
    offset : three int
        Position of b's first voxel in a, (z, y, x); may be negative.
    spacing : three positive floats
        Depth, height and width of a voxel.
    gradient, cost, core, data_range, options
        As for :func:`find_surface`.
    block : int, optional
        Join by blocks of about this side, in voxels; of dask arrays 160 by default. A coarse surface of the
        whole decides first, so that blocks agree at their borders (:mod:`toposeam.volume.blocks`).
    keep : path, optional
        zarr folder for the labels when joining by blocks; by default they are in memory, a byte each.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    JoinedVolume

    Raises
    ------
    ImageError, OverlapError, OptionError, MissingPackageError
        The text states the value received and a remedy.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> cells = np.random.default_rng(0).random((6, 20, 30))
    >>> joined = ts.join_volumes(cells[:, :, :20], cells[:, :, 12:], offset=(0, 0, 12))
    >>> bool((joined.volume == cells).all())
    True
    """
    check_function("progress", progress)
    flat = getattr(a, "ndim", None) == 3 or (isinstance(a, list | tuple) and check_numbers("a", a).ndim == 3)
    lazy = block is not None or any(hasattr(stack, "dask") for stack in (a, b))
    if lazy:
        from toposeam.volume.blocks import as_dask

        a, b = as_dask(a, "a"), as_dask(b, "b")
    one, other = (stack if lazy else as_volume(stack, name) for stack, name in ((a, "a"), (b, "b")))
    if one.dtype != other.dtype:
        raise ImageError(
            "{a} has dtype {dtype_a} and {b} has {dtype_b}; convert one of them",
            kind="dtype",
            dtype_a=str(one.dtype),
            dtype_b=str(other.dtype),
        )
    if one.shape[3] != other.shape[3]:
        raise ImageError(
            "{a} has {channels_a} channels and {b} has {channels_b}; give both equally many",
            kind="channels",
            channels_a=one.shape[3],
            channels_b=other.shape[3],
        )
    match = check_no_reach(match_options(gradient, cost), "surfaces")
    spacing = check_spacing(spacing)
    places = place_stacks(one.shape[:3], other.shape[:3], offset)
    settings: dict[str, Any] = {
        "offset": tuple(int(step) for step in offset),
        "spacing": spacing,
        "block": block,
        **dataclasses.asdict(match),
    }
    surface = None
    labels: Any
    if lazy:
        from toposeam.volume.blocks import BLOCK, assemble, labels_by_blocks

        side = BLOCK if block is None else check_whole("block", block, 16, 4096)
        labels = labels_by_blocks(one, other, places, match, spacing, side, data_range, keep, progress)
        joined = assemble(one, other, places, labels)
    else:
        surface, labels = _join_whole(
            one, other, places, match, spacing, core, data_range, options, progress, given
        )
        joined = _assemble(one, other, places, labels)
    return JoinedVolume(
        volume=joined[..., 0] if flat else joined,
        labels=labels,
        places=places,
        surface=surface,
        settings=settings,
    )


def _join_whole(
    a: Volume,
    b: Volume,
    places: Places,
    cost: MatchCost,
    spacing: Sequence[float],
    core: float,
    data_range: float | None,
    options: SurfaceOptions | None,
    progress: Callable[[float], None] | None,
    given: SurfaceKeywords,
) -> tuple[Surface, Mask]:
    """Find the surface on the common box with a margin of one voxel; return it and the labels of the box."""
    window = tuple(
        slice(max(0, part.start - 1), min(length, part.stop + 1))
        for part, length in zip(places.overlap, places.canvas, strict=True)
    )
    shape = tuple(part.stop - part.start for part in window)
    stacks, masks = [], []
    for stack, which in ((a, "a"), (b, "b")):
        box = places.box(which)
        common = [slice(max(w.start, s.start), min(w.stop, s.stop)) for w, s in zip(window, box, strict=True)]
        here = tuple(slice(c.start - w.start, c.stop - w.start) for c, w in zip(common, window, strict=True))
        values = np.zeros((*shape, stack.shape[3]), stack.dtype)
        values[here] = stack[places.inside(common, which)]
        mask = np.zeros(shape, bool)
        mask[here] = True
        stacks.append(values)
        masks.append(mask)
    surface = find_surface(
        *stacks,
        *masks,
        cost=cost,
        spacing=spacing,
        core=core,
        data_range=data_range,
        options=options,
        progress=progress,
        **given,
    )
    inner = tuple(
        slice(part.start - w.start, part.stop - w.start)
        for part, w in zip(places.overlap, window, strict=True)
    )
    return surface, surface.labels[inner]


def _assemble(a: Volume, b: Volume, places: Places, labels: Mask) -> Volume:
    joined = np.zeros((*places.canvas, a.shape[3]), a.dtype)
    joined[places.box("b")] = b
    before = joined[places.overlap].copy()
    joined[places.box("a")] = a
    common = joined[places.overlap]
    joined[places.overlap] = np.where(labels[..., np.newaxis], before, common)
    return joined
