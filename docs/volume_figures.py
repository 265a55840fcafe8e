"""Figures of docs/volumes.md and docs/loops.md, from samples/clips.py: ``python docs/volume_figures.py``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

import toposeam as ts
from toposeam.heat.bricks import HIGH, LOW, along
from toposeam.heat.grid_flow import GridFlow
from toposeam.seam.problem.overlap import A, B

HERE = Path(__file__).resolve().parent
FIGURES = HERE / "figures"
sys.path.insert(0, str(HERE.parent / "samples"))
import clips  # noqa: E402

Picture = npt.NDArray[np.uint8]
PAPER = (243, 242, 238)
INK = (20, 20, 20)
GLOW = [(16, 18, 38), (86, 22, 82), (196, 54, 60), (250, 150, 50), (255, 246, 200)]


def main() -> None:
    """Write all of them."""
    flag = clips.flag()
    waving = ts.loop(flag, level=True)
    strip(flag, waving)
    heat(waving.surfaces[0])
    moving("loop-fire.webp", ts.loop(clips.flames(seed=11), level=True).frames)
    moving("loop-flag.webp", waving.frames)
    cells()


def strip(clip: Picture, made: ts.volume.Loop) -> None:
    """The moments round the loop point: cut off, cross-faded, along the surface, and which frames show."""
    (jump,), count = made.jumps, made.transition
    shown = np.linspace(0, count - 1, 6).round().astype(int)
    a, b = clip[jump.leaves :][:count], clip[jump.enters :][:count]
    share = ((shown + 0.5) / count)[:, None, None, None]
    faded = np.rint((1 - share) * a[shown] + share * b[shown]).astype(np.uint8)
    cut = np.where(shown[:, None, None, None] < count / 2, a[shown], b[shown])
    label = made.surfaces[0].labels[shown]
    tint = np.where(label[..., None], (46, 134, 171), (241, 143, 1))
    sides = np.rint(0.45 * made.frames[shown] + 0.55 * tint).astype(np.uint8)
    rows = {"cut off": cut, "cross-fade": faded, "surface": made.frames[shown], "end | beginning": sides}
    sheet = Image.new("RGB", (8 + 6 * 188, 8 + len(rows) * 128), PAPER)
    drawing = ImageDraw.Draw(sheet)
    for row, (name, frames) in enumerate(rows.items()):
        for column, frame in enumerate(frames):
            sheet.paste(Image.fromarray(frame), (8 + 188 * column, 8 + 128 * row))
        drawing.rectangle((8, 8 + 128 * row, 20 + 6.2 * len(name), 24 + 128 * row), fill=PAPER)
        drawing.text((13, 10 + 128 * row), name, fill=INK)
    sheet.save(FIGURES / "loop-strip.jpg", quality=88)


def heat(surface: ts.volume.Surface) -> None:
    """Heat gathering: how much of it flows through one row of the picture at every moment, after some sweeps,
    and the surface in the end.
    """
    problem = surface.problem
    side = problem.overlap.side
    flow = GridFlow(problem.costs, (side == A) | (side == B), side == B)
    row = side.shape[1] // 2
    tiles = []
    done = 0
    for sweeps in (40, 120, 300, 1000):
        flow.sweep(sweeps - done)
        done = sweeps
        tiles.append((f"{sweeps} sweeps", glow(flow.potential[:, row])))
    tiles.append(("the surface", glow(problem.complete(surface.shown)[:, row].astype(np.float32))))
    height, width = tiles[0][1].shape[:2]
    sheet = Image.new("RGB", (24 + width + 420, 8 + len(tiles) * (height + 24)), PAPER)
    drawing = ImageDraw.Draw(sheet)
    for index, (name, tile) in enumerate(tiles):
        at = 4 + index * (height + 24)
        drawing.text((8, at), name, fill=INK)
        sheet.paste(Image.fromarray(tile), (8, at + 16))
    sheet.paste(relief(surface, 400, sheet.height - 16), (16 + width, 8))
    sheet.save(FIGURES / "surface-heat.png", optimize=True)


def glow(potential: npt.NDArray[np.float32]) -> Picture:
    """The jumps of a slice of the potential, enlarged: bright where much heat flows."""
    total = np.zeros(potential.shape)
    for axis in range(2):
        jump = np.abs(potential[along(axis, HIGH)] - potential[along(axis, LOW)])
        total[along(axis, LOW)] += jump / 2
        total[along(axis, HIGH)] += jump / 2
    bright = np.clip(total / 0.5, 0, 1) ** 0.5
    return clips.coloured(bright, GLOW).repeat(4, axis=0).repeat(3, axis=1)


def relief(surface: ts.volume.Surface, width: int, height: int) -> Image.Image:
    """The surface seen from the side, time upwards."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    mesh = surface.mesh(smooth=1.5)
    depth, tall, wide = surface.labels.shape
    figure = Figure(figsize=(width / 100, height / 100), dpi=100, facecolor=[part / 255 for part in PAPER])
    axes: Any = figure.add_axes((0, 0, 1, 1), projection="3d")
    z, y, x = mesh.vertices.T / np.array([[surface.settings["spacing"][0]], [1], [1]])
    axes.plot_trisurf(x, tall - y, z, triangles=mesh.faces, cmap="magma", linewidth=0, antialiased=False)
    axes.set_box_aspect((wide, tall, 4 * depth))
    axes.view_init(elev=28, azim=-60)
    axes.set(xlabel="x", ylabel="y", zlabel="time", xticks=[], yticks=[], zticks=[])
    axes.set_facecolor(figure.get_facecolor())
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def moving(name: str, frames: Picture) -> None:
    """A loop, running."""
    pictures = [Image.fromarray(frame) for frame in frames]
    pictures[0].save(
        FIGURES / name, save_all=True, append_images=pictures[1:], duration=50, loop=0, quality=70, method=6
    )


