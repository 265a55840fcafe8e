"""Drawing of a motif as SVG: contours of every layer, multiplied onto the paper, repeated by a pattern.

Each layer is a group that is blended by multiplication. Within a group, areas of higher density lie on those
of lower density in opaque colours. So only the groups need blending, and editors can recolour each layer.
A crisp ink has a path for each stroke, so that single ones can be taken.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import Any, Protocol, TypedDict, Unpack, runtime_checkable

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Floats
from toposeam.checks import check_kind, check_range, check_whole, kind_error, options_from
from toposeam.colours import to_hex
from toposeam.errors import OptionError, Term
from toposeam.motif.ink.stroke_edges import SMOOTHING, fineness
from toposeam.motif.ink.stroke_repair import find_crumbs, find_holes
from toposeam.motif.symmetry.tiling import extend, period, tile
from toposeam.vector.contours import MARGIN_PX, CurvePath, contour_beyond

#: Largest document, in characters: editors do not open larger ones.
LARGEST_CHARACTERS = 60_000_000


@runtime_checkable
class Drawable(Protocol):
    """Interface of what can be drawn, such as :class:`toposeam.motif.ink.printing.Inked`."""

    @property
    def densities(self) -> npt.NDArray[np.float32]:
        """(n_L, H, W) float32 in [0, 1]."""

    @property
    def inks(self) -> Floats:
        """(n_L, 3) sRGB in [0, 1]."""

    @property
    def paper(self) -> Floats:
        """(3,) sRGB in [0, 1]."""

    @property
    def repeat(self) -> str:
        """The rule by which it repeats."""

    @property
    def inking(self) -> str:
        """Kind of the inks."""

    @property
    def edges(self) -> tuple[str, ...]:
        """Stroke edges of each layer."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the inks."""

    @property
    def record(self) -> Mapping[str, Any]:
        """Record that reproduces it, as values that JSON can hold."""

    def ends(self, layer: int) -> tuple[float, np.float32]:
        """Return the density at which a layer's strokes end in print, and the factor on densities inside."""

    def resampled(self, size: tuple[int, int] | None = None) -> npt.NDArray[np.float32]:
        """Return the densities at another size."""


class SvgKeywords(TypedDict, total=False):
    """Fields of :class:`SvgOptions`."""

    levels: int
    width_mm: float | None
    transparent: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SvgOptions:
    """Options of the drawing of a motif.

    Examples
    --------
    >>> import toposeam as ts
    >>> motif = ts.motif(16, layers=1, seed=1, iterations=3)
    >>> 'width="80mm"' in ts.motif.draw_svg(motif, options=ts.motif.SvgOptions(width_mm=80))
    True
    """

    #: Number of contours between paper and full ink; with more, ink wash is smoother.
    levels: int = 12
    #: Width of one motif on paper, mm; with None an element of the densities is one px.
    width_mm: float | None = None
    #: Leave the paper out, so that the background shows.
    transparent: bool = False

    def __post_init__(self) -> None:
        check_whole("levels", self.levels, 1, 64)
        if self.width_mm is not None:
            check_range(0, 1e5, above=True, width_mm=self.width_mm)


