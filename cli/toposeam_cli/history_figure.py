"""How the heat converged: the objective and compliance over the iterations, and a film strip of the densities.

In kind the thesis's Figures 3.12 and 3.16 to 3.18.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts

#: Interfaces less dense than this are not drawn (thesis, Figure 3.12).
LEAST_DENSITY = 0.1
_FRAMES = 8


def history_figure(seam: ts.Seam, suffix: str = ".png") -> bytes:
    """Draw the history of a seam that was found with ``record_frames=True``.

    Parameters
    ----------
    seam : Seam
    suffix : {".png", ".svg", ".pdf"}

    Returns
    -------
    bytes
        The file's content.

    Raises
    ------
    MissingPackageError
        When matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ts.MissingPackageError("--history needs matplotlib; install it with: pip install 'toposeam[plot]'") from error
    frames = _chosen(seam)
    tall = not frames or frames[0].right.shape[0] >= frames[0].right.shape[1]
    rows = 1 if tall else 2
    columns = max(1, -(-len(frames) // rows))
    figure = Figure(figsize=(10, 6.4), dpi=150, layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=[1, 1.15])
    _curves(upper.subplots(), seam)
    axes = np.atleast_1d(lower.subplots(rows, columns)).ravel()
    for axis in axes:
        axis.axis("off")
    for axis, frame in zip(axes, frames, strict=False):
        axis.imshow(film_frame(frame), interpolation="nearest" if frame.right.shape[0] < 200 else "antialiased")
        axis.set_title(f"iteration {frame.iteration}, stage {frame.stage}", fontsize=8)
    buffer = io.BytesIO()
    figure.savefig(buffer, format=suffix.removeprefix("."))
    return buffer.getvalue()


def film_frame(frame: ts.Frame) -> npt.NDArray[np.uint8]:
    """One frame as a picture: each pixel interface a short line, the redder the denser; (2h + 1, 2w + 1, 3) uint8.

    Corners lie at even rows and columns, pixels at odd ones.
    """
    height, width = frame.right.shape[0], frame.right.shape[1] + 1
    strength = np.zeros((2 * height + 1, 2 * width + 1), np.float32)
    strength[1::2, 2:-1:2] = frame.right
    strength[2:-1:2, 1::2] = frame.down
    strength[strength < LEAST_DENSITY] = 0
    # A corner takes the strength of the lines that meet there.
    corners = strength[::2, ::2]
    lines_y, lines_x = strength[1::2, ::2], strength[::2, 1::2]
    corners[1:] = np.maximum(corners[1:], lines_y)
    corners[:-1] = np.maximum(corners[:-1], lines_y)
    corners[:, 1:] = np.maximum(corners[:, 1:], lines_x)
    corners[:, :-1] = np.maximum(corners[:, :-1], lines_x)
    share = np.sqrt(np.clip(strength, 0, 1))[..., np.newaxis]
    paper, ink = np.array([245, 245, 242], np.float32), np.array([200, 20, 30], np.float32)
    return np.asarray(np.rint(paper + share * (ink - paper)), np.uint8)


def _chosen(seam: ts.Seam) -> list[ts.Frame]:
    """Some frames, evenly spread, with the last of every stage among them."""
    frames = seam.frames
    if len(frames) <= _FRAMES:
        return list(frames)
    last_of_stage = {frame.stage: index for index, frame in enumerate(frames)}
    wanted = set(list(last_of_stage.values())[-_FRAMES:])
    for index in np.linspace(min(3, len(frames) - 1), len(frames) - 1, _FRAMES).round().astype(int):
        if len(wanted) < _FRAMES:
            wanted.add(int(index))
    return [frames[index] for index in sorted(wanted)]


def _curves(axis: Any, seam: ts.Seam) -> None:
    iterations = np.arange(1, len(seam.history) + 1)
    objective = np.array([record.objective for record in seam.history])
    compliance = np.array([record.compliance for record in seam.history])
    stages = np.array([record.stage for record in seam.history])
    axis.plot(iterations, objective, color="#c0182a", label="objective: match-cost-weighted mass")
    axis.set_xlabel("iteration")
    axis.set_ylabel("objective", color="#c0182a")
    axis.set_yscale("log")
    twin = axis.twinx()
    twin.plot(iterations, compliance, color="#24539b", linestyle=":", label="thermal compliance")
    twin.set_ylabel("compliance", color="#24539b")
    twin.set_yscale("log")
    for start in np.flatnonzero(np.diff(stages)) + 1:
        axis.axvline(start + 0.5, color="0.7", linewidth=0.8)
    for stage in np.unique(stages):
        middle = iterations[stages == stage].mean()
        axis.annotate(f"stage {stage}", (middle, 1.01), xycoords=("data", "axes fraction"), ha="center", va="bottom", fontsize=8, color="0.4")
    axis.margins(x=0.01)
    lines = axis.get_lines()[:1] + twin.get_lines()
    axis.legend(lines, [line.get_label() for line in lines], fontsize=8, frameon=False, loc="best")
