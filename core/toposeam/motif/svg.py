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
from toposeam.motif.arrange import extend, tile
from toposeam.motif.motif import Motif
from toposeam.vector.contours import MARGIN_PX, contour_beyond

Floats = npt.NDArray[np.float64]

#: Cells smaller than this are drawn from densities interpolated to twice their size, for the sake of fine strokes.
_FINE = 1024
#: Standard deviation of a blur before contours are drawn, px of the densities: takes the staircase off hard edges.
_BLUR_PX = 0.5
#: Documents of more characters are refused: no editor would open them.
LARGEST_CHARACTERS = 60_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SvgOptions:
    """How a motif is drawn."""

    #: Steps between paper and full ink; more show ink wash more smoothly.
    levels: int = 12
    #: Width of one motif on paper, mm; None lets an element of the densities be one px.
    width_mm: float | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.levels <= 64:
            raise OptionError(f"levels is {self.levels}; use 1 to 64")
        if self.width_mm is not None and not 0 < self.width_mm < 1e5:
            raise OptionError(f"width_mm is {self.width_mm}; give a positive width in millimetres")


def draw_svg(
    motif: Motif, counts: tuple[float, float] = (1, 1), *, options: SvgOptions | None = None, note: Mapping[str, Any] | None = None
) -> str:
    """A motif, or a sheet of it, as an SVG document.

    Parameters
    ----------
    motif : Motif
    counts : (rows, columns)
        How many motifs the document shows, whole numbers or not. One is drawn directly; more are a ``<pattern>``, arranged by the motif's
        rule.
    options : SvgOptions
    note : mapping, optional
        What is written into ``<metadata>`` beside the recipe; anything JSON can hold.

    Returns
    -------
    str

    Raises
    ------
    OptionError
        For impossible counts, or a document beyond `LARGEST_CHARACTERS`.
    """
    chosen = options if options is not None else SvgOptions()
    rows, columns = counts
    check_counts(counts)
    height, width = motif.densities.shape[1:]
    # What a pattern repeats by translation: with mirrored or turned neighbours two by two motifs.
    single = (rows, columns) == (1, 1)
    pair = 1 if single or motif.repeat not in ("reflect", "rotate") else 2
    rule = motif.repeat if pair == 1 else "translate"
    groups = []
    fine = 2 if max(height, width) < _FINE else 1
    densities = motif.resampled((fine * height, fine * width))
    for number, (density, ink) in enumerate(zip(densities, motif.inks, strict=True), 1):
        groups += _layer(tile(density, motif.repeat, (pair, pair)), rule, ink, number, chosen.levels, fine)
    unit, scale = ("", 1.0) if chosen.width_mm is None else ("mm", chosen.width_mm / width)
    size_x, size_y = width * columns, height * rows
    settings = {**(note or {}), "recipe": motif.recipe.to_dict()}
    margin = MARGIN_PX
    ground = (
        f'<rect x="{-margin}" y="{-margin}" width="{pair * width + 2 * margin}" height="{pair * height + 2 * margin}"'
        f' fill="{_colour(motif.paper)}"/>'
    )
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
        f' width="{_number(size_x * scale)}{unit}" height="{_number(size_y * scale)}{unit}"'
        f' viewBox="0 0 {_number(size_x)} {_number(size_y)}">',
        f'<metadata id="toposeam">{escape(json.dumps(settings, allow_nan=False), quote=False)}</metadata>',
    ]
    if single:
        lines += [ground, *groups]
    else:
        lines += [
            "<defs>",
            f'<pattern id="motif" width="{pair * width}" height="{pair * height}" patternUnits="userSpaceOnUse">',
            ground,
            *groups,
            "</pattern>",
            "</defs>",
            f'<rect width="{_number(size_x)}" height="{_number(size_y)}" fill="url(#motif)"/>',
        ]
    document = "\n".join([*lines, "</svg>", ""])
    if len(document) > LARGEST_CHARACTERS:
        raise OptionError(
            f"the drawing would take {len(document) / 1e6:.0f} MB, more than editors open; use fewer levels or a smaller size"
        )
    return document


def check_counts(counts: tuple[float, float]) -> None:
    """Refuse a sheet of no or too many motifs.

    Raises
    ------
    OptionError
    """
    rows, columns = counts
    if not (0 < rows <= 10_000 and 0 < columns <= 10_000):
        raise OptionError(f"the sheet has {rows:g} × {columns:g} motifs; use numbers above 0 and up to 10000")


def _layer(density: npt.NDArray[np.float32], rule: str, ink: Floats, number: int, levels: int, fine: int) -> list[str]:
    """One ink's group. Levels lie half-way between the densities whose colours they part."""
    blur = int(np.ceil(4 * _BLUR_PX))
    wide = extend(density, rule, MARGIN_PX + blur).astype(np.float64)
    smooth = ndimage.gaussian_filter(wide, _BLUR_PX)[blur : len(wide) - blur, blur : wide.shape[1] - blur]
    thresholds = (np.arange(levels) + 0.5) / levels
    band = np.digitize(smooth[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX], thresholds).ravel()
    # Each band takes the mean of what lies in it, so that the whole keeps its tone.
    count = np.bincount(band, minlength=levels + 1)
    total = np.bincount(band, density.ravel(), levels + 1)
    typical = np.where(count > 0, total / np.maximum(count, 1), np.arange(levels + 1) / levels)
    lines = [f'<g id="ink-{number}" inkscape:groupmode="layer" inkscape:label="ink {number}" style="mix-blend-mode:multiply">']
    if count[0] and typical[0] > 0:  # the thin haze where no contour is
        across, down = (size // fine + MARGIN_PX for size in (smooth.shape[1], smooth.shape[0]))
        colour = _colour(1.0 - typical[0] * (1.0 - ink))
        lines.append(f'<rect x="{-MARGIN_PX}" y="{-MARGIN_PX}" width="{across}" height="{down}" fill="{colour}"/>')
    for level, threshold in enumerate(thresholds, 1):
        data = contour_beyond(smooth, float(threshold)).data(1 / fine)
        if data:
            colour = _colour(1.0 - typical[level] * (1.0 - ink))
            lines.append(f'<path fill="{colour}" fill-rule="evenodd" d="{data}"/>')
    return [*lines, "</g>"]


def _colour(rgb: Floats) -> str:
    return "#" + "".join(f"{round(255 * min(max(float(value), 0.0), 1.0)):02x}" for value in rgb)


def _number(value: float) -> str:
    return f"{value:.6g}" if value < 1e5 else f"{value:.0f}"
