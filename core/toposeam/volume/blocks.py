"""Joining of stacks larger than memory, block by block on dask arrays.

First a coarse surface is found. The match cost is computed once, block by block, and summed between coarse
voxels that are large enough for their grid to fit into memory. The surface on this grid gives every voxel a
first label. Then a surface is found in each block, within a slab round the first one. The block's border is
fixed at the first labels, so that blocks agree in any order and for any number of workers. A second round on
blocks that are shifted by half frees the surface at the borders of the first.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Bytes, Mask
from toposeam.checks import is_masked
from toposeam.errors import ImageError, MissingPackageError, OverlapError, Term
from toposeam.heat.bricks import HIGH, LOW, along
from toposeam.heat.threads import one_thread
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.seam.problem.overlap import FREE, A, B, Overlap
from toposeam.volume.heat.block_surface import (
    COARSE_SHARE,
    block_costs,
    block_sides,
    coarse_labels,
    coarse_span,
)
from toposeam.volume.heat.levels import refine
from toposeam.volume.heat.method import SurfaceOptions, dilate, heat_surface
from toposeam.volume.problem.canvas import Places
from toposeam.volume.problem.cells import brightness, reach_of, window_sides
from toposeam.volume.problem.surface_problem import SurfaceProblem

#: Default side of a block, in voxels.
BLOCK = 160
#: Chunks, in voxels, of arrays in memory or mapped: small, so that little is read beyond a block.
_CHUNKS = (64, 256, 256)
#: Reach of the slab beyond the side of a coarse voxel, in voxels.
_SLAB_MARGIN = 3
#: Bits of a voxel's state: its label, and whether that is fixed.
_SHOWS_B, _FIXED = np.uint8(1), np.uint8(2)

#: Options of the search in a block: never a slab of its own.
_BLOCK_OPTIONS = SurfaceOptions(tolerance=2e-3, max_iterations=1000, whole=10**9)
#: Identifiers of interrupted runs, whose remaining tasks stop.
_INTERRUPTED: set[str] = set()


def _dask() -> Any:
    try:
        import dask.array
    except ImportError as error:
        raise MissingPackageError(
            "joining by blocks needs dask; install it with: pip install 'dask[array]'", kind="no dask"
        ) from error
    return dask.array


def as_dask(stack: Any, name: str) -> Any:
    """Return a stack as a dask array (D, H, W, C)."""
    array = _dask()
    if not all(hasattr(stack, attribute) for attribute in ("shape", "dtype", "ndim")):
        try:
            stack = np.asarray(stack)
        except (TypeError, ValueError, OverflowError) as error:
            raise ImageError(
                "{array} is no array of numbers; pass (D, H, W) or (D, H, W, C)",
                kind="array",
                array=Term(name),
            ) from error
    if is_masked(stack):
        raise ImageError("{array} is a masked array; pass {array}.filled(0)", kind="array", array=Term(name))
    if getattr(stack.dtype, "kind", "O") not in "biuf":
        raise ImageError(
            "{array} has dtype {dtype}; pass integers or floats",
            kind="dtype",
            dtype=str(stack.dtype),
            array=Term(name),
        )
    if stack.ndim not in (3, 4) or 0 in stack.shape:
        raise ImageError(
            "{array} has shape {shape!s}; pass a non-empty (D, H, W) or (D, H, W, C) array",
            kind="shape",
            shape=stack.shape,
            array=Term(name),
        )
    if hasattr(stack, "dask"):
        lazy = stack
    else:
        # Small chunks: otherwise many times a block's size would be read for it.
        parts = (*_CHUNKS, -1)[: stack.ndim]
        lazy = array.from_array(
            _ReadByParts(stack) if isinstance(stack, np.ndarray) else stack, chunks=parts, name=False
        )
    return lazy[..., np.newaxis] if lazy.ndim == 3 else lazy


class _ReadByParts:
    """An array in memory, or mapped, that is read by parts; dask would copy a plain array whole."""

    def __init__(self, stack: npt.NDArray[Any]) -> None:
        self.shape, self.dtype, self.ndim = stack.shape, stack.dtype, stack.ndim
        self._stack = stack

    def __getitem__(self, key: Any) -> npt.NDArray[Any]:
        return np.asarray(self._stack[key])


def labels_by_blocks(
    one: Any,
    other: Any,
    places: Places,
    cost: MatchCost,
    spacing: Sequence[float],
    block: int,
    data_range: float | None,
    keep: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
    cells: Any = None,
    present: Any = None,
) -> Any:
    """Compute the labels of the common box, as a bool array, or as a dask array if `keep` names a folder.

    Parameters
    ----------
    one, other : (D, H, W, C) dask arrays
        What each stack shows of the common box.
    cells : (D, H, W, K) dask array, optional
        As for :func:`toposeam.volume.problem.cells.add_prices`.
    present : (D, H, W) dask array of bool, optional
        Where the first stack has voxels; everywhere by default.

    Raises
    ------
    OverlapError
        When one stack lies inside the other: the part of it that must show depends on its depth, which is
        not known in a block.
    """
    array = _dask()
    ground = _face_grounds(places)
    # Where the first stack has no voxels the second one goes on.
    beyond = set(ground.values()) | ({B} if present is not None else set())
    if not {A, B} <= beyond:
        raise OverlapError(
            "one stack does not reach beyond the other, which blocks cannot decide; join NumPy arrays, "
            "without block",
            kind="inside",
            parameter=Term("block"),
            value=block,
        )
    shape = one.shape[:3]
    span = coarse_span(shape)
    coarse = coarse_labels(one, other, shape, span, ground, cost, spacing, block, data_range, progress, cells)
    chunks = tuple(_even_chunks(length, block) for length in shape)
    state = array.map_blocks(
        _first_state, chunks=chunks, dtype=np.uint8, coarse=coarse, span=span, ground=ground, shape=shape
    )
    if present is not None:
        state = array.where(present.rechunk(chunks), state, _FIXED | _SHOWS_B)
    run = secrets.token_hex(8)
    settings = {
        "cost": cost,
        "spacing": tuple(spacing),
        "data_range": data_range,
        "reach": max(span) + _SLAB_MARGIN,
        "run": run,
    }
    for shifted in (False, True):
        cut = tuple(_even_chunks(length, block, shifted) for length in shape)
        depth = dict.fromkeys(range(3), 1)
        parts = [
            array.overlap.overlap(
                part.rechunk((*cut, -1) if part.ndim == 4 else cut),
                {**depth, 3: 0} if part.ndim == 4 else depth,
                "none",
            )
            for part in (one, other, *(() if cells is None else (cells,)))
        ]
        around = array.overlap.overlap(state.rechunk(cut), depth, "none")
        state = array.map_blocks(
            _solve_block,
            around[..., np.newaxis].rechunk((*around.chunks, 1)),
            *parts,
            dtype=np.uint8,
            chunks=(*cut, (1,)),
            **settings,
        )[..., 0]
    labels = (state & _SHOWS_B).astype(bool)
    with _TaskProgress(progress, COARSE_SHARE), _interrupting(run):
        if keep is None:
            return labels.compute()
        array.to_zarr(labels.rechunk((block,) * 3), str(keep))
    return array.from_zarr(str(keep))


def prices_by_blocks(
    one: Any, other: Any, spacing: Sequence[float], numbers: tuple[Any, Any] | None, block: int
) -> Any:
    """Return what :func:`toposeam.volume.counting.prices` does, as a dask array of dask arrays."""
    array, sides = _dask(), window_sides(spacing)
    parts = [part.rechunk((block, block, block, -1)) for part in (one, other)]
    shown = array.maximum(*parts).max(axis=3)
    depth = {axis: min(reach, shown.shape[axis]) for axis, reach in enumerate(reach_of(sides))}
    bright = shown.map_overlap(brightness, depth=depth, boundary="none", dtype=np.uint8, sides=sides)
    bright = bright[..., np.newaxis]
    if numbers is None:
        return bright
    lazy = [as_dask(part, "cells").rechunk((block, block, block, 1)) for part in numbers]
    together = array.concatenate([part.astype(np.int32) for part in (bright, *lazy)], axis=3)
    return together.rechunk({3: -1})


@contextmanager
def _interrupting(run: str) -> Iterator[None]:
    """Stop the remaining tasks of a run if the code in this context is interrupted."""
    try:
        yield
    except BaseException:
        _INTERRUPTED.add(run)
        raise


def _check_interrupted(run: str) -> None:
    """Raise KeyboardInterrupt if the run was interrupted."""
    if run in _INTERRUPTED:
        raise KeyboardInterrupt


def assemble(a: Any, b: Any, places: Places, labels: Any) -> Any:
    """Join two stacks by the labels of their common box, as a dask array."""
    array = _dask()
    labels = labels if hasattr(labels, "dask") else array.from_array(labels)

    def on_canvas(values: Any, box: tuple[slice, ...], fill: Any) -> Any:
        around = [(part.start, length - part.stop) for part, length in zip(box, places.canvas, strict=True)]
        return array.pad(values, around + [(0, 0)] * (values.ndim - 3), constant_values=fill)

    inside_b = on_canvas(array.ones(b.shape[:3], dtype=np.uint8, chunks=b.chunks[:3]), places.box("b"), 0)
    on_both = on_canvas(array.ones(labels.shape, dtype=np.uint8, chunks=labels.chunks), places.overlap, 0)
    shows = on_canvas(labels.astype(np.uint8), places.overlap, 0)
    show_b = array.where(on_both > 0, shows > 0, inside_b > 0)
    values_a, values_b = on_canvas(a, places.box("a"), 0), on_canvas(b, places.box("b"), 0)
    return array.where(show_b[..., np.newaxis], values_b, values_a)


def _face_grounds(places: Places) -> dict[tuple[int, bool], int]:
    """Return the stack, A or B, beyond each face of the common box, by axis and whether at the upper end."""
    found = {}
    for axis, part in enumerate(places.overlap):
        for which, label in (("a", A), ("b", B)):
            reach = places.box(which)[axis]
            if reach.start < part.start:
                found[axis, False] = label
            if reach.stop > part.stop:
                found[axis, True] = label
    return found


class _TaskProgress:
    """Reports the progress of dask's tasks, as a share of the work from `start` to 1."""

    def __init__(self, progress: Callable[[float], None] | None, start: float) -> None:
        from dask.callbacks import Callback

        self._share = start

        def done(key: Any, result: Any, graph: Any, state: Any, worker: Any) -> None:
            if progress is not None:
                finished = len(state["finished"])
                total = sum(len(state[part]) for part in ("ready", "waiting", "running", "finished"))
                self._share = max(self._share, start + (1 - start) * finished / max(1, total))
                progress(self._share)

        self._callback = Callback(posttask=done)

    def __enter__(self) -> None:
        self._callback.register()

    def __exit__(self, *_: object) -> None:
        self._callback.unregister()


