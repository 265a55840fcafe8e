"""A pattern on things one can hold: a tie, a scarf, a shirt and a framed canvas, drawn to scale.

Each product is a drawing in millimetres; the pattern lies behind its outline at its true size, folds and shadows over it. They show how a
pattern reads at that size, not how cloth falls.
"""

from __future__ import annotations

import base64
import math
from dataclasses import dataclass

import numpy as np

from toposeam.errors import OptionError
from toposeam_cli.libvips import load_vips, to_vips

#: Pixels per mm of the drawing.
_SCALE = 1.5
#: Nothing finer repeats on a product, mm.
_LEAST_MM = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Product:
    """One thing to print on."""

    name: str
    #: Size of the picture, mm.
    width: int
    height: int
    #: Customary width of one motif on it, mm.
    motif_mm: float
    #: What is drawn: ``{pattern}`` stands for the pattern's ``<image>``, ``{paper}`` and ``{ink}`` for colours.
    drawing: str
    #: Angle of the pattern, degrees.
    angle: float = 0.0
    #: How far the pattern has to reach, as a share of the longer side: 1, or more where pieces of it are turned.
    reach: float = 1.0


_SHADOW = '<filter id="soft" x="-20%" y="-20%" width="140%" height="140%"><feGaussianBlur stdDeviation="{}"/></filter>'


def _fold(number: int, x1: float, y1: float, x2: float, y2: float, stops: str) -> str:
    """A gradient across a fold: stops are offset, darkness (below 0: light) pairs."""
    parts = []
    for stop in stops.split():
        offset, _, depth = stop.partition(":")
        colour = "#fff" if float(depth) < 0 else "#1a1420"
        parts.append(f'<stop offset="{offset}" stop-color="{colour}" stop-opacity="{abs(float(depth))}"/>')
    where = f'x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}"'
    return f'<linearGradient id="fold{number}" gradientUnits="userSpaceOnUse" {where}>{"".join(parts)}</linearGradient>'


def _tie() -> Product:
    blade = "M152,92 C148,160 140,300 132,520 L175,585 L218,520 C210,300 202,160 198,92 Z"
    knot = "M140,28 C158,22 192,22 210,28 L196,96 C186,102 164,102 154,96 Z"
    tail = "M190,110 C200,220 210,330 214,470 L199,492 L184,470 Z"
    return Product(
        name="tie", width=350, height=640, motif_mm=24, angle=45, reach=1.2,
        drawing=f"""<defs>{_SHADOW.format(5)}
{_fold(1, 132, 0, 218, 0, "0:.34 .16:.05 .4:-.16 .62:0 .88:.14 1:.38")}
{_fold(2, 140, 40, 210, 60, "0:.3 .3:-.14 .6:.02 1:.34")}
{_fold(3, 0, 90, 0, 150, "0:.5 1:0")}
<clipPath id="blade"><path d="{blade}"/></clipPath><clipPath id="knot"><path d="{knot}"/></clipPath>
<clipPath id="tail"><path d="{tail}"/></clipPath></defs>
<rect width="350" height="640" fill="#ece8e1"/>
<path d="{blade}" transform="translate(7,9)" fill="#3a3128" opacity=".38" filter="url(#soft)"/>
<path d="{tail}" transform="translate(10,8)" fill="#3a3128" opacity=".3" filter="url(#soft)"/>
<g clip-path="url(#tail)">{{pattern}}<rect width="350" height="640" fill="#1a1420" opacity=".3"/></g>
<path d="{blade}" transform="translate(3,3)" fill="#1a1420" opacity=".35" filter="url(#soft)"/>
<g clip-path="url(#blade)">{{pattern}}
<rect width="350" height="640" fill="url(#fold1)"/><rect width="350" height="640" fill="url(#fold3)"/></g>
<path d="{knot}" transform="translate(2,4)" fill="#1a1420" opacity=".4" filter="url(#soft)"/>
<g clip-path="url(#knot)"><g transform="rotate(-28 175 60)">{{pattern}}</g><rect width="350" height="640" fill="url(#fold2)"/></g>
<path d="M175,98 C176,112 176,124 175,142" stroke="#1a1420" stroke-opacity=".28" stroke-width="2.2" fill="none"/>""",
    )  # fmt: skip