def draw_svg(
    motif: Drawable,
    counts: tuple[float, float] = (1, 1),
    *,
    options: SvgOptions | None = None,
    note: Mapping[str, Any] | None = None,
    **given: Unpack[SvgKeywords],
) -> str:
    """Return a motif, or a sheet of it, as an SVG document.

    Parameters
    ----------
    motif : Motif or Arrangement
    counts : (rows, columns)
        Number of motifs in the document, whole or not. One is drawn directly; more are a ``<pattern>``,
        arranged by the motif's rule.
    options : SvgOptions
    note : mapping, optional
        Entries for ``<metadata>`` beside the recipe; any values that JSON can hold.
    **given
        The options as plain keywords instead.

    Returns
    -------
    str

    Raises
    ------
    OptionError
        For impossible counts, or a document beyond `LARGEST_CHARACTERS`.

    Examples
    --------
    >>> import toposeam as ts
    >>> motif = ts.motif(16, layers=1, seed=1, iterations=3)
    >>> "<svg" in ts.motif.draw_svg(motif, (2, 2), width_mm=80)
    True
    """
    chosen = options_from(SvgOptions, options, given, "a drawing")
    check_kind("motif", motif, Drawable, "a Motif")
    if not isinstance(counts, tuple | list) or len(counts) != 2:
        raise OptionError(
            "{parameter} is {value!r}; pass two numbers, rows and columns",
            kind="type",
            parameter=Term("counts"),
            value=counts,
        )
    rows, columns = counts
    check_counts(counts)
    if note is not None:
        check_kind("note", note, Mapping, "a mapping of what JSON can hold")
        try:
            json.dumps(dict(note))
        except (TypeError, ValueError, RecursionError) as error:
            raise kind_error("note", note, "a mapping of what JSON can hold") from error
    height, width = motif.densities.shape[1:]
    # The cell that repeats by translation holds several motifs if neighbours are mirrored, turned or shifted.
    single = (rows, columns) == (1, 1)
    down, across = (1, 1) if single else period(motif.repeat)
    rule = motif.repeat if (down, across) == (1, 1) else "translate"
    groups = []
    fine = fineness((height, width))
    densities = motif.resampled((fine * height, fine * width))
    layers = zip(densities, motif.inks, motif.edges, motif.names, strict=True)
    for number, (density, ink, edge, name) in enumerate(layers, 1):
        cell = tile(density, motif.repeat, (down, across))
        bands = Bands(edge, motif.ends(number - 1), chosen.levels)
        groups += _layer(cell, rule, _Colour(ink, motif.inking), (number, name), bands, fine)
    unit, scale = ("", 1.0) if chosen.width_mm is None else ("mm", chosen.width_mm / width)
    size_x, size_y = width * columns, height * rows
    settings = {**(note or {}), **motif.record}
    margin = MARGIN_PX
    ground = (
        ""
        if chosen.transparent
        else (
            f'<rect x="{-margin}" y="{-margin}" width="{across * width + 2 * margin}" '
            f'height="{down * height + 2 * margin}" fill="{to_hex(motif.paper)}"/>'
        )
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
            f'<pattern id="motif" width="{across * width}" height="{down * height}" '
            'patternUnits="userSpaceOnUse">',
            ground,
            *groups,
            "</pattern>",
            "</defs>",
            f'<rect width="{_number(size_x)}" height="{_number(size_y)}" fill="url(#motif)"/>',
        ]
    document = "\n".join([*lines, "</svg>", ""])
    if len(document) > LARGEST_CHARACTERS:
        raise OptionError(
            "the drawing would take {megabytes:.0f} MB, more than editors open; use fewer levels or a "
            "smaller size",
            kind="too large",
            megabytes=len(document) / 1e6,
        )
    return document


def check_counts(counts: tuple[float, float]) -> None:
    """Refuse a sheet of no or too many motifs.

    Raises
    ------
    OptionError
    """
    rows, columns = counts
    check_range(0, 10_000, above=True, rows=rows, columns=columns)


class Bands:
    """The levels whose contours are drawn, and the tones printed above each."""

    def __init__(self, edge: str, ends: tuple[float, np.float32], levels: int) -> None:
        self.gain = np.float32(1.0)
        self.edge = edge
        self.thresholds = (np.arange(levels) + 0.5) / levels
        if edge == "soft":
            return
        at, self.gain = ends
        self.thresholds = np.array([at]) if edge == "crisp" else np.append(at, self.thresholds / self.gain)
        self.thresholds = self.thresholds[self.thresholds >= at]

    def tones(self, smooth: Floats) -> Floats:
        """Compute the mean tone between successive levels, so that the whole keeps its tone."""
        many = len(self.thresholds) + 1
        if self.edge == "crisp":
            return np.array([0.0, 1.0])
        inside = np.clip(smooth * self.gain, 0.0, 1.0).ravel()
        band = np.digitize(smooth.ravel(), self.thresholds)
        count = np.bincount(band, minlength=many)
        mean = np.bincount(band, inside, many) / np.maximum(count, 1)
        tones: Floats = np.where(count > 0, mean, np.arange(many) / (many - 1))
        if self.edge == "ink":
            tones[0] = 0.0
        return tones


