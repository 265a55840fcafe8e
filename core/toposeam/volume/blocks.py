"""Stacks larger than memory, joined block by block on dask arrays.

A coarse surface decides first. The match cost is read once, block by block, and summed between coarse voxels
so large that their grid fits into memory; the surface there gives every voxel a first label. Then each block
lets heat gather in a slab round that surface, with its own border held at the first labels, so that blocks
agree however many are worked on at once, and in whatever order. A second round does so once more on blocks
that are shifted by half, which lets the surface go where borders held it.
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
from toposeam.volume.heat.levels import refined
from toposeam.volume.heat.method import SurfaceOptions, heat_surface, spread
from toposeam.volume.problem.canvas import Places
from toposeam.volume.problem.surface_problem import SurfaceProblem

#: Side of a block, in voxels.
BLOCK = 160
#: So many voxels of an array in memory, or mapped, are taken at a time.
_READ = (64, 256, 256)
#: The slab reaches this far beyond the size of a coarse voxel.
_REACH = 3
#: Bits of a voxel's state.
_SHOWS_B, _FIXED = np.uint8(1), np.uint8(2)

_BLOCK_OPTIONS = SurfaceOptions(tolerance=2e-3, max_iterations=1000, whole=10**9)
#: Runs that were interrupted.
_STOPPED: set[str] = set()


def _dask() -> Any:
    try:
        import dask.array
    except ImportError as error:
        raise MissingPackageError(
            "joining by blocks needs dask; install it with: pip install 'dask[array]'", kind="no dask"
        ) from error
    return dask.array


def lazily(stack: Any, name: str) -> Any:
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
        # In small parts, or what is read for one block would be many times as large as that.
        parts = (*_READ, -1)[: stack.ndim]
        lazy = array.from_array(
            _Parts(stack) if isinstance(stack, np.ndarray) else stack, chunks=parts, name=False
        )
    return lazy[..., np.newaxis] if lazy.ndim == 3 else lazy


class _Parts:
    """An array in memory, or mapped, of which parts are read; dask would copy all of it first."""

    def __init__(self, stack: npt.NDArray[Any]) -> None:
        self.shape, self.dtype, self.ndim = stack.shape, stack.dtype, stack.ndim
        self._stack = stack

    def __getitem__(self, key: Any) -> npt.NDArray[Any]:
        return np.asarray(self._stack[key])


def labels_by_blocks(
    a: Any,
    b: Any,
    places: Places,
    cost: MatchCost,
    spacing: Sequence[float],
    block: int,
    data_range: float | None,
    keep: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> Any:
    """Compute the labels of the common box: an array of bool, or a dask array where a folder keeps them.

    Raises
    ------
    OverlapError
        When one stack lies inside the other: what must show of it is decided by depth, which blocks do not
        know.
    """
    array = _dask()
    ground = _grounds(places)
    if not {A, B} <= set(ground.values()):
        raise OverlapError(
            "one stack does not reach beyond the other, which blocks cannot decide; join NumPy arrays, "
            "without block",
            kind="inside",
            parameter=Term("block"),
            value=block,
        )
    box = places.overlap
    one, other = a[places.inside(box, "a")], b[places.inside(box, "b")]
    shape = one.shape[:3]
    span = coarse_span(shape)
    coarse = coarse_labels(one, other, shape, span, ground, cost, spacing, block, data_range, progress)
    chunks = tuple(_even(length, block) for length in shape)
    state = array.map_blocks(
        _first_state, chunks=chunks, dtype=np.uint8, coarse=coarse, span=span, ground=ground, shape=shape
    )
    run = secrets.token_hex(8)
    settings = {
        "cost": cost,
        "spacing": tuple(spacing),
        "data_range": data_range,
        "reach": max(span) + _REACH,
        "run": run,
    }
    for shifted in (False, True):
        cut = tuple(_even(length, block, shifted) for length in shape)
        depth = dict.fromkeys(range(3), 1)
        parts = [
            array.overlap.overlap(
                part.rechunk((*cut, -1) if part.ndim == 4 else cut),
                {**depth, 3: 0} if part.ndim == 4 else depth,
                "none",
            )
            for part in (one, other)
        ]
        around = array.overlap.overlap(state.rechunk(cut), depth, "none")
        state = array.map_blocks(
            _settled,
            around[..., np.newaxis].rechunk((*around.chunks, 1)),
            *parts,
            dtype=np.uint8,
            chunks=(*cut, (1,)),
            **settings,
        )[..., 0]
    labels = (state & _SHOWS_B).astype(bool)
    with _Counting(progress, COARSE_SHARE), _stopped_with(run):
        if keep is None:
            return labels.compute()
        array.to_zarr(labels.rechunk((block,) * 3), str(keep))
    return array.from_zarr(str(keep))


@contextmanager
def _stopped_with(run: str) -> Iterator[None]:
    """Stop the block's threads, soon, when the block is interrupted."""
    try:
        yield
    except BaseException:
        _STOPPED.add(run)
        raise


