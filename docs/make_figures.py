"""Draw the gallery: ``python docs/make_figures.py`` writes docs/figures/*.png and the table of numbers in
docs/gallery.md.

The seams are found by ``method="thesis"``; what method heat makes of the same pair stands beside them in
numbers.
"""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

import thesis_cases
import toposeam as ts
from figure_sheet import GRAY, SEAM, Sheet, save_png
from photographs import beside, corner, pairs, still_life
from thesis_cases import Case
from toposeam_cli.figures.history import history_figure
from toy_figures import Joined, toy_problem

DOCS = Path(__file__).resolve().parent
FIGURES = DOCS / "figures"
GALLERY = DOCS / "gallery.md"
#: Space between the patches where they are shown apart, in px of the sheet.
APART = 18
_MARGIN = 30
_BLUE = "#24539b"
_BEGIN, _END = "<!-- numbers: written by make figures -->", "<!-- end of numbers -->"


def main() -> None:
    """Draw every figure."""
    started = time.perf_counter()
    FIGURES.mkdir(exist_ok=True)
    rows = [*toy_problem(), *zigzag(), *ell_and_random_colours(), *photographs(), *two_sizes()]
    hero()
    write_numbers(rows)
    total = sum(path.stat().st_size for path in FIGURES.glob("*.png"))
    print(
        f"{len(list(FIGURES.glob('*.png')))} figures, {total / 1e6:.1f} MB, in "
        f"{time.perf_counter() - started:.0f} s: {FIGURES}"
    )


# Figures 3.11 to 3.14


def zigzag() -> list[tuple[str, Joined]]:
    case = thesis_cases.zigzag()
    with_gradient = Joined.find(case)
    without = Joined.find(case, ts.seam.MatchCost(law="colour"))
    scale, gap, head = 3, 48, 60
    step = case.a.shape[1] * scale + gap
    columns = [_MARGIN + _apart_size(case, scale)[1] + gap + index * step for index in range(3)]
    sheet = Sheet(columns[-1] + step - gap + _MARGIN, head + case.a.shape[0] * scale + 140)
    _apart(sheet, case, _MARGIN, head, scale)
    over_a = _over(case)
    for x, title, joined in (
        (columns[0], "with gradient, (2.4)", with_gradient),
        (columns[1], "without, (3.22)", without),
    ):
        sheet.words(title, x, head - 14, va="bottom", large=True)
        sheet.seam(sheet.picture(over_a, x, head, scale), joined.thesis.paths, halo=False)
        thesis, heat = joined.numbers
        lines = [*thesis.split(", ", 1), heat]
        for line, text in enumerate(lines):
            sheet.words(text, x, head + case.a.shape[0] * scale + 10 + 29 * line, color=GRAY)
    sheet.words("the two patches", _MARGIN, head - 14, va="bottom", large=True)
    sheet.words("joined, either way", columns[2], head - 14, va="bottom", large=True)
    sheet.picture(case.joined(with_gradient.thesis), columns[2], head, scale)
    sheet.save(FIGURES / "fig-3.11-zigzag.png")
    save_png(history_figure(with_gradient.thesis), FIGURES / "fig-3.12-zigzag-history.png")
    save_png(history_figure(without.thesis), FIGURES / "fig-3.12-zigzag-history-no-gradient.png")
    return [("3.11 zigzag, with gradient", with_gradient), ("3.11 zigzag, without gradient", without)]


def ell_and_random_colours() -> list[tuple[str, Joined]]:
    ell, colours = Joined.find(thesis_cases.ell()), Joined.find(thesis_cases.random_colours())
    _three_columns([ell], [4], FIGURES / "fig-3.13-l-shape.png", over_a=True)
    _three_columns([colours], [4], FIGURES / "fig-3.14-random-colours.png")
    save_png(history_figure(colours.thesis), FIGURES / "fig-3.14-random-colours-history.png")
    return [("3.13 L-shape", ell), ("3.14 random colours", colours)]


# Figures 3.15 to 3.23


def photographs() -> list[tuple[str, Joined]]:
    found = [(title, Joined.find(case)) for title, case in pairs()]
    _three_columns([joined for _, joined in found], [2, 5, 5, 4], FIGURES / "fig-3.15-photographs.png")
    for number, (_, joined) in zip((16, 19, 20, 21), found, strict=True):
        save_png(history_figure(joined.thesis), FIGURES / f"fig-3.{number}-history.png")
    first = found[0][1].thesis
    _densities(first, FIGURES / "fig-3.17-densities.png")
    save_png(history_figure(first, frames=24, curves=False), FIGURES / "fig-3.18-film-strip.png")
    return [(f"3.15 {title}", joined) for title, joined in found]


