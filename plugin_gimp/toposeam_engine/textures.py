"""The engine's operations on textures: grown from a sample, made to repeat, holes filled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.arrays import Image, Mask
from toposeam.images import box_of, full_scale
from toposeam_engine.job import EngineJob
from toposeam_engine.layers import colours_of, place_of, with_alpha

#: Least width of the area round a hole from which the option `around` copies, px.
_AROUND_PX = 48
#: Size above which only the surroundings of a hole are searched, pixels, and their width: as a multiple of
#: the hole's longer side, and at least, px. :func:`toposeam.fill` does the same; in smaller surroundings
#: objects are repeated.
_LARGE, _AROUND, _LEAST_REACH = 1 << 20, 1.5, 512

Part = tuple[slice, slice]


class Sample(NamedTuple):
    """The colours of a layer, its opacity unless it is opaque, and the selection."""

    image: Image
    alpha: npt.NDArray[Any] | None
    selected: npt.NDArray[np.bool_] | None


def synthesize(job: EngineJob) -> dict[str, Any]:
    """Grow a texture of any size from a layer or its selected part."""
    made = synthesized(job)
    return {"picture": job.write(with_alpha(made.image, made.alpha))}


def synthesized(job: EngineJob) -> ts.texture.Synthesis:
    """Compute the texture of a request."""
    sample, options = _sample(job), _usual(job.options, "patch", "overlap")
    if options.get("setting", "auto") != "auto":
        options["patch"] = None  # its field is insensitive
    return ts.synthesize(
        sample.image,
        (options.pop("height"), options.pop("width")),
        alpha=sample.alpha,
        source_mask=sample.selected,
        data_range=_white(sample.image),
        progress=job.progress,
        **options,
    )


def make_tileable(job: EngineJob) -> dict[str, Any]:
    """Make a layer repeat."""
    made = made_tileable(job)
    return {"picture": job.write(with_alpha(made.image, made.alpha))}


def made_tileable(job: EngineJob) -> ts.texture.Synthesis:
    """Compute the tile of a request."""
    sample, options = _sample(job), _usual(job.options, "band")
    return ts.make_tileable(
        sample.image, alpha=sample.alpha, data_range=_white(sample.image), progress=job.progress, **options
    )


class Filled(NamedTuple):
    """The part of a layer from which its hole was filled, after and before; its place in the layer; and the
    mask of pixels that may be copied, None for all of them or those of another layer.
    """

    image: Image
    alpha: npt.NDArray[Any] | None
    sample: Sample
    box: Part
    source: Mask | None


def fill(job: EngineJob) -> dict[str, Any]:
    """Fill the selected part of a layer; the result is transparent where the layer stays unchanged."""
    image, alpha, sample, part, _source = filled(job)
    changed = (image != sample.image) if image.ndim == 2 else (image != sample.image).any(axis=2)
    changed |= np.asarray(sample.selected)
    if alpha is not None:
        changed &= alpha > 0
    box = box_of(changed)
    shown = np.broadcast_to(full_scale(image.dtype), changed.shape) if alpha is None else alpha
    raster = job.write(with_alpha(image[box], np.where(changed[box], shown[box], image.dtype.type(0))))
    x, y = place_of(job.request["layer"])
    at = [x + part[1].start + box[1].start, y + part[0].start + box[0].start]
    return {"picture": {**raster, "at": at}}


def filled(job: EngineJob) -> Filled:
    """Fill the hole of a layer.

    The option ``from`` names the source: `layer`, `around` the selection, or `other`, the request's
    ``source``, which is another picture, or a mask that is white where the layer may be copied.
    """
    options = _usual(job.options, "patch", "overlap", "band")
    other = options.pop("from", "layer") == "other"
    options.pop("only", None)
    sample, part, copied = _searched(job)
    image, alpha, hole, source = sample.image, sample.alpha, np.asarray(sample.selected), copied
    own = np.s_[: hole.shape[0], : hole.shape[1]]
    if other and source is None:
        image, alpha, hole, source = _beside(sample, *colours_of(job, job.request["source"]))
    made = ts.fill(
        image,
        hole,
        source=source,
        alpha=alpha,
        data_range=_white(image),
        progress=job.progress,
        **options,
    )
    shown = None if made.alpha is None or sample.alpha is None else made.alpha[own]
    return Filled(made.image[own], shown, sample, part, copied)


def copied_from(job: EngineJob) -> Mask:
    """Return the mask of pixels of a layer that may fill its hole, (H, W) bool."""
    sample, part, source = _searched(job)
    raster = job.request["layer"]
    where = np.zeros((int(raster["height"]), int(raster["width"])), bool)
    where[part] = ~np.asarray(sample.selected) & (True if source is None else source)
    if sample.alpha is not None:
        where[part] &= sample.alpha > 0
    return where


def _searched(job: EngineJob) -> tuple[Sample, Part, Mask | None]:
    """Return the part of a layer that is searched to fill its hole, its place, and the mask of pixels that
    may be copied: None for all of them or those of another layer.
    """
    where, hole = job.options.get("from", "layer"), _selected(job)
    if hole is None or not hole.any():
        raise ts.OptionError("nothing is selected; select what is to be replaced")
    source: Mask | None = None
    if where == "around":
        source = _around(hole)
    elif where == "other" and job.request["source"].get("is_mask"):
        source = _white_of(job, hole.shape)
    painted = _painted(job, hole.shape)
    if painted is not None:
        source = painted if source is None else source & painted
    part = whole = slice(0, hole.shape[0]), slice(0, hole.shape[1])
    if job.request["layer"].get("cut_from", hole.size) > _LARGE:
        part = _surroundings(hole) if source is None else box_of(source | hole, _AROUND_PX)
    sample = _sample(job, part)
    if source is None and where == "layer" and part != whole and _scarce(sample):
        part, sample = whole, _sample(job, whole)
    return sample, part, None if source is None else source[part]


def _surroundings(hole: Mask) -> Part:
    """Return the part of a large layer that is searched to fill a hole."""
    longer = max(side.stop - side.start for side in box_of(hole))
    return box_of(hole, max(_LEAST_REACH, round(_AROUND * longer)))


def _scarce(sample: Sample) -> bool:
    """Test whether the source has less than twice the pixels of the hole."""
    hole = np.asarray(sample.selected)
    there = ~hole if sample.alpha is None else ~hole & (sample.alpha > 0)
    return int(np.count_nonzero(there)) < 2 * int(np.count_nonzero(hole))


def _white_of(job: EngineJob, shape: tuple[int, ...]) -> Mask:
    """Return the (H, W) bool mask of the layer's pixels where the request's source, a mask, is white."""
    raster, (x, y) = job.request["source"], place_of(job.request["layer"])
    white, (left, top) = job.read(raster) >= 128, place_of(raster)
    result = np.zeros(shape, bool)
    rows, columns = (
        slice(min(max(start, 0), limit), max(min(start + length, limit), 0))
        for start, length, limit in zip((top - y, left - x), white.shape, shape, strict=True)
    )
    result[rows, columns] = white[
        rows.start - (top - y) : rows.stop - (top - y), columns.start - (left - x) : columns.stop - (left - x)
    ]
    return result


def _painted(job: EngineJob, shape: tuple[int, ...]) -> Mask | None:
    """Return the (H, W) bool mask of the discs from which alone may be copied; None for everywhere."""
    text = str(job.options.get("only", ""))
    if not text:
        return None
    try:
        discs = np.array([[float(value) for value in disc.split(",")] for disc in text.split(";")])
        x, y, radius = (discs * float(job.request.get("scale", 1))).T
    except ValueError as error:
        raise ts.OptionError(f"only is {text!r:.60}; give discs as x,y,radius with ; between them") from error
    left, top = place_of(job.request["layer"])
    result = np.zeros(shape, bool)
    for column, row, reach in zip(x - left, y - top, radius, strict=True):
        rows = np.arange(max(int(row - reach), 0), min(int(row + reach) + 1, shape[0]))
        columns = np.arange(max(int(column - reach), 0), min(int(column + reach) + 1, shape[1]))
        near = (rows[:, np.newaxis] - row) ** 2 + (columns - column) ** 2 <= reach**2
        result[np.ix_(rows, columns)] |= near
    return result


def _beside(
    sample: Sample, other: Image, opacity: npt.NDArray[Any] | None
) -> tuple[Image, npt.NDArray[Any], Mask, Mask]:
    """Return a picture of the sample with another picture to its right; its opacity, the hole in it, and the
    mask of the other picture, which may be copied.
    """
    (height, width), (tall, wide) = sample.image.shape[:2], other.shape[:2]
    shape = max(height, tall), width + wide
    own, there = np.s_[:height, :width], np.s_[:tall, width:]
    image = np.zeros((*shape, *sample.image.shape[2:]), sample.image.dtype)
    alpha, hole, source = np.zeros(shape, image.dtype), np.zeros(shape, bool), np.zeros(shape, bool)
    image[own], image[there] = sample.image, other
    alpha[own] = full_scale(image.dtype) if sample.alpha is None else sample.alpha
    alpha[there], source[there] = full_scale(image.dtype) if opacity is None else opacity, True
    hole[own] = np.asarray(sample.selected)
    return image, alpha, hole, source


def _sample(job: EngineJob, part: Part = np.s_[:, :]) -> Sample:
    image, alpha = colours_of(job, job.request["layer"])
    selected = _selected(job)
    if alpha is not None:
        alpha = None if bool((alpha[part] == full_scale(alpha.dtype)).all()) else alpha[part]
    return Sample(np.array(image[part]), alpha, None if selected is None else selected[part])


def _selected(job: EngineJob) -> Mask | None:
    """Return the (H, W) bool selection on the layer; None without a selection."""
    return None if job.request.get("selection") is None else job.read(job.request["selection"]) >= 128


def _around(selected: Mask) -> Mask:
    """Return the (H, W) bool mask of the selection's box enlarged by its own size, at least by 48 px."""
    rows, columns = (np.flatnonzero(selected.any(axis=axis)) for axis in (1, 0))
    reach = max(len(rows), len(columns), _AROUND_PX)
    near = np.zeros(selected.shape, bool)
    near[
        max(rows[0] - reach, 0) : rows[-1] + 1 + reach, max(columns[0] - reach, 0) : columns[-1] + 1 + reach
    ] = True
    return near


def _usual(options: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """Return the options with None, core's default, for 0 in those that have such a default."""
    return {name: None if name in names and not value else value for name, value in options.items()}


def _white(image: Image) -> float | None:
    """Return the white level: 1 for floats, whose highlights may be brighter."""
    return 1.0 if np.issubdtype(image.dtype, np.floating) else None
