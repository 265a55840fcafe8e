"""Convergence of the heat: the objective and compliance over the iterations, and a film strip of the
densities.

Like the thesis's Figures 3.12 and 3.16 to 3.23.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam_cli.figures.frames import INK, choose_frames, film_frame, fitted
from toposeam_cli.files.interruption import uninterrupted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COMPLIANCE = "#24539b"
_GRAY = "0.45"
_FRAMES = 8
_DPI = 150
# All lengths of the layout in px.
_WIDTH = 1500
_MARGIN = 20
_GAP = 12
_CURVES = 330
_STRIP = 820
_LABEL = 110
#: Decades of the objective shown above its last value; higher values would flatten the rest of the curve.
_DECADES = 3

Floats32 = npt.NDArray[np.float32]


def check_matplotlib() -> None:
    """Refuse a figure for want of matplotlib, before a seam is searched for it.

    Raises
    ------
    MissingPackageError
        When matplotlib is not installed.
    """
    try:
        with uninterrupted():  # matplotlib would take Ctrl-C for a failed optional import, and go on
            import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise ts.MissingPackageError(
            "--history needs matplotlib; install it with: pip install matplotlib"
        ) from error


def history_figure(
    seam: ts.seam.Seam, suffix: str = ".png", *, frames: int = _FRAMES, curves: bool = True
) -> bytes:
    """Draw the history of a seam that was found with ``record_frames=True``.

    Parameters
    ----------
    seam : Seam
    suffix : {".png", ".svg", ".pdf"}
    frames : int
        Frames in the film strip, at most.
    curves : bool
        Whether the curves are drawn above the film strip.

    Returns
    -------
    bytes
        The file's content, the same for the same seam.

    Raises
    ------
    MissingPackageError
        When matplotlib is not installed.
    """
    check_matplotlib()
    import matplotlib as mpl
    from matplotlib.figure import Figure

    chosen = choose_frames(seam.frames, frames)
    strip = None if not chosen else _Strip.fitting(chosen)
    top = (50 + _CURVES + 80) if curves else _MARGIN
    height = top + (0 if strip is None else strip.height + _MARGIN)
    file_format = suffix.removeprefix(".")
    undated: dict[str, dict[str, Any]] = {
        "png": {"Software": None},
        "svg": {"Date": None},
        "pdf": {"CreationDate": None},
    }
    buffer = io.BytesIO()
    with mpl.rc_context(
        {
            **mpl.rcParamsDefault,
            "backend": "agg",
            "font.size": 9.0,
            "axes.linewidth": 0.6,
            "svg.hashsalt": "toposeam",
        }
    ):
        figure = Figure(figsize=(_WIDTH / _DPI, height / _DPI), dpi=_DPI)
        if curves:
            _curves(
                figure.add_axes(
                    (110 / _WIDTH, 1 - (50 + _CURVES) / height, (_WIDTH - 220) / _WIDTH, _CURVES / height)
                ),
                seam,
            )
        if strip is not None:
            _film_strip(figure, seam, chosen, strip, top, height)
        figure.savefig(buffer, format=file_format, metadata=undated.get(file_format))
    return buffer.getvalue()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Strip:
    """Layout of the frames, in px."""

    columns: int
    rows: int
    #: Height and width of the space of a frame.
    cell: tuple[int, int]
    #: Height and width of the frame drawn in it.
    picture: tuple[int, int]

    #: Space above each row for the stages, and below it for the iterations.
    head, foot = 44, 34

    @classmethod
    def fitting(cls, frames: list[ts.optimize.Frame]) -> _Strip:
        """Choose the number of columns that makes frames largest; a gap in the last row counts against it."""
        shape = film_frame(frames[0]).shape[:2]
        best, best_score = None, 0.0
        for rows in range(1, len(frames) + 1):
            columns = -(-len(frames) // rows)
            width = (_WIDTH - 2 * _MARGIN - (columns - 1) * _GAP) // columns
            height = max(24, _STRIP // rows - cls.head - cls.foot)
            picture = fitted(shape, (height, width))
            score = picture[0] * (1.0 if rows * columns == len(frames) else 0.7)
            if score > 1.1 * best_score:
                best, best_score = (
                    cls(columns=columns, rows=rows, cell=(picture[0], width), picture=picture),
                    score,
                )
        assert best is not None  # noqa: S101 - there is at least one frame
        return best

    @property
    def height(self) -> int:
        """Height of the strip."""
        return self.rows * (self.head + self.cell[0] + self.foot)


def _film_strip(
    figure: Figure, seam: ts.seam.Seam, frames: list[ts.optimize.Frame], strip: _Strip, top: int, height: int
) -> None:
    cell_height, cell_width = strip.cell
    used = strip.columns * cell_width + (strip.columns - 1) * _GAP
    left = (_WIDTH - used) // 2
    for row in range(strip.rows):
        upper = top + row * (strip.head + cell_height + strip.foot) + strip.head
        placed = list(enumerate(frames[row * strip.columns : (row + 1) * strip.columns]))
        for column, frame in placed:
            x = left + column * (cell_width + _GAP) + (cell_width - strip.picture[1]) // 2
            axis = figure.add_axes(
                (
                    x / _WIDTH,
                    1 - (upper + cell_height) / height,
                    strip.picture[1] / _WIDTH,
                    strip.picture[0] / height,
                )
            )
            axis.imshow(
                film_frame(frame, seam.problem.overlap.shared, strip.picture),
                interpolation="nearest",
                aspect="auto",
            )
            axis.axis("off")
            label = f"iteration {frame.iteration}" if cell_width > _LABEL else f"{frame.iteration}"
            figure.text(
                (x + strip.picture[1] / 2) / _WIDTH,
                1 - (upper + cell_height + 8) / height,
                label,
                ha="center",
                va="top",
                fontsize=7.5,
                color="0.2",
            )
        for stage, group in groupby(placed, key=lambda item: item[1].stage):
            columns = [column for column, _ in group]
            first = left + columns[0] * (cell_width + _GAP) + (cell_width - strip.picture[1]) // 2
            last = left + columns[-1] * (cell_width + _GAP) + (cell_width + strip.picture[1]) // 2
            y = 1 - (upper - 10) / height
            figure.add_artist(_line((first / _WIDTH, last / _WIDTH), (y, y)))
            figure.text(
                first / _WIDTH,
                1 - (upper - 16) / height,
                f"stage {stage}",
                ha="left",
                va="bottom",
                fontsize=7.5,
                color=_GRAY,
            )


def _line(x: tuple[float, float], y: tuple[float, float]) -> Any:
    from matplotlib.lines import Line2D

    return Line2D(x, y, color="0.7", linewidth=0.8, solid_capstyle="butt")


def _curves(axis: Any, seam: ts.seam.Seam) -> None:
    if not seam.history:
        axis.axis("off")
        axis.text(
            0.5,
            0.5,
            "no iterations: nothing was left to decide",
            ha="center",
            va="center",
            color=_GRAY,
            transform=axis.transAxes,
        )
        return
    ink = tuple(value / 255 for value in INK)
    iterations = np.arange(1, len(seam.history) + 1)
    objective = np.array([record.objective for record in seam.history])
    compliance = np.array([record.compliance for record in seam.history])
    bound = np.array([record.bound for record in seam.history])
    stages = np.array([record.stage for record in seam.history])
    axis.plot(iterations, objective, color=ink, linewidth=1.4)
    axis.set_yscale("log")
    highest = 10**_DECADES * objective[-1]
    if objective.max() > highest > 0:
        axis.set_ylim(top=highest, bottom=objective[objective > 0].min() / 2)
        axis.annotate(
            f"up to ${scientific(objective.max())}$",
            (0, 1),
            xycoords="axes fraction",
            xytext=(6, -4),
            textcoords="offset points",
            ha="left",
            va="top",
            fontsize=7.5,
            color=ink,
        )
    axis.set_xlabel("iteration", labelpad=4)
    axis.set_ylabel("objective: weighted mass (solid)", color=ink, fontsize=8)
    axis.xaxis.get_major_locator().set_params(integer=True)
    twin = axis.twinx()
    twin.set_yscale("log")
    for stage in np.unique(stages):
        at = iterations[stages == stage]
        twin.plot(
            [at[0] - 0.5, at[-1] + 0.5],
            bound[stages == stage][[0, -1]],
            color=_COMPLIANCE,
            linewidth=0.8,
            alpha=0.5,
        )
        label = f"stage {stage}" if len(at) > 0.06 * len(stages) else f"{stage}"
        axis.annotate(
            label,
            ((at[0] + at[-1]) / 2, 1),
            xycoords=("data", "axes fraction"),
            xytext=(0, 4),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=7.5,
            color=_GRAY,
        )
    twin.plot(iterations, compliance, color=_COMPLIANCE, linestyle=(0, (1, 1.5)), linewidth=1.6)
    bounded = bool(np.isfinite(bound).any())
    twin.set_ylabel(
        "compliance (dotted)" + (", bound C* (thin)" if bounded else ""), color=_COMPLIANCE, fontsize=8
    )
    for start in np.flatnonzero(np.diff(stages)) + 1:
        axis.axvline(start + 0.5, color="0.8", linewidth=0.8, zorder=0)
    for side in (axis, twin):
        plain_numbers(side.yaxis)
    axis.set_xlim(0.5, len(iterations) + 0.5)
    for side in (axis, twin):
        side.spines["top"].set_visible(False)
        side.tick_params(which="both", width=0.6, labelsize=8)


def plain_numbers(axis: Any) -> None:
    """Set the ticks of a logarithmic axis at powers of ten, and at 2 and 5 times these if its ends differ by
    less than 200 times.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 200 * low else (1,)))
    axis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{value:g}" if 0.001 <= value < 1e4 else f"${scientific(value)}$")
    )
    axis.set_minor_formatter(NullFormatter())


def scientific(value: float) -> str:
    """Return a number as mathtext, to one digit: 2·10^{14}."""
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"10^{{{int(exponent)}}}" if mantissa == "1" else f"{mantissa}·10^{{{int(exponent)}}}"
