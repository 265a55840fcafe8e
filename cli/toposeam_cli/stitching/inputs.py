"""Read pictures and their places, and make layers on one canvas of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import full_scale
from toposeam.layers.canvas.transforms import (
    CameraTransform,
    MeshTransform,
    Transform,
    fitted_transforms,
    is_move,
    settled,
    similarity,
    unbent,
)
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.registration.find_places import PlaceOptions, Places, among, found_places
from toposeam_cli.app.options import Keyed, with_skip_bad
from toposeam_cli.files.regular import check_pattern
from toposeam_cli.media.pictures.decode import check_together, size_of
from toposeam_cli.media.pictures.lens import exposure, focal_length, in_pixels, is_fisheye, noted
from toposeam_cli.media.pictures.masks import read_white
from toposeam_cli.media.pictures.picture import MAX_PIXELS, Picture, match_pictures, read_picture
from toposeam_cli.stitching.positions import ALONE, LAYOUTS, Where, places_of
from toposeam_cli.stitching.resample import blank, check_canvas, placed_layers

if TYPE_CHECKING:
    from toposeam_cli.files.scratch import Scratch
    from toposeam_cli.media.layouts.layout import LayoutLayer

#: Whether the boundary of a canvas is bent, by the transforms of its pictures and whether these were found.
Fits: TypeAlias = Callable[..., bool]
#: Metadata of a photograph, by EXIF tag.
_Notes: TypeAlias = Mapping[int, Any]
#: The number or the name of a picture, and the ends of a line of it, px from the middle of its upper left
#: pixel, which come to lie level, or upright if they are nearer to that.
Horizon: TypeAlias = tuple[str, tuple[tuple[float, float], tuple[float, float]]]

#: Largest number of pixels of all pictures together that are kept in memory; with more they are stored in
#: files.
STORED_PIXELS = 64_000_000
#: A canvas that nobody allowed has at most so many times the pixels of its pictures, or so many megapixels:
#: a file of a hundred bytes asks for a thousand.
_LARGEST_RATIO, _SMALL_MEGAPIXELS = 16, 16.0


def picture_number(key: str, names: Mapping[int, str], count: int) -> int | None:
    """Find a picture by its name, if unique, or by its number, counted from 0; None if none matches."""
    called = [number for number, name in names.items() if name == key]
    if len(called) == 1:
        return called[0]
    return int(key) if key.isdecimal() and int(key) < count else None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedPictures:
    """Pictures of one depth and colour space, with their places."""

    pictures: tuple[Picture, ...]
    layers: tuple[ts.Layer, ...]
    #: The file of each picture; empty if one file holds them all. Files of where each may show, and of where
    #: no other may.
    files: tuple[Path, ...] = ()
    masks: tuple[Path | None, ...] = ()
    keeps: tuple[Path | None, ...] = ()
    #: The placement that was found; None if places were given.
    placement: ts.layers.Placement | None = None
    #: Whether the pixels are stored in files.
    stored: bool = False
    #: The reason for each picture that was left out.
    skipped: tuple[str, ...] = ()
    #: The transform of each picture's pixels to the canvas, and the width of a round canvas, px.
    transforms: tuple[Transform, ...] = ()
    wrap: int | None = None
    #: How the boundary of the canvas is bent; None where it is not.
    boundary: MeshTransform | None = None
    #: If some pictures were left out: the number of each layer among the given ones, and the names of those
    #: left out.
    numbers: tuple[int, ...] = ()
    lost: tuple[str, ...] = ()
    #: Groups of files that show something else, each group together.
    other_groups: tuple[tuple[Path, ...], ...] = ()

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the canvas."""
        return ts.layers.common_canvas(self.layers).shape

    def warped(self, index: int) -> bool:
        """Test whether a picture was transformed by more than a translation."""
        return self.boundary is not None or not is_move(self.transforms[index])

    @property
    def onto_canvas(self) -> tuple[Transform, ...]:
        """The transform of each picture's pixels to the canvas with its bent boundary."""
        return fitted_transforms(self.transforms, self.boundary, self.wrap)

    def number(self, key: str) -> int | None:
        """Find a layer by its number, counted from 0 among the given pictures, or its name; None if it was
        left out.

        Raises
        ------
        OptionError
            If no picture, or more than one, matches.
        """
        names = [layer.name for layer in self.layers]
        count = len(names) + len(self.lost)
        numbers = self.numbers or tuple(range(count))
        number = picture_number(key, dict(zip(numbers, names, strict=True)), count)
        if number is not None:
            return numbers.index(number) if number in numbers else None
        if key in self.lost:
            return None
        raise ts.OptionError(
            f"{key!r} is no picture of this job; use a number from 0 to {count - 1}, or one of "
            f"{', '.join(dict.fromkeys(names))}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceFinding:
    """The options of finding places that are not given, and how the canvas is turned."""

    #: All but the focal length; the number of the central picture counts the given ones.
    options: PlaceOptions = field(default_factory=PlaceOptions)
    #: Focal length, mm, as equivalent for film of 24 × 36 mm.
    focal_mm: float | None = None
    horizon: Horizon | None = None
    #: The options of the command line that were given.
    named: tuple[str, ...] = ()
    #: Whether pictures that show something else are joined by themselves instead of left out.
    takes_groups: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Source:
    picture: Picture
    name: str
    transform: Transform | None = None
    mask: Path | None = None
    keep: Path | None = None
    file: Path | None = None


@dataclass(slots=True, kw_only=True)
class _Reading:
    """A reading of pictures one after another; with `skips` unreadable ones are left out and recorded."""

    limit: int
    #: The folder in which pixels are stored; None keeps them in memory.
    scratch: Scratch | None
    #: Whether unreadable pictures are left out; None if the command has no such option.
    skips: bool | None
    executor: Executor | None
    #: Whether the executor may run on other machines.
    elsewhere: bool = False
    reasons: list[str] = field(default_factory=list)
    #: The numbers of the pictures that were read, among the given ones, and the names of the others.
    numbers: list[int] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    names: Sequence[str] = ()
    #: The bent boundary that a layout has.
    boundary: MeshTransform | None = None

    def read(self, files: Sequence[Path], names: Sequence[str]) -> Iterator[tuple[int, Picture]]:
        """Yield the pictures that can be read, with their numbers."""
        self.names = names
        if not self.skips:
            try:
                check_together(files, self.limit)
            except ts.ImageError as error:
                raise self._with_remedy(error, len(files)) from None
        scratch = self.scratch
        items = (
            (
                path.absolute() if self.elsewhere else path,
                self.limit,
                None if scratch is None else scratch.new(),
            )
            for path in files
        )
        pictures = results(None if scratch is None else self.executor, _read, items)
        with nullcontext() if scratch is None else scratch.failures_told():
            for number, (picture, name) in enumerate(zip(pictures, names, strict=True)):
                if isinstance(picture, ts.ImageError):
                    if not self.skips:
                        raise self._with_remedy(picture, len(files))
                    self.reasons.append(str(picture))
                    self.lost.append(name)
                    continue
                self.numbers.append(number)
                yield number, picture

    def leave_out(self, reasons: Mapping[int, str], silently: Collection[int] = ()) -> None:
        """Leave out some of the pictures that were read; `reasons` has their numbers among these."""
        for number in sorted(reasons, reverse=True):
            self.lost.append(self.names[self.numbers.pop(number)])
        self.reasons += [reasons[number] for number in sorted(reasons) if number not in silently]

    def _with_remedy(self, error: ts.ImageError, count: int) -> ts.ImageError:
        """Point to ``--skip-bad`` in an error about one of `count` pictures, if enough would be left."""
        return error if self.skips is None else with_skip_bad(error, count)


@dataclass(slots=True)
class _Laying:
    """Lays pictures on a canvas, whose boundary is bent where that is given or asked for."""

    place: Callable[[Sequence[ts.Layer], Sequence[Transform], int | None], Sequence[ts.Layer]]
    boundary: MeshTransform | None
    #: Tells whether it is asked for; and whether the places are found.
    fits: Fits | None
    found: bool

    def __call__(
        self, layers: Sequence[ts.Layer], transforms: Sequence[Transform], wrap: int | None
    ) -> Sequence[ts.Layer]:
        transforms = tuple(map(settled, transforms))
        asked = self.fits is not None and self.fits(transforms, found=self.found)
        if self.fits is not None and not asked:
            self.boundary = None  # all is kept unbent, or cropped otherwise
        if self.boundary is None and asked:
            from toposeam.layers.boundary.fit import fitted_boundary

            self.boundary = fitted_boundary(layers, transforms, wrap)
        return self.place(layers, fitted_transforms(transforms, self.boundary, wrap), wrap)


def _read(item: tuple[Path, int, Path | None]) -> Picture | ts.ImageError:
    """Read a picture within a limit of pixels, and store it in a file if one is given; return the error if it
    fails.
    """
    path, limit, waits = item
    try:
        if waits is not None:
            from toposeam_cli.media.pictures.stored import read_stored

            return read_stored(path, limit, waits)
        picture = read_picture(path, max_pixels=limit)
    except ts.ImageError as error:
        return error
    if picture.alpha is not None and picture.alpha.min() == full_scale(picture.alpha.dtype):
        picture = replace(picture, alpha=None)  # opaque everywhere
    return picture


def arrange(
    files: Sequence[Path],
    where: Where,
    *,
    masks: Sequence[Keyed] = (),
    keeps: Sequence[Keyed] = (),
    max_megapixels: float,
    skip_bad: bool | None = None,
    progress: Callable[[float], None] | None = None,
    scratch: Scratch | None = None,
    alone: bool = False,
    executor: Executor | None = None,
    stores: bool = False,
    finding: PlaceFinding | None = None,
    lay: Places | None = None,
    fits: Fits | None = None,
) -> PlacedPictures:
    """Read pictures, or the layers of one OpenRaster file or layout, and place them.

    With `scratch` the pixels of many pictures, or with `stores` of all, are kept there instead of in memory,
    and an executor may decode several pictures at a time. With `alone` a single picture is accepted, and
    pictures without a given place lie at 0,0. `finding` has the options of finding places. `lay` lays
    pictures on the canvas by their transforms, if they are not to be warped at full size; `fits` tells
    whether its boundary is bent to come nearer to a rectangle.

    Raises
    ------
    OptionError
        If places are missing, or given twice.
    ImageError
        If a file cannot be used.
    OverlapError
        If two pictures share no pixel.
    """
    limit = round(max_megapixels * 1e6)
    kept = scratch if scratch is not None and (stores or has_many_pixels(files)) else None
    keep = None
    if kept is not None:
        from toposeam_cli.media.pictures.stored import store

        keep = partial(store, scratch=kept)
    reading = _Reading(limit=limit, scratch=kept, skips=skip_bad, executor=executor, elsewhere=stores)
    sources, wrap = _sources(files, where, reading, 1 if alone else 2)
    shown = sources
    sources, wrap, finding = _viewed(sources, wrap, finding)
    turned = sources is not shown or (finding is not None and finding.horizon is not None)
    pictures = match_pictures([source.picture for source in sources], keep)
    transforms = _given_places(sources, pictures, where, reading, len(files), alone=alone)
    notes = [noted(source.file) for source in sources]
    named = PlacedPictures(
        pictures=(),
        layers=tuple(map(_layer, sources, pictures, notes)),
        numbers=tuple(reading.numbers),
        lost=tuple(reading.lost),
    )
    sources = _with_masks(named, sources, masks, keeps)
    layers = _masked(named.layers, sources, limit)
    pixels = sum(math.prod(source.picture.pixels.shape[:2]) for source in sources)
    most = canvas_megapixels(max_megapixels, pixels)
    place = _Laying(
        lay or partial(placed_layers, scratch=kept, executor=executor, max_megapixels=most),
        None if turned else reading.boundary,  # which is that of another view
        fits,
        not transforms,
    )
    placement = None
    other_groups: tuple[tuple[Path, ...], ...] = ()
    if not transforms:
        finding = finding or PlaceFinding()
        options = replace(
            _finding_options(finding, sources, notes, reading.numbers), horizon=_horizon(named, finding)
        )
        try:
            placement = found_places(layers, options, progress, executor if kept else None, place)
        except ts.OverlapError as error:
            raise _with_fisheyes(error, sources, notes) from error
        layers, wrap, transforms = list(placement.layers), placement.wrap, list(placement.transforms)
        grouped = {number for group in placement.other_groups for number in group}
        reading.leave_out(placement.left_out, grouped if finding.takes_groups else ())
        other_groups = tuple(
            tuple(file for number in group if (file := sources[number].file) is not None)
            for group in placement.other_groups
        )
        sources = [sources[number] for number in placement.numbers]
        pictures = [pictures[number] for number in placement.numbers]
    else:
        transforms = _turned(named, transforms, wrap, finding)
        layers = _laid(layers, transforms, wrap, place, alone)
    return replace(
        named,
        pictures=tuple(map(_as_placed, pictures, layers)),
        layers=tuple(layers),
        **_files_of(sources),
        placement=placement,
        skipped=tuple(reading.reasons),
        numbers=tuple(reading.numbers),
        lost=tuple(reading.lost),
        other_groups=other_groups,
        stored=kept is not None,
        transforms=tuple(map(settled, transforms)),
        wrap=wrap,
        boundary=place.boundary,
    )


def _laid(
    layers: Sequence[ts.Layer],
    transforms: Sequence[Transform],
    wrap: int | None,
    place: Places,
    alone: bool,
) -> list[ts.Layer]:
    """Lay layers in given places.

    Raises
    ------
    OverlapError
        If two lie beside each other.
    OptionError
        If the canvas is too large.
    """
    one_pair = len(layers) == 2 and not alone
    try:
        laid = list(place(layers, transforms, wrap))
    except ts.OptionError:
        if one_pair:  # whose places are told
            _check_touching(*map(blank, layers, map(settled, transforms)))
        raise
    if one_pair:
        _check_touching(*laid)
    return laid


def _horizon(named: PlacedPictures, finding: PlaceFinding) -> tuple[int, Any] | None:
    """Return the number of the picture that has the horizon, among those that were read, and the line.

    Raises
    ------
    OptionError
        If the picture is none of them.
    """
    if finding.horizon is None:
        return None
    picture, line = finding.horizon
    number = named.number(picture)
    if number is None:
        raise ts.OptionError(
            f"--horizon is a line of {picture}, which was left out; take a line of another picture"
        )
    return number, line


def _turned(
    named: PlacedPictures, transforms: Sequence[Transform], wrap: int | None, finding: PlaceFinding | None
) -> list[Transform]:
    """Turn given places until a line of a picture is level, if that is asked for.

    Raises
    ------
    OptionError
        If an option finds places, or if the canvas goes all the way round and its pictures have no cameras.
    """
    foreign = [name for name in (finding.named if finding is not None else ()) if name != "--horizon"]
    if foreign:
        if foreign[0] in ("--projection", "--fov"):
            raise ts.OptionError(
                f"{foreign[0]} shows anew what cameras saw, and here places without cameras are given; "
                "let them be found with --model rotation, or leave it out"
            )
        raise ts.OptionError(
            f"{foreign[0]} is for places that are found, and here they are given; leave it out"
        )
    horizon = None if finding is None else _horizon(named, finding)
    if horizon is None:
        return list(transforms)
    from toposeam.layers.canvas.levelling import levelled  # only where it is asked for

    if wrap is not None and not all(isinstance(unbent(one), CameraTransform) for one in transforms):
        raise ts.OptionError(
            "--horizon cannot turn pictures that were warped round a whole turn already; leave it out"
        )
    return list(levelled(transforms, horizon[0], np.array(horizon[1])))


def _files_of(sources: Sequence[_Source]) -> dict[str, Any]:
    """Return the files of pictures and of their masks, as fields of :class:`PlacedPictures`."""
    return {
        "files": tuple(source.file for source in sources if source.file is not None),
        "masks": tuple(source.mask for source in sources),
        "keeps": tuple(source.keep for source in sources),
    }


def canvas_megapixels(max_megapixels: float, pixels: float = math.inf) -> float:
    """Return the limit for a canvas: that of the pictures if one is given, else the library's, or what
    pictures of so many pixels fill.
    """
    given = max_megapixels * 1e6 != MAX_PIXELS
    return max_megapixels if given else sparse_megapixels(ts.MAX_PIXELS / 1e6, pixels)


def sparse_megapixels(most: float, pixels: float) -> float:
    """Return the limit for a canvas that pictures of so many pixels fill in part."""
    return min(most, max(_SMALL_MEGAPIXELS, _LARGEST_RATIO * pixels / 1e6))


def _check_extent(layers: Sequence[LayoutLayer], limit: int) -> None:
    """Refuse a layout whose canvas is too large, or whose pictures overlap too often, before any is read.

    Raises
    ------
    OptionError
    """
    from toposeam.layers.labelling.posing import check_pairs

    blanks, pixels = [], 0
    for layer in layers:
        with suppress(ts.ImageError):  # raised again where the file is read
            width, height = size_of(layer.file)
            pixels += width * height
            nothing = np.broadcast_to(np.uint8(0), (height, width))
            blanks.append(blank(ts.Layer(nothing, name=layer.name), layer.transform))
    if blanks:
        check_canvas(blanks, canvas_megapixels(limit / 1e6, pixels))
        check_pairs(blanks)


def _as_placed(picture: Picture, layer: ts.Layer) -> Picture:
    """Return a picture with the pixels of its layer, which may be warped."""
    return (
        picture if layer.image is picture.pixels else replace(picture, pixels=layer.image, alpha=layer.alpha)
    )


def _viewed(
    sources: list[_Source], wrap: int | None, finding: PlaceFinding | None
) -> tuple[list[_Source], int | None, PlaceFinding | None]:
    """Show what given cameras saw in the projection and field of view that are asked for."""
    cameras = [one.transform for one in sources if isinstance(one.transform, CameraTransform)]
    known = {"--projection", "--fov", "--horizon"}
    if finding is None or set(finding.named) - known or len(cameras) < len(sources):
        return sources, wrap, finding
    asked: dict[str, Any] = {"fov": finding.options.fov, "projection": finding.options.projection}
    asked = {key: value for key, value in asked.items() if value not in (None, "auto")}
    if not asked:
        return sources, wrap, replace(finding, named=())
    shown = [
        replace(source, transform=replace(camera, **asked))
        for source, camera in zip(sources, cameras, strict=True)
    ]
    round_way = "fov" not in asked and asked.get("projection", "sphere") in ("cylinder", "sphere")
    return shown, wrap if round_way else None, replace(finding, named=())


def _given_places(
    sources: Sequence[_Source],
    pictures: Sequence[Picture],
    where: Where,
    reading: _Reading,
    count: int,
    *,
    alone: bool,
) -> list[Transform]:
    """Return the places that files or options give; empty if they have to be found."""
    transforms = [source.transform for source in sources if source.transform is not None]
    if transforms:
        return transforms
    numbers = reading.numbers if reading.lost else None
    places = places_of([source.file or Path() for source in sources], pictures, where, numbers, count)
    if places is None and alone:
        places = [(0, 0) for _ in sources]
    return [similarity((float(x), float(y))) for x, y in places or ()]


def _layer(source: _Source, picture: Picture, notes: _Notes) -> ts.Layer:
    """Make a layer of a picture that has no place yet."""
    return ts.Layer(
        picture.pixels,
        alpha=picture.alpha,
        name=source.name,
        data_range=1.0 if picture.pixels.dtype.kind == "f" else None,
        exposure=exposure(notes),
    )


def _with_fisheyes(
    error: ts.OverlapError, sources: Sequence[_Source], notes: Sequence[_Notes]
) -> ts.OverlapError:
    """Add a hint at fisheye lenses to an error about pictures that are not placed."""
    bent = [
        source.name
        for source, own in zip(sources, notes, strict=True)
        if is_fisheye(source.picture.pixels, own)
    ]
    if not bent:
        return error
    return error.within(
        "{error}; {bent} seems to be taken with a fisheye: make such pictures flat first, as in Hugin",
        bent=bent[0],
    )


def _finding_options(
    finding: PlaceFinding, sources: Sequence[_Source], notes: Sequence[_Notes], numbers: Sequence[int]
) -> PlaceOptions:
    """Return the options for the pictures that were read, with the focal length that is given or that all
    their files state.
    """
    options = finding.options
    if options.centre is not None:
        options = replace(
            options, centre=numbers.index(options.centre) if options.centre in numbers else None
        )
    options = replace(options, points=among(numbers, options.points))
    sizes = [(source.picture.pixels.shape[1], source.picture.pixels.shape[0]) for source in sources]
    if finding.focal_mm is not None:
        return replace(options, focal=in_pixels(finding.focal_mm, sizes[0]))
    found = [focal_length(own, size) for own, size in zip(notes, sizes, strict=True)]
    known = [length for length in found if length is not None]
    if not known or len(known) < len(sources) or max(known) > 1.05 * min(known):
        return options
    return replace(options, focal=float(np.median(known)), about=True)


def has_many_pixels(files: Sequence[Path]) -> bool:
    """Test whether the pictures have too many pixels for memory."""
    if len(files) == 1 and files[0].suffix.lower() == ".ora":
        return False
    if len(files) == 1 and files[0].suffix.lower() in LAYOUTS:
        from toposeam_cli.media.layouts.any_layout import layout_in

        files = [layer.file for layer in layout_in(files[0]).layers]
    total = 0
    for path in files:
        with suppress(ts.ImageError):  # raised again where the file is read
            width, height = size_of(path)
            total += width * height
    return total > STORED_PIXELS


def _with_masks(
    named: PlacedPictures, sources: Sequence[_Source], masks: Sequence[Keyed], keeps: Sequence[Keyed]
) -> list[_Source]:
    """Return sources with the files of masks that the command line gives, before those of their layout."""
    found = list(sources)
    for kind, keyed in (("mask", masks), ("keep", keeps)):
        for option in keyed:
            number = named.number(option.key or "")
            if number is not None:
                changed: dict[str, Any] = {kind: option.path}
                found[number] = replace(found[number], **changed)
    return found


def _masked(layers: Sequence[ts.Layer], sources: Sequence[_Source], limit: int) -> list[ts.Layer]:
    """Add to layers the masks where each may show, and where no other may."""

    def white(path: Path | None, layer: ts.Layer) -> npt.NDArray[np.bool_] | None:
        return None if path is None else _white(path, layer, limit)

    return [
        replace(layer, mask=white(source.mask, layer), keep=white(source.keep, layer))
        for layer, source in zip(layers, sources, strict=True)
    ]


def read_avoid(path: Path, shape: tuple[int, int], max_megapixels: float) -> npt.NDArray[np.bool_]:
    """Read the mask that seams must avoid: the white pixels of a picture of the canvas's size."""
    return read_white(path, shape, "the canvas", round(max_megapixels * 1e6))


def _sources(
    files: Sequence[Path],
    where: Where,
    reading: _Reading,
    least: int,
) -> tuple[list[_Source], int | None]:
    """Read the pictures; return them with their transforms, if the file has any, and the width of a round
    canvas.
    """
    kind = files[0].suffix.lower()
    if len(files) == 1 and kind in ALONE:
        if where.at or where.offset is not None or where.overlap is not None or where.arranged:
            raise ts.OptionError(
                f"'{files[0]}' says itself where its pictures lie; leave --at, --offset and --overlap out"
            )
        if kind == ".ora":
            from toposeam_cli.media.pictures.openraster import read_ora

            wrap = None
            sources = [
                _Source(picture=layer.picture, name=layer.name, transform=similarity(layer.at))
                for layer in read_ora(files[0], reading.limit)
            ]
        else:
            from toposeam_cli.media.layouts.any_layout import layout_in

            layout = layout_in(files[0])
            placed, wrap, reading.boundary = layout.layers, layout.wrap, layout.boundary
            _check_extent(placed, reading.limit)
            read = reading.read([layer.file for layer in placed], [layer.name for layer in placed])
            sources = [
                _Source(
                    picture=picture,
                    name=placed[number].name,
                    transform=placed[number].transform,
                    mask=placed[number].mask,
                    keep=placed[number].keep,
                    file=placed[number].file,
                )
                for number, picture in read
            ]
        _check_enough(reading, len(sources), 2)
        if len(sources) < 2:
            raise ts.OptionError(
                f"'{files[0]}' has {'one' if sources else 'no'} visible layer; joining needs at least two, "
                "so add or show some"
            )
        for source in sources:
            _check_size(source)
        return sources, wrap
    if len(files) == 1 and files[0].is_dir():
        raise ts.OptionError(f"'{files[0]}' is a folder; give the pictures in it, like {files[0]}/*.jpg")
    if len(files) < least:
        check_pattern(files[0])
        raise ts.OptionError(
            f"'{files[0]}' is only one picture; give at least two, an OpenRaster file (.ora) or a layout "
            "(.toml, .json, .pto)"
        )
    for path in files:
        if path.suffix.lower() == ".ora":
            raise ts.OptionError(
                f"'{path}' holds layers of its own; give it alone, or export its layers as pictures"
            )
        if path.suffix.lower() in LAYOUTS:
            raise ts.OptionError(f"'{path}' is a layout; give it alone, and name all pictures in it")
    sources = [
        _Source(picture=picture, name=files[number].name, file=files[number])
        for number, picture in reading.read(files, [path.name for path in files])
    ]
    _check_enough(reading, len(sources), least)
    return sources, None


def _check_size(source: _Source) -> None:
    """Refuse a picture whose size differs from that of its camera or mesh."""
    if not isinstance(source.transform, CameraTransform | MeshTransform):
        return
    height, width = source.picture.pixels.shape[:2]
    if (width, height) != source.transform.size:
        given = source.transform.size
        raise ts.OptionError(
            f"{source.name} is {width} × {height} px, and its layout speaks of {given[0]} × {given[1]}; give "
            "the picture that it was made for"
        )


def _check_enough(reading: _Reading, count: int, least: int) -> None:
    """Refuse a reading in which pictures were left out and fewer than `least`, `count`, remain."""
    if reading.lost and count < least:
        given = count + len(reading.lost)
        raise ts.ImageError(f"only {count} of {given} pictures can be read: {reading.reasons[0]}")


def _check_touching(a: ts.Layer, b: ts.Layer) -> None:
    x, y = b.at[0] - a.at[0], b.at[1] - a.at[1]
    height, width = a.image.shape[:2]
    if x >= width or y >= height or x + b.image.shape[1] <= 0 or y + b.image.shape[0] <= 0:
        raise ts.OverlapError(
            f"{b.name} at {x},{y} lies beside {a.name}, which is {width} × {height} px; choose an offset at "
            "which they overlap"
        )


def _white(path: Path, layer: ts.Layer, limit: int) -> npt.NDArray[np.bool_]:
    return read_white(path, (layer.image.shape[0], layer.image.shape[1]), layer.name, limit)
