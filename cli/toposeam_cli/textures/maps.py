"""Further maps of a texture's samples: read, handed to core, and written in formats of their own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.images import full_scale
from toposeam_cli.files.writing import TEXTURE_SUFFIXES
from toposeam_cli.media.pictures.picture import Picture, match_pictures, read_picture

#: Formats of maps; later ones hold more depth.
_RICHER = (".jpg", ".jpeg", ".webp", ".png", ".tif", ".tiff", ".exr")


@dataclass(frozen=True, slots=True, kw_only=True)
class Maps:
    """Maps of one or several samples.

    Parameters
    ----------
    files : tuple of Path
        The given files: each map once per sample.
    pictures : tuple of tuples of Picture
        Per map, one picture per sample; the normal map last.
    has_normal : bool
    """

    files: tuple[Path, ...] = ()
    pictures: tuple[tuple[Picture, ...], ...] = ()
    has_normal: bool = False

    @classmethod
    def read(cls, also: Sequence[Path], normal: Sequence[Path], count: int, max_pixels: int) -> Maps:
        """Read the maps of some samples.

        Raises
        ------
        OptionError
            When their number is no multiple of the number of samples.
        """
        if len(also) % count:
            raise ts.OptionError(
                f"--also was given {len(also)} times for {count} sources; give each map once for every "
                "source, in their order"
            )
        if len(normal) not in (0, count):
            raise ts.OptionError(
                f"--normal was given {len(normal)} times for {count} sources; give one for each, in their "
                "order"
            )
        files = (*also, *normal)
        groups = [files[first : first + count] for first in range(0, len(files), count)]
        pictures = [
            match_pictures([read_picture(path, max_pixels=max_pixels) for path in group]) for group in groups
        ]
        return cls(files=files, pictures=tuple(map(tuple, pictures)), has_normal=bool(normal))

    def keywords(self, picture: Picture, weights: tuple[float, ...] | None) -> dict[str, Any]:
        """Return the keywords for core; opacities are maps of weight 0."""
        further, normals = self.pictures, None
        if self.has_normal:
            further, normals = self.pictures[:-1], self.pictures[-1]
        opacities = self._opacities
        if weights is None:
            weights = (1.0,) * (1 + len(self.pictures))
        if opacities:  # before the weight of the normal map, which comes last
            at = 1 + len(further)
            weights = (*weights[:at], *(0.0 for _ in opacities), *weights[at:])
        white = [white_of(picture), *map(_range_of, further)]
        white += [_range_of(self.pictures[index]) for index in opacities]
        return {
            "maps": [[one.pixels for one in each] for each in further]
            + [_opacity(self.pictures[index]) for index in opacities],
            "normal": None if normals is None else [one.pixels for one in normals],
            "weights": weights,
            "data_range": white if normals is None else [*white, white_of(normals[0])],
        }

    def made(self, made: ts.texture.Synthesis | ts.texture.TileSet) -> list[Picture]:
        """Return the maps of a texture, or of tiles."""
        values = list(made.maps)
        opacities = {index: values.pop() for index in reversed(self._opacities)}
        values += [] if made.normal is None else [made.normal]
        return [
            dataclasses.replace(owner[0], pixels=pixels, alpha=opacities.get(index))
            for index, (owner, pixels) in enumerate(zip(self.pictures, values, strict=True))
        ]

    def changed(self, change: Callable[[Picture], Picture]) -> Maps:
        """Return the maps, with a function applied to each picture."""
        pictures = tuple(tuple(map(change, each)) for each in self.pictures)
        return dataclasses.replace(self, pictures=pictures)

    @property
    def _opacities(self) -> list[int]:
        """Return the maps that have opacity; that of the normal map has no meaning."""
        count = len(self.pictures) - self.has_normal
        return [
            k for k, each in enumerate(self.pictures[:count]) if any(one.alpha is not None for one in each)
        ]


def map_outputs(output: Path, also: Sequence[Path], normal: Sequence[Path], count: int) -> tuple[Path, ...]:
    """Return the paths of further maps: beside the output, the map's own name appended to the output's, in
    the map's own format; of several samples in the format that holds most.

    Examples
    --------
    >>> [path.name for path in map_outputs(Path("wall.jpg"), [Path("a/height.tif")], [Path("n.png")], 1)]
    ['wall_height.tif', 'wall_n.png']
    """
    files = (*also, *normal)
    return tuple(
        output.with_name(f"{output.stem}_{files[first].stem}{suffix_of(files[first : first + count])}")
        for first in range(0, len(files), count)
    )


def white_of(picture: Picture) -> float | None:
    """Return the white level of a picture: 1 for floats, whose highlights may be brighter."""
    return 1.0 if np.issubdtype(picture.pixels.dtype, np.floating) else None


def suffix_of(files: Sequence[Path]) -> str:
    """Return the format of a map that is made from several, which holds most."""
    own = [path.suffix.lower() for path in files]
    return max((one if one in TEXTURE_SUFFIXES else ".tif" for one in own), key=_RICHER.index)


def _range_of(pictures: Sequence[Picture]) -> float | None:
    """Return the white level of a map: the range of its values for heights, which may have any unit."""
    white = white_of(pictures[0])
    if white is None:
        return None
    low = min(float(one.pixels.min()) for one in pictures)
    high = max(float(one.pixels.max()) for one in pictures)
    return max(white, high - low)


def _opacity(pictures: Sequence[Picture]) -> list[np.ndarray]:
    full = full_scale(pictures[0].pixels.dtype)
    return [
        np.full(one.pixels.shape[:2], full, one.pixels.dtype) if one.alpha is None else one.alpha
        for one in pictures
    ]
