"""What the engine can be asked for about textures: grown from a sample, made to repeat, holes filled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import Image, Mask, full_scale
from toposeam_engine.layers import colours_of, place_of, with_alpha
from toposeam_engine.serving import Job

#: What is copied into a hole from around it comes from at least so near.
_AROUND_PX = 48


class Sample(NamedTuple):
    """Colours, opacity where it is not full everywhere, and what is selected."""

    image: Image
    alpha: npt.NDArray[Any] | None
    selected: npt.NDArray[np.bool_] | None


def synthesize(job: Job) -> dict[str, Any]:
    """A texture of any size grown from a layer, or from the selected part of it."""
    made = synthesized(job)
    return {"picture": job.write(with_alpha(made.image, made.alpha))}


def synthesized(job: Job) -> ts.Synthesis:
    """The texture itself."""
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


def make_tileable(job: Job) -> dict[str, Any]:
    """A layer that repeats."""
    made = made_tileable(job)
    return {"picture": job.write(with_alpha(made.image, made.alpha))}


def made_tileable(job: Job) -> ts.Synthesis:
    """The tile itself."""
    sample, options = _sample(job), _usual(job.options, "band")
    return ts.make_tileable(
        sample.image, alpha=sample.alpha, data_range=_white(sample.image), progress=job.progress, **options
    )


def fill(job: Job) -> dict[str, Any]:
    """What replaces the selected part of a layer, transparent where the layer stays as it is."""
    made, sample = filled(job)
    changed = (
        (made.image != sample.image) if made.image.ndim == 2 else (made.image != sample.image).any(axis=2)
    )
    changed |= np.asarray(sample.selected)
    if made.alpha is not None:
        changed &= made.alpha > 0
    rows, columns = (np.flatnonzero(changed.any(axis=axis)) for axis in (1, 0))
    box = np.s_[int(rows[0]) : int(rows[-1]) + 1, int(columns[0]) : int(columns[-1]) + 1]
    shown = np.broadcast_to(full_scale(made.image.dtype), changed.shape) if made.alpha is None else made.alpha
    raster = job.write(
        with_alpha(made.image[box], np.where(changed[box], shown[box], made.image.dtype.type(0)))
    )
    x, y = place_of(job.request["layer"])
    return {"picture": {**raster, "at": [x + int(columns[0]), y + int(rows[0])]}}


def filled(job: Job) -> tuple[ts.Synthesis, Sample]:
    """The whole layer with its hole filled, and the layer as it was."""
    sample, options = _sample(job), _usual(job.options, "patch", "overlap", "band")
    if sample.selected is None or not sample.selected.any():
        raise ts.OptionError("nothing is selected; select what is to be replaced")
    source = _around(sample.selected) if options.pop("from", "layer") == "around" else None
    made = ts.fill(
        sample.image,
        sample.selected,
        source=source,
        alpha=sample.alpha,
        data_range=_white(sample.image),
        progress=job.progress,
        **options,
    )
    return made, sample


def _sample(job: Job) -> Sample:
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
    """The options, 0 turned into None, which stands for the usual value, in those that know it."""
    return {name: None if name in names and not value else value for name, value in options.items()}


def _white(image: Image) -> float | None:
    """What counts as white: 1 in floats, though lights may go beyond it."""
    return 1.0 if np.issubdtype(image.dtype, np.floating) else None
