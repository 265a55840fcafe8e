"""A sheet of paper measured in pixels: pictures at whole scales, seams drawn over them, and words beside
them.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import Normal, Stroke
from PIL import Image

import toposeam as ts
from toposeam.vector.polyline import trace_boundary
from toposeam_cli.figures.frames import INK

SEAM = tuple(value / 255 for value in INK)
DARK, GRAY, FAINT = "0.13", "0.42", "0.75"

mpl.rcdefaults()
mpl.rcParams.update(
    {
        "font.size": 8.0,
        "axes.linewidth": 0.6,
        "text.color": DARK,
        "axes.labelcolor": DARK,
        "mathtext.default": "regular",
    }
)


class Sheet:
    """A figure whose coordinates are pixels from the upper left corner.

    Parameters
    ----------
    width, height : int
        In px.
    small : int
        Size of small words in px; large ones are a third larger.
    """

    def __init__(self, width: int, height: int, small: int = 22) -> None:
        self.width, self.height, self.small = width, height, small
        self._dpi = 200
        self.figure = Figure(
            figsize=(width / self._dpi, height / self._dpi), dpi=self._dpi, facecolor="white"
        )

    def points(self, px: float) -> float:
        """A length in px as typographic points."""
        return px * 72 / self._dpi

    def axes(self, x: float, y: float, width: float, height: float) -> Axes:
        """Axes with the given upper left corner and size."""
        box = (x / self.width, 1 - (y + height) / self.height, width / self.width, height / self.height)
        return self.figure.add_axes(box)

    def picture(
        self,
        pixels: npt.NDArray[Any],
        x: int,
        y: int,
        scale: int = 1,
        covered: npt.NDArray[np.bool_] | None = None,
    ) -> Axes:
        """A picture, each of its pixels `scale` px large, white where it is not covered; the axes' units are
        its pixels.
        """
        height, width = pixels.shape[:2]
        shown = np.asarray(pixels, float) / (255 if pixels.dtype == np.uint8 else 1)
        if shown.ndim == 2:
            shown = np.repeat(shown[..., np.newaxis], 3, axis=2)
        if covered is not None:
            shown = np.where(covered[..., np.newaxis], shown, 1.0)
        axis = self.axes(x, y, width * scale, height * scale)
        axis.imshow(
            np.clip(shown, 0, 1), extent=(0, width, height, 0), interpolation="nearest", aspect="auto"
        )
        axis.axis("off")
        return axis

    def seam(
        self, axis: Axes, lines: Iterable[ts.vector.Polyline], width: float = 4.0, *, halo: bool = True
    ) -> None:
        """Lines in the seam's red, `width` px wide, on a white halo."""
        effects = [Stroke(linewidth=self.points(2 * width), foreground="white"), Normal()] if halo else []
        for line in lines:
            x, y = line.outline.T
            axis.plot(
                x,
                y,
                color=SEAM,
                linewidth=self.points(width),
                solid_joinstyle="miter",
                solid_capstyle="butt",
                path_effects=effects,
            )

    def dashes(self, axis: Axes, inside: npt.NDArray[np.bool_], within: npt.NDArray[np.bool_]) -> None:
        """The outline of an area, dashed dark on light so that it shows on any picture."""
        for line in trace_boundary(inside, within):
            x, y = line.outline.T
            for color, style in (("white", "-"), ("0.2", (0, (3, 3)))):
                axis.plot(
                    x,
                    y,
                    color=color,
                    linestyle=style,
                    linewidth=self.points(2.0),
                    solid_capstyle="butt",
                    dash_capstyle="butt",
                )

    def words(
        self,
        text: str,
        x: float,
        y: float,
        *,
        large: bool = False,
        color: str | tuple[float, ...] = DARK,
        **options: Any,
    ) -> None:
        """Words whose upper left corner lies at a point, unless ``ha`` and ``va`` say otherwise."""
        size = self.points(self.small * (4 / 3 if large else 1))
        self.figure.text(
            x / self.width,
            1 - y / self.height,
            text,
            fontsize=size,
            color=color,
            **({"ha": "left", "va": "top"} | options),
        )

    def rule(
        self,
        x: Sequence[float],
        y: Sequence[float],
        color: str | tuple[float, ...] = FAINT,
        width: float = 2.0,
    ) -> None:
        """A line through points."""
        self.figure.add_artist(
            Line2D(
                [v / self.width for v in x],
                [1 - v / self.height for v in y],
                color=color,
                linewidth=self.points(width),
                solid_capstyle="butt",
            )
        )

    def save(self, path: Path) -> None:
        """Write the sheet as PNG, the same bytes for the same sheet."""
        buffer = io.BytesIO()
        self.figure.savefig(buffer, format="png", dpi=self._dpi)
        save_png(buffer.getvalue(), path)


def save_png(document: bytes, path: Path) -> None:
    """Write a PNG as small as lossless compression makes it, with a palette where it has few colours."""
    image = Image.open(io.BytesIO(document)).convert("RGB")
    colours = image.getcolors(256)
    if colours is not None:
        image = image.quantize(len(colours), dither=Image.Dither.NONE)
    image.save(path, optimize=True)
