"""Sets of corner tiles of two materials: any two whose corners agree fit each other (Wang tiles; Cohen,
Shade, Hiller and Deussen 2003, doi:10.1145/882262.882265).

Of each material a small texture is laid that repeats. All tiles show what it has along its borders, so that
each continues any other; their interiors are laid anew. Where a tile has corners of both materials, these
meet along the best seam near a line drawn at random, which crosses a border where both are most alike, in all
tiles at the same place.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats32, Image, Ints32, Mask
from toposeam.checks import Seed, check_function, check_items, check_whole, check_whole_array
from toposeam.errors import ImageError, OverlapError, Term
from toposeam.picture_files import PictureResult
from toposeam.seam.labels import seam_labels
from toposeam.texture.assemble_result import finish
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import PlaceGrid
from toposeam.texture.exemplar.atlas import Atlas, values_at
from toposeam.texture.exemplar.mirror_narrow import widened
from toposeam.texture.exemplar.sources import DataRange, Images, Sources, check_varied
from toposeam.texture.material import Material, lay
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.placement.request import TextureRequest
from toposeam.texture.scheduling.raster import patches_along
from toposeam.texture.synthesize import check_patch
from toposeam.texture.tile_origin import line_steps

#: Least and largest side of a tile, px.
SMALLEST, LARGEST = 24, 512
#: px along a border that are alike in all tiles of a material, and share of a side within which interiors are
#: joined to them.
_RING, _FRAME = 2, 1 / 8
#: How patches of interiors are chosen (:func:`toposeam.synth`).
_VARIATION = 0.25
#: How far a line between materials strays, and how far off it the seam may run, as shares of the way from
#: corner to corner.
_STRAY, _FREE = 0.12, 0.14
#: Part of a border, from its middle, on which materials may meet.
_MEETING = 0.1
#: By which share of a tile's side the places of patches in two tiles differ at least, as long as that rules
#: out no more than this share of the sample.
_FRESH, _RULED_OUT = 1 / 8, 1 / 2


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TileSet(PictureResult):
    """Corner tiles of two materials on one sheet, 4 in a row: 16 for all combinations of their corners, then
    the next variants of these.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> grass, dirt = np.random.default_rng(0).random((2, 64, 64))
    >>> tiles = ts.texture.tile_set([grass, dirt / 2], 32, variants=1)
    >>> tiles, tiles.image.shape, tiles.corners[6].tolist()
    (TileSet(16 tiles of 32 × 32 px), (128, 128), [0, 1, 1, 0])
    """

    #: (H, W) or (H, W, C), dtype and channels of the materials: the sheet.
    image: Image
    #: The further maps, cut alike; every value is one of the given map's.
    maps: tuple[Image, ...] = ()
    #: The normal map, cut alike.
    normal: Image | None = None
    #: Side of a tile, px.
    size: int
    #: (n, 4) uint8, the material at each tile's corners: top left, top right, bottom left, bottom right.
    corners: npt.NDArray[np.uint8]

    def __repr__(self) -> str:
        return f"TileSet({len(self.corners)} tiles of {self.size} × {self.size} px)"

    def numbers(self, corners: npt.ArrayLike, seed: Seed = 0) -> Ints32:
        """Choose tiles for a grid of corners, their variants at random.

        Parameters
        ----------
        corners : (h + 1, w + 1) array_like of 0 and 1
            The material at each corner.
        seed : int, Generator or None

        Returns
        -------
        (h, w) int32 array
        """
        if isinstance(corners, np.ndarray) and corners.dtype == bool:
            corners = corners.astype(np.uint8)
        grid = check_whole_array("corners", corners)
        if grid.ndim != 2 or min(grid.shape) < 2 or ((grid != 0) & (grid != 1)).any():
            raise ImageError(
                "{array} has shape {shape!s}, or values that are no materials; give 0 or 1 for each corner, "
                "at least two in each direction",
                kind="shape",
                array=Term("corners"),
                shape=grid.shape,
            )
        grid = grid.astype(np.int32)
        code: Ints32 = grid[:-1, :-1] + 2 * grid[:-1, 1:] + 4 * grid[1:, :-1] + 8 * grid[1:, 1:]
        variants = np.random.default_rng(seed).integers(len(self.corners) // 16, size=code.shape)
        return code + 16 * variants.astype(np.int32)

    def laid(self, numbers: npt.ArrayLike) -> Image:
        """Lay tiles, given by number, (h, w), side by side: (h * size, w * size[, C])."""
        chosen, size = check_whole_array("numbers", numbers), self.size
        if chosen.ndim != 2 or not chosen.size or chosen.min() < 0 or chosen.max() >= len(self.corners):
            raise ImageError(
                "{array} has shape {shape!s}, or numbers of no tiles; give rows of numbers from 0 to {most}",
                kind="shape",
                array=Term("numbers"),
                shape=chosen.shape,
                most=len(self.corners) - 1,
            )
        deep = self.image.reshape(*self.image.shape[:2], -1)
        tiles = (
            deep.reshape(-1, size, 4, size, deep.shape[2])
            .swapaxes(1, 2)
            .reshape(-1, size, size, deep.shape[2])
        )
        rows, columns = chosen.shape
        field = tiles[chosen].swapaxes(1, 2).reshape(rows * size, columns * size, *self.image.shape[2:])
        return np.ascontiguousarray(field)

    def field(self, rows: int, columns: int, seed: Seed = 0) -> Image:
        """Lay a field of so many tiles, with patches of either material at random."""
        rng = np.random.default_rng(seed)
        noise = ndimage.gaussian_filter(rng.normal(size=(rows + 1, columns + 1)), 1.2)
        return self.laid(self.numbers(noise > np.median(noise), rng))


def tile_set(
    sources: Sequence[Images],
    size: int = 64,
    *,
    variants: int = 4,
    seed: Seed = 0,
    maps: Sequence[Images] = (),
    normal: Images | None = None,
    weights: Sequence[float] | None = None,
    data_range: DataRange = None,
    smooth: int = 1,
    progress: Callable[[float], None] | None = None,
) -> TileSet:
    """Make corner tiles of two materials, for maps of games: each tile has one of them at each corner, and
    fits any other tile that has the same ones at the corners they share.

    Parameters
    ----------
    sources : two of (H, W[, C]) array_like
        Samples of the materials, gray or RGB, of one dtype.
    size : int
        Side of a tile, px.
    variants : int
        How many tiles there are of each combination of corners.
    seed : int, Generator or None
        The same seed gives the same bytes.
    maps, normal, weights, data_range, smooth
        As for :func:`toposeam.synth`; of each map one per material.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].

    Returns
    -------
    TileSet

    Raises
    ------
    ImageError
        For samples or maps that cannot be used.
    OptionError
        For sizes and numbers out of range.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> grass, dirt = np.random.default_rng(0).random((2, 48, 48))
    >>> tiles = ts.texture.tile_set([grass, dirt / 2], 24, variants=1)
    >>> tiles.laid(tiles.numbers([[0, 0, 1], [1, 1, 0]])).shape
    (24, 48)
    """
    check_function("progress", progress)
    size = check_whole("size", size, SMALLEST, LARGEST)
    variants = check_whole("variants", variants, 1, 64)
    pictures = widened(check_items("sources", sources, object, "a sequence of two images"))
    if len(pictures) != 2:
        raise ImageError(
            "{array} has {count} images; a set of tiles is of two materials, so give two",
            kind="count",
            array=Term("sources"),
            count=len(pictures),
        )
    request = TextureRequest.of(
        "tile_set",
        None,
        {},
        seed=seed,
        smooth=smooth,
        alpha=None,
        maps=widened(check_items("maps", maps, object, "a sequence of images, one a map")),
        normal=widened(normal),
        weights=weights,
        data_range=data_range,
        variation=_VARIATION,
    )
    read = request.read(pictures, None, "source")
    check_varied(read)
    rng = request.rng
    grounds = [_Ground(read, number, size, request, rng) for number in range(2)]
    meeting = _meeting(grounds, size)
    every = list(itertools.product(range(variants), range(16)))
    padded = size + 2 * _RING
    sheet = np.empty((len(every), padded, padded), np.int32)
    for done, (_, code) in enumerate(every, start=1):
        corners = np.array([code >> bit & 1 for bit in range(4)])
        layers = [
            ground.laid(rng) if number in corners else ground.base for number, ground in enumerate(grounds)
        ]
        shows = _shown(corners, layers, grounds[0].features, meeting, rng)
        tile = np.where(shows, layers[1], layers[0])
        # what lies beyond its borders is the same beside any neighbour
        sheet[done - 1] = np.where(
            np.pad(shows, _RING, mode="edge"), *(np.pad(layer, _RING, mode="wrap") for layer in layers[::-1])
        )
        sheet[done - 1, _RING:-_RING, _RING:-_RING] = tile
        if progress is not None:
            progress(done / len(every))
    rows = len(every) // 4
    index = sheet.reshape(rows, 4, padded, padded).swapaxes(1, 2).reshape(rows * padded, 4 * padded)
    canvas = IndexCanvas(index.shape, (False, False), grounds[0].atlas.usable.size)
    canvas.begin(index)
    made = finish(read, grounds[0].atlas, canvas, (size, size), {}, request)

    def cropped(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
        parts = values.reshape(rows, padded, 4, padded, -1)[:, _RING:-_RING, :, _RING:-_RING]
        return np.ascontiguousarray(parts.reshape(rows * size, 4 * size, *values.shape[2:]))

    return TileSet(
        image=cropped(made.image),
        maps=tuple(map(cropped, made.maps)),
        normal=None if made.normal is None else cropped(made.normal),
        size=size,
        corners=np.array([[code >> bit & 1 for bit in range(4)] for _, code in every], np.uint8),
    )


class _Fresh:
    """Excludes the places of earlier tiles, which would only be continued: a :class:`Penalty`."""

    def __init__(self, reach: int, most: int) -> None:
        self._reach = reach
        self._shifts: deque[tuple[int, int]] = deque(maxlen=most)

    def note(self, canvas: IndexCanvas, atlas: Atlas) -> None:
        """Note the shifts of the copies that show."""
        y, x = np.divmod(canvas.index, np.int32(atlas.width))
        rows, columns = np.ogrid[: canvas.shape[0], : canvas.shape[1]]
        shifts, counts = np.unique(
            np.stack([y - rows, x - columns], axis=2).reshape(-1, 2), axis=0, return_counts=True
        )
        for down, across in shifts[counts > canvas.index.size // 50].tolist():
            if (down, across) not in self._shifts:
                self._shifts.append((down, across))

    def factor(self, places: PlaceGrid) -> Floats32:
        """Compute the factor on the error of places: (n, m) float32."""
        rows, columns = places.axes
        away = rows - places.at[0], columns - places.at[1]
        near = np.zeros((len(rows), len(columns)), bool)
        reach = max(self._reach, places.step)
        for down, across in self._shifts:
            near |= (np.abs(away[0] - down) <= reach)[:, np.newaxis] & (np.abs(away[1] - across) <= reach)
        return np.where(near, np.float32(np.inf), np.float32(1))


class _Ground:
    """A material: a texture that repeats, and others that have its borders."""

    def __init__(
        self, sources: Sources, number: int, size: int, request: TextureRequest, rng: np.random.Generator
    ) -> None:
        copied = [usable & (number == one) for one, usable in enumerate(sources.usable)]
        self.atlas = Atlas.of(sources.present, request.options.context, copied)
        self.features = self.atlas.spread(sources.features)
        own = Sources(
            planes=tuple((plane[number],) for plane in sources.planes),
            gray=sources.gray,
            compared=sources.compared,
            features=(sources.features[number],),
            present=(sources.present[number],),
            usable=(sources.usable[number],),
            has_alpha=sources.has_alpha,
            has_normal=sources.has_normal,
            own_features=sources.own_features,
        )
        self._side, self._lap = check_patch(own, None, None)
        reach = round(_FRESH * size)
        most = max(1, int(_RULED_OUT * sources.usable[number].sum() / (2 * reach + 1) ** 2))
        self._options, self._size, self._fresh = request.options, size, _Fresh(reach, most)
        self._material = Material(atlas=self.atlas, features=self.features)
        placer = self._placer(rng)
        lay(placer, self._side, self._lap)
        shown = values_at(self.features, placer.canvas.index)
        down, across = line_steps(shown)
        #: (size, size) int32, flat indices of a texture that repeats, begun where that shows least.
        self.base: Ints32 = np.roll(placer.canvas.index, (-int(down.argmin()), -int(across.argmin())), (0, 1))
        placer.canvas.index[:] = self.base
        self._fresh.note(placer.canvas, self.atlas)

    def _placer(self, rng: np.random.Generator) -> PatchPlacer:
        return self._material.placer((self._size, self._size), (True, True), self._options, rng)

    def laid(self, rng: np.random.Generator) -> Ints32:
        """Lay another interior."""
        size, frame = self._size, max(2 * _RING, round(_FRAME * self._size))
        placer = self._placer(rng)
        index = self.base.copy()
        index[frame:-frame, frame:-frame] = -1
        placer.canvas.begin(index)
        placer.ranking.penalties.append(self._fresh)
        free = np.zeros((size, size), bool)
        free[_RING:-_RING, _RING:-_RING] = True
        side, starts = patches_along(size - 2 * _RING, min(self._side, 2 * size // 3), self._lap, False)
        for top, left in itertools.product(starts, repeat=2):
            part = np.s_[_RING + top : _RING + top + side, _RING + left : _RING + left + side]
            placer.lay(_RING + top, _RING + left, (side, side), free[part])
        self._fresh.note(placer.canvas, self.atlas)
        return placer.canvas.index


class _Meeting(NamedTuple):
    """Where materials meet on vertical borders, going down, and on horizontal ones, going right, px."""

    down: int
    right: int


def _meeting(grounds: Sequence[_Ground], size: int) -> _Meeting:
    """Find where on borders materials are most alike, near their middle."""
    first, second = (values_at(ground.features, ground.base) for ground in grounds)
    apart = np.square(first - second).sum(axis=2)
    low, high = round((0.5 - _MEETING) * size), round((0.5 + _MEETING) * size)
    found = []
    for lines in (apart[:, [-2, -1, 0, 1]], apart[[-2, -1, 0, 1]].T):
        steps = lines[:-1].sum(axis=1) + lines[1:].sum(axis=1)  # of both pixels beside a seam
        found.append(low + int(steps[low:high].argmin()) + 1)
    return _Meeting(*found)


def _shown(
    corners: npt.NDArray[np.intp],
    layers: Sequence[Ints32],
    features: Floats32,
    meeting: _Meeting,
    rng: np.random.Generator,
) -> Mask:
    """Find where the second material shows in a tile, (size, size) bool."""
    size = len(layers[0])
    if corners.min() == corners.max():
        return np.full((size, size), bool(corners[0]))
    weights = [_share(size, middle) for middle in meeting]
    grid = corners.reshape(2, 2).astype(float)
    down, right = (np.stack([1 - one, one]) for one in weights)
    level: npt.NDArray[np.float64] = down.T @ grid @ right
    inside = np.minimum(np.arange(size), np.arange(size)[::-1])
    window = np.clip((np.minimum.outer(inside, inside) - _RING) / (size / 4), 0, 1)
    noise = ndimage.gaussian_filter(rng.normal(size=(size, size)), size / 8, mode="wrap")
    level += _STRAY * window * noise / max(float(noise.std()), 1e-9)
    border = inside < _RING
    fixed = border[:, np.newaxis] | border | (np.abs(level - 0.5) > _FREE)
    wanted: Mask = level > 0.5
    a, b = (values_at(features, layer) for layer in layers)
    scale = max(float(np.abs(features).max()), 1e-9)
    try:
        found: Mask = seam_labels(a / scale, b / scale, ~fixed | ~wanted, ~fixed | wanted)
    except OverlapError:
        return wanted
    return found


def _share(size: int, middle: int) -> npt.NDArray[np.float64]:
    """Compute how far each pixel of a border is from its first corner to its last, 0.5 where materials meet;
    none and all of the way near either, so that tiles that meet there agree.
    """
    result: npt.NDArray[np.float64] = np.interp(np.arange(size) + 0.5, [0, middle, size], [0.0, 0.5, 1.0])
    result[:_RING], result[-_RING:] = 0.0, 1.0
    return result
