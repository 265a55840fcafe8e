"""Mock-ups of products: drawings in millimetres whose pieces are dressed with a pattern as cloth.

A drawing is an .svg file in ``drawings`` with four groups. ``ground`` and ``over`` are drawn as they are,
with ``{paper}`` and ``{ink}`` filled in. ``folds`` is a height: white up, black down. Each path of ``pieces``
is dressed with the pattern ``data-pattern`` (1, 2, or 0 for the plain colour ``data-fill``); its other data
attributes are the fields of :class:`toposeam_cli.motifs.cloth.Piece`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from toposeam.colours import parse_colour, to_hex
from toposeam.errors import OptionError
from toposeam_cli.media.pictures.libvips import load_vips, to_vips
from toposeam_cli.motifs.cloth import Piece, lay

#: Every product by name, in the order of books.
PRODUCTS = ("tie", "scarf", "shirt", "canvas", "cushion", "wallpaper", "wrapping", "phone")
#: Default and least length of a mock-up's longer side, px, and the most pixels of a mock-up.
_LONGER_PX, _LEAST_PX, _MOST_PX = 1200, 64, 20_000_000
#: Resolution of the sampled pattern, px per px of the mock-up.
_FINER = 1.5
#: Least width of a motif on a product, mm.
_LEAST_MM = 1.0
#: Standard deviations of the blurs "wide" and "fine" of drawings, as shares of the longer side.
_WIDE, _FINE = 0.014, 0.006
#: Gray of height 0 in the folds.
_LEVEL = "#808080"
_SVG = "{http://www.w3.org/2000/svg}"
_FILTERS = (
    '<filter id="wide" x="-30%" y="-30%" width="160%" height="160%"><feGaussianBlur stdDeviation="{wide}"/>'
    '</filter><filter id="fine" x="-30%" y="-30%" width="160%" height="160%"><feGaussianBlur '
    'stdDeviation="{fine}"/></filter>'
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Product:
    """A product that shows a pattern."""

    name: str
    #: Size of the picture, mm.
    width: float
    height: float
    #: Customary width of one motif on it, mm.
    motif_mm: float
    #: The drawings of the groups of these names, as SVG.
    ground: str
    folds: str
    over: str
    #: Attributes of each piece's path.
    pieces: tuple[dict[str, str], ...]
    #: Resolution of the mock-up.
    px_per_mm: float

    @property
    def longer_px(self) -> float:
        """Longer side of the mock-up, px."""
        return self.px_per_mm * max(self.width, self.height)


@cache
def product(name: str, dpi: float | None = None) -> Product:
    """Load the product of that name, at `dpi` px per inch of the product, or 1200 px long without.

    Raises
    ------
    OptionError
        When the mock-up would be too small or too large.
    """
    from defusedxml.ElementTree import fromstring, tostring

    root = fromstring(files("toposeam_cli.motifs").joinpath("drawings", f"{name}.svg").read_text("utf-8"))
    groups = {group.get("id"): group for group in root if group.get("id")}
    _, _, width, height = (float(number) for number in root.get("viewBox").split())
    drawn = {key: tostring(groups[key], encoding="unicode") for key in ("ground", "folds", "over")}
    pieces = groups["pieces"].iter(f"{_SVG}path")
    scale = _LONGER_PX / max(width, height) if dpi is None else dpi / 25.4
    if scale * max(width, height) < _LEAST_PX or scale**2 * width * height > _MOST_PX:
        least, most = _LEAST_PX / max(width, height), (_MOST_PX / (width * height)) ** 0.5
        raise OptionError(
            f"at {dpi:g} dpi a {name} of {width:g} × {height:g} mm would be {scale * width:,.0f} × "
            f"{scale * height:,.0f} px; ask for {math.ceil(25.4 * least)} to {math.floor(25.4 * most)} dpi"
        )
    return Product(
        name=name,
        px_per_mm=scale,
        width=width,
        height=height,
        motif_mm=float(root.get("data-motif-mm")),
        pieces=tuple({str(key): str(value) for key, value in path.attrib.items()} for path in pieces),
        **drawn,
    )


def pattern_px(name: str, motif_mm: float | None = None, dpi: float | None = None) -> int:
    """Return the width of one motif in px at which a mock-up is sharp."""
    shown = product(name, dpi)
    return max(8, round((shown.motif_mm if motif_mm is None else motif_mm) * shown.px_per_mm * _FINER))


def draw_product(
    name: str,
    pattern: np.ndarray,
    motif_px: int,
    paper: np.ndarray,
    ink: np.ndarray,
    motif_mm: float | None = None,
    second: tuple[np.ndarray, int] | None = None,
    dpi: float | None = None,
) -> np.ndarray:
    """Draw a product with a pattern on it.

    Parameters
    ----------
    name : str
        One of `PRODUCTS`.
    pattern : (H, W, 3) uint8 array
        A piece of the pattern that repeats by translation: one motif, or several if its rule needs them.
    motif_px : int
        Width of one motif in `pattern`.
    paper, ink : (3,) arrays
        sRGB in [0, 1], for linings and borders.
    motif_mm : float, optional
        Width of one motif on the product; the customary one without it.
    second : (pattern, motif_px), optional
        A second pattern for lining, collar, border, ribbon or wainscot; without it the first, or plain ink.
    dpi : float, optional
        Px per inch of the product.

    Returns
    -------
    (H, W, 3) uint8 array
        The longer side has 1200 px without `dpi`.

    Raises
    ------
    OptionError
        For a pattern too fine for the product, or a resolution too low or too high.
    """
    shown = product(name, dpi)
    scale = shown.px_per_mm
    wide = shown.motif_mm if motif_mm is None else motif_mm
    swatches: list[tuple[np.ndarray, float] | None]
    swatches = [None, _swatch(shown, pattern, motif_px / wide)]
    swatches.append(None if second is None else _swatch(shown, second[0], second[1] / wide))
    colours = {"{paper}": to_hex(paper), "{ink}": to_hex(ink)}
    picture = _rendered(shown, shown.ground, colours)[..., :3].copy()
    folds = _folds(shown, picture.shape[:2])
    for place in shown.pieces:
        piece = _piece(shown, place)
        which = int(place.get("data-pattern", "1"))
        swatch = swatches[which] if which < 2 or second is not None else _for_second(shown, swatches[1], ink)
        if swatch is None:
            plain = _plain(place.get("data-fill", "{ink}"), colours)
            swatch = (plain, 1.0)
        lay(picture, piece, folds, swatch, scale, shown.width)
    over = _rendered(shown, shown.over, colours)
    alpha = over[..., 3:]
    picture = (1 - alpha) * picture + alpha * over[..., :3]
    drawn: np.ndarray = np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8)
    return drawn


def _folds(shown: Product, shape: tuple[int, ...]) -> np.ndarray:
    """Return the drawn folds, -1 to 1. They are blurred here, as slopes of 8 bits are too coarse."""
    if "path" not in shown.folds:
        return np.zeros(shape)
    share = _FINE if "url(#fine)" in shown.folds else _WIDE
    drawing = shown.folds.replace('filter="url(#fine)"', "").replace('filter="url(#wide)"', "")
    height = 2.0 * (_rendered(shown, drawing, {}, _LEVEL)[..., 0] - parse_colour(_LEVEL)[0])
    blurred: np.ndarray = gaussian_filter(height, share * shown.longer_px)
    return blurred


def _for_second(
    shown: Product, first: tuple[np.ndarray, float] | None, ink: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """Return the substitute for a missing second pattern: the first where it is the same cloth, else plain
    ink.
    """
    if shown.name in ("tie", "shirt"):
        return first
    return np.broadcast_to(np.asarray(ink, np.float32), (1, 1, 3)), 1.0


def _swatch(shown: Product, pattern: np.ndarray, px_per_mm: float) -> tuple[np.ndarray, float]:
    """Return the pattern as floats, reduced to the detail that the mock-up can show, and its resolution."""
    sides = [side / px_per_mm for side in pattern.shape[:2]]
    if min(sides) < _LEAST_MM:
        raise OptionError(
            f"the pattern would be {sides[1]:.3g} × {sides[0]:.3g} mm on the {shown.name}, and needs "
            f"{_LEAST_MM:g} mm a side; give a wider --motif-width, or a picture that is less narrow"
        )
    shrink = shown.px_per_mm * _FINER / px_per_mm
    image = to_vips(pattern)
    if shrink < 1:
        image = image.resize(max(shrink, 2 / image.width), vscale=max(shrink, 2 / image.height))
    values: np.ndarray = image.numpy().astype(np.float32) / 255
    return values, values.shape[1] / sides[1]


def _piece(shown: Product, place: dict[str, str]) -> Piece:
    mask = _rendered(shown, f'<path d="{place["d"]}" fill="#fff"/>', {})[..., 3]
    numbers: dict[str, Any] = {
        key: float(place[f"data-{key}"])
        for key in ("angle", "puff", "edge", "shade", "light", "weave", "gloss", "shadow")
        if f"data-{key}" in place
    }
    matrix = place.get("data-matrix")
    return Piece(mask=mask, matrix=None if matrix is None else tuple(map(float, matrix.split())), **numbers)


def _rendered(shown: Product, drawing: str, fill: dict[str, str], ground: str | None = None) -> np.ndarray:
    """Return a drawing as (H, W, 4) float in [0, 1]."""
    for name, value in fill.items():
        drawing = drawing.replace(name, value)
    size = max(shown.width, shown.height)
    filters = _FILTERS.format(wide=_WIDE * size, fine=_FINE * size)
    floor = "" if ground is None else f'<rect width="100%" height="100%" fill="{ground}"/>'
    document = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        f'width="{round(shown.width * shown.px_per_mm)}" height="{round(shown.height * shown.px_per_mm)}" '
        f'viewBox="0 0 {shown.width:g} {shown.height:g}"><defs>{filters}</defs>{floor}{drawing}</svg>'
    )
    image = load_vips().Image.svgload_buffer(document.encode(), unlimited=True)
    pixels: np.ndarray = image.numpy().astype(np.float32) / 255
    return pixels


def _plain(colour: str, colours: dict[str, str]) -> np.ndarray:
    """Return one colour as a pattern."""
    return np.array([[parse_colour(colours.get(colour, colour))]], np.float32)
