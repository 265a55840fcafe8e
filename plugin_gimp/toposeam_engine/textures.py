"""The engine's operations on textures: grown from a sample, made to repeat, holes filled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import Image, Mask, full_scale
from toposeam_engine.job import EngineJob
from toposeam_engine.layers import colours_of, place_of, with_alpha

#: What is copied into a hole from around it comes from at least so near.
_AROUND_PX = 48


class Sample(NamedTuple):
    """Colours, opacity where it is not full everywhere, and what is selected."""

    image: Image
    alpha: npt.NDArray[Any] | None
    selected: npt.NDArray[np.bool_] | None


def synthesize(job: EngineJob) -> dict[str, Any]:
    """Return a texture of any size grown from a layer, or from the selected part of it."""
    made = synthesized(job)
    return {"picture": job.write(with_alpha(made.image, made.alpha))}


def synthesized(job: EngineJob) -> ts.Synthesis:
    """Return the texture itself."""
    sample, options = _sample(job), _usual(job.options, "patch", "overlap")
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
    """Return a layer that repeats."""
    made = made_tileable(job)
    return {"picture": job.write(with_alpha(made.image, made.alpha))}


def made_tileable(job: EngineJob) -> ts.Synthesis:
    """Return the tile itself."""
    sample, options = _sample(job), _usual(job.options, "band")
    return ts.make_tileable(
        sample.image, alpha=sample.alpha, data_range=_white(sample.image), progress=job.progress, **options
    )


def fill(job: EngineJob) -> dict[str, Any]:
    """Fill the selected part of a layer; the result is transparent where the layer stays unchanged."""
    image, alpha, sample = filled(job)
    changed = (image != sample.image) if image.ndim == 2 else (image != sample.image).any(axis=2)
    changed |= np.asarray(sample.selected)
    if alpha is not None:
        changed &= alpha > 0
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    box = np.s_[int(rows[0]) : int(rows[-1]) + 1, int(columns[0]) : int(columns[-1]) + 1]
    shown = np.broadcast_to(full_scale(image.dtype), changed.shape) if alpha is None else alpha
    raster = job.write(with_alpha(image[box], np.where(changed[box], shown[box], image.dtype.type(0))))
    x, y = place_of(job.request["layer"])
    return {"picture": {**raster, "at": [x + int(columns[0]), y + int(rows[0])]}}


def filled(job: EngineJob) -> tuple[Image, npt.NDArray[Any] | None, Sample]:
    """Return the whole layer with its hole filled, its opacity, and the layer as it was.

    What may be copied is asked for by the option ``from``: `layer`, `around` the selection, or `other`, the
    request's ``source``, which is another picture, or a mask that is white where the layer may be copied.
    """
    sample, options = _sample(job), _usual(job.options, "patch", "overlap", "band")
    if sample.selected is None or not sample.selected.any():
        raise ts.OptionError("nothing is selected; select what is to be replaced")
    where, image, alpha, hole, source = (
        options.pop("from", "layer"),
        sample.image,
        sample.alpha,
        sample.selected,
        None,
    )
    if where == "around":
        source = _around(hole)
    elif where == "other" and job.request["source"]["channels"] == 1:
        source = _white_of(job, hole.shape)
    elif where == "other":
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
    own = tuple(slice(length) for length in sample.selected.shape)
    shown = None if made.alpha is None or sample.alpha is None else made.alpha[own]
    return made.image[own], shown, sample


def _white_of(job: EngineJob, shape: tuple[int, ...]) -> Mask:
    """(H, W) bool on the layer: where the request's source, a mask, is white."""
    raster, (x, y) = job.request["source"], place_of(job.request["layer"])
    white, (left, top) = job.read(raster) >= 128, place_of(raster)
    result = np.zeros(shape, bool)
    rows, columns = (
        slice(max(start, 0), max(min(start + length, limit), 0))
        for start, length, limit in zip((top - y, left - x), white.shape, shape, strict=True)
    )
    result[rows, columns] = white[
        rows.start - (top - y) : rows.stop - (top - y), columns.start - (left - x) : columns.stop - (left - x)
    ]
    return result


def _beside(
    sample: Sample, other: Image, opacity: npt.NDArray[Any]
) -> tuple[Image, npt.NDArray[Any], Mask, Mask]:
    """Return a picture that holds the sample and, to the right of it, another one; its opacity, the hole in
    it, and the other one's place in it, which may be copied.
    """
    (height, width), (tall, wide) = sample.image.shape[:2], other.shape[:2]
    shape = max(height, tall), width + wide
    own, there = np.s_[:height, :width], np.s_[:tall, width:]
    image = np.zeros((*shape, *sample.image.shape[2:]), sample.image.dtype)
    alpha, hole, source = np.zeros(shape, image.dtype), np.zeros(shape, bool), np.zeros(shape, bool)
    image[own], image[there] = sample.image, other
    alpha[own] = full_scale(image.dtype) if sample.alpha is None else sample.alpha
    alpha[there], source[there] = opacity, True
    hole[own] = np.asarray(sample.selected)
    return image, alpha, hole, source


def _sample(job: EngineJob) -> Sample:
    image, alpha = colours_of(job, job.request["layer"])
    image = np.array(image)
    selected = None if job.request.get("selection") is None else job.read(job.request["selection"]) >= 128
    return Sample(image, None if bool((alpha == full_scale(alpha.dtype)).all()) else alpha, selected)


def _around(selected: Mask) -> Mask:
    """(H, W) bool: what lies within the selection's own size of it, and at least 48 px."""
    rows, columns = (np.flatnonzero(selected.any(axis=axis)) for axis in (1, 0))
    reach = max(len(rows), len(columns), _AROUND_PX)
    near = np.zeros(selected.shape, bool)
    near[
        max(rows[0] - reach, 0) : rows[-1] + 1 + reach, max(columns[0] - reach, 0) : columns[-1] + 1 + reach
    ] = True
    return near


def _usual(options: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """Return the options, 0 turned into None, which stands for the usual value, in those that know it."""
    return {name: None if name in names and not value else value for name, value in options.items()}


def _white(image: Image) -> float | None:
    """Return the white level: 1 in floats, though lights may go beyond it."""
    return 1.0 if np.issubdtype(image.dtype, np.floating) else None
