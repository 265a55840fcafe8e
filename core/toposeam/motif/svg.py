"""A motif as vector graphics: contours of every layer, multiplied onto the paper, repeated by a pattern.

Each layer is a group that is blended by multiplication; within it areas of higher density lie on those of lower density in ordinary
opaque colours, so that only the groups need blending and editors show layers that can be recoloured one by one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.errors import OptionError
from toposeam.vector.contours import MARGIN_PX, contour

Floats = npt.NDArray[np.float64]

#: Documents of more characters are refused: no editor would open them.
LARGEST_CHARACTERS = 60_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SvgOptions:
    """How a motif is drawn."""

    #: Steps between paper and full ink; more show ink wash more smoothly.
    levels: int = 8
    #: Width of one repeated cell on paper, mm; None lets one density pixel be one px.
    width_mm: float | None = None
    #: Farthest a curve may be from the polygon of marching squares, px of the densities.
    tolerance_px: float = 0.08
    #: Standard deviation of a blur before contours are drawn, px of the densities: takes the pixels' staircase off hard edges.
    smoothing_px: float = 0.6

    def __post_init__(self) -> None:
        if not 1 <= self.levels <= 64:
            raise OptionError(f"levels is {self.levels}; use 1 to 64")
        if self.width_mm is not None and not 0 < self.width_mm < 1e5:
            raise OptionError(f"width_mm is {self.width_mm}; give a positive width in millimetres")
        if not 0 <= self.smoothing_px <= 20:
            raise OptionError(f"smoothing_px is {self.smoothing_px}; use 0 to 20")


def draw_svg(
    densities: npt.ArrayLike, inks: npt.ArrayLike, paper: npt.ArrayLike, metadata: Mapping[str, Any], *,
    times: tuple[float, float] = (1, 1), periodic: bool = True, options: SvgOptions | None = None,
) -> str:  # fmt: skip
    """An SVG document of ink layers.

    Parameters
    ----------
    densities : (n, H, W) array_like
        In [0, 1]; the cell that repeats by translation.
    inks : (n, 3) array_like
    paper : (3,) array_like
        sRGB in [0, 1].
    metadata : mapping
        Anything JSON can hold; written into ``<metadata>``.
    times : (float, float)
        How many cells the document shows, down and across. One cell is drawn directly; more are a ``<pattern>`` of it.
    periodic : bool
        Whether contours go on over the border.
    options : SvgOptions

    Returns
    -------
    str

    Raises
    ------
    OptionError
        For an impossible number of repetitions, or a document beyond `LARGEST_CHARACTERS`.
    """
    chosen = options if options is not None else SvgOptions()
    layers = np.asarray(densities, np.float64)
    _, height, width = layers.shape
    down, across = times
    if not (0 < down <= 10_000 and 0 < across <= 10_000):
        raise OptionError(f"the sheet has {down} × {across} motifs; use numbers above 0 and up to 10000")
    paper_rgb = np.asarray(paper, np.float64)
    groups = []
    for number, (layer, ink) in enumerate(zip(layers, np.asarray(inks, np.float64), strict=True), 1):
        groups += _layer(layer, ink, number, periodic, chosen)
    size_x, size_y = width * across, height * down
    unit, scale = ("", 1.0) if chosen.width_mm is None else ("mm", chosen.width_mm / width)
    margin = MARGIN_PX
    ground = f'<rect x="{-margin}" y="{-margin}" width="{width + 2 * margin}" height="{height + 2 * margin}" fill="{_colour(paper_rgb)}"/>'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
        f' width="{_number(size_x * scale)}{unit}" height="{_number(size_y * scale)}{unit}"'
        f' viewBox="0 0 {_number(size_x)} {_number(size_y)}">',
        f'<metadata id="toposeam">{escape(json.dumps(dict(metadata), allow_nan=False), quote=False)}</metadata>',
    ]
    if (down, across) == (1, 1):
        lines += [ground, *groups]
    else:
        lines += [
            "<defs>",
            f'<pattern id="motif" width="{width}" height="{height}" patternUnits="userSpaceOnUse">', ground, *groups, "</pattern>",
            "</defs>",
            f'<rect width="{_number(size_x)}" height="{_number(size_y)}" fill="url(#motif)"/>',
        ]  # fmt: skip
    document = "\n".join([*lines, "</svg>", ""])
    if len(document) > LARGEST_CHARACTERS:
        raise OptionError(
            f"the drawing would take {len(document) / 1e6:.0f} MB, more than editors open; use fewer levels or a smaller size"
        )
    return document


def _layer(density: Floats, ink: Floats, number: int, periodic: bool, options: SvgOptions) -> list[str]:
    """One ink's group. Levels lie half-way between the densities whose colours they part."""
    smooth = ndimage.gaussian_filter(density, options.smoothing_px, mode="wrap" if periodic else "nearest")
    thresholds = (np.arange(options.levels) + 0.5) / options.levels
    band = np.digitize(smooth, thresholds)
    # Each band takes the mean of what lies in it, so that the whole keeps its tone.
    count = np.bincount(band.ravel(), minlength=options.levels + 1)
    total = np.bincount(band.ravel(), density.ravel(), options.levels + 1)
    typical = np.where(count > 0, total / np.maximum(count, 1), np.arange(options.levels + 1) / options.levels)
    lines = [f'<g id="ink-{number}" inkscape:groupmode="layer" inkscape:label="ink {number}" style="mix-blend-mode:multiply">']
    for level, threshold in enumerate(thresholds, 1):
        data = contour(smooth, float(threshold), periodic=periodic, tolerance_px=options.tolerance_px).data()
        if data:
            colour = _colour(1.0 - typical[level] * (1.0 - ink))
            lines.append(f'<path fill="{colour}" fill-rule="evenodd" d="{data}"/>')
    return [*lines, "</g>"]


def _colour(rgb: Floats) -> str:
    return "#" + "".join(f"{round(255 * min(max(float(value), 0.0), 1.0)):02x}" for value in rgb)


def _number(value: float) -> str:
    return f"{value:.6g}" if value < 1e5 else f"{value:.0f}"
