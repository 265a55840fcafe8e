"""Exemplars as a caller gives them: one or several, each with any number of maps, opacity and a mask."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32, Image, Mask
from toposeam.checks import Name, check_items, check_number, term_of
from toposeam.errors import ImageError, OptionError, Term
from toposeam.images import as_array, as_float, as_mask, check_values, full_scale

Images = npt.ArrayLike | Sequence[npt.ArrayLike]
#: The value that counts as white in the picture, or in the picture and each of its maps.
DataRange = float | Sequence[float | None] | None
#: Rows and columns of an exemplar.
Window = tuple[slice, slice]
WHOLE: Window = np.s_[:, :]
#: Largest difference that is not seen, as a share of white: one level of 8 bits.
UNSEEN_STEP = 0.004
#: Step between the rows of an exemplar that are looked at first: they nearly always show whether it is flat.
_ROW_STEP = 64
#: Largest weight of a map; only ratios of weights count.
_MOST_WEIGHT = 1e6

_ALPHA, _NORMAL = Term("alpha"), Term("normal", "the normal map")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sources:
    """Exemplars, checked.

    Parameters
    ----------
    planes : tuple of tuples
        Per map (the picture itself first, then further maps, then normals and opacity if there are any), one
        (H, W, C) array per exemplar.
    gray : tuple of bool
        Per map, whether it came without a channel axis.
    compared : tuple of (int, float, float or None)
        The maps whose channels are features: number, weight, and what counts as white. Of maps that vary more
        than the picture the weight is less, so that none counts for more than the picture.
    features : tuple of (H, W, F) float32 arrays
        Per exemplar, the channels of all maps times the root of the map's weight; empty before
        :meth:`with_features`.
    present : tuple of (H, W) bool arrays
        Where the exemplar has pixels.
    usable : tuple of (H, W) bool arrays
        Where it may be copied.
    has_alpha : bool
        Whether the last plane is opacity.
    has_normal : bool
        Whether the last plane before that holds unit vectors.
    transparent : bool
        Whether places without opacity are present.
    """

    planes: tuple[tuple[npt.NDArray[Any], ...], ...]
    gray: tuple[bool, ...]
    compared: tuple[tuple[int, float, float | None], ...]
    features: tuple[Floats32, ...] = ()
    present: tuple[Mask, ...]
    usable: tuple[Mask, ...]
    has_alpha: bool
    has_normal: bool = False
    transparent: bool = False
    #: Number of features that are the picture's own.
    own_features: int = 0

    @property
    def shapes(self) -> tuple[tuple[int, int], ...]:
        """Height and width of each exemplar."""
        return tuple((mask.shape[0], mask.shape[1]) for mask in self.usable)

    def feature_planes(self, exemplar: int = 0, window: Window = WHOLE) -> Iterator[Floats32]:
        """Yield the features of a window of an exemplar one by one, (h, w) each."""
        there, share = self.present[exemplar][window], None
        if self.transparent and self.has_alpha:
            opacity = self.planes[-1][exemplar][window][..., 0]
            share = (opacity / full_scale(opacity.dtype)).astype(np.float32)
        for number, weight, white in self.compared:
            plane = self.planes[number][exemplar][window]
            for channel in range(plane.shape[2]):
                values = as_float(_masked(there, plane[..., channel]), data_range=white)[..., 0]
                if share is not None and number != len(self.planes) - 1:
                    values *= share
                if weight != 1:
                    values *= np.float32(np.sqrt(weight))
                yield values

    def features_in(self, exemplar: int = 0, window: Window = WHOLE) -> Floats32:
        """Stack the features of a window of an exemplar: (h, w, F)."""
        count = sum(self.planes[number][exemplar].shape[2] for number, *_ in self.compared)
        result = np.empty((*self.present[exemplar][window].shape, count), np.float32)
        for number, plane in enumerate(self.feature_planes(exemplar, window)):
            result[..., number] = plane
        return result

    def with_features(self) -> Sources:
        """Return sources that hold their features."""
        return dataclasses.replace(self, features=tuple(map(self.features_in, range(len(self.present)))))


def as_list(images: Images | None, count: int, name: Name) -> list[Any]:
    """List one entry per exemplar: a lone array stands for the only exemplar.

    Raises
    ------
    ImageError
        When there are not as many images as exemplars.
    """
    if images is None:
        return [None] * count
    found: list[Any] = list(images) if isinstance(images, list | tuple) else [images]
    if len(found) != count:
        raise ImageError(
            "{array} has {given} images for {count} {exemplars}; give one for each, in the same order",
            kind="count",
            array=term_of(name),
            given=len(found),
            count=count,
        )
    return found


def read_sources(
    source: Images,
    *,
    alpha: Images | None = None,
    mask: Images | None = None,
    maps: Sequence[Images] = (),
    normal: Images | None = None,
    weights: Sequence[float] | None = None,
    data_range: DataRange = None,
    name: str = "source",
    transparent: bool = False,
    features: bool = True,
) -> Sources:
    """Check exemplars and all that belongs to them.

    Parameters
    ----------
    source : (H, W[, C]) array_like, or a list of such
    alpha, mask : (H, W) array_like, or a list with one (or None) per exemplar
        Opacity, and where to sample; by default where the opacity is above 0.
    maps : sequence
        Further maps of the same exemplars, each an array or a list with one per exemplar.
    normal : (H, W, 3) array_like, or a list with one per exemplar
        Unit vectors, stored as shares of white about a half, or in floats below 0 as they are.
    weights : sequence of float, optional
        How much the picture, each further map and the normals count in the search; 1 each by default.
    data_range : float, or sequence of float or None, optional
        The value that counts as white (:func:`toposeam.images.as_float`) in the picture, or in the picture,
        each further map and the normals.
    name : str
        The caller's name for the exemplars, for messages.
    transparent : bool
        Whether opacity is part of the picture, so that places without any are copied like others.
    features : bool
        Whether the result holds all features.

    Raises
    ------
    ImageError
        For images that cannot be used, or unlike sizes.
    OptionError
        For weights that do not fit.
    """
    maps = check_items("maps", maps, object, "a sequence of images, one a map")
    labels = [Term("maps", f"map {k + 1}", k) for k in range(len(maps))]
    if normal is not None:
        maps, labels = (*maps, normal), [*labels, _NORMAL]
    pictures, names = _read_pictures(source, name)
    count, shapes = len(pictures), [picture.shape[:2] for picture in pictures]
    opacity = [None if a is None else as_array(a, "alpha") for a in as_list(alpha, count, "alpha")]
    masks = [
        None if m is None else as_mask(m, shape, "mask")
        for m, shape in zip(as_list(mask, count, "mask"), shapes, strict=True)
    ]
    factors, white = _check_weights(weights, 1 + len(maps)), white_of(data_range, 1 + len(maps))
    planes, gray = _read_planes(pictures, names, maps, labels)
    if normal is not None:
        _check_normal(planes[-1])
    present = [
        _find_present(a, picture, label, transparent=transparent)
        for a, picture, label in zip(opacity, planes[0], names, strict=True)
    ]
    usable = [there if m is None else there & m for there, m in zip(present, masks, strict=True)]
    _check_usable(usable, masks, name)
    if factors[0] > 0:
        factors[1:] = _balanced_weights(planes, [Term(name), *labels], factors, white, present)
    has_alpha = _has_opacity(opacity, usable)
    if has_alpha:
        planes.append(_opacity_plane(opacity, planes[0]))
        gray, labels = [*gray, True], [*labels, _ALPHA]
        factors, white = [*factors, 1.0], [*white, float(full_scale(planes[0][0].dtype))]
    weighed = [
        (number, factor, one)
        for number, (factor, one) in enumerate(zip(factors, white, strict=True))
        if factor > 0
    ]
    for exemplar, (there, own) in enumerate(zip(present, names, strict=True)):
        for number, _, one in weighed:
            check_values(_masked(there, planes[number][exemplar]), [own, *labels][number], one)
    read = Sources(
        planes=tuple(planes),
        gray=tuple(gray),
        compared=tuple(weighed),
        present=tuple(present),
        usable=tuple(usable),
        has_alpha=has_alpha,
        has_normal=normal is not None,
        transparent=transparent,
        own_features=planes[0][0].shape[2] if factors[0] > 0 else 0,
    )
    return read.with_features() if features else read


def _read_pictures(source: Images, name: str) -> tuple[list[Image], list[Term]]:
    """Check the pictures of all exemplars; return them and their names for messages."""
    several: list[Any] = list(source) if isinstance(source, list | tuple) else [source]
    if not several:
        raise ImageError(
            "{array} is an empty list; give at least one image", kind="count", array=Term(name), count=0
        )
    count = len(several)
    names = [Term(name) if count == 1 else Term(name, f"{name} {k + 1}", k) for k in range(count)]
    return [_read_picture(image, label) for image, label in zip(several, names, strict=True)], names


def _read_planes(
    pictures: Sequence[Image], names: Sequence[Term], maps: Sequence[Images], labels: Sequence[Term]
) -> tuple[list[tuple[npt.NDArray[Any], ...]], list[bool]]:
    """Check the maps of all exemplars; return the planes of the picture and of each map, and whether each
    came without a channel axis.
    """
    planes, gray = [_with_equal_channels(pictures, names)], [all(picture.ndim == 2 for picture in pictures)]
    for label, given in zip(labels, maps, strict=True):
        found = _read_map(as_list(given, len(pictures), label), label, pictures, names)
        planes.append(_with_equal_channels(found, [label] * len(pictures)))
        gray.append(all(image.ndim == 2 for image in found))
    return planes, gray


def _check_normal(planes: Sequence[npt.NDArray[Any]]) -> None:
    """Refuse normal maps without three channels."""
    if planes[0].shape[2] != 3:
        raise ImageError(
            "{array} has one channel, a normal map three; give heights and masks as further maps",
            kind="channels",
            array=_NORMAL,
            channels=1,
        )


def _has_opacity(opacity: Sequence[Image | None], usable: Sequence[Mask]) -> bool:
    """Test whether any pixel that may be copied is not opaque."""
    return any(
        a is not None and bool((a[pixels] < full_scale(a.dtype)).any())
        for a, pixels in zip(opacity, usable, strict=True)
    )


def _opacity_plane(
    opacity: Sequence[Image | None], pictures: Sequence[npt.NDArray[Any]]
) -> tuple[npt.NDArray[Any], ...]:
    """Return the opacity of every exemplar, (H, W, 1) each; full where none was given."""
    dtype = pictures[0].dtype
    full = [
        np.full(picture.shape[:2], full_scale(dtype), dtype) if a is None else a
        for a, picture in zip(opacity, pictures, strict=True)
    ]
    return tuple(one[..., np.newaxis] for one in full)


def _balanced_weights(
    planes: Sequence[Sequence[Image]],
    labels: Sequence[Term],
    factors: Sequence[float],
    white: Sequence[float | None],
    present: Sequence[Mask],
) -> list[float]:
    """Return the weights of the maps, reduced where a map varies more than the picture.

    Otherwise such a map would count for more than the picture: heights of bricks would decide where seams
    run, and colours would be torn.
    """

    def variance(index: int) -> float:
        each = zip(present, planes[index], strict=True)
        seen = [as_float(_masked(there, one), labels[index], white[index])[there] for there, one in each]
        return float(np.concatenate(seen).var(axis=0, dtype=np.float64).sum())

    count = range(1, len(planes))
    if not any(factors[index] for index in count):
        return list(factors[1 : len(planes)])
    most = variance(0)
    found = []
    for index in count:
        varies = variance(index) if factors[index] else 0.0
        found.append(factors[index] * (most / varies if varies > most > 0 else 1.0))
    return found


def check_varied(sources: Sources, name: str = "source") -> None:
    """Refuse exemplars of one flat colour, from which every texture is that colour.

    Raises
    ------
    ImageError
    """
    exemplars = list(zip(sources.features, sources.usable, strict=True))
    some = [values[::_ROW_STEP][usable[::_ROW_STEP]] for values, usable in exemplars]
    if any(len(values) and (values != values[:1]).any() for values in some):
        return
    seen = [values[usable] for values, usable in exemplars]
    if all(len(values) == 0 or (values == seen[0][:1]).all() for values in seen):
        raise ImageError(
            "{array} has one value everywhere, so there is nothing to make a texture of; give"
            " a picture with some structure",
            kind="plain",
            array=Term(name),
        )


def _read_picture(image: npt.ArrayLike, name: Term) -> Image:
    array = as_array(image, name)
    if array.ndim == 3 and array.shape[2] not in (1, 3):
        raise ImageError(
            "{array} has {channels} channels; pass gray or RGB, and opacity apart as {alpha}",
            kind="channels",
            array=name,
            channels=array.shape[2],
        )
    return array


def _read_map(
    images: list[Any], label: Term, pictures: Sequence[Image], names: Sequence[Term]
) -> list[Image]:
    """Check a map of each exemplar."""
    found = [_read_picture(image, label) for image in images]
    for image, picture, whose in zip(found, pictures, names, strict=True):
        if image.shape[:2] != picture.shape[:2]:
            raise ImageError(
                "{array} is {width} × {height} px, but {other} {other_width} × {other_height} px;"
                " scale the maps to one size",
                kind="other size",
                array=label,
                width=image.shape[1],
                height=image.shape[0],
                other=whose,
                other_width=picture.shape[1],
                other_height=picture.shape[0],
            )
    return found


def _find_present(opacity: Image | None, picture: Image, label: Term, *, transparent: bool) -> Mask:
    """Find where an exemplar has pixels."""
    if opacity is not None and (opacity.shape != picture.shape[:2] or opacity.dtype != picture.dtype):
        raise ImageError(
            "alpha of {array} is {dtype} of shape {shape!s}; give {wanted} of shape {expected!s}",
            kind="shape",
            array=label,
            dtype=str(opacity.dtype),
            shape=opacity.shape,
            wanted=str(picture.dtype),
            expected=picture.shape[:2],
        )
    if opacity is None or transparent:
        return np.ones(picture.shape[:2], bool)
    return np.asarray(opacity > 0)


def _check_usable(usable: Sequence[Mask], masks: Sequence[Mask | None], name: str) -> None:
    """Refuse exemplars of which nothing may be copied."""
    if any(pixels.any() for pixels in usable):
        return
    if all(m is None for m in masks):
        raise ImageError(
            "{array} is transparent everywhere; give one that shows something",
            kind="transparent",
            array=Term(name),
        )
    if not any(m is not None and m.any() for m in masks):
        raise ImageError(
            "nothing of {array} may be sampled: {mask} is empty; paint it white somewhere",
            kind="nothing to sample",
            array=Term(name),
            mask=Term("source_mask", "its mask"),
        )
    raise ImageError(
        "nothing of {array} may be sampled: wherever {mask} is white it is transparent; "
        "paint white what shows something",
        kind="nothing to sample",
        array=Term(name),
        mask=Term("source_mask", "its mask"),
    )


def _masked(present: Mask, values: Image) -> Image:
    """Set an exemplar's values, or those of a channel, to 0 where it has no pixels."""
    if present.all():
        return values
    shown = present if values.ndim == 2 else present[..., np.newaxis]
    return np.where(shown, values, values.dtype.type(0))


