"""Two large stacks joined by blocks: python benchmarks/stacks.py [depth,height,width] [overlap] [options of
toposeam volume].

Two 16-bit TIFF stacks of cells, 500 × 1000 × 1000 voxels with an overlap of 20 % unless told otherwise, are
joined by the command in a process of its own. Between the first stack and the second one every cell has moved
by up to three voxels and has faded by a twentieth. Told are the process's largest resident memory, pages of
the mapped files included, and its time; and how many of the cells that both stacks have are cut by the
surface, against those that a plane through the middle of the overlap cuts.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import tifffile

from measured import toposeam
from stamp import stamp

#: Radius of a cell, and side of the cube in which there is one, in voxels.
_RADIUS, _ROOM = (5, 11), 32
#: Voxels a cell moves between the stacks, at most.
_MOVES = 3


def main(shape: tuple[int, int, int], overlap: int, options: list[str]) -> None:
    depth, height, width = shape
    step = width - overlap
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paint(folder, shape, step)
        words = [
            "volume",
            "a.tif",
            "b.tif",
            f"--offset=0,0,{step}",
            "-o",
            "out.tif",
            "--labels",
            "labels.tif",
        ]
        ran = toposeam([*words, "--quiet", *options], folder)
        print(
            f"{depth} × {height} × {width} twice, overlap {overlap}: {ran.megabytes / 1024:.2f} GiB; "
            f"{ran.clock:.0f} s, {ran.seconds:.0f} s of CPU"
        )
        labels = tifffile.memmap(folder / "labels.tif", mode="r")
        cut, halved, both = 0, 0, 0
        place, radius, _ = cells(shape, step)
        for at, r in zip(place, radius, strict=True):
            x = at[2]
            if not step + r + _MOVES <= x < width - r - _MOVES:
                continue
            both += 1
            box, away = around(at, r, shape)
            shown = labels[(*box[:2], slice(box[2].start - step, box[2].stop - step))][away < r - 1]
            cut += bool(shown.min() != shown.max())
            halved += abs(x - step - overlap / 2) < r - 1
        print(f"of {both} cells that lie in both, the surface cuts {cut}, a plane in the middle {halved}")


def cells(
    shape: tuple[int, int, int], step: int
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Places (n, 3), radii and moves (n, 3) of the cells of both stacks."""
    rng = np.random.default_rng(0)
    whole = (shape[0], shape[1], shape[2] + step)
    n = int(np.prod(whole) // _ROOM**3)
    place = rng.uniform(0, whole, (n, 3))
    return place, rng.uniform(*_RADIUS, n), rng.uniform(-_MOVES, _MOVES, (n, 3))


def paint(folder: Path, shape: tuple[int, int, int], step: int) -> None:
    """Write a.tif and b.tif."""
    place, radius, move = cells(shape, step)
    rng = np.random.default_rng(1)
    for file, start, share in (("a.tif", 0, 0.0), ("b.tif", step, 1.0)):
        stack = tifffile.memmap(folder / file, shape=shape, dtype=np.uint16)
        for z in range(shape[0]):
            stack[z] = rng.integers(2000, 2600, shape[1:], np.uint16)
        at = place + share * move - (0, 0, start)
        for (z, y, x), r in zip(at, radius, strict=True):
            box, away = around((z, y, x), r, shape)
            if not away.size:
                continue
            light = 40000 * (1 - 0.05 * share) * np.clip(r - away, 0, 2) / 2
            room = stack[box]
            np.maximum(room, light.astype(np.uint16), out=room)
        stack.flush()


def around(
    place: Sequence[float], radius: float, shape: tuple[int, ...]
) -> tuple[tuple[slice, ...], npt.NDArray[np.float64]]:
    """The box of voxels round a cell, and their distances from its middle."""
    axes = [
        np.arange(max(0, int(p - radius)), max(0, min(length, int(p + radius) + 2)))
        for p, length in zip(place, shape, strict=True)
    ]
    box = tuple(slice(int(axis[0]), int(axis[-1]) + 1) if len(axis) else slice(0) for axis in axes)
    return box, np.sqrt(sum((axis - p) ** 2 for axis, p in zip(np.ix_(*axes), place, strict=True)))


if __name__ == "__main__":
    print(stamp())
    size = tuple(map(int, (sys.argv[1] if sys.argv[1:] else "500,1000,1000").split(",")))
    main(size, int(sys.argv[2]) if sys.argv[2:] else size[2] // 5, sys.argv[3:])
