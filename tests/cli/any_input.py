"""What the tests beside this have in common."""

import os
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from hypothesis import HealthCheck, settings

from toposeam_cli.app.main import main
from toposeam_cli.media.pictures.picture import Picture

FULL = {"uint8": 255, "uint16": 65535, "float32": 1.0}


quick = settings(
    max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)


#: The full measure is TOPOSEAM_FUZZ=32.
thorough = settings(
    max_examples=75 * int(os.environ.get("TOPOSEAM_FUZZ", "1")),
    deadline=None,
    suppress_health_check=list(HealthCheck),
)


@dataclass(frozen=True)
class Ran:
    code: int
    out: str
    err: str


def run(folder, *arguments):
    """Run the command on files in a folder; anything but success or one sentence fails the test."""
    result = CliRunner().invoke(
        main, [word if word.startswith("-") or "." not in word else f"{folder}/{word}" for word in arguments]
    )
    ran = Ran(result.exit_code, result.stdout, result.stderr)
    assert result.exc_info[0] is SystemExit, result
    assert "something went wrong" not in ran.err, (ran, arguments)
    if ran.code == 0:
        assert not ran.err or ran.err.startswith("warning: "), ran
    else:
        assert re.fullmatch(r"(Usage: .*\n(Try .*\n)?\n)?Error: .{10,}\n", ran.err), (ran, arguments)
        assert ran.out == "", ran
    return ran


def names(folder):
    return {path.name for path in Path(folder).iterdir()}


@dataclass
class Expected:
    """Two pictures on their canvas, worked out the plain way."""

    a: Picture
    b: Picture
    x: int
    y: int
    shape: tuple[int, int] = field(init=False)

    def __post_init__(self):
        heights, widths = (self.a.pixels.shape[i] for i in (0, 1)), (self.b.pixels.shape[i] for i in (0, 1))
        (ha, wa), (hb, wb) = tuple(heights), tuple(widths)
        self.left, self.top = min(0, self.x), min(0, self.y)
        self.shape = (max(ha, self.y + hb) - self.top, max(wa, self.x + wb) - self.left)

    def placed(self, picture, x, y):
        """Colour and opacity of one picture on the canvas, 0 where it has no pixels."""
        height, width = picture.pixels.shape[:2]
        place = np.s_[y - self.top : y - self.top + height, x - self.left : x - self.left + width]
        dtype = picture.pixels.dtype
        opacity = np.zeros(self.shape, dtype)
        opacity[place] = FULL[dtype.name] if picture.alpha is None else picture.alpha
        colour = np.zeros((*self.shape, *picture.pixels.shape[2:]), dtype)
        colour[place] = picture.pixels
        colour[opacity == 0] = 0
        return colour, opacity

    def check(self, result, b_shows):
        """The result shows A or B at every pixel, as the labels say, and every pixel that one of them
        covers.
        """
        (colour_a, alpha_a), (colour_b, alpha_b) = (
            self.placed(self.a, 0, 0),
            self.placed(self.b, self.x, self.y),
        )
        assert result.pixels.shape[:2] == self.shape
        assert result.pixels.dtype == self.a.pixels.dtype
        opacity = (
            np.full(self.shape, FULL[alpha_a.dtype.name], alpha_a.dtype)
            if result.alpha is None
            else result.alpha
        )
        np.testing.assert_array_equal(opacity > 0, (alpha_a > 0) | (alpha_b > 0))
        assert not (b_shows & (alpha_b == 0)).any()
        assert not (~b_shows & (alpha_a == 0) & (alpha_b > 0)).any()
        np.testing.assert_array_equal(opacity, np.where(b_shows, alpha_b, alpha_a))
        shows = b_shows if colour_a.ndim == 2 else b_shows[..., np.newaxis]
        np.testing.assert_array_equal(result.pixels, np.where(shows, colour_b, colour_a))
