"""Previews of tiny made-up layers, so that libraries have loaded all they need before the first request."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from toposeam_engine.job import EngineJob
from toposeam_engine.previews import preview
from toposeam_engine.restitching import restitch

_SIDE = 48


class _Rehearsal(EngineJob):
    """A job with made-up pixels, whose results are dropped."""

    def read(self, raster: Mapping[str, Any]) -> Any:
        shape = int(raster["height"]), int(raster["width"]), int(raster["channels"])
        if "stroke" in raster:
            pixels = np.zeros(shape, np.uint8)
            pixels[20:26, 30:34] = *raster["stroke"], 255
            return pixels
        pixels = np.random.default_rng(0).integers(1, 255, shape, np.uint8)
        pixels[..., -1] = 255
        if shape[2] > 1:
            return pixels
        pixels[16:24, 16:24, 0] = 0
        return 255 - pixels[..., 0]

    def write(self, pixels: Any) -> dict[str, Any]:
        return {}


def rehearse(of: str) -> None:
    """Make a dialog's preview of tiny layers, or join them again; unknown names do nothing."""
    request = _requests().get(of)
    if request is not None:
        job = _Rehearsal(
            folder=Path(), request={"of": of, "scale": 1.0, **request}, progress=lambda _share: None
        )
        (restitch if of == "restitch" else preview)(job)


def _requests() -> dict[str, dict[str, Any]]:
    size = {"width": _SIDE, "height": _SIDE, "dtype": "uint8"}
    left, right = ({**size, "channels": 4, "at": [x, 0], "name": str(x)} for x in (0, _SIDE // 2))
    hole = {**size, "channels": 1, "at": [0, 0]}
    texture: dict[str, Any] = {"layer": left, "selection": None}
    patch = {"patch": 12, "overlap": 0, "seed": 0}
    motif = {"size": 32, "repeat": "translate", "layers": 1, "palette": "random", "mass": 0.0}
    return {
        "stitch": {"layers": [left, right], "options": {"blend": "gradient"}},
        "patch": {"layers": [left, right], "selection": None, "options": {"blend": "gradient", "core": 0.5}},
        "synthesize": {**texture, "options": {**patch, "width": 64, "height": 64}},
        "make_tileable": {**texture, "options": {"band": 0, "seed": 0}},
        "fill": {**texture, "selection": hole, "source": None, "options": {**patch, "band": 0}},
        "restitch": {
            "layers": [left, right],
            "shown": [None, None],
            "hints": {**left, "at": [0, 0], "stroke": [0, 0, 255]},
            "colours": [[0, 0, 255], [255, 0, 0]],
            "seams": [],
            "options": {"blend": "none"},
        },
        "motif": {"layer": None, "options": {**motif, "base_strength": 0.0, "iterations": 1, "seed": 0}},
        "loop": {"layers": [left] * 8, "options": {"length": 4, "transition": 2, "level": True}},
    }