def _scarf() -> Product:
    outline = "M70,96 C300,70 640,76 868,92 C884,330 888,640 872,884 C640,900 330,898 84,878 C66,640 62,340 70,96 Z"
    inner = "M112,136 C310,114 630,118 828,134 C842,340 846,630 832,844 C630,858 336,856 124,838 C108,630 104,350 112,136 Z"
    waves = "".join(
        f'<path d="M{x},60 C{x + bend},300 {x - bend},640 {x + bend / 2},920" stroke="{colour}" stroke-opacity="{strength}"'
        f' stroke-width="{wide}" fill="none" filter="url(#soft)"/>'
        for x, bend, colour, strength, wide in (
            (220, 46, "#fff", 0.30, 34), (262, 46, "#120d18", 0.24, 30), (470, -38, "#fff", 0.24, 40), (520, -38, "#120d18", 0.20, 34),
            (716, 52, "#fff", 0.28, 30), (756, 52, "#120d18", 0.26, 28),
        )
    )  # fmt: skip
    return Product(
        name="scarf", width=940, height=970, motif_mm=300,
        drawing=f"""<defs>{_SHADOW.format(12)}<clipPath id="cloth"><path d="{outline}"/></clipPath>
<clipPath id="inner"><path d="{inner}"/></clipPath></defs>
<rect width="940" height="970" fill="#e9e6e0"/>
<path d="{outline}" transform="translate(9,14)" fill="#3a3128" opacity=".42" filter="url(#soft)"/>
<g clip-path="url(#cloth)"><rect width="940" height="970" fill="{{ink}}"/><g clip-path="url(#inner)">{{pattern}}</g>
<path d="{inner}" fill="none" stroke="{{paper}}" stroke-width="5"/>{waves}</g>
<path d="{outline}" fill="none" stroke="#1a1420" stroke-opacity=".35" stroke-width="2.5"/>""",
    )  # fmt: skip