def _with_equal_channels(images: Sequence[Image], names: Sequence[Term]) -> tuple[npt.NDArray[Any], ...]:
    """Give all images a channel axis and equally many channels; gray ones are repeated."""
    if len({image.dtype for image in images}) > 1:
        raise ImageError(
            "the {exemplars} differ in dtype ({arrays}: {dtypes}); convert them to one",
            kind="dtype",
            arrays=tuple(names),
            dtypes=tuple(str(image.dtype) for image in images),
        )
    widest = max(1 if image.ndim == 2 else image.shape[2] for image in images)
    deep = [image[..., np.newaxis] if image.ndim == 2 else image for image in images]
    return tuple(np.repeat(image, widest, axis=2) if image.shape[2] < widest else image for image in deep)


def _check_weights(weights: Sequence[float] | None, count: int) -> list[float]:
    if weights is None:
        return [1.0] * count
    found = [
        check_number(Term("weights", "one of the weights", 0), weight, 0, _MOST_WEIGHT)
        for weight in _read_list(weights, "weights")
    ]
    if len(found) != count:
        raise OptionError(
            "{count} {weights} were given for the picture and {maps_count} further maps; give one for each",
            kind="count",
            parameter=Term("weights"),
            count=len(found),
            maps_count=count - 1,
        )
    if not any(found):
        raise OptionError(
            "the {weights} are {value}; give at least one above 0",
            kind="number",
            parameter=Term("weights"),
            value=tuple(f"{weight:g}" for weight in found),
        )
    return found


def white_of(data_range: DataRange, count: int) -> list[float | None]:
    """List what counts as white in the picture and in each of the maps; None where its dtype says it."""
    if data_range is None or not isinstance(data_range, Sequence | np.ndarray):
        given: list[Any] = [data_range] + [None] * (count - 1)
    else:
        given = _read_list(data_range, "data_range")
    if len(given) != count:
        raise OptionError(
            "{parameter} has {given} values for the picture and {maps_count} further maps; give one for each",
            kind="count",
            parameter=Term("data_range"),
            given=len(given),
            maps_count=count - 1,
        )
    return [None if one is None else check_number("data_range", one, 0, above=True) for one in given]


def _read_list(values: Any, name: str) -> list[Any]:
    items = list(check_items(name, values, object, "a list with one number per map"))
    if any(isinstance(item, Sequence | np.ndarray) for item in items):
        raise OptionError(
            "{parameter} is a list of lists; pass a list with one number per map",
            kind="type",
            parameter=Term(name),
            value=values,
        )
    return items
