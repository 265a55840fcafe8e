"""Label maps and masks of a canvas that may be larger than memory.

A label map of a gigapixel shows one layer nearly everywhere. :class:`TileMap` keeps a single value for each
tile of equal pixels, and an array only for the other tiles, which lie along seams and the edges of layers. It
is read and written like an array, by slices of rows and columns; small canvases use arrays (:func:`new_map`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import compress, product
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Mask
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.canvas.packed_runs import packed, unpacked

#: Maps of at most this many pixels are arrays.
DENSE_PIXELS = 1 << 22
#: Side of the tiles, and of the blocks in which whole canvases are processed, px.
TILE, BLOCK = 128, 1024
#: Side of the blocks, px, in which masks are processed that change only along the edges of layers.
EDGES = 256

#: Slices of rows and columns.
Windows2 = tuple[slice, slice]


class TileMap:
    """An (H, W) array in which most tiles hold a single value.

    Parameters
    ----------
    shape : (int, int)
    fill : int or bool
    dtype : dtype

    Examples
    --------
    >>> labels = TileMap((5000, 7000), -1, np.int16)
    >>> labels[100:4000, 200:6000] = 3
    >>> labels[99:102, 198:202].tolist()
    [[-1, -1, -1, -1], [-1, -1, 3, 3], [-1, -1, 3, 3]]
    >>> labels.nbytes < 5000 * 7000 // 4  # of 70 MB
    True
    """

    def __init__(self, shape: tuple[int, int], fill: Any, dtype: npt.DTypeLike) -> None:
        self.shape, self.dtype, self.ndim = shape, np.dtype(dtype), 2
        self._values = np.full(tuple(-(-side // TILE) for side in shape), fill, self.dtype)
        #: Tiles are replaced, never changed, since parts of a map share them.
        self._tiles: dict[tuple[int, int], npt.NDArray[Any]] = {}

    @property
    def nbytes(self) -> int:
        """Memory in use, bytes."""
        return self._values.nbytes + sum(tile.nbytes for tile in self._tiles.values())

    def copy(self) -> TileMap:
        """Return an independent copy."""
        result = TileMap(self.shape, 0, self.dtype)
        result._values, result._tiles = self._values.copy(), dict(self._tiles)
        return result

    def part(self, *boxes: Box) -> TileMap:
        """Return the map inside some boxes; 0 elsewhere."""
        result = TileMap(self.shape, 0, self.dtype)
        for box in boxes:
            rows, columns = _tiles_of(box.shared(Box(0, 0, *self.shape)))
            window = slice(rows.start, max(rows.stop, 0)), slice(columns.start, max(columns.stop, 0))
            result._values[window] = self._values[window]
            inside = (at for at in product(rows, columns) if at in self._tiles) if self._tiles else ()
            result._tiles |= {at: self._tiles[at] for at in inside}
        return result

    def __getstate__(self) -> dict[str, Any]:
        values = np.concatenate([self._values.ravel(), *(tile.ravel() for tile in self._tiles.values())])
        return self.__dict__ | {"_tiles": list(self._tiles), "_values": packed(values)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        values, tiles = unpacked(state.pop("_values"), state["dtype"]), state.pop("_tiles")
        self.__dict__.update(state)
        high, wide = (-(-side // TILE) for side in self.shape)
        self._values = values[: high * wide].reshape(high, wide)
        self._tiles, start = {}, high * wide
        for at in tiles:
            height, width = self._size(at)
            self._tiles[at] = values[start : start + height * width].reshape(height, width)
            start += height * width

    def __getitem__(self, key: Windows2) -> npt.NDArray[Any]:
        rows, columns = self._bounds(key)
        value = self._single_value(rows, columns)
        if value is not None:
            return np.full((len(rows), len(columns)), value, self.dtype)
        if not len(rows) or not len(columns):
            return np.empty((len(rows), len(columns)), self.dtype)
        r, c = (np.arange(part[0] // TILE, part[-1] // TILE + 1) for part in (rows, columns))
        high, wide = (
            np.minimum((k + 1) * TILE, part.stop) - np.maximum(k * TILE, part.start)
            for k, part in ((r, rows), (c, columns))
        )
        result = self._values[r[0] : r[-1] + 1, c[0] : c[-1] + 1].repeat(wide, 1).repeat(high, 0)
        for at, inside, here in self._parts(rows, columns) if self._tiles else ():
            tile = self._tiles.get(at)
            if tile is not None:
                result[here] = tile[inside]
        return result

    def __setitem__(self, key: Windows2, values: Any) -> None:
        rows, columns = self._bounds(key)
        if np.ndim(values) == 0 and self._is_of_tiles(rows, columns):
            r, c = (range(part.start // TILE, -(-part.stop // TILE)) for part in (rows, columns))
            self._values[r.start : r.stop, c.start : c.stop] = values
            for at in product(r, c) if self._tiles else ():
                self._tiles.pop(at, None)
            return
        given = np.broadcast_to(np.asarray(values, self.dtype), (len(rows), len(columns)))
        value = given.flat[0] if given.size and given.strides == (0, 0) else None
        for at, inside, here in self._parts(rows, columns):
            part = given[here]
            size = self._size(at)
            if part.shape == size:
                if value is None:
                    self._put(at, part)
                else:
                    self._values[at] = value
                    self._tiles.pop(at, None)
                continue
            tile = self._tiles.get(at)
            if tile is None:
                if (part == self._values[at]).all() if value is None else value == self._values[at]:
                    continue
                tile = np.full(size, self._values[at])
            else:
                tile = tile.copy()
            tile[inside] = part
            self._put(at, tile)

    def _is_of_tiles(self, rows: range, columns: range) -> bool:
        """Test whether a window, which is not empty, consists of whole tiles."""
        return all(
            part.start < part.stop and part.start % TILE == 0 and (part.stop % TILE == 0 or part.stop == side)
            for part, side in zip((rows, columns), self.shape, strict=True)
        )

    def uniform(self, box: Box) -> Any:
        """Return the single value of all tiles that a box touches; None if they hold several."""
        common = box.shared(Box(0, 0, *self.shape))
        if not all(common.shape):
            return None
        return self._single_value(range(common.top, common.bottom), range(common.left, common.right))

    def holds(self, box: Box, value: Any) -> bool:
        """Test whether all pixels of a box on the map have a value."""
        rows, columns = _tiles_of(box)
        right = self._values[rows.start : rows.stop, columns.start : columns.stop] == value
        for (r, c), tile in self._tiles.items():
            if r in rows and c in columns:
                part = box.moved(-r * TILE, -c * TILE).shared(Box(0, 0, TILE, TILE))
                if not (tile[part.slices] == value).all():
                    return False
                right[r - rows.start, c - columns.start] = True
        return bool(right.all())

    def doubled(self, shape: tuple[int, int]) -> TileMap:
        """Return the map at twice the size, cut to a shape."""
        result = TileMap(shape, 0, self.dtype)
        rows, columns = result._values.shape
        result._values = self._values.repeat(2, axis=0).repeat(2, axis=1)[:rows, :columns].copy()
        for (r, c), tile in self._tiles.items():
            large = _doubled(tile)
            for at in product((2 * r, 2 * r + 1), (2 * c, 2 * c + 1)):
                if at[0] < rows and at[1] < columns:
                    height, width = result._size(at)
                    top, left = (at[0] - 2 * r) * TILE, (at[1] - 2 * c) * TILE
                    result._put(at, large[top : top + height, left : left + width])
        return result

    def alike(self, side: int, overlap: int) -> npt.NDArray[np.bool_]:
        """Test for all blocks of `side` px, which overlap the next ones, whether :meth:`uniform` finds a
        value.

        Returns (rows, columns) of blocks, bool.
        """
        least = most = self._values
        several = np.zeros(self._values.shape, bool)
        if self._tiles:
            several[tuple(np.array(list(self._tiles)).T)] = True
        for axis, length in enumerate(self.shape):
            starts = np.arange(0, length, side)
            stops = np.minimum(starts + side + overlap, length)
            first, last = starts // TILE, -(-stops // TILE)
            bounds = np.stack([first, np.minimum(last, least.shape[axis])], axis=1).ravel()
            least, most, several = (
                _reduced_between(function, values, bounds, axis)
                for function, values in ((np.minimum, least), (np.maximum, most), (np.logical_or, several))
            )
        known: npt.NDArray[np.bool_] = (least == most) & ~several
        return known

    def _single_value(self, rows: range, columns: range) -> Any:
        if not len(rows) or not len(columns):
            return None
        first, last = rows[0] // TILE, rows[-1] // TILE + 1
        left, right = columns[0] // TILE, columns[-1] // TILE + 1
        values = self._values[first:last, left:right]
        if self._tiles and any((r, c) in self._tiles for r in range(first, last) for c in range(left, right)):
            return None
        value = values.flat[0]
        return value if (values == value).all() else None

    def _bounds(self, key: Windows2) -> tuple[range, range]:
        rows, columns = (range(*part.indices(side)) for part, side in zip(key, self.shape, strict=True))
        return rows, columns

    def _size(self, at: tuple[int, int]) -> tuple[int, int]:
        height, width = (min(TILE, side - TILE * k) for side, k in zip(self.shape, at, strict=True))
        return height, width

    @staticmethod
    def _parts(rows: range, columns: range) -> Iterator[tuple[tuple[int, int], Windows2, Windows2]]:
        """Yield the tiles that a window touches, with the parts of tile and window that coincide."""
        for r in range(rows.start // TILE, -(-rows.stop // TILE) if len(rows) else 0):
            top, bottom = max(rows.start, r * TILE), min(rows.stop, (r + 1) * TILE)
            for c in range(columns.start // TILE, -(-columns.stop // TILE) if len(columns) else 0):
                left, right = max(columns.start, c * TILE), min(columns.stop, (c + 1) * TILE)
                inside = slice(top - r * TILE, bottom - r * TILE), slice(left - c * TILE, right - c * TILE)
                here = (
                    slice(top - rows.start, bottom - rows.start),
                    slice(left - columns.start, right - columns.start),
                )
                yield (r, c), inside, here

    def _put(self, at: tuple[int, int], tile: npt.NDArray[Any]) -> None:
        value = tile.flat[0]
        if (tile == value).all():
            self._values[at] = value
            self._tiles.pop(at, None)
        else:
            self._tiles[at] = tile.copy()


def _tiles_of(box: Box) -> tuple[range, range]:
    """Return the rows and columns of tiles that a box touches."""
    top, left, bottom, right = box
    return range(top // TILE, -(-bottom // TILE)), range(left // TILE, -(-right // TILE))


def _reduced_between(
    function: np.ufunc, values: npt.NDArray[Any], bounds: npt.NDArray[np.intp], axis: int
) -> npt.NDArray[Any]:
    """Reduce values along an axis by a ufunc between pairs of bounds; the last bound may be the end."""
    ends = np.concatenate([values, values.take([-1], axis)], axis)  # reduceat takes no bound at the end
    return function.reduceat(ends, bounds, axis).take(range(0, len(bounds), 2), axis)


def new_map(shape: tuple[int, int], fill: Any, dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Make an (H, W) map of one value, to be written to: an array, or a :class:`TileMap` if large."""
    if shape[0] * shape[1] <= DENSE_PIXELS:
        return np.full(shape, fill, dtype)
    return cast("npt.NDArray[Any]", TileMap(shape, fill, dtype))