def _go_on(run: str) -> None:
    if run in _STOPPED:
        raise KeyboardInterrupt


def assembled(a: Any, b: Any, places: Places, labels: Any) -> Any:
    """Return the joined stack, a dask array."""
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


def _grounds(places: Places) -> dict[tuple[int, bool], int]:
    """Find the stack beyond the common box, by axis and whether at the upper end."""
    found = {}
    for axis, part in enumerate(places.overlap):
        for which, label in (("a", A), ("b", B)):
            reach = places.box(which)[axis]
            if reach.start < part.start:
                found[axis, False] = label
            if reach.stop > part.stop:
                found[axis, True] = label
    return found


class _Counting:
    """Reports the share of dask's tasks that are done, from some share on."""

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


def _even(length: int, block: int, shifted: bool = False) -> tuple[int, ...]:
    """Return chunks of about the same length; shifted, the borders lie in the middle of where they were."""
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
    """Return the first labels of a block."""
    place = block_info[None]["array-location"]
    low = [first // side for (first, _), side in zip(place, span, strict=True)]
    part = coarse[
        tuple(slice(at, -(-last // side)) for at, (_, last), side in zip(low, place, span, strict=True))
    ]
    whole = tuple(n * side for n, side in zip(part.shape, span, strict=True))
    fine = refined(part, span, whole)
    inner = tuple(
        slice(first - at * side, last - at * side)
        for at, (first, last), side in zip(low, place, span, strict=True)
    )
    state: Bytes = fine[inner].astype(np.uint8)
    side = block_sides(state.shape, ground, [first for first, _ in place], shape)
    state[side == A] = _FIXED
    state[side == B] = _FIXED | _SHOWS_B
    return state


def _settled(
    state: Bytes,
    a: Any,
    b: Any,
    cost: MatchCost,
    spacing: Sequence[float],
    data_range: float | None,
    reach: int,
    run: str,
    block_info: Any = None,
) -> Bytes:
    """Return the labels of a block with a voxel around it, without what is around it."""
    _go_on(run)
    inner, held = [], (state[..., 0] & _FIXED) > 0
    labels = (state[..., 0] & _SHOWS_B) > 0
    location, count = block_info[0]["chunk-location"], block_info[0]["num-chunks"]
    for axis in range(3):
        first, last = location[axis] == 0, location[axis] == count[axis] - 1
        inner.append(slice(0 if first else 1, None if last else -1))
        if not first:
            held[along(axis, slice(2))] = True
        if not last:
            held[along(axis, slice(-2, None))] = True
    trimmed = (*inner, slice(None))
    near = np.zeros(labels.shape, bool)
    for axis in range(3):
        differs = labels[along(axis, LOW)] != labels[along(axis, HIGH)]
        near[along(axis, LOW)] |= differs
        near[along(axis, HIGH)] |= differs
    free = spread(near, reach) & ~held
    if not free.any():
        return state[trimmed]
    # Only the slab and a voxel round it are looked at.
    box = []
    for axis in range(3):
        used = np.flatnonzero(free.any(axis=tuple(other for other in range(3) if other != axis)))
        box.append(slice(max(0, int(used[0]) - 1), int(used[-1]) + 2))
    here = tuple(box)
    side = np.where(free[here], FREE, np.where(labels[here], B, A)).astype(np.uint8)
    overlap = Overlap(side, np.ones(side.shape, bool), (0, 0, 0), side.shape)
    problem = SurfaceProblem(overlap, block_costs(a[here], b[here], cost, spacing, data_range))
    with one_thread():
        solution, _ = heat_surface(problem, _BLOCK_OPTIONS, lambda _: _go_on(run))
    if problem.cost(solution.labels) < problem.cost(labels[here]):
        changed = labels.copy()
        changed[here] = problem.complete(solution.labels)
        labels = changed
    result: Bytes = (labels.astype(np.uint8) | (state[..., 0] & _FIXED))[..., np.newaxis]
    return result[trimmed]