def _even_chunks(length: int, block: int, shifted: bool = False) -> tuple[int, ...]:
    """Return about equal lengths of chunks; with `shifted`, borders lie half way between the usual ones."""
    count = -(-length // block)
    ends = [round(length * index / count) for index in range(count + 1)]
    if shifted and count > 1:
        ends = [0, *((low + high) // 2 for low, high in pairwise(ends)), length]
    return tuple(high - low for low, high in pairwise(ends))


def _first_state(
    coarse: Mask,
    span: tuple[int, ...],
    ground: dict[tuple[int, bool], int],
    shape: tuple[int, ...],
    block_info: Any = None,
) -> Bytes:
    """Return the first state of a block, with the labels of the coarse surface."""
    place = block_info[None]["array-location"]
    low = [first // side for (first, _), side in zip(place, span, strict=True)]
    part = coarse[
        tuple(slice(at, -(-last // side)) for at, (_, last), side in zip(low, place, span, strict=True))
    ]
    whole = tuple(n * side for n, side in zip(part.shape, span, strict=True))
    fine = refine(part, span, whole)
    inner = tuple(
        slice(first - at * side, last - at * side)
        for at, (first, last), side in zip(low, place, span, strict=True)
    )
    state: Bytes = fine[inner].astype(np.uint8)
    side = block_sides(state.shape, ground, [first for first, _ in place], shape)
    state[side == A] = _FIXED
    state[side == B] = _FIXED | _SHOWS_B
    return state


def _solve_block(
    state: Bytes,
    a: Any,
    b: Any,
    cells: Any = None,
    *,
    cost: MatchCost,
    spacing: Sequence[float],
    data_range: float | None,
    reach: int,
    run: str,
    block_info: Any = None,
) -> Bytes:
    """Find the surface in a block with a margin of one voxel; return the state without the margin."""
    _check_interrupted(run)
    inner, fixed = [], (state[..., 0] & _FIXED) > 0
    labels = (state[..., 0] & _SHOWS_B) > 0
    location, count = block_info[0]["chunk-location"], block_info[0]["num-chunks"]
    for axis in range(3):
        first, last = location[axis] == 0, location[axis] == count[axis] - 1
        inner.append(slice(0 if first else 1, None if last else -1))
        if not first:
            fixed[along(axis, slice(2))] = True
        if not last:
            fixed[along(axis, slice(-2, None))] = True
    trimmed = (*inner, slice(None))
    near = np.zeros(labels.shape, bool)
    for axis in range(3):
        differs = labels[along(axis, LOW)] != labels[along(axis, HIGH)]
        near[along(axis, LOW)] |= differs
        near[along(axis, HIGH)] |= differs
    free = dilate(near, reach) & ~fixed
    if not free.any():
        return state[trimmed]
    # Crop to the slab and one voxel round it.
    box = []
    for axis in range(3):
        used = np.flatnonzero(free.any(axis=tuple(other for other in range(3) if other != axis)))
        box.append(slice(max(0, int(used[0]) - 1), int(used[-1]) + 2))
    here = tuple(box)
    side = np.where(free[here], FREE, np.where(labels[here], B, A)).astype(np.uint8)
    overlap = Overlap(side, np.ones(side.shape, bool), (0, 0, 0), side.shape)
    problem = SurfaceProblem(
        overlap,
        block_costs(a[here], b[here], cost, spacing, data_range, None if cells is None else cells[here]),
    )
    with one_thread():
        solution, _ = heat_surface(problem, _BLOCK_OPTIONS, lambda _: _check_interrupted(run))
    if problem.cost(solution.labels) < problem.cost(labels[here]):
        changed = labels.copy()
        changed[here] = problem.complete(solution.labels)
        labels = changed
    result: Bytes = (labels.astype(np.uint8) | (state[..., 0] & _FIXED))[..., np.newaxis]
    return result[trimmed]
