"""Layers on the canvas, those that are turned or scaled resampled into files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.layers.execution.tasks import Executor, results
from toposeam_cli.files.scratch import Scratch
from toposeam_cli.media.pictures.picture import Picture
from toposeam_cli.media.pictures.stored import stored_in

Numbers = Sequence[float] | npt.NDArray[np.float64]


def placed_layers(
    layers: Sequence[ts.Layer],
    places: Sequence[tuple[float, float]] | npt.NDArray[np.float64],
    turns: Numbers,
    scales: Numbers,
    scratch: Scratch | None,
    executor: Executor | None,
) -> list[ts.Layer]:
    """Return the layers on the canvas. Those that are turned or scaled are resampled, and where pixels wait
    in files one at a time, or several where an executor does that.
    """
    placed = [
        _Turning(layer, (float(x), float(y)), float(turn), float(scale), None)
        for layer, (x, y), turn, scale in zip(layers, places, turns, scales, strict=True)
    ]
    if scratch is None:
        return [_turned(one) for one in placed]
    turned = [index for index, one in enumerate(placed) if one.turn != 0 or one.scale != 1]
    items = (replace(placed[index], waits=scratch.new()) for index in turned)
    with scratch.failures_told():
        found = dict(zip(turned, results(executor, _turned, items), strict=True))
    return [found.get(index) or _turned(one) for index, one in enumerate(placed)]


@dataclass(frozen=True, slots=True)
class _Turning:
    """A layer that is to be placed, and the file in which its pixels are to wait."""

    layer: ts.Layer
    at: tuple[float, float]
    turn: float
    scale: float
    waits: Path | None


def _turned(item: _Turning) -> ts.Layer:
    layer = ts.placed(item.layer, at=item.at, turn=item.turn, scale=item.scale)
    if item.waits is None:
        return layer
    picture = stored_in(item.waits, Picture(pixels=layer.image, alpha=layer.alpha))
    return replace(layer, image=picture.pixels, alpha=picture.alpha)