class _Colour:
    """How an ink is drawn: transparent ones multiply, opaque ones cover."""

    def __init__(self, ink: Floats, inking: str) -> None:
        self._ink, self._opaque = ink, inking == "opaque"
        self.blend = "normal" if self._opaque else "multiply"

    def fill(self, tone: float, below: float) -> str:
        """Return the fill of an area of a tone that lies on one of the tone `below`."""
        if not self._opaque:
            return f'fill="{to_hex(1.0 - tone * (1.0 - self._ink))}"'
        left = 1.0 - (1.0 - tone) / max(1.0 - below, 1e-6)
        cover = "" if tone >= 1.0 else f' fill-opacity="{max(left, 0.0):.4f}"'
        return f'fill="{to_hex(self._ink)}"{cover}'


def _layer(
    density: npt.NDArray[np.float32],
    rule: str,
    colour: _Colour,
    name: tuple[int, str],
    bands: Bands,
    fine: int,
) -> list[str]:
    """Return the lines of one ink's SVG group."""
    faint, areas = inked_areas(density, rule, bands, fine)
    lines = [
        f'<g id="ink-{name[0]}" inkscape:groupmode="layer" inkscape:label="{escape(name[1])}" '
        f'style="mix-blend-mode:{colour.blend}">'
    ]
    if faint > 0:
        across, down = (side // fine + 2 * MARGIN_PX for side in (density.shape[1], density.shape[0]))
        lines.append(
            f'<rect x="{-MARGIN_PX}" y="{-MARGIN_PX}" width="{across}" height="{down}" '
            f"{colour.fill(faint, 0.0)}/>"
        )
    for area in areas:
        drawn = [f'<path d="{data}"/>' for stroke in area.strokes if (data := stroke.data(1 / fine))]
        if drawn:
            lines += [f'<g {colour.fill(area.tone, area.below)} fill-rule="evenodd">', *drawn, "</g>"]
    return [*lines, "</g>"]


@dataclass(frozen=True, slots=True, eq=False)
class InkedArea:
    """Where an ink has a tone or a higher one, on an area of the tone `below`."""

    tone: float
    below: float
    strokes: list[CurvePath]


def inked_areas(
    density: npt.NDArray[np.float32], rule: str, bands: Bands, fine: int
) -> tuple[float, list[InkedArea]]:
    """Return the faint tone below all levels, and the areas of one ink from light to dark.

    Their curves go on for `MARGIN_PX` beyond the cell.
    """
    blur = int(np.ceil(4 * SMOOTHING * fine))
    wide = extend(density, rule, MARGIN_PX + blur).astype(np.float64)
    inner = slice(blur, len(wide) - blur), slice(blur, wide.shape[1] - blur)
    smooth = ndimage.gaussian_filter(wide, SMOOTHING * fine)[inner]
    if bands.edge != "soft":
        smooth = _without_crumbs(smooth, rule, float(bands.thresholds[0]))
    typical = bands.tones(smooth[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX])
    areas = []
    for level, threshold in enumerate(bands.thresholds, 1):
        found = contour_beyond(smooth, float(threshold))
        strokes = found.pieces() if bands.edge == "crisp" else [found]
        areas.append(InkedArea(float(typical[level]), float(typical[level - 1]), strokes))
    return float(typical[0]), areas


def _without_crumbs(smooth: Floats, rule: str, at: float) -> Floats:
    """Remove pieces and holes that are too small from a cell with a margin."""
    inside = smooth[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX] > at
    smooth = np.where(extend(find_crumbs(inside, rule), rule, MARGIN_PX), 0.0, smooth)
    return np.where(extend(find_holes(inside, rule), rule, MARGIN_PX), np.maximum(smooth, 1.5 * at), smooth)


def _number(value: float) -> str:
    return f"{value:.6g}" if value < 1e5 else f"{value:.0f}"
