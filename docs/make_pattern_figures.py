"""Draw the pictures of docs/patterns.md and docs/paths.md: ``python docs/make_pattern_figures.py``, about two
minutes.

Pictures of patterns are JPEG: ink wash does not compress otherwise.
"""

from __future__ import annotations

import time
from collections import defaultdict
from pathlib import Path

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont
from scipy import ndimage

import toposeam as ts
from toposeam.motif.book import SEASONS, book_recipe
from toposeam.motif.ink.sampling import resample
from toposeam.motif.ink.svg import draw_svg
from toposeam.motif.kinds import Kind, measure
from toposeam.motif.recipe.recipe import unpack_base
from toposeam.motif.symmetry.tiling import period
from toposeam_cli.media.pictures.libvips import load_vips
from toposeam_cli.motifs.products import draw_product, pattern_px

DOCS = Path(__file__).resolve().parent
FIGURES = DOCS / "figures"
THEME = DOCS.parent / "samples" / "leaf.png"
Pixels = npt.NDArray[np.uint8]
_GRAY, _DARK = (120, 114, 106), (43, 41, 38)
_PAPER = (255, 255, 255)


def main() -> None:
    """Draw every picture."""
    for draw in (sheet, kinds, products, drawing, obstacles, terrain):
        started = time.perf_counter()
        draw()
        print(f"{draw.__name__}: {time.perf_counter() - started:.0f} s", flush=True)


def bytes_of(image: npt.NDArray[np.floating]) -> Pixels:
    return np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def save(canvas: Image.Image, name: str, quality: int = 80) -> None:
    canvas.save(FIGURES / name, quality=quality, optimize=True, progressive=True)


def font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(str(Path(mpl.get_data_path()) / "fonts/ttf/DejaVuSans.ttf"), size)


# Patterns