def _shirt() -> Product:
    body = (
        "M318,120 L262,142 L238,300 C246,470 244,620 236,742 C330,764 570,764 664,742"
        " C656,620 654,470 662,300 L638,142 L582,120 C540,168 360,168 318,120 Z"
    )
    left = "M262,142 C214,160 178,190 160,226 L88,404 C122,432 172,450 216,454 L250,350 L238,300 Z"
    right = "M638,142 C686,160 722,190 740,226 L812,404 C778,432 728,450 684,454 L650,350 L662,300 Z"
    collar_left = "M340,104 C356,138 396,172 446,196 L404,250 C366,214 330,168 316,122 Z"
    collar_right = "M560,104 C544,138 504,172 454,196 L496,250 C534,214 570,168 584,122 Z"
    neck = "M340,104 C390,82 510,82 560,104 C544,138 504,172 450,196 C396,172 356,138 340,104 Z"
    buttons = "".join(
        f'<g transform="translate(450,{y})"><circle r="6.5" cx="1.5" cy="2" fill="#120d18" opacity=".35"/><circle r="6.5" fill="#f6f2ea"/>'
        '<circle r="6.5" fill="none" stroke="#8d8577" stroke-width=".8"/><circle r="1" cx="-1.8" fill="#6d6557"/>'
        '<circle r="1" cx="1.8" fill="#6d6557"/></g>'
        for y in range(262, 720, 88)
    )
    clips = "".join(
        f'<clipPath id="{name}"><path d="{path}"/></clipPath>'
        for name, path in (("body", body), ("left", left), ("right", right), ("cl", collar_left), ("cr", collar_right))
    )
    outlines = "".join(
        f'<path d="{path}" fill="none" stroke="#1a1420" stroke-opacity=".45" stroke-width="2.2" stroke-linejoin="round"/>'
        for path in (left, right, body)
    )
    creases = "".join(
        f'<path d="{path}" stroke="#120d18" stroke-opacity="{strength}" stroke-width="{wide}" fill="none" filter="url(#soft)"/>'
        for path, strength, wide in (
            ("M262,300 C300,420 290,560 276,730", 0.32, 16), ("M638,300 C600,420 610,560 624,730", 0.32, 16),
            ("M340,420 C352,520 344,640 350,740", 0.16, 14), ("M560,400 C548,520 556,640 548,740", 0.16, 14),
            ("M130,330 C160,350 190,362 222,366", 0.26, 10), ("M770,330 C740,350 710,362 678,366", 0.26, 10),
        )
    )  # fmt: skip
    return Product(
        name="shirt", width=900, height=830, motif_mm=130, reach=1.25,
        drawing=f"""<defs>{_SHADOW.format(9)}{clips}
{_fold(1, 236, 0, 664, 0, "0:.36 .14:.06 .32:-.1 .5:.05 .68:-.08 .86:.08 1:.36")}
{_fold(2, 100, 300, 262, 260, "0:.1 .5:-.08 1:.34")}{_fold(3, 800, 300, 638, 260, "0:.1 .5:-.08 1:.34")}</defs>
<rect width="900" height="830" fill="#eae6df"/>
<g transform="translate(6,12)" fill="#3a3128" opacity=".4" filter="url(#soft)"><path d="{body}"/><path d="{left}"/><path d="{right}"/></g>
<path d="{neck}" fill="{{paper}}"/><path d="{neck}" fill="#1a1420" opacity=".42"/>
<g clip-path="url(#left)"><g transform="rotate(24 200 300)">{{pattern}}</g><rect width="900" height="830" fill="url(#fold2)"/></g>
<g clip-path="url(#right)"><g transform="rotate(-24 700 300)">{{pattern}}</g><rect width="900" height="830" fill="url(#fold3)"/></g>
<g clip-path="url(#body)">{{pattern}}<rect width="900" height="830" fill="url(#fold1)"/>{creases}</g>
<path d="M450,196 L450,756" stroke="#120d18" stroke-opacity=".45" stroke-width="2"/>
<path d="M464,204 L464,757" stroke="#120d18" stroke-opacity=".25" stroke-width="1.2" stroke-dasharray="5 3"/>
{outlines}
<g fill="#120d18" opacity=".42" filter="url(#soft)" transform="translate(0,7)"><path d="{collar_left}"/><path d="{collar_right}"/></g>
<g clip-path="url(#cl)"><g transform="rotate(40 380 170)">{{pattern}}</g><rect width="900" height="830" fill="#fff" opacity=".08"/></g>
<g clip-path="url(#cr)"><g transform="rotate(-40 520 170)">{{pattern}}</g><rect width="900" height="830" fill="#fff" opacity=".08"/></g>
<g fill="none" stroke="#1a1420" stroke-opacity=".5" stroke-width="2.2" stroke-linejoin="round">
<path d="{collar_left}"/><path d="{collar_right}"/></g>
{buttons}""",
    )  # fmt: skip


