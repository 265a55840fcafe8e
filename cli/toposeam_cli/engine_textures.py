"""What the engine can be asked for about textures: grown from a sample, made to repeat, holes filled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import Image, full_scale
from toposeam.texture.synthesize import Tileable
from toposeam_cli.engine import Job

_BORDERS: dict[str, Tileable] = {"none": False, "x": "x", "y": "y", "both": True}


class _Sample(NamedTuple):
    """Colours, opacity where it is not full everywhere, and what is selected."""

    image: Image
    alpha: npt.NDArray[Any] | None
    selected: npt.NDArray[np.bool_] | None


def synthesize(job: Job) -> dict[str, Any]:
    """A texture of any size grown from a layer, or from the selected part of it."""
    sample, options = _sample(job), _usual(job.options, "patch", "overlap")
    made = ts.synthesize(
        sample.image, (options.pop("height"), options.pop("width")), options.pop("patch"), alpha=sample.alpha, mask=sample.selected,
        tileable=_BORDERS[options.pop("tileable")], progress=job.progress, **options,
    )  # fmt: skip
    return {"picture": job.write(_with_alpha(made.image, made.alpha))}


def make_tileable(job: Job) -> dict[str, Any]:
    """A layer that repeats."""
    sample, options = _sample(job), _usual(job.options, "band")
    tileable = _BORDERS[options.pop("tileable")]
    made = ts.make_tileable(sample.image, tileable=tileable, alpha=sample.alpha, progress=job.progress, **options)
    return {"picture": job.write(_with_alpha(made.image, made.alpha))}


def fill(job: Job) -> dict[str, Any]:
    """What replaces the selected part of a layer, transparent where the layer stays as it is."""
    sample, options = _sample(job), _usual(job.options, "patch", "overlap", "band")
    if sample.selected is None:
        raise ts.OptionError("nothing is selected; select what is to be replaced")
    made = ts.fill(sample.image, sample.selected, alpha=sample.alpha, progress=job.progress, **options)
    changed = (made.image != sample.image) if made.image.ndim == 2 else (made.image != sample.image).any(axis=2)
    changed |= sample.selected
    if made.alpha is not None:
        changed &= made.alpha > 0
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    box = np.s_[int(rows[0]) : int(rows[-1]) + 1, int(columns[0]) : int(columns[-1]) + 1]
    shown = np.broadcast_to(full_scale(made.image.dtype), changed.shape) if made.alpha is None else made.alpha
    raster = job.write(_with_alpha(made.image[box], np.where(changed[box], shown[box], made.image.dtype.type(0))))
    x, y = job.request["layer"]["offset"]
    return {"picture": {**raster, "offset": [x + int(columns[0]), y + int(rows[0])]}}


def _sample(job: Job) -> _Sample:
    raster = job.request["layer"]
    pixels = np.array(job.read(raster))
    alpha = pixels[..., -1]
    if raster.get("mask") is not None:
        share = job.read(raster["mask"]) / np.float32(255)
        alpha = (np.rint(alpha * share) if np.issubdtype(alpha.dtype, np.integer) else alpha * share).astype(alpha.dtype)
    image = pixels[..., 0] if pixels.shape[2] == 2 else pixels[..., :-1]
    selected = None if job.request.get("selection") is None else job.read(job.request["selection"]) >= 128
    return _Sample(image, None if bool((alpha == full_scale(alpha.dtype)).all()) else alpha, selected)


def _usual(options: Mapping[str, Any], *names: str) -> dict[str, Any]:
    """The options, 0 turned into None, which stands for the usual value, in those that know it."""
    return {name: None if name in names and not value else value for name, value in options.items()}


def _with_alpha(image: Image, alpha: Image | None) -> Image:
    shown = np.broadcast_to(full_scale(image.dtype), image.shape[:2]) if alpha is None else alpha
    return np.dstack([image, shown])
