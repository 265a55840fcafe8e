"""Figures 3.5 to 3.7 of the gallery: the toy problem, and how it is solved."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

import thesis_cases
import toposeam as ts
from figure_sheet import GRAY, SEAM, Sheet
from thesis_cases import Case
from toposeam_cli.figures.history import plain_numbers, scientific

FIGURES = Path(__file__).resolve().parent / "figures"
_MARGIN = 30
_BLUE = "#24539b"
#: Column and row of the nodes of the toy problem's seam.
_TOY_PATH = [(1, 0), (1, 1), (2, 1), (2, 2), (2, 3)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Joined:
    """A case with the seams that two methods find."""

    case: Case
    thesis: ts.seam.Seam
    heat: ts.seam.Seam

    @classmethod
    def find(cls, case: Case, cost: ts.seam.MatchCost | None = None) -> Joined:
        """Both seams, the thesis's with its history."""
        return cls(
            case=case,
            thesis=case.find("thesis", cost=cost, record_frames=True),
            heat=case.find("heat", cost=cost),
        )

    @property
    def numbers(self) -> tuple[str, str]:
        """What the two methods cost, a line each."""
        thesis, heat = self.thesis, self.heat
        return (
            f"thesis: {thesis.optimum_ratio():.4f} × optimum, {thesis.history[-1].stage} stages, "
            f"{len(thesis.history)} iterations",
            f"heat: {heat.optimum_ratio():.4f} × optimum, {len(heat.history)} iterations",
        )


def toy_problem() -> list[tuple[str, Joined]]:
    joined = Joined.find(thesis_cases.toy())
    case, seam = joined.case, joined.thesis
    sheet, grid, patch, top = Sheet(1600, 640), 144, 58, 84
    height = 3 * grid
    for name, image, y in (("Patch A", case.a, top), ("Patch B", case.b, top + height - 3 * patch)):
        sheet.words(name, _MARGIN, y - 14, va="bottom")
        _pixel_lines(sheet.picture(image, _MARGIN, y, patch))
    left = 380
    sheet.words("Match cost of the elements; light gray: $M_{max}$", left, top - 44, va="bottom")
    _cost_grid(sheet.axes(left - 30, top - 30, height + 60, height + 60), seam, sheet)
    left = 1010
    sheet.words("Joined, with the seam", left, top - 44, va="bottom")
    axis = sheet.picture(case.joined(seam), left, top, grid)
    _pixel_lines(axis)
    sheet.seam(axis, seam.paths, 9)
    sheet.words(
        "through nodes " + ", ".join(str(4 * y + x + 1) for x, y in _TOY_PATH),
        left,
        top + height + 14,
        color=GRAY,
    )
    sheet.words(";   ".join(joined.numbers), _MARGIN, 596, color=GRAY)
    sheet.save(FIGURES / "fig-3.05-toy-problem.png")
    _toy_history(seam)
    return [("3.5 toy problem", joined)]


def _pixel_lines(axis: object) -> None:
    for at in range(4):
        axis.plot([at, at], [0, 3], color="0.5", linewidth=0.4)
        axis.plot([0, 3], [at, at], color="0.5", linewidth=0.4)


def _elements(
    seam: ts.seam.Seam, right: npt.NDArray[np.float32], down: npt.NDArray[np.float32]
) -> list[tuple[tuple[int, int], tuple[int, int], float]]:
    """(start, end, value) of each of the 24 elements of the toy problem, from values per interface of its
    window.
    """
    found = [((x, y), (x, y + 1), float(right[y + 1, x])) for y in range(3) for x in range(4)]
    return found + [((x, y), (x + 1, y), float(down[y, x + 1])) for y in range(4) for x in range(3)]


def _lattice(axis: object, margin: float = 0.25) -> None:
    axis.set_xlim(-margin, 3 + margin)
    axis.set_ylim(3 + margin, -margin)
    axis.axis("off")


