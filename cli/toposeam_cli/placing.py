"""From files and where they lie to layers on one canvas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam_cli.layout import read_layout
from toposeam_cli.openraster import read_ora
from toposeam_cli.parameters import Keyed, Length
from toposeam_cli.picture import Picture, match_pictures, read_picture, read_white


@dataclass(frozen=True, slots=True, kw_only=True)
class Where:
    """What the command line says about the places of pictures."""

    at: Sequence[tuple[int, int]] = ()
    offset: tuple[int, int] | None = None
    overlap: Length | None = None
    side: ts.Side | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Arrangement:
    """Pictures of one depth and colour space, placed."""

    pictures: tuple[Picture, ...]
    layers: tuple[ts.Layer, ...]

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the canvas."""
        return ts.common_canvas(self.layers, ts.MAX_PIXELS).shape

    def number(self, key: str) -> int:
        """The layer that is meant by a number, counted from 0, or by a name.

        Raises
        ------
        OptionError
            When there is none, or more than one.
        """
        names = [layer.name for layer in self.layers]
        if names.count(key) == 1:
            return names.index(key)
        if key.isdecimal() and int(key) < len(names):
            return int(key)
        raise ts.OptionError(
            f"{key!r} is no picture of this job; use a number from 0 to {len(names) - 1}, or one of {', '.join(dict.fromkeys(names))}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Source:
    picture: Picture
    at: tuple[int, int] | None
    name: str
    mask: Path | None = None
    keep: Path | None = None


def arrange(
    files: Sequence[Path], where: Where, *, masks: Sequence[Keyed] = (), keeps: Sequence[Keyed] = (), max_megapixels: float
) -> Arrangement:
    """Read pictures, or the layers of one OpenRaster file or layout, and place them.

    Raises
    ------
    OptionError
        When places are missing, or given twice.
    ImageError
        When a file cannot be used.
    OverlapError
        When two pictures share no pixel.
    """
    limit = round(max_megapixels * 1e6)
    sources = _sources(files, where, limit)
    pictures = match_pictures([source.picture for source in sources])
    offsets = [source.at for source in sources] if sources[0].at is not None else _offsets(files, pictures, where)
    layers = [
        ts.Layer(image=picture.pixels, alpha=picture.alpha, offset=offset or (0, 0), name=source.name)
        for source, picture, offset in zip(sources, pictures, offsets, strict=True)
    ]
    if len(layers) == 2:
        _check_touching(*layers)
    arrangement = Arrangement(pictures=tuple(pictures), layers=tuple(layers))
    wanted: dict[str, dict[int, Path]] = {"mask": {}, "keep": {}}
    for kind, keyed in (("mask", masks), ("keep", keeps)):
        wanted[kind] = {index: path for index, source in enumerate(sources) if (path := getattr(source, kind)) is not None}
        for option in keyed:
            wanted[kind][arrangement.number(option.key or "")] = option.path
    for index, layer in enumerate(layers):
        mask, keep = (_white(paths[index], layer, limit) if index in paths else None for paths in (wanted["mask"], wanted["keep"]))
        layers[index] = replace(layer, mask=mask, keep=keep)
    return Arrangement(pictures=tuple(pictures), layers=tuple(layers))


def read_avoid(path: Path, shape: tuple[int, int], max_megapixels: float) -> npt.NDArray[np.bool_]:
    """Where the seams must not run: the white of a picture of the canvas's size."""
    return read_white(path, shape, "the canvas", round(max_megapixels * 1e6))


def _sources(files: Sequence[Path], where: Where, limit: int) -> list[_Source]:
    """The pictures; `at` is set when the file itself says where they lie."""
    kind = files[0].suffix.lower()
    if len(files) == 1 and kind in (".ora", ".toml", ".json"):
        if where.at or where.offset is not None or where.overlap is not None:
            raise ts.OptionError(f"'{files[0]}' says itself where its pictures lie; leave --at, --offset and --overlap out")
        if kind == ".ora":
            sources = [_Source(picture=layer.picture, at=layer.offset, name=layer.name) for layer in read_ora(files[0], limit)]
        else:
            sources = [
                _Source(picture=read_picture(layer.file, max_pixels=limit), at=layer.at, name=layer.name, mask=layer.mask, keep=layer.keep)
                for layer in read_layout(files[0])
            ]
        if len(sources) < 2:
            raise ts.OptionError(
                f"'{files[0]}' has {'one' if sources else 'no'} visible layer; joining needs at least two, so add or show some"
            )
        return sources
    if len(files) == 1:
        raise ts.OptionError(f"'{files[0]}' is only one picture; give at least two, an OpenRaster file (.ora) or a layout (.toml, .json)")
    for path in files:
        if path.suffix.lower() == ".ora":
            raise ts.OptionError(f"'{path}' holds layers of its own; give it alone, or export its layers as pictures")
    return [_Source(picture=read_picture(path, max_pixels=limit), at=None, name=path.name) for path in files]


def _offsets(files: Sequence[Path], pictures: Sequence[Picture], where: Where) -> list[tuple[int, int]]:
    ways = [bool(where.at), where.offset is not None, where.overlap is not None]
    if len(files) > 2 and not ways[0]:
        raise ts.OptionError(f"say where the {len(files)} pictures lie: --at X,Y for each, in their order, or a layout (.toml, .json)")
    if len(files) > 2 and sum(ways) > 1:
        raise ts.OptionError("--offset and --overlap are for two pictures; leave them out where --at is given")
    if sum(ways) != 1:
        raise ts.OptionError("say where B lies: either --offset X,Y or --overlap N[%] with --side, or --at X,Y for both")
    if where.side is not None and where.overlap is None:
        raise ts.OptionError("--side belongs to --overlap; leave it out, or give that instead")
    if where.at:
        if len(where.at) != len(files):
            raise ts.OptionError(f"--at is given {len(where.at)} times for {len(files)} pictures; give it once for each, in their order")
        return list(where.at)
    if where.offset is not None:
        return [(0, 0), where.offset]
    return [(0, 0), _shifted(pictures[0], pictures[1], where.overlap, where.side or "right")]


def _check_touching(a: ts.Layer, b: ts.Layer) -> None:
    x, y = b.offset[0] - a.offset[0], b.offset[1] - a.offset[1]
    height, width = a.image.shape[:2]
    if x >= width or y >= height or x + b.image.shape[1] <= 0 or y + b.image.shape[0] <= 0:
        raise ts.OverlapError(
            f"{b.name} at {x},{y} lies beside {a.name}, which is {width} × {height} px; choose an offset at which they overlap"
        )


def _shifted(a: Picture, b: Picture, overlap: Length | None, side: ts.Side) -> tuple[int, int]:
    """The offset at which B overlaps A by a length at one side of A; the pictures are aligned at the top or left."""
    if overlap is None:
        raise ts.OptionError("--overlap is missing")
    across = 1 if side in ("right", "left") else 0
    whole, other = a.pixels.shape[across], b.pixels.shape[across]
    length = overlap.pixels(whole)
    if not 0 < length <= min(whole, other):
        raise ts.OptionError(
            f"--overlap comes to {length} px, but across that side A has {whole} px and B {other} px; choose 1 to {min(whole, other)} px"
        )
    shift = whole - length if side in ("right", "bottom") else length - other
    return (shift, 0) if across else (0, shift)


def _white(path: Path, layer: ts.Layer, limit: int) -> npt.NDArray[np.bool_]:
    return read_white(path, (layer.image.shape[0], layer.image.shape[1]), layer.name, limit)


def given_seams(files: Sequence[Keyed], arrangement: Arrangement) -> dict[tuple[int, int], ts.SvgSeam]:
    """The seams of ``--use-seam`` by pair: ``seam.svg``, ``0:1=seam.svg``, or a file in which paths are named after their pairs."""
    seams: dict[tuple[int, int], ts.SvgSeam] = {}
    names = [layer.name for layer in arrangement.layers]
    for file in files:
        try:
            drawing = ts.read_svg(file.path)
        except ts.PathError as error:
            raise error if str(file.path) in str(error) else ts.PathError(f"'{file.path}': {error}") from error
        if file.key is not None:
            first, colon, second = file.key.partition(":")
            if not colon:
                raise ts.OptionError(f"--use-seam {file.key}=… names no pair; write it as 0:1={file.path.name}")
            found = {(arrangement.number(first), arrangement.number(second)): drawing}
        elif len(names) == 2:
            found = {(0, 1): drawing}
        else:
            found = _by_name(file.path, drawing, arrangement)
        for between, one in found.items():
            pair = (min(between), max(between))
            if pair in seams:
                raise ts.OptionError(f"two seams are given between {names[pair[0]]} and {names[pair[1]]}; leave one of them out")
            seams[pair] = one
    return seams


def _by_name(path: Path, drawing: ts.SvgSeam, arrangement: Arrangement) -> dict[tuple[int, int], ts.SvgSeam]:
    names = [layer.name for layer in arrangement.layers]
    pairs = {ts.pair_name(names[i], names[j]): (i, j) for i in range(len(names)) for j in range(i + 1, len(names))}
    stranger = next((name for name in drawing.names if name not in pairs), None)
    if stranger is not None:
        raise ts.PathError(
            f"'{path}': the path {stranger!r} names no pair; call it as {next(iter(pairs))!r}, or use --use-seam 0:1={path.name}"
        )
    found = {}
    for name in dict.fromkeys(drawing.names):
        lines = tuple(line for line, own in zip(drawing.polylines, drawing.names, strict=True) if own == name)
        found[pairs[name]] = replace(drawing, polylines=lines, names=(name,) * len(lines))
    return found