def two_sizes() -> list[tuple[str, Joined]]:
    joined = Joined.find(corner())
    _three_columns([joined], [2], FIGURES / "fig-3.22-two-sizes.png")
    save_png(history_figure(joined.thesis), FIGURES / "fig-3.23-history.png")
    return [("3.22 Hubble deep field", joined)]


def _densities(seam: ts.seam.Seam, path: Path) -> None:
    """Figure 3.17: how many elements have which density at the end of each stage."""
    last = {frame.stage: frame for frame in seam.frames}
    chosen = sorted(last)[:2] + sorted(last)[-1:]
    sheet = Sheet(1600, 430)
    bins = np.linspace(0, 1, 21)
    usable = [seam.problem.right > 0, seam.problem.down > 0]
    for column, stage in enumerate(dict.fromkeys(chosen)):
        frame = last[stage]
        values = np.concatenate(
            [values[mask] for values, mask in zip((frame.right, frame.down), usable, strict=True)]
        )
        axis = sheet.axes(110 + column * 510, 80, 420, 250)
        counts, _ = np.histogram(np.clip(values, 0, 1), bins)
        axis.bar(
            bins[:-1],
            counts,
            width=0.045,
            align="edge",
            color=[SEAM if edge > 0.94 else "0.6" for edge in bins[:-1]],
        )
        axis.set_yscale("log")
        axis.set_ylim(0.7, 3e4)
        axis.set_xlim(-0.02, 1.02)
        axis.tick_params(labelsize=sheet.points(20), width=0.5, length=2.5)
        axis.spines[["top", "right"]].set_visible(False)
        axis.set_xlabel("density", fontsize=sheet.points(22), labelpad=3)
        if not column:
            axis.set_ylabel("elements", fontsize=sheet.points(22))
        sheet.words(f"end of stage {stage}, iteration {frame.iteration}", 110 + column * 510, 20)
        sheet.words(
            f"{np.count_nonzero(values > 0.95)} at 1", 110 + column * 510 + 420, 50, ha="right", color=SEAM
        )
    sheet.save(path)


def hero() -> None:
    """Two pictures with parallax, the seam between them, the joined picture."""
    case = beside(*still_life(), 170)
    seam = case.find()
    joined = case.joined(seam)
    height, width, gap, top = 310, 478, 28, 0
    share = height / case.a.shape[0]
    band = round(170 * share)
    apart = band + APART
    sheet = Sheet(2 * gap + 3 * width + apart, height + 52, small=21)
    patches = ((case.a[:, :440], "A", 0), (case.b[:, 270:], "B", round(270 * share) + apart))
    for image, name, x in patches:
        shown = _resized(image, (height, round(image.shape[1] * share)))
        axis = sheet.picture(shown, x, top)
        shared = np.zeros(shown.shape[:2], bool)
        inside = np.s_[:, -band:] if name == "A" else np.s_[:, :band]
        shared[inside] = True
        sheet.dashes(axis, shared, np.ones_like(shared))
        end = x + shown.shape[1]
        middle = end - band / 2 if name == "A" else x + band / 2
        sheet.words("overlap", middle, top + height + 12, color=GRAY, ha="center")
        sheet.words(name, x if name == "A" else end, top + height + 12, ha="left" if name == "A" else "right")
    x = width + apart + gap
    axis = sheet.picture(_resized(joined, (height, width)), x, top)
    sheet.seam(
        axis, [ts.vector.Polyline(points=line.points * share, closed=line.closed) for line in seam.paths], 3
    )
    sheet.words("the seam that heat finds", x, top + height + 12, color=GRAY)
    x += width + gap
    sheet.picture(_resized(joined, (height, width)), x, top)
    sheet.words("joined: one picture from two cameras", x, top + height + 12, color=GRAY)
    sheet.save(FIGURES / "hero.png")


# What the figures share


