"""The result of laying patches: the picture and its maps, where every pixel came from, and the seams between
the patches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Image, Ints32, Mask
from toposeam.checks import check_choice, check_whole, check_whole_array
from toposeam.display import to_png
from toposeam.errors import ImageError, Term
from toposeam.images import as_array
from toposeam.picture_files import PictureResult
from toposeam.saving import save
from toposeam.sentence import counted
from toposeam.texture.canvas.rendering import MAX_SMOOTH, render
from toposeam.texture.canvas.tileable import Tileable, wraps_of
from toposeam.texture.canvas.visible_joints import JointVerdict
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.mirror_narrow import widened
from toposeam.texture.exemplar.sources import Images, as_list
from toposeam.texture.exemplar.turns import TURNS, Turns, count_of, turned
from toposeam.vector.polyline import Polyline, trace_boundary


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Synthesis(PictureResult):
    """A picture made of patches of exemplars.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> sample = np.random.default_rng(0).random((48, 48))
    >>> grown = ts.synth(sample, (60, 70), patch=20)
    >>> grown.image.shape, grown.source.shape
    ((60, 70), (60, 70, 2))
    """

    #: (H, W) or (H, W, C), dtype and channels of the exemplars.
    image: Image
    #: (H, W) opacity in that dtype, or None where every pixel is opaque.
    alpha: npt.NDArray[Any] | None = None
    #: The further maps, made of the same patches along the same seams; every value is one of the given map's.
    maps: tuple[Image, ...] = ()
    #: The normal map, likewise, mixed at seams to vectors of length 1; None where none was given.
    normal: Image | None = None
    #: (H, W) int32, number of the patch that shows; patches that continue one another as one copy have one
    #: number. In pictures that were only mended, 0 is what was there.
    labels: Ints32
    #: (H, W) int32, flat index into the atlas of the pixel that shows.
    index: Ints32
    #: Whether rows and whether columns continue at the opposite border.
    wraps: tuple[bool, bool] = (False, False)
    #: Height and width near by on which the texture's order would close hardly stretched, px; None where it
    #: does so, or has none, or no size near by is better.
    fits: tuple[int, int] | None = None
    #: How visible joints are.
    verdict: JointVerdict
    #: The settings that were tried on small textures, best first, and their verdicts; None for those that
    #: were given up half-way.
    tried: dict[str, JointVerdict | None] = field(default_factory=dict)
    #: (height, width) of the patches, px.
    patch: tuple[int, int]
    #: The settings that reproduce it.
    settings: dict[str, Any] = field(default_factory=dict)
    #: px to either side of a seam in which neighbouring patches are mixed.
    smooth: int = 1
    #: (H, W) bool: pixels that may differ from the picture given; None means all.
    changed: Mask | None = field(default=None)
    atlas: Atlas

    def __repr__(self) -> str:
        height, width = self.labels.shape
        h, w = self.patch
        return f"Synthesis({width} × {height} px, {counted(self.count, 'patch')} of {w} × {h} px)"

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> Image:
        """Return the picture, for NumPy and matplotlib."""
        return np.array(self.image, dtype, copy=copy)

    def _repr_png_(self) -> bytes:
        """Return the picture itself: seams are all over a texture and would hide it; ``to_svg`` shows
        them.
        """
        return to_png(self.image, self.alpha)

    @property
    def count(self) -> int:
        """Number of patches that show; what was there before is none."""
        laid = self.labels[self.labels >= (self.changed is not None)]
        return int(np.count_nonzero(np.bincount(laid)))

    @cached_property
    def source(self) -> Ints32:
        """(H, W, 2) int32, row and column of the exemplar's pixel that shows."""
        return self._located[1]

    @cached_property
    def exemplar(self) -> npt.NDArray[np.int16]:
        """(H, W) int16, number of the exemplar it came from."""
        return self._located[0]

    @cached_property
    def _located(self) -> tuple[npt.NDArray[np.int16], Ints32]:
        return self.atlas.locate(self.index)

    @cached_property
    def paths(self) -> list[Polyline]:
        """The seams, as lines through pixel corners; those along the border of the picture left out."""
        lines = []
        for number, box in enumerate(ndimage.find_objects(self.labels + 1)):
            if box is None:
                continue
            grown = tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in box)
            shown = self.labels[grown]
            shift = np.array([grown[1].start, grown[0].start], float)
            # Against lower numbers only, so that no seam is drawn twice.
            traced = trace_boundary(shown == number, (shown <= number) & (shown >= 0))
            lines += [Polyline(points=line.points + shift, closed=line.closed) for line in traced]
        return lines

    def to_svg(self, path: str | Path | None = None) -> str:
        """Draw the seams as an SVG document of the picture's size, the settings in ``<metadata>``.

        Parameters
        ----------
        path : str or Path, optional
            Also write the document there (an existing file is replaced).
        """
        from toposeam.vector.svg import write_svg  # fills of a stitch's corners need none

        height, width = self.labels.shape
        text = write_svg(self.paths, width, height, self.settings)
        if path is not None:
            save(path, text)
        return text

    def apply(self, images: Images, *, smooth: int | None = None) -> Image:
        """Cut other pictures into the same patches along the same seams.

        Parameters
        ----------
        images : (H, W[, C]) array_like, or a list with one per exemplar
            Of the exemplars' sizes: another map of them, or another version.
        smooth : int, optional
            px to either side of a seam in which neighbours are mixed, 0 for heights and masks; by default as
            in the picture.

        Returns
        -------
        (H, W) or (H, W, C) array of their dtype

        Raises
        ------
        ImageError
            For other sizes, or images that differ in dtype or channels.
        """
        reach = self.smooth if smooth is None else check_whole("smooth", smooth, 0, MAX_SMOOTH)
        turns = self.settings.get("turns", "none")
        images = widened(images) if self.changed is None else images
        found = turned(_of_one_kind(images, len(self.atlas.shapes) // count_of(turns)), turns)
        for image, (height, width) in zip(found, self.atlas.shapes.tolist(), strict=True):
            if image.shape[:2] != (height, width):
                raise ImageError(
                    "an image has shape {shape!s}, but its exemplar is {width} × {height} px; scale it to "
                    "that size",
                    kind="other size",
                    parameter=Term("images"),
                    shape=image.shape,
                    width=width,
                    height=height,
                )
        deep = [image[..., np.newaxis] if image.ndim == 2 else image for image in found]
        made = self._render(deep, reach)
        return made[..., 0] if found[0].ndim == 2 else made

    def _render(self, images: Sequence[npt.NDArray[Any]], smooth: int) -> npt.NDArray[Any]:
        made = render(self.index, self.atlas.spread(images), self.atlas.usable, self.wraps, smooth)
        if self.changed is not None:
            np.copyto(made, images[0], where=~self.changed[..., np.newaxis])
        return made


def apply_coordinates(
    images: Images,
    source: npt.ArrayLike,
    exemplar: npt.ArrayLike | None = None,
    *,
    tileable: Tileable = "none",
    turns: Turns = "none",
    smooth: int = 1,
) -> Image:
    """Cut pictures as another synthesis was cut, from its source coordinates alone.

    Parameters
    ----------
    images : (H, W[, C]) array_like, or a list with one per exemplar
    source : (H', W', 2) integer array_like
        Row and column of the pixel to show, as in :attr:`Synthesis.source`.
    exemplar : (H', W') integer array_like, optional
        Number of the image it is taken from; 0 everywhere without it.
    tileable : {"both", "x", "y", "none"} or bool
        On which axes the texture continues at the opposite border; matters for the mixing at seams there.
    turns : {"none", "mirror", "quarters", "all"}
        As given to :func:`toposeam.synth`; `exemplar` counts every position of an image.
    smooth : int
        px to either side of a seam in which neighbouring patches are mixed.

    Returns
    -------
    (H', W') or (H', W', C) array of the images' dtype

    Raises
    ------
    ImageError
        For images that differ in kind, NaN or infinite values to be mixed, or coordinates beyond the images.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> sample, height = np.random.default_rng(0).random((2, 48, 48))
    >>> grown = ts.synth(sample, (60, 60), patch=20)
    >>> ts.texture.apply_coordinates(height, grown.source).shape
    (60, 60)
    """
    wraps, smooth = wraps_of(tileable), check_whole("smooth", smooth, 0, MAX_SMOOTH)
    place = check_whole_array("source", source)
    if place.ndim != 3 or place.shape[2] != 2:
        raise ImageError(
            "source has shape {shape!s}; pass {allowed}",
            kind="shape",
            parameter=Term("source"),
            shape=place.shape,
            allowed="(H, W, 2) whole numbers, row and column",
        )
    number = check_whole_array("exemplar", 0 * place[..., 0] if exemplar is None else exemplar)
    if number.shape != place.shape[:2]:
        raise ImageError(
            "exemplar has shape {shape!s}, the coordinates {wanted!s}; pass one value per pixel",
            kind="shape",
            parameter=Term("exemplar"),
            shape=number.shape,
            wanted=place.shape[:2],
        )
    check_choice("turns", turns, TURNS)
    images = widened(images)
    several = images if isinstance(images, list) else [images]
    found = turned(_of_one_kind(images, len(several)), turns)
    shapes = np.array([image.shape[:2] for image in found])
    if number.min() < 0 or number.max() >= len(found) or (place < 0).any() or (place >= shapes[number]).any():
        sizes = ", ".join(f"{width} × {height}" for height, width in shapes.tolist())
        raise ImageError(
            "the coordinates point beyond the pictures ({sizes} px); give pictures of the size of those they "
            "were made with",
            kind="outside",
            parameter=Term("source"),
            sizes=sizes,
        )
    atlas = Atlas.of([np.ones(image.shape[:2], bool) for image in found], 2)
    deep = [image[..., np.newaxis] if image.ndim == 2 else image for image in found]
    for image in found if smooth else ():
        if np.issubdtype(image.dtype, np.floating) and not np.isfinite(image).all():
            raise ImageError(
                "an image has NaN or infinite values, which cannot be mixed; say {smooth}",
                kind="not finite",
                smooth=Term("smooth", value=0),
            )
    made = render(
        atlas.index_of(number.astype(np.int16), place.astype(np.int32)),
        atlas.spread(deep),
        atlas.usable,
        wraps,
        smooth,
    )
    return made[..., 0] if found[0].ndim == 2 else made


def _of_one_kind(images: Images, count: int) -> list[npt.NDArray[Any]]:
    """Read one array per exemplar, alike in dtype and channels."""
    found = [as_array(image, "an image") for image in as_list(images, count, "images")]
    if len({(image.dtype, image.shape[2:]) for image in found}) > 1:
        raise ImageError(
            "the images differ in dtype or channels; convert them to one",
            kind="unlike",
            parameter=Term("images"),
        )
    return found
