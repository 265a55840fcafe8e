"""A grid cut into bricks, of which only some are stored: neighbours in the grid are close in memory."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Mask

Index = tuple[slice, ...]

LOW, HIGH = slice(None, -1), slice(1, None)
#: Longest sides of a brick, in voxels: of a volume, of a plane and of a line.
_SIDES = {3: (8, 8, 8), 2: (16, 32), 1: (512,)}


def along(axis: int, part: slice) -> Index:
    """Return the index of a part of one axis, and of all of the others before it."""
    return (*(slice(None),) * axis, part)


class Bricks:
    """The bricks of a grid that hold a voxel of a mask.

    Arrays on them have the shape (n + 1, *side): the last brick stands for all that are not stored.

    Parameters
    ----------
    mask : bool array
        Of the grid's shape.

    Examples
    --------
    >>> import numpy as np
    >>> mask = np.zeros((40, 40, 40), bool)
    >>> mask[3, :, 5] = True
    >>> bricks = Bricks(mask)
    >>> len(bricks), bricks.side, bricks.upper[1].tolist()
    (5, (8, 8, 8), [1, 2, 3, 4, 5])
    """

    def __init__(self, mask: Mask) -> None:
        self.shape = mask.shape
        most = _SIDES[mask.ndim]
        self._counts = [-(-length // side) for length, side in zip(self.shape, most, strict=True)]
        #: Voxels along each axis.
        self.side = tuple(-(-length // n) for length, n in zip(self.shape, self._counts, strict=True))
        within = tuple(range(1, 2 * mask.ndim, 2))
        stored = self._divided(mask).any(axis=within)
        self._places = np.nonzero(stored)
        n = len(self._places[0])
        number = np.full([count + 2 for count in stored.shape], n, np.intp)
        number[(slice(1, -1),) * stored.ndim][stored] = np.arange(n)
        #: (count, …) number of the brick at each place; n where none is stored.
        self._number = number[(slice(1, -1),) * stored.ndim]
        around = [tuple(place + 1 for place in self._places)] * stored.ndim
        #: Per axis the (n,) neighbours beyond either end; n where none is stored.
        self.lower, self.upper = (
            [number[(*at[:axis], at[axis] + step, *at[axis + 1 :])] for axis, at in enumerate(around)]
            for step in (-1, 1)
        )

    def __len__(self) -> int:
        return len(self._places[0])

    def gather(self, values: npt.NDArray[np.generic]) -> npt.NDArray:  # type: ignore[type-arg]
        """Copy the values of a grid, which may be shorter along some axes, to its bricks; 0 beyond."""
        result = np.zeros((len(self) + 1, *self.side), values.dtype)
        result[:-1] = self._ordered(self._divided(values))[self._places]
        return result

    def scatter(self, values: npt.NDArray[np.generic], into: npt.NDArray[np.generic]) -> None:
        """Write the values of the bricks into a grid, which may be shorter along some axes."""
        divided = self._divided(into)
        self._ordered(divided)[self._places] = values[:-1]
        if not np.shares_memory(divided, into):
            whole = divided.reshape([a * b for a, b in zip(self._counts, self.side, strict=True)])
            into[...] = whole[tuple(slice(length) for length in into.shape)]

    def flat_index(self, voxel: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
        """Turn flat indices of voxels in the grid into flat indices in an array of the bricks.

        Voxels in no stored brick get indices in the last one.
        """
        place = np.unravel_index(voxel, self.shape)
        brick, inner = zip(
            *(divmod(index, side) for index, side in zip(place, self.side, strict=True)), strict=True
        )
        within = np.ravel_multi_index(inner, self.side)
        found: npt.NDArray[np.intp] = self._number[brick] * int(np.prod(self.side)) + within
        return found

    def _divided(self, values: npt.NDArray[np.generic]) -> npt.NDArray:  # type: ignore[type-arg]
        """Reshape (n, m, …) to (count, side, count, side, …): a view where nothing is missing."""
        missing = [
            (0, count * side - length)
            for length, count, side in zip(values.shape, self._counts, self.side, strict=True)
        ]
        if any(more for _, more in missing):
            values = np.pad(values, missing)
        shape = [n for pair in zip(self._counts, self.side, strict=True) for n in pair]
        return values.reshape(shape)

    def _ordered(self, divided: npt.NDArray) -> npt.NDArray:  # type: ignore[type-arg]
        """Reorder (count, side, count, side, …) to (count, count, …, side, side, …), a view."""
        axes = range(divided.ndim)
        return divided.transpose(*axes[::2], *axes[1::2])