def cells() -> None:
    """A slice of two stacks of cells that moved meanwhile: a, b, cross-faded, joined; and the surface."""
    a, b = clips.cells()
    start = a.shape[2] - 60
    joined = ts.join_volumes(a, b, offset=(0, 0, start))
    index, left = 34, start - 30
    share = np.linspace(0, 1, 60)
    canvas = np.zeros((2, *a.shape[1:2], start + b.shape[2]))
    canvas[0, :, : a.shape[2]], canvas[1, :, start:] = a[index], b[index]
    faded = canvas[0] + canvas[1]
    faded[:, start : start + 60] = (1 - share) * a[index, :, start:] + share * b[index, :, :60]
    slices = {"a": canvas[0], "b": canvas[1], "cross-fade": faded, "surface": joined.volume[index]}
    width, height = 2 * 120, 2 * a.shape[1]
    sheet = Image.new("RGB", (8 + len(slices) * (width + 8), height + 32), PAPER)
    drawing = ImageDraw.Draw(sheet)
    for place, (name, values) in enumerate(slices.items()):
        shown = np.rint(np.clip(values[:, left : left + 120] / 32000, 0, 1) ** 0.7 * 255).astype(np.uint8)
        gray = np.repeat(shown[..., None], 3, axis=2)
        if name == "surface":
            label = joined.labels[index]
            edge = np.zeros(gray.shape[:2], bool)
            edge[:, 30:89] |= label[:, 1:] != label[:, :-1]
            edge[:-1, 30:90] |= label[1:] != label[:-1]
            gray[edge] = (255, 150, 40)
        tile = Image.fromarray(gray).resize((width, height), Image.Resampling.NEAREST)
        sheet.paste(tile, (8 + place * (width + 8), 24))
        drawing.text((8 + place * (width + 8), 6), name, fill=INK)
    sheet.save(FIGURES / "volume-cells.png", optimize=True)


if __name__ == "__main__":
    main()