def _three_columns(found: list[Joined], scales: list[int], path: Path, *, over_a: bool = False) -> None:
    """A row for each pair: the patches apart, joined with the seam, joined; with `over_a` the seam is drawn
    over patch A instead.
    """
    gap, head = 48, 60
    sizes = [
        (joined.case.a.shape[0] * scale, joined.case.a.shape[1] * scale)
        for joined, scale in zip(found, scales, strict=True)
    ]
    apart = [_apart_size(joined.case, scale) for joined, scale in zip(found, scales, strict=True)]
    columns = [_MARGIN, _MARGIN + max(size[1] for size in apart) + gap]
    columns.append(columns[1] + max(size[1] for size in sizes) + gap)
    heights = [max(size[0] + 96, other[0] + 66) for size, other in zip(sizes, apart, strict=True)]
    sheet = Sheet(columns[2] + max(size[1] for size in sizes) + _MARGIN, head + sum(heights))
    for x, title in zip(
        columns,
        ("the two patches", "the seam, over patch A" if over_a else "the seam", "joined"),
        strict=True,
    ):
        sheet.words(title, x, head - 14, va="bottom", large=True)
    y = head
    for joined, scale, height in zip(found, scales, heights, strict=True):
        case, image = joined.case, joined.case.joined(joined.thesis)
        _apart(sheet, case, columns[0], y, scale)
        sheet.seam(
            sheet.picture(_over(case) if over_a else image, columns[1], y, scale),
            joined.thesis.paths,
            halo=not over_a,
        )
        sheet.picture(image, columns[2], y, scale)
        for line, text in enumerate(joined.numbers):
            sheet.words(text, columns[1], y + image.shape[0] * scale + 10 + 29 * line, color=GRAY)
        y += height
    sheet.save(path)


def _over(case: Case) -> npt.NDArray[np.float64]:
    """Patch A laid over patch B: the shade that a seam follows, and that the joined picture no longer has."""
    return np.where(case.mask_a if case.a.ndim == 2 else case.mask_a[..., np.newaxis], case.a, case.b)


def _shift(case: Case, scale: int) -> tuple[int, int]:
    """How far down and right B is moved, in px of the sheet, so that the overlap shows in both patches."""
    shared = case.mask_a & case.mask_b
    last_row, last_column = (int(np.flatnonzero(case.mask_b.any(axis=axis))[-1]) for axis in (1, 0))
    down, right = (
        int(count) * scale + APART if count else 0
        for count in (shared[:, last_column].sum(), shared[last_row].sum())
    )
    return down, right


def _apart_size(case: Case, scale: int) -> tuple[int, int]:
    down, right = _shift(case, scale)
    return case.a.shape[0] * scale + down, case.a.shape[1] * scale + right


def _apart(sheet: Sheet, case: Case, x: int, y: int, scale: int) -> None:
    """The two patches, moved apart so that the overlap shows in both, with its outline."""
    shared = case.mask_a & case.mask_b
    for name, image, mask, (down, right) in (
        ("A", case.a, case.mask_a, (0, 0)),
        ("B", case.b, case.mask_b, _shift(case, scale)),
    ):
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        left, top = x + int(columns[0]) * scale + right, y + int(rows[0]) * scale + down
        axis = sheet.picture(image[window], left, top, scale, covered=mask[window])
        sheet.dashes(axis, shared[window], mask[window])
        sheet.words(
            f"{name}, {len(columns)} × {len(rows)} px", left, top + len(rows) * scale + 10, color=GRAY
        )


def _resized(image: npt.NDArray[np.float64], shape: tuple[int, int]) -> npt.NDArray[np.uint8]:
    pixels = Image.fromarray(np.asarray(np.rint(image * 255), np.uint8))
    return np.asarray(pixels.resize((shape[1], shape[0]), Image.Resampling.LANCZOS))


def write_numbers(rows: list[tuple[str, Joined]]) -> None:
    """Put the table of numbers between its two marks in the gallery page."""
    lines = [
        "| figure | overlap, px | thesis: cost ÷ optimum | stages, iterations | heat: cost ÷ optimum | "
        "iterations |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for name, joined in rows:
        thesis, heat = joined.thesis, joined.heat
        area = int(thesis.problem.overlap.shared.sum())
        lines.append(
            f"| {name} | {area} | {thesis.optimum_ratio():.4f} | {thesis.history[-1].stage}, "
            f"{len(thesis.history)} | {heat.optimum_ratio():.4f} | {len(heat.history)} |"
        )
    text = GALLERY.read_text(encoding="utf-8")
    before, _, rest = text.partition(_BEGIN)
    _, _, after = rest.partition(_END)
    GALLERY.write_text(before + _BEGIN + "\n" + "\n".join(lines) + "\n" + _END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