def _cost_grid(axis: object, seam: ts.seam.Seam, sheet: Sheet) -> None:
    _lattice(axis, 30 / 144)
    path = {frozenset(pair) for pair in pairwise(_TOY_PATH)}
    for start, end, cost in _elements(seam, seam.problem.right, seam.problem.down):
        (x0, y0), (x1, y1) = start, end
        outer = x0 == x1 in (0, 3) or y0 == y1 in (0, 3)
        on_path = frozenset((start, end)) in path
        axis.plot(
            [x0, x1],
            [y0, y1],
            color="0.85" if outer else SEAM if on_path else "0.45",
            linewidth=sheet.points(10 if outer else 5),
            zorder=1,
        )
        if not outer:
            axis.text(
                (x0 + x1) / 2,
                (y0 + y1) / 2,
                f"{cost:.2f}",
                ha="center",
                va="center",
                fontsize=sheet.points(20),
                zorder=2,
                color=SEAM if on_path else "0.3",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.2},
            )
    for y in range(4):
        for x in range(4):
            axis.plot(x, y, "o", markersize=sheet.points(38), color="0.13", zorder=3)
            axis.text(
                x,
                y + 0.01,
                str(4 * y + x + 1),
                color="white",
                ha="center",
                va="center_baseline",
                fontsize=sheet.points(19),
                zorder=4,
            )


def _toy_history(seam: ts.seam.Seam) -> None:
    sheet = Sheet(1600, 720)
    iterations = np.arange(1, len(seam.history) + 1)
    stages = np.array([record.stage for record in seam.history])
    objective = np.array([record.objective for record in seam.history])
    density = np.array([float(frame.down[1, 2]) for frame in seam.frames])
    for x, values, title, color in (
        (130, objective, "objective, weighted mass", SEAM),
        (930, density, r"density ρ$_5$ of element 6–7", _BLUE),
    ):
        axis = sheet.axes(x, 80, 620, 270)
        axis.plot(iterations, values, "o-", color=color, markersize=2, linewidth=1.2)
        axis.set_xlim(0, len(iterations) + 1)
        axis.set_xlabel("iteration", fontsize=sheet.points(22), labelpad=3)
        axis.tick_params(labelsize=sheet.points(20), width=0.5, length=2.5)
        axis.spines[["top", "right"]].set_visible(False)
        for start in np.flatnonzero(np.diff(stages)) + 1:
            axis.axvline(start + 0.5, color="0.85", linewidth=0.8, zorder=0)
        for stage in np.unique(stages):
            name = f"stage {stage}" if np.count_nonzero(stages == stage) > 0.15 * len(stages) else f"{stage}"
            axis.annotate(
                name,
                (iterations[stages == stage].mean(), 1),
                xycoords=("data", "axes fraction"),
                xytext=(0, 3),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=sheet.points(20),
                color=GRAY,
            )
        sheet.words(title, x, 22, color=color)
    sheet.figure.axes[0].set_yscale("log")
    inner = objective[objective < 1e3 * objective[-1]]
    sheet.figure.axes[0].set_ylim(0.5 * inner.min(), 2 * inner.max())
    plain_numbers(sheet.figure.axes[0].yaxis)
    if len(inner) < len(objective):
        sheet.words(f"up to ${scientific(objective.max())}$", 144, 84, color=SEAM)
    sheet.figure.axes[1].set_ylim(-0.05, 1.1)
    count = 8
    shown = np.unique(np.linspace(0, len(seam.frames) - 1, count).round().astype(int))
    step = (1600 - 2 * _MARGIN) // count
    for column, index in enumerate(shown):
        frame = seam.frames[index]
        axis = sheet.axes(_MARGIN + column * step, 480, step - 20, step - 20)
        _lattice(axis, 0.15)
        for start, end, value in _elements(seam, frame.right, frame.down):
            axis.plot([start[0], end[0]], [start[1], end[1]], color="0.86", linewidth=0.8, zorder=1)
            if value > 0.02:
                axis.plot(
                    [start[0], end[0]],
                    [start[1], end[1]],
                    color=SEAM,
                    linewidth=4 * value,
                    solid_capstyle="round",
                    zorder=2,
                )
        sheet.words(
            f"iteration {frame.iteration}",
            _MARGIN + column * step + (step - 20) / 2,
            480 + step - 6,
            ha="center",
            color=GRAY,
        )
    sheet.save(FIGURES / "fig-3.07-toy-history.png")
