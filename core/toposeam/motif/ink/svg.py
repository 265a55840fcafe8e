"""Drawing of a motif as SVG: contours of every layer, multiplied onto the paper, repeated by clones.

Each layer is a group that is blended by multiplication. Within a group, areas of higher density lie on those
of lower density in opaque colours. So only the groups need blending, and editors can recolour each layer.
A crisp ink has a path for each stroke, so that single ones can be taken. On a sheet every other motif is a
clone (``<use>``) of the first one: what an editor changes there changes in all of them. Each copy is cut half
a px beyond its border, so that neighbours overlap and no hairline shows between them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
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
from toposeam.motif.symmetry.tiling import Placed, extend, lines_of_copies
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
    frame: float


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
    #: Width of a frame of ink round the whole, in elements, which holds what the edge cuts off; below 0 a
    #: frame without ink, for stencils.
    frame: float = 0.0

    def __post_init__(self) -> None:
        check_whole("levels", self.levels, 1, 64)
        check_range(-1000, 1000, frame=self.frame)
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
        Number of motifs in the document, whole or not. The first one is drawn, the others are clones of it,
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
    sheet = _Sheet.of(motif, (rows, columns), chosen.frame)
    settings = {**(note or {}), **motif.record}
    return _document(motif, (rows, columns), chosen, settings, sheet, _inks(motif, chosen, sheet))


def draw_frames(
    frames: Sequence[Drawable],
    counts: tuple[float, float],
    seconds: tuple[float, float],
    *,
    options: SvgOptions,
) -> str:
    """Return an SVG document that shows drawings one after another, again and again.

    Parameters
    ----------
    frames : sequence of Motif
        Of one size. Where nothing moves, the last one shows.
    counts : (rows, columns)
    seconds : (float, float)
        Duration of all of them, and of the last one after that.
    options : SvgOptions

    Raises
    ------
    OptionError
        As of :func:`draw_svg`.
    """
    check_counts(counts)
    last = frames[-1]
    sheet = _Sheet.of(last, counts, options.frame)
    whole = sum(seconds)
    step = seconds[0] / len(frames) / whole
    lines = []
    for number, frame in enumerate(frames):
        begin = number * step
        end = 1.0 if number == len(frames) - 1 else begin + step
        moments = [(0.0, begin == 0), (begin, True), (end, False)]
        moments = [moment for index, moment in enumerate(moments) if index != 1 or begin > 0]
        moments = [moment for moment in moments if moment[0] < 1]
        shown = ";".join("inline" if visible else "none" for _, visible in moments)
        times = ";".join(f"{time:.5f}" for time, _ in moments)
        hidden = "" if frame is last else ' display="none"'
        lines += [
            f'<g id="frame-{number + 1}"{hidden}>',
            f'<animate attributeName="display" values="{shown}" keyTimes="{times}" dur="{whole:g}s" '
            'calcMode="discrete" repeatCount="indefinite"/>',
            *_inks(frame, options, sheet, f"frame-{number + 1}-"),
            "</g>",
        ]
    return _document(last, counts, options, dict(last.record), sheet, lines)


def _inks(motif: Drawable, options: SvgOptions, sheet: _Sheet | None, prefix: str = "") -> list[str]:
    """Return the lines of the groups of all inks."""
    height, width = motif.densities.shape[1:]
    groups = []
    fine = fineness((height, width))
    densities = motif.resampled((fine * height, fine * width))
    layers = zip(densities, motif.inks, motif.edges, motif.names, strict=True)
    for number, (density, ink, edge, name) in enumerate(layers, 1):
        bands = Bands(edge, motif.ends(number - 1), options.levels)
        areas = inked_areas(density, motif.repeat, bands, fine)
        label = f"{prefix}ink-{number}", name
        groups += _layer(areas, (height, width), _Colour(ink, motif.inking), label, fine, sheet)
    return groups


def _document(
    motif: Drawable,
    counts: tuple[float, float],
    chosen: SvgOptions,
    settings: Mapping[str, Any],
    sheet: _Sheet | None,
    groups: list[str],
) -> str:
    """Return a document of groups of inks."""
    rows, columns = counts
    height, width = motif.densities.shape[1:]
    unit, scale = ("", 1.0) if chosen.width_mm is None else ("mm", chosen.width_mm / width)
    size_x, size_y = width * columns, height * rows
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
        f' width="{_number(size_x * scale)}{unit}" height="{_number(size_y * scale)}{unit}"'
        f' viewBox="0 0 {_number(size_x)} {_number(size_y)}">',
        f'<metadata id="toposeam">{escape(json.dumps(settings, allow_nan=False), quote=False)}</metadata>',
        *([] if sheet is None else sheet.definitions()),
    ]
    if not chosen.transparent:
        margin = MARGIN_PX
        lines.append(
            f'<rect id="paper" x="{-margin}" y="{-margin}" width="{_number(size_x + 2 * margin)}" '
            f'height="{_number(size_y + 2 * margin)}" fill="{to_hex(motif.paper)}"/>'
        )
    lines += groups
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


class _Sheet:
    """Copies of a cell on a sheet, as clones of what is drawn on the first one."""

    def __init__(self, repeat: str, counts: tuple[float, float], cell: tuple[int, int], frame: float) -> None:
        self._counts, self._cell, self._frame = counts, cell, frame
        self._copies, self._lines = lines_of_copies(repeat, counts)

    @classmethod
    def of(cls, motif: Drawable, counts: tuple[float, float], frame: float) -> _Sheet | None:
        """Return the sheet of a motif; None where it is the motif alone."""
        height, width = motif.densities.shape[1:]
        return (
            None
            if tuple(counts) == (1, 1) and not frame
            else cls(motif.repeat, counts, (height, width), frame)
        )

    def definitions(self) -> list[str]:
        """Return the lines that define the areas to which a copy, and the sheet, are cut."""
        (rows, columns), (height, width) = self._counts, self._cell
        free = max(-self._frame, 0.0)
        wide, high = columns * width - 2 * free, rows * height - 2 * free
        return [
            "<defs>",
            f'<clipPath id="cell"><rect x="-0.5" y="-0.5" width="{width + 1}" height="{height + 1}"/>'
            "</clipPath>",
            f'<clipPath id="sheet"><rect x="{_number(free)}" y="{_number(free)}" width="{_number(wide)}" '
            f'height="{_number(high)}"/></clipPath>',
            "</defs>",
        ]

    def framed(self, fill: str) -> list[str]:
        """Return the line of a frame of ink, if there is one."""
        if self._frame <= 0:
            return []
        return [f'<path {fill} fill-rule="evenodd" d="{frame_path(self._counts, self._cell, self._frame)}"/>']

    def cloned(self, name: str, drawn: list[str]) -> list[str]:
        """Return the lines of a drawing on the first cell, and of its clones on all others."""
        lines = [f'<g id="{name}-motif" clip-path="url(#cell)">', *drawn, "</g>"]
        lines += [self._clone(f"{name}-motif", each) for each in self._copies[1:]]
        if len(self._lines) == 1:
            return lines
        row = [f'<g id="{name}-line">', *lines, "</g>"]
        return [*row, *(self._clone(f"{name}-line", each) for each in self._lines[1:])]

    def _clone(self, name: str, at: Placed) -> str:
        height, width = self._cell
        x, y = _number(at.x * width), _number(at.y * height)
        moved = (
            f"translate({x},{y})"
            if (at.flip_x, at.flip_y) == (1, 1)
            else f"matrix({at.flip_x},0,0,{at.flip_y},{x},{y})"
        )
        return f'<use xlink:href="#{name}" transform="{moved}"/>'


def _layer(
    inked: tuple[float, list[InkedArea]],
    cell: tuple[int, int],
    colour: _Colour,
    label: tuple[str, str],
    fine: int,
    sheet: _Sheet | None,
) -> list[str]:
    """Return the lines of one ink's SVG group, of the id and name in `label`.

    Tone by tone, a sheet has all copies of one before the next: so no copy covers darker parts of another.
    """
    faint, areas = inked
    cut = "" if sheet is None else ' clip-path="url(#sheet)"'
    lines = [
        f'<g id="{label[0]}" inkscape:groupmode="layer" inkscape:label="{escape(label[1])}" '
        f'style="mix-blend-mode:{colour.blend}"{cut}>'
    ]
    tones = []
    if faint > 0:
        height, width = (side + 2 * MARGIN_PX for side in cell)
        tones.append(
            [
                f'<rect x="{-MARGIN_PX}" y="{-MARGIN_PX}" width="{width}" height="{height}" '
                f"{colour.fill(faint, 0.0)}/>"
            ]
        )
    for area in areas:
        drawn = [f'<path d="{data}"/>' for stroke in area.strokes if (data := stroke.data(1 / fine))]
        if drawn:
            tones.append([f'<g {colour.fill(area.tone, area.below)} fill-rule="evenodd">', *drawn, "</g>"])
    for number, drawn in enumerate(tones, 1):
        lines += drawn if sheet is None else sheet.cloned(f"{label[0]}-{number}", drawn)
    if sheet is not None:
        lines += sheet.framed(colour.fill(1.0, 0.0))
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


def frame_path(counts: tuple[float, float], cell: tuple[int, int], frame: float) -> str:
    """Return the path data of a frame along the edge of a sheet."""
    width, height = counts[1] * cell[1], counts[0] * cell[0]
    x, y, f = (_number(each) for each in (width - frame, height - frame, frame))
    return f"M0,0V{_number(height)}H{_number(width)}V0zM{f},{f}H{x}V{y}H{f}z"


def _number(value: float) -> str:
    return f"{value:.6g}" if value < 1e5 else f"{value:.0f}"
