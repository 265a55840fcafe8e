"""Two placed stacks, made comparable: what the search for their surface is handed, and what is joined."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Mask, Volume
from toposeam.seam.problem.match_cost import MatchCost
from toposeam.volume.counting import Cells, prices
from toposeam.volume.find import solve_surface
from toposeam.volume.heat.method import SurfaceOptions
from toposeam.volume.problem.canvas import Places
from toposeam.volume.problem.posing import surface_problem
from toposeam.volume.problem.tones import Tones
from toposeam.volume.surface import Surface
from toposeam.volume.verdict import SurfaceVerdict, surface_verdict

_Which = Literal["a", "b"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StackPair:
    """Two stacks on a canvas; all of them arrays, or all of them dask arrays."""

    #: (D, H, W, C): the stacks.
    a: Any
    b: Any
    places: Places
    cost: MatchCost
    spacing: tuple[float, float, float]
    #: What makes them comparable; without, `data_range` is white.
    tones: Tones | None
    data_range: float | None
    #: Whether cells have a price, and their segmentations.
    priced: bool
    cells: Cells | None
    #: (D, H, W) bool: where the first stack has voxels; None if everywhere.
    present: Any

    def whole(
        self,
        core: float,
        options: SurfaceOptions,
        settings: dict[str, Any],
        progress: Callable[[float], None] | None,
    ) -> tuple[Surface, Mask]:
        """Find the surface on the common box with a margin of one voxel; return it and the box's labels."""
        places = self.places
        window = tuple(
            slice(max(0, part.start - 1), min(length, part.stop + 1))
            for part, length in zip(places.overlap, places.canvas, strict=True)
        )
        (one, on_a), (other, on_b) = self._on(window, "a"), self._on(window, "b")
        cells = None
        if self.priced:
            numbers = None
            if self.cells is not None:
                numbers = self._laid(self.cells.a, "a", window), self._laid(self.cells.b, "b", window)
            cells = prices(one, other, self.spacing, numbers)
        problem, only_b = surface_problem(
            one,
            other,
            on_a,
            on_b,
            0,
            self.cost,
            self.spacing,
            core=core,
            data_range=self.data_range if self.tones is None else 1.0,
            cells=cells,
        )
        surface = solve_surface(problem, only_b, "heat", options, settings, progress)
        inner = tuple(
            slice(part.start - w.start, part.stop - w.start)
            for part, w in zip(places.overlap, window, strict=True)
        )
        return surface, surface.labels[inner]

    def by_blocks(self, block: int, keep: str | Path | None, progress: Callable[[float], None] | None) -> Any:
        """Find the labels of the common box block by block."""
        from toposeam.volume.blocks import labels_by_blocks, prices_by_blocks

        box = self.places.overlap
        inside = {which: self.places.inside(box, which) for which in ("a", "b")}
        one, other = self.a[inside["a"]], self.b[inside["b"]]
        if self.tones is not None:
            start = [part.start for part in box]
            one, other = (
                part.map_blocks(_shares, dtype=np.float32, tones=self.tones, which=which, start=start)
                for part, which in ((one, "a"), (other, "b"))
            )
        cells = None
        if self.priced:
            numbers = None
            if self.cells is not None:
                numbers = self.cells.a[inside["a"]], self.cells.b[inside["b"]]
            cells = prices_by_blocks(one, other, self.spacing, numbers, block)
        return labels_by_blocks(
            one,
            other,
            self.places,
            self.cost,
            self.spacing,
            block,
            self.data_range if self.tones is None else 1.0,
            keep,
            progress,
            cells,
            None if self.present is None else self.present[inside["a"]],
        )

    def joined(self, labels: Any, evened: bool) -> Any:
        """Join the stacks by the labels of their common box; `evened` gives b the tones of a."""
        other = self.b
        if evened and self.tones is not None:
            tones, start = self.tones, list(self.places.b)
            if hasattr(other, "dask"):
                other = other.map_blocks(_evened, dtype=other.dtype, tones=tones, start=start)
            else:
                other = tones.evened(other, start)
        return self._assembled(self.a, other, labels)

    def joined_cells(self, labels: Any) -> Any:
        """Join the segmentations; None without."""
        if self.cells is None:
            return None
        found = self._assembled(self.cells.a[..., np.newaxis], self.cells.b[..., np.newaxis], labels)
        return found[..., 0]

    def covered(self) -> Any:
        """Return where the canvas has voxels, (D, H, W) bool; None if everywhere."""
        places = self.places
        sizes = [np.prod(size, dtype=float) for size in (places.size_a, places.size_b, places.canvas)]
        common = np.prod([part.stop - part.start for part in places.overlap], dtype=float)
        if self.present is None and sizes[0] + sizes[1] - common == sizes[2]:
            return None
        if hasattr(self.a, "dask"):
            first, second = np.broadcast_to(True, places.size_a), np.broadcast_to(True, places.size_b)
            first = first if self.present is None else self.present
            everywhere = np.ones([part.stop - part.start for part in places.overlap], bool)
            return self._assembled(first[..., np.newaxis], second[..., np.newaxis], everywhere)[..., 0]
        result = np.zeros(places.canvas, bool)
        result[places.box("a")] = True if self.present is None else self.present
        result[places.box("b")] = True
        return result

    def verdict(self, labels: Any, evened: bool) -> SurfaceVerdict:
        """Judge how visibly slices show the surface; parameters as of :meth:`joined`."""
        black: Any = 0.0
        white = self.data_range or (1.0 if self.a.dtype.kind in "fb" else float(np.iinfo(self.a.dtype).max))
        if self.tones is not None:
            black, white = self.tones.black_a, self.tones.white

        def shown(window: tuple[slice, ...], which: str) -> tuple[Floats32, Mask]:
            place: _Which = "a" if which == "a" else "b"
            stack = self.a if which == "a" else self.b
            common, here = self._common(window, place)
            values = np.zeros((*(part.stop - part.start for part in window), stack.shape[3]), np.float32)
            mask = np.zeros(values.shape[:3], bool)
            inside = self.places.inside(common, which)
            if all(part.start < part.stop for part in common):
                found = np.asarray(stack[inside])
                if which == "b" and evened and self.tones is not None:
                    found = self.tones.evened(found, [part.start for part in common])
                values[here] = (found - black) / white
                known = which == "a" and self.present is not None
                mask[here] = np.asarray(self.present[inside]) if known else True
            return values, mask

        return surface_verdict(self.places, labels, shown)

    def _on(self, window: tuple[slice, ...], which: _Which) -> tuple[Volume | Floats32, Mask]:
        """Return what a stack shows of a window of the canvas, and where it has voxels there."""
        stack = self.a if which == "a" else self.b
        common, here = self._common(window, which)
        inside = self.places.inside(common, which)
        found = stack[inside]
        if self.tones is not None:
            found = self.tones.shares(found, which, [part.start for part in common])
        values = np.zeros((*(part.stop - part.start for part in window), stack.shape[3]), found.dtype)
        values[here] = found
        mask = np.zeros(values.shape[:3], bool)
        mask[here] = self.present[inside] if which == "a" and self.present is not None else True
        return values, mask

    def _laid(self, numbers: Any, which: _Which, window: tuple[slice, ...]) -> npt.NDArray[np.int32]:
        """Lay numbers of cells on a window of the canvas."""
        common, here = self._common(window, which)
        result = np.zeros([part.stop - part.start for part in window], np.int32)
        result[here] = numbers[self.places.inside(common, which)]
        return result

    def _common(
        self, window: tuple[slice, ...], which: _Which
    ) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
        """Return what a window has in common with a stack, on the canvas and in the window."""
        box = self.places.box(which)
        common = tuple(
            slice(max(w.start, s.start), min(w.stop, s.stop)) for w, s in zip(window, box, strict=True)
        )
        return common, tuple(
            slice(c.start - w.start, c.stop - w.start) for c, w in zip(common, window, strict=True)
        )

    def _assembled(self, a: Any, b: Any, labels: Any) -> Any:
        if hasattr(self.a, "dask"):
            from toposeam.volume.blocks import as_dask, assemble

            return assemble(as_dask(a, "a"), as_dask(b, "b"), self.places, labels)
        places = self.places
        joined = np.zeros((*places.canvas, a.shape[3]), np.result_type(a, b))
        joined[places.box("b")] = b
        before = joined[places.overlap].copy()
        joined[places.box("a")] = a
        shows = labels
        if self.present is not None:
            shows = labels | ~self.present[places.inside(places.overlap, "a")]
        joined[places.overlap] = np.where(shows[..., np.newaxis], before, joined[places.overlap])
        return joined


def _shares(
    values: Volume, tones: Tones, which: _Which, start: Sequence[int], block_info: Any = None
) -> Floats32:
    return tones.shares(values, which, _first(start, block_info))


def _evened(values: Volume, tones: Tones, start: Sequence[int], block_info: Any = None) -> Volume:
    return tones.evened(values, _first(start, block_info))


def _first(start: Sequence[int], block_info: Any) -> list[int]:
    """Return the index, on the canvas, of the first voxel of a block."""
    place = block_info[0]["array-location"]
    return [first + low for first, (low, _) in zip(start, place, strict=False)]