def sheet() -> None:
    """Twelve patterns, each of another style and rule; the seeds are counted up."""
    shown = (
        ("vein", "rotate", "sea"),
        ("leaf", "p4m", "fall"),
        ("fern", "translate", "botanic"),
        ("daisy", "pgg", "plum"),
        ("cutout", "p4g", "summer"),
        ("batik", "p31m", "terracotta"),
        ("seed", "p6m", "winter"),
        ("rosette", "cmm", "saffron"),
        ("key", "p3", "night"),
        ("folk", "pmm", "spring"),
        ("pebble", "p2", "indigo"),
        ("thread", "drop", "sumi"),
    )
    side, gap, foot = 300, 16, 30
    canvas = Image.new("RGB", (4 * side + 3 * gap, 3 * (side + foot)), _PAPER)
    pen = ImageDraw.Draw(canvas)
    for index, (style, rule, name) in enumerate(shown):
        motif = ts.motif(192, style=style, seed=index + 1, repeat=rule, palette=name)
        height, width = motif.densities.shape[1:]
        size = (round(150 * height / width), 150)
        pattern = bytes_of(ts.repeat(motif, (2, 2), size=size))
        pattern = (
            pattern[:side, :side]
            if len(pattern) >= side
            else bytes_of(ts.repeat(motif, (3, 3), size=size))[:side, :side]
        )
        x, y = (index % 4) * (side + gap), (index // 4) * (side + foot)
        canvas.paste(Image.fromarray(pattern), (x, y))
        pen.text((x, y + side + 5), f"{style}, {rule}", font=font(14), fill=_GRAY)
    save(canvas, "patterns-rules.jpg")


def _theme() -> npt.NDArray[np.floating]:
    return np.asarray(Image.open(THEME).convert("L"), float) / 255


def kinds() -> None:
    """A pattern of each kind and season from a small book, as Figure 4.10."""
    theme = _theme()
    found: dict[tuple[Kind, str], list[tuple[float, Image.Image]]] = defaultdict(list)
    side = 200
    for number in range(1, 81):
        season = SEASONS[number % 4]
        recipe = book_recipe(theme, 3, number, 96)
        motif = ts.motif(recipe)
        if motif.densities.shape[1:] != recipe.size:
            continue
        character = measure(motif.image(), resample(unpack_base(recipe.base), "none", recipe.size))
        pattern = Image.fromarray(bytes_of(ts.repeat(motif, (2, 2), size=(side // 2, side // 2))))
        found[character.kind, season].append((character.likeness, pattern))
    left, top, gap, foot = 0, 30, 12, 46
    canvas = Image.new("RGB", (left + 4 * side + 3 * gap, top + 4 * (side + foot)), _PAPER)
    pen = ImageDraw.Draw(canvas)
    for column, season in enumerate(SEASONS):
        pen.text((left + column * (side + gap), 4), season, font=font(15), fill=_DARK)
    for line, kind in enumerate(Kind):
        y = top + line * (side + foot)
        for column, season in enumerate(SEASONS):
            if found[kind, season]:  # the most and the least alike
                choose = max if kind in (Kind.THICK_CLEAR, Kind.THIN_CLEAR) else min
                likeness, pattern = choose(found[kind, season], key=lambda pair: pair[0])
                x = left + column * (side + gap)
                canvas.paste(pattern, (x, y))
                words = f"likeness {likeness:.2f}"
                pen.text((x + side, y + side + 6), words, font=font(12), fill=_DARK, anchor="ra")
        pen.text((left, y + side + 20), f"{kind}: {kind.words}", font=font(14), fill=_GRAY)
    save(canvas, "patterns-kinds.jpg")


def products() -> None:
    """Every product, with two patterns where there is a place for a second one."""
    shown = (
        ("tie", "pgg", 4, "indigo"),
        ("scarf", "p4m", 7, "summer"),
        ("shirt", "translate", 11, "botanic"),
        ("cushion", "drop", 3, "terracotta"),
        ("canvas", "rotate", 5, "fall"),
        ("wallpaper", "translate", 9, "sea"),
        ("wrapping", "p31m", 2, "winter"),
        ("phone", "brick", 6, "plum"),
    )
    height, gap = 380, 12
    pictures = []
    for name, rule, seed, colours in shown:
        across = pattern_px(name)
        motif, other = (ts.motif(128, seed=seed, repeat=of, palette=colours) for of in (rule, "p4g"))
        swatches = []
        for made in (motif, other):
            rows, columns = made.densities.shape[1:]
            size = (round(across * rows / columns), across)
            swatches.append(bytes_of(ts.repeat(made, period(made.repeat), size=size)))
        dark = motif.inks[int(np.argmin(motif.inks.sum(axis=1)))]
        drawn = Image.fromarray(
            draw_product(name, swatches[0], across, motif.paper, dark, second=(swatches[1], across))
        )
        pictures.append(
            drawn.resize((round(drawn.width * height / drawn.height), height), Image.Resampling.LANCZOS)
        )
    lines = [pictures[:4], pictures[4:]]
    wide = max(sum(picture.width + gap for picture in line) for line in lines) - gap
    canvas = Image.new("RGB", (wide, 2 * height + gap), _PAPER)
    for y, line in enumerate(lines):
        x = 0
        for picture in line:
            canvas.paste(picture, (x, y * (height + gap)))
            x += picture.width + gap
    save(canvas, "patterns-products.jpg")


def drawing() -> None:
    """A corner of a motif: as pixels, and as the SVG that is drawn from it."""
    motif = ts.motif(128, seed=5, repeat="rotate", palette="sea")
    side, crop = 1280, 420
    document = draw_svg(motif).replace('width="128" height="128"', f'width="{side}" height="{side}"', 1)
    drawn = Image.fromarray(
        load_vips().Image.svgload_buffer(document.encode(), unlimited=True).numpy()[..., :3]
    )
    pixels = Image.fromarray(bytes_of(motif.image())).resize((side, side), Image.Resampling.NEAREST)
    canvas = Image.new("RGB", (2 * crop + 16, crop + 30), _PAPER)
    pen = ImageDraw.Draw(canvas)
    for index, (picture, words) in enumerate(
        ((pixels, "128 × 128 elements"), (drawn, "the SVG of the same motif"))
    ):
        canvas.paste(picture.crop((560, 60, 560 + crop, 60 + crop)), (index * (crop + 16), 0))
        pen.text((index * (crop + 16), crop + 6), words, font=font(14), fill=_GRAY)
    save(canvas, "patterns-drawing.jpg")


# Paths


def _show(axis: object, found: ts.path.PlannedPath, name: str, points: list[tuple[float, float]]) -> None:
    for line in found.paths:
        axis.plot(
            *line.points.T, color="white", linewidth=4.2, solid_capstyle="round", solid_joinstyle="round"
        )
        axis.plot(
            *line.points.T, color="#d7263d", linewidth=2.2, solid_capstyle="round", solid_joinstyle="round"
        )
    for x, y in points:
        axis.plot(
            x + 0.5,
            y + 0.5,
            "o",
            markersize=6.5,
            color="#d7263d",
            markeredgecolor="white",
            markeredgewidth=1.4,
        )
    axis.set_title(name, fontsize=9, color="0.3", loc="left")
    axis.axis("off")


def _heat(axis: object, found: ts.path.PlannedPath, obstacles: npt.NDArray[np.bool_] | None = None) -> None:
    height, width = found.density.shape
    axis.imshow(
        np.sqrt(found.density),
        cmap="inferno",
        vmin=0,
        vmax=1,
        extent=(0, width, height, 0),
        interpolation="nearest",
    )
    if obstacles is not None:
        axis.imshow(
            np.ma.masked_where(~obstacles, obstacles),
            cmap="gray",
            vmin=-1.2,
            vmax=2,
            extent=(0, width, height, 0),
            interpolation="nearest",
        )


def obstacles() -> None:
    """Round obstacles, through stopovers, from several starts; and the heat at three moments."""
    height, width = 96, 140
    y, x = np.mgrid[:height, :width]
    blocked = np.zeros((height, width), bool)
    for cy, cx, radius in ((30, 38, 15), (66, 60, 13), (24, 88, 12)):
        blocked |= np.hypot(y - cy, x - cx) < radius
    blocked |= (np.abs(x - 108) < 3) & (y > 40) & (y < 96)
    blocked |= (np.abs(y - 84) < 3) & (x > 14) & (x < 44)
    figure = Figure(figsize=(10, 4.9), dpi=120)
    axes = figure.subplots(2, 3)
    start, end = (5, 8), (134, 86)
    ways = (
        ("round obstacles", start, end, []),
        ("with two stopovers", start, end, [(22, 64), (74, 44)]),
        ("from three starts", [start, (5, 90), (72, 90)], end, []),
    )
    for column, (name, sources, sink, stops) in enumerate(ways):
        found = ts.plan_path((height, width), sources, sink, obstacles=blocked, stopovers=stops)
        axis = axes[0, column]
        axis.imshow(
            blocked, cmap="gray_r", vmin=0, vmax=1.6, extent=(0, width, height, 0), interpolation="nearest"
        )
        marks = [*(sources if isinstance(sources, list) else [sources]), sink, *stops]
        _show(axis, found, f"{name}: {found.length:.0f} px", marks)
    for column, (gather, sharpen) in enumerate(((4, 0), (12, 0), (40, 30))):
        options = ts.path.PathOptions(gather=gather, sharpen=sharpen)
        found = ts.plan_path((height, width), start, end, obstacles=blocked, options=options)
        _heat(axes[1, column], found, blocked)
        axes[1, column].set_title(
            f"heat after {gather + sharpen} iterations, p = {found.history[-1].penalty:g}",
            fontsize=9,
            color="0.3",
            loc="left",
        )
        axes[1, column].axis("off")
    figure.subplots_adjust(0.01, 0.01, 0.99, 0.95, 0.04, 0.12)
    figure.savefig(FIGURES / "paths-obstacles.png")
    Image.open(FIGURES / "paths-obstacles.png").convert("RGB").quantize(128).save(
        FIGURES / "paths-obstacles.png", optimize=True
    )


def ground(height: int, width: int, seed: int = 4) -> npt.NDArray[np.floating]:
    """Generated hills: noise at three scales, in px of height."""
    rng = np.random.default_rng(seed)
    relief = sum(
        scale * 9 * ndimage.gaussian_filter(rng.standard_normal((height, width)), scale, mode="reflect")
        for scale in (6, 12, 24)
    )
    return np.asarray(relief - relief.min())


def terrain() -> None:
    """Over generated hills, where a step costs more the steeper the ground; beside it the shortest way on the
    grid.
    """
    from skimage.graph import MCP_Geometric

    height, width = 140, 200
    relief = ground(height, width)
    cost = 1 + 2.5 * np.hypot(*np.gradient(relief))
    start, end = (10, 12), (188, 126)
    found = ts.plan_path(cost, start, end)
    search = MCP_Geometric(cost)
    reached, _ = search.find_costs([start[::-1]])
    grid = np.array(search.traceback(end[::-1]))
    straight = ts.path.path_cost(ts.vector.Polyline(np.array([start, end]) + 0.5), cost)
    figure = Figure(figsize=(10, 3.9), dpi=120)
    axes = figure.subplots(1, 2)
    light = mpl.colors.LightSource(315, 45)
    shaded = light.shade(
        relief,
        cmap=mpl.colormaps["gist_earth"],
        vert_exag=1.0,
        blend_mode="soft",
        vmin=-15,
        vmax=relief.max() * 1.25,
    )
    axes[0].imshow(shaded, extent=(0, width, height, 0), interpolation="bilinear")
    axes[0].contour(
        relief, 12, colors="white", linewidths=0.35, alpha=0.5, extent=(0.5, width - 0.5, 0.5, height - 0.5)
    )
    title = (
        f"red: heat, cost {found.cost:.0f}; dashed: Dijkstra on the grid, {reached[end[::-1]]:.0f}; "
        f"straight on: {straight:.0f}"
    )
    _show(axes[0], found, title, [start, end])
    axes[0].plot(grid[:, 1] + 0.5, grid[:, 0] + 0.5, color="#16324f", linewidth=1.0, linestyle=(0, (3, 2)))
    _heat(axes[1], found)
    axes[1].set_title("where the heat gathered", fontsize=9, color="0.3", loc="left")
    axes[1].axis("off")
    figure.subplots_adjust(0.01, 0.01, 0.99, 0.93, 0.03, 0.1)
    figure.savefig(FIGURES / "paths-terrain.png")
    Image.open(FIGURES / "paths-terrain.png").convert("RGB").save(
        FIGURES / "paths-terrain.jpg", quality=86, optimize=True
    )
    (FIGURES / "paths-terrain.png").unlink()


if __name__ == "__main__":
    main()