def doubled(values: npt.NDArray[Any], shape: tuple[int, int]) -> npt.NDArray[Any]:
    """Return a map at twice the size, each pixel as four, cut to a shape.

    Examples
    --------
    >>> doubled(np.array([[1, 2]], np.int16), (1, 3)).tolist()
    [[1, 1, 2]]
    """
    if isinstance(values, TileMap):  # the larger one is a TileMap, too
        return cast("npt.NDArray[Any]", values.doubled(shape))
    result = new_map(shape, 0, values.dtype)
    for box in blocks(Box(0, 0, *values.shape), EDGES):
        fine = box.doubled().shared(Box(0, 0, *shape))
        result[fine.slices] = _doubled(values[box.slices])[: fine.shape[0], : fine.shape[1]]
    return result


def _doubled(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    height, width = values.shape
    result = np.empty((2 * height, 2 * width), values.dtype)
    result[::2, ::2] = values
    result[::2, 1::2] = values
    result[1::2] = result[::2]
    return result


def part_of(values: Any, *boxes: Box) -> npt.NDArray[Any]:
    """Return a map inside some boxes, small enough to be passed to another process; elsewhere any value.

    Examples
    --------
    >>> import pickle
    >>> mask = np.zeros((3000, 4000), bool)
    >>> mask[1000:1100, 2000:2100] = True
    >>> part = pickle.dumps(part_of(mask, Box(900, 1900, 1200, 2200)))
    >>> len(part) < 5000, int(np.sum(pickle.loads(part)[900:1200, 1900:2200]))
    (True, 10000)
    """
    if isinstance(values, TileMap):
        return cast("npt.NDArray[Any]", values.part(*boxes))
    shape = values.shape[0], values.shape[1]
    inside = [box.shared(Box(0, 0, *shape)) for box in boxes]
    value = uniform(values, inside[0])  # the value of the whole map, if it is known
    result = TileMap(shape, 0 if value is None else value, values.dtype)
    for box in (box for box in inside if value is None and all(box.shape)):
        result[box.slices] = values[box.slices]
    return cast("npt.NDArray[Any]", result)


def made_map(
    shape: tuple[int, int], dtype: npt.DTypeLike, values: Callable[[Box], Any], side: int = BLOCK
) -> npt.NDArray[Any]:
    """Make an (H, W) map block by block; `values` computes an array, or a single value, for a box."""
    result = new_map(shape, 0, dtype)
    for box in blocks(Box(0, 0, *shape), side):
        result[box.slices] = values(box)
    return result


def uniform(values: Any, box: Box) -> Any:
    """Return the single value of a map in a box if that is known without reading pixels, else None."""
    if isinstance(values, TileMap):
        return values.uniform(box)
    if isinstance(values, np.ndarray) and values.size and not any(values.strides):
        return values.flat[0]
    return None


def is_empty(mask: Any) -> bool:
    """Test whether a mask is False everywhere."""
    return mask.holds(Box(0, 0, *mask.shape), False) if isinstance(mask, TileMap) else not np.any(mask)


def dense(values: Any) -> npt.NDArray[Any]:
    """Return the map as an array."""
    return values[:, :] if isinstance(values, TileMap) else np.asarray(values)


def blocks(box: Box, side: int = BLOCK, overlap: int = 0) -> Iterator[Box]:
    """Yield the blocks of a box, row by row; each reaches over the next ones by `overlap` px."""
    for top in range(box.top, box.bottom, side):
        for left in range(box.left, box.right, side):
            yield Box(top, left, top + side + overlap, left + side + overlap).shared(box)


def several(label_map: Any, box: Box, overlap: int = 1, side: int | None = None) -> Iterator[Box]:
    """Yield the blocks of a box in which a map has more than one value; each reaches over the next ones by
    `overlap` px.

    Blocks are large on arrays, where each must be read, and small on a :class:`TileMap`, where equal ones are
    known.
    """
    if side is None:
        side = EDGES if isinstance(label_map, TileMap) else BLOCK
    if isinstance(label_map, TileMap) and box == Box(0, 0, *label_map.shape):
        yield from compress(blocks(box, side, overlap), ~label_map.alike(side, overlap).ravel())
        return
    for block in blocks(box, side, overlap):
        if uniform(label_map, block) is None:
            yield block


def cover_of(layer: Layer) -> Mask:
    """(h, w) bool map, True where a layer has pixels that may show."""
    height, width = layer.image.shape[:2]
    if layer.alpha is None and layer.mask is None:
        return np.broadcast_to(np.True_, (height, width))
    if height * width <= DENSE_PIXELS:
        return layer.covered

    def values(box: Box) -> Mask:
        opaque = np.ones(box.shape, bool) if layer.alpha is None else layer.alpha[box.slices] > 0
        return opaque if layer.mask is None else opaque & np.asarray(layer.mask[box.slices])  # type: ignore[index]

    return made_map((height, width), bool, values)


def all_of(mask: Mask) -> bool:
    """Test whether a map is True everywhere."""
    box = Box(0, 0, *mask.shape)
    return all(bool(uniform(mask, block)) or bool(mask[block.slices].all()) for block in blocks(box))


def any_of(mask: Mask) -> bool:
    """Test whether a map is True somewhere."""
    box = Box(0, 0, *mask.shape)
    return any(uniform(mask, block) is not False and bool(mask[block.slices].any()) for block in blocks(box))


def occupied_columns(values: Any) -> npt.NDArray[np.bool_]:
    """(w,) bool: True at the columns in which an (h, w) mask is True, or an opacity above 0."""
    used = np.zeros(values.shape[1], bool)
    for box in blocks(Box(0, 0, *values.shape)):
        used[box.left : box.right] |= (values[box.slices] > 0).any(axis=0)
    return used


def ground(places: Sequence[Box], covers: Sequence[Mask], box: Box) -> Mask:
    """(h, w) bool mask of a box of the canvas, True where any layer has pixels; may be read-only."""
    near = [k for k, place in enumerate(places) if all(place.shared(box).shape)]
    for k in near:
        if places[k].shared(box) == box and uniform(covers[k], box.moved(-places[k].top, -places[k].left)):
            return np.broadcast_to(np.True_, box.shape)
    result = np.zeros(box.shape, bool)
    for k in near:
        common = places[k].shared(box)
        if uniform(covers[k], common.moved(-places[k].top, -places[k].left)) is not np.False_:
            result[common.within(box)] |= covers[k][common.within(places[k])]
    return result
