"""Join two stacks, of which the second continues the first."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Volume
from toposeam.checks import (
    check_choice,
    check_function,
    check_number,
    check_numbers,
    check_whole,
    kind_error,
    options_from,
)
from toposeam.display import to_png
from toposeam.errors import ImageError
from toposeam.seam.problem.match_cost import MatchCost, check_no_reach, match_options
from toposeam.volume.counting import cells_of
from toposeam.volume.heat.method import SurfaceKeywords, SurfaceOptions
from toposeam.volume.mesh import Mesh, mesh_of
from toposeam.volume.pair import StackPair
from toposeam.volume.problem.arrays import as_volume
from toposeam.volume.problem.canvas import Places, place_stacks
from toposeam.volume.problem.posing import check_spacing
from toposeam.volume.problem.tones import Tones, tones_of
from toposeam.volume.surface import Surface
from toposeam.volume.verdict import SurfaceVerdict


@dataclass(frozen=True, kw_only=True, eq=False)
class JoinedVolume:
    """Two stacks joined along a surface; of dask arrays the volume is a dask array, not computed yet.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 8, 10, 10))
    >>> ts.volume(a, b, offset=(4, 0, 0)).volume.shape
    (12, 10, 10)
    """

    #: (D, H, W[, C]) array of the stacks' dtype; 0 where neither has voxels.
    volume: Any = field(repr=False)
    #: Labels of the box that both cover, True where ``b`` shows.
    labels: Any = field(repr=False)
    #: Boxes of the stacks on the canvas, and their common box.
    places: Places
    #: (D, H, W) numbers of cells on the canvas, of the stacks that show, if a segmentation was given.
    cells: Any = field(default=None, repr=False)
    #: Black, white and gain of the stacks, unless they were taken as they are.
    tones: Tones | None = field(default=None, repr=False)
    #: (D, H, W) array of bool, where the canvas has voxels; None if everywhere.
    present: Any = field(default=None, repr=False)
    #: The surface, unless it was found by blocks. Its window is the common box with a margin of one voxel
    #: within the canvas.
    surface: Surface | None = None
    #: The settings that make it again.
    settings: dict[str, Any] = field(default_factory=dict, repr=False)
    #: The stacks.
    _pair: StackPair = field(repr=False)

    @cached_property
    def verdict(self) -> SurfaceVerdict:
        """How visibly slices show the surface, judged when it is asked for: up to twelve across each axis."""
        return self._pair.verdict(self.labels, bool(self.settings["match_tones"]))

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


def volume(
    a: Any,
    b: Any,
    *,
    offset: Sequence[int],
    spacing: Sequence[float] = (1.0, 1.0, 1.0),
    gradient: bool | None = None,
    cost: MatchCost | None = None,
    cells: bool | Sequence[Any] = True,
    match_tones: bool = False,
    core: float = 0.5,
    block: int | None = None,
    keep: str | Path | None = None,
    data_range: float | None = None,
    options: SurfaceOptions | None = None,
    progress: Callable[[float], None] | None = None,
    **given: Unpack[SurfaceKeywords],
) -> JoinedVolume:
    """Join two overlapping stacks along the surface that shows least, and cuts the fewest cells.

    Parameters
    ----------
    a, b : (D, H, W) or (D, H, W, C) arrays of one dtype and number of channels
        NumPy arrays, or dask arrays, which are joined by blocks and may be larger than memory. ``a`` may be a
        :class:`JoinedVolume`, to which a further stack is joined.
    offset : three int
        Position of b's first voxel in a, (z, y, x); may be negative.
    spacing : three positive floats
        Depth, height and width of a voxel.
    gradient, cost, core, options
        As for :func:`find_surface`.
    cells : bool, or a pair of (D, H, W) arrays of integers or bool
        Segmentations of ``a`` and ``b``: the number of the cell at each voxel, 0 between cells, or a mask;
        None where there is none. Cutting a cell has a price; it is not forbidden. By default cells are taken
        to be what is bright among its surroundings. False leaves the costs as they are, and white as it is
        for :func:`find_surface`: for clips, and for what is looked at rather than counted.
    match_tones : bool
        Give ``b`` the black and the brightness of ``a``, as a smooth field: its values change. The search for
        the surface evens them out in any case, unless `cells` is False.
    block : int, optional
        Join by blocks of about this side, in voxels; of dask arrays 160 by default. A coarse surface of the
        whole decides first, so that blocks agree at their borders (:mod:`toposeam.volume.blocks`).
    keep : path, optional
        zarr folder for the labels when joining by blocks; by default they are in memory, a byte each.
    data_range : float, optional
        Difference between white and black; by default found from the stacks.
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
    >>> joined = ts.volume(cells[:, :, :20], cells[:, :, 12:], offset=(0, 0, 12))
    >>> bool((joined.volume == cells).all())
    True
    """
    check_function("progress", progress)
    check_choice("match_tones", match_tones, (True, False))
    before = a if isinstance(a, JoinedVolume) else None
    flat, lazy, one, other = _stacks(a if before is None else before.volume, b, block)
    match = check_no_reach(match_options(gradient, cost), "surfaces")
    chosen = options_from(SurfaceOptions, options, given, "method heat")
    spacing = check_spacing(spacing)
    places = place_stacks(one.shape[:3], other.shape[:3], offset)
    side = None
    if lazy:
        from toposeam.volume.blocks import BLOCK

        side = BLOCK if block is None else check_whole("block", block, 16, 4096)
    if before is not None and cells is True and before.cells is not None:
        cells = (before.cells, None)
    counted = None
    if not isinstance(cells, bool):
        numbers = _pair_of(cells)
        if lazy:
            from toposeam.volume.blocks import as_dask

            numbers = [None if each is None else as_dask(each, "cells")[..., 0] for each in numbers]
        counted = cells_of(numbers, places)
    present = None if before is None else before.present
    tones = None
    if cells is not False or match_tones:
        white = None if data_range is None else check_number("data_range", data_range, 0, 1e30, above=True)
        tones = tones_of(one, other, places, white, present)
    pair = StackPair(
        a=one,
        b=other,
        places=places,
        cost=match,
        spacing=spacing,
        tones=tones,
        data_range=data_range,
        priced=cells is not False and match.law == "natural",
        cells=counted,
        present=present,
    )
    settings: dict[str, Any] = {
        "offset": tuple(int(step) for step in offset),
        "spacing": spacing,
        "block": block,
        "match_tones": match_tones,
        **dataclasses.asdict(match),
    }
    surface = None
    labels: Any
    if side is None:
        surface, labels = pair.whole(core, chosen, settings, progress)
    else:
        labels = pair.by_blocks(side, keep, progress)
    joined = pair.joined(labels, match_tones)
    return JoinedVolume(
        volume=joined[..., 0] if flat else joined,
        labels=labels,
        places=places,
        cells=pair.joined_cells(labels),
        tones=tones,
        present=pair.covered(),
        surface=surface,
        settings=settings,
        _pair=pair,
    )


def _stacks(a: Any, b: Any, block: int | None) -> tuple[bool, bool, Any, Any]:
    """Return whether stacks have no channel axis and are dask arrays, and both with such an axis.

    Raises
    ------
    ImageError
        For stacks of unlike dtypes or numbers of channels.
    """
    flat = getattr(a, "ndim", None) == 3 or (isinstance(a, list | tuple) and check_numbers("a", a).ndim == 3)
    lazy = block is not None or any(hasattr(stack, "dask") for stack in (a, b))
    if lazy:
        from toposeam.volume.blocks import as_dask

        a, b = as_dask(a, "a"), as_dask(b, "b")
    else:
        a, b = as_volume(a, "a"), as_volume(b, "b")
    if a.dtype != b.dtype:
        raise ImageError(
            "{a} has dtype {dtype_a} and {b} has {dtype_b}; convert one of them",
            kind="dtype",
            dtype_a=str(a.dtype),
            dtype_b=str(b.dtype),
        )
    if a.shape[3] != b.shape[3]:
        raise ImageError(
            "{a} has {channels_a} channels and {b} has {channels_b}; give both equally many",
            kind="channels",
            channels_a=a.shape[3],
            channels_b=b.shape[3],
        )
    return flat, lazy, a, b


def _pair_of(cells: Any) -> list[Any]:
    """Return segmentations of two stacks.

    Raises
    ------
    OptionError
        Unless there are two of them.
    """
    if not isinstance(cells, list | tuple) or len(cells) != 2:
        raise kind_error("cells", type(cells).__name__, "True, False, or a pair of arrays, None for neither")
    return list(cells)


#: The former name of :func:`volume`.
join_volumes = volume