def _canvas() -> Product:
    return Product(
        name="canvas", width=1100, height=1000, motif_mm=300,
        drawing=f"""<defs>{_SHADOW.format(14)}
<linearGradient id="wall" x1="0" y1="0" x2="1" y2="1">
<stop offset="0" stop-color="#f3f0ea"/><stop offset="1" stop-color="#d9d3c9"/></linearGradient>
<linearGradient id="wood" x1="0" y1="0" x2="1" y2="1"><stop offset="0" stop-color="#5b4636"/><stop offset=".5" stop-color="#3e2f25"/>
<stop offset="1" stop-color="#2c211a"/></linearGradient>
<linearGradient id="glance" x1="0" y1="0" x2="1" y2="1"><stop offset="0" stop-color="#fff" stop-opacity=".16"/>
<stop offset=".45" stop-color="#fff" stop-opacity="0"/></linearGradient>
<clipPath id="art"><rect x="250" y="130" width="600" height="600"/></clipPath></defs>
<rect width="1100" height="1000" fill="url(#wall)"/><rect y="900" width="1100" height="100" fill="#b9a58d"/>
<rect y="900" width="1100" height="7" fill="#f7f4ee"/><rect y="907" width="1100" height="3" fill="#8d7b66"/>
<rect x="232" y="120" width="660" height="660" fill="#2c241c" opacity=".5" filter="url(#soft)" transform="translate(0,8)"/>
<rect x="220" y="100" width="660" height="660" fill="url(#wood)"/>
<path d="M220,100 L250,130 M880,100 L850,130 M220,760 L250,730 M880,760 L850,730" stroke="#1c140e" stroke-width="1.5"/>
<rect x="246" y="126" width="608" height="608" fill="#17110c"/>
<g clip-path="url(#art)">{{pattern}}<rect x="250" y="130" width="600" height="600" fill="url(#glance)"/>
<path d="M250,130 H850 V142 H262 V730 H250 Z" fill="#120d18" opacity=".3"/></g>""",
    )  # fmt: skip


#: Every product by name.
PRODUCTS = {product.name: product for product in (_tie(), _scarf(), _shirt(), _canvas())}


def draw_product(
    product: Product, pattern: np.ndarray, motif_px: int, paper: np.ndarray, ink: np.ndarray, motif_mm: float | None = None
) -> np.ndarray:
    """A product with a pattern on it.

    Parameters
    ----------
    product : Product
    pattern : (H, W, 3) uint8 array
        A piece of the pattern that repeats by translation: one motif, or as many as that takes.
    motif_px : int
        Width of one motif in `pattern`.
    paper, ink : (3,) arrays
        sRGB in [0, 1], for linings and borders.
    motif_mm : float, optional
        Width of one motif on the product; the customary one without it.

    Returns
    -------
    (H, W, 3) uint8 array
        At 1.5 px per mm.
    """
    vips = load_vips()
    mm_per_px = (product.motif_mm if motif_mm is None else motif_mm) / motif_px
    # As much as covers the picture, resampled once to the picture's own resolution, so that no seam lies between tiles.
    reach = product.reach * max(product.width, product.height)
    tile = to_vips(pattern)
    if min(tile.width, tile.height) * mm_per_px < _LEAST_MM:
        raise OptionError(
            f"the pattern would be {tile.width * mm_per_px:.3g} × {tile.height * mm_per_px:.3g} mm on the {product.name}, and needs"
            f" {_LEAST_MM:g} mm a side; give a wider --motif-width, or a picture that is less narrow"
        )
    across, down = (math.ceil(reach / (size * mm_per_px)) for size in (tile.width, tile.height))
    covering = tile.replicate(across, down).resize(mm_per_px * _SCALE * 1.2)
    width, height = across * tile.width * mm_per_px, down * tile.height * mm_per_px
    data = base64.b64encode(covering.pngsave_buffer(compression=1)).decode("ascii")
    x, y = (product.width - width) / 2, (product.height - height) / 2
    turn = f' transform="rotate({product.angle} {product.width / 2} {product.height / 2})"' if product.angle else ""
    image = (
        f'<g{turn}><image x="{x:.2f}" y="{y:.2f}" width="{width:.2f}" height="{height:.2f}" preserveAspectRatio="none"'
        f' xlink:href="data:image/png;base64,{data}"/></g>'
    )
    body = product.drawing.format(pattern='<use xlink:href="#pattern"/>', paper=_hex(paper), ink=_hex(ink))
    document = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
        f' width="{product.width * _SCALE:.0f}" height="{product.height * _SCALE:.0f}" viewBox="0 0 {product.width} {product.height}">'
        f'<defs><g id="pattern">{image}</g></defs>{body}</svg>'
    )
    drawn: np.ndarray = vips.Image.svgload_buffer(document.encode(), unlimited=True).flatten(background=255).numpy()
    return drawn[..., :3]


def _hex(colour: np.ndarray) -> str:
    return "#" + "".join(f"{round(255 * float(value)):02x}" for value in np.clip(colour, 0, 1))
