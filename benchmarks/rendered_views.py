"""Views of one sphere or one plane, rendered so that it is known exactly where each pixel lies.

What is seen is made of the photographs that come with scikit-image: large ones beside each other, small ones
upon them, and detail at every scale. A large one comes back mirrored, then as a negative. What is seen is
sharper than the views by `DENSITY`. Each view is sampled from it once, by cubic splines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from PIL import Image
from scipy import ndimage
from skimage import data

from toposeam.layers.canvas.transforms import CameraTransform, PlaneTransform, Transform, reach

Floats = np.ndarray
Pixels = np.ndarray

PHOTOGRAPHS = (
    *("astronaut", "coffee", "chelsea", "rocket", "retina", "hubble_deep_field", "immunohistochemistry"),
    *("stereo_motorcycle", "camera", "cell", "coins", "clock", "grass", "moon"),
)
#: px of what is seen for a px of a view, in its middle.
DENSITY = 1.5
#: Blur of what is seen, px of it: a view has a quarter of its contrast left at the finest it can show.
BLUR = 0.8
#: Side of a large photograph, the grid on which they lie, and sides and share of the small ones, px.
PIECE, CELL, SMALL, COVERED = 1400, 900, (90, 400), 0.2
EXPOSURE, NOISE = 0.20, 1.5
#: mm, as on film 36 mm wide; b of the radial distortion; shares of a view.
FOCAL, BARREL, OVERLAP = (24.0, 70.0), (-0.03, 0.02), (0.3, 0.5)
LONG_SIDE, FRAMES = (500, 900), 24
#: Degrees: tilt of a camera before a wall, roll of it and of a scan, and how far a hand is off.
TILT, ROLL, SCAN_ROLL, HAND = 12.0, 3.0, 1.5, 2.0
#: Farthest that views reach round, degrees, unless they reach all the way.
SPAN = 320.0
#: A spline's margin, px.
_MARGIN = 12


@dataclass(frozen=True)
class Views:
    """Pictures, and where each belongs."""

    name: str
    #: As ``Placement.model`` has it.
    model: str
    images: list[Pixels]
    transforms: list[Transform]
    #: px; None before a plane.
    focal: float | None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of each picture."""
        height, width = self.images[0].shape[:2]
        return width, height


@dataclass(frozen=True)
class Scene:
    """What is seen."""

    #: (H, W, 3) uint8.
    pixels: Pixels
    #: Coordinates of its first pixel.
    left: int
    top: int
    #: Whether the last column continues with the first.
    around: bool

    def sample(self, points: Floats) -> Floats:
        """(..., 3) float32 at (..., 2) points."""
        x, y = points[..., 0] - self.left, points[..., 1] - self.top
        first = [math.floor(at.min()) - _MARGIN for at in (y, x)]
        last = [math.ceil(at.max()) + _MARGIN + 1 for at in (y, x)]
        rows, columns = (np.arange(*ends) for ends in zip(first, last, strict=True))
        height, width = self.pixels.shape[:2]
        columns = columns % width if self.around else columns.clip(0, width - 1)
        part = self.pixels[rows.clip(0, height - 1)][:, columns]
        at = [y - first[0], x - first[1]]
        planes = [
            ndimage.map_coordinates(part[..., c].astype(np.float32), at, order=3, mode="mirror")
            for c in range(3)
        ]
        return np.stack(planes, axis=-1)


def make_views(
    rng: np.random.Generator,
    kind: str,
    *,
    most: int = FRAMES,
    lens: bool = False,
    photographs: Sequence[str] = PHOTOGRAPHS,
) -> Views:
    """Render a set in any order; kind is "row", "rows", "turn", "wall" or "scan"."""
    size = _size(rng, landscape=kind == "rows")
    if kind in ("wall", "scan"):
        name, focal, transforms = _before_a_plane(rng, kind, size, most)
    else:
        name, focal, transforms = _from_a_point(rng, kind, size, most, lens)
    seen = scene_for(rng, transforms, size, photographs, around=kind == "turn")
    images, places = [], []
    for number in rng.permutation(len(transforms)):
        images.append(render_view(rng, seen, transforms[number], size))
        places.append(transforms[number])
    model = {"wall": "plane", "scan": "similarity"}.get(kind, "rotation")
    return Views(name, model, images, places, focal if model == "rotation" else None)


def _size(rng: np.random.Generator, landscape: bool) -> tuple[int, int]:
    long = int(rng.integers(LONG_SIDE[0], LONG_SIDE[1] + 1))
    short = round(long * (2 / 3 if rng.random() < 0.5 else 3 / 4))
    return (long, short) if landscape or rng.random() < 0.6 else (short, long)


def _focal(rng: np.random.Generator, size: tuple[int, int], longest: float = FOCAL[1]) -> tuple[float, float]:
    """In mm and px."""
    millimetres = math.exp(rng.uniform(math.log(FOCAL[0]), math.log(longest)))
    return millimetres, millimetres / 36 * max(size)


def _count(rng: np.random.Generator, most: float) -> int:
    """From 2 on, small numbers as often as large ones ten times as far apart."""
    return int(math.exp(rng.uniform(math.log(2), math.log(max(2.0, most) + 0.99))))


def _from_a_point(
    rng: np.random.Generator, kind: str, size: tuple[int, int], most: int, lens: bool
) -> tuple[str, float, list[Transform]]:
    """Rows of pictures by a camera that turns about one point."""
    rows = 2 if kind == "rows" else 1
    while True:
        # So many pictures of a long focal length do not go all the way round.
        millimetres, focal = _focal(rng, size, 45.0 if kind == "turn" else FOCAL[1])
        overlap = rng.uniform(*OVERLAP)
        across, down = (2 * math.atan(side / 2 / focal) for side in size)
        step = across * (1 - overlap)
        if kind != "turn":
            columns = _count(rng, min(most / rows, (math.radians(SPAN) - across) / step))
            break
        columns = math.ceil(2 * math.pi / step)
        step = 2 * math.pi / columns
        if columns <= most:
            break
    barrel = float(rng.uniform(*BARREL)) if lens else 0.0
    radius = focal * DENSITY
    if kind == "turn":
        radius = round(2 * math.pi * radius) / (2 * math.pi)
    transforms: list[Transform] = []
    for row in range(rows):
        for column in range(columns):
            yaw = (column - (columns - 1) / 2) * step
            pitch = (row - (rows - 1) / 2) * down * (1 - overlap)
            off = np.radians(rng.uniform(-HAND, HAND, 3)) * (min(1.0, across), 1, 1)
            transforms.append(
                CameraTransform(
                    size=size,
                    rotation=rotation_of(yaw + off[0], pitch + off[1], off[2]),
                    focal=focal,
                    projection="sphere",
                    radius=radius,
                    lens=(0.0, barrel, 0.0),
                )
            )
    return f"{kind} {millimetres:.0f} mm b {barrel:+.3f}", focal, transforms


def _before_a_plane(
    rng: np.random.Generator, kind: str, size: tuple[int, int], most: int
) -> tuple[str, float, list[Transform]]:
    """Pictures by a camera that is moved before a wall, or by a scanner that does not tilt."""
    millimetres, focal = _focal(rng, size)
    count = _count(rng, most / 2)
    columns = min(count, int(rng.integers(1, 5)) if count > 3 else count)
    overlap = rng.uniform(*OVERLAP)
    tilt, nearer = (TILT, 0.07) if kind == "wall" else (0.0, 0.01)
    transforms: list[Transform] = []
    for number in range(count):
        row, column = divmod(number, columns)
        aim = np.array([column * size[0], row * size[1]]) * (1 - overlap) * DENSITY
        aim += rng.uniform(-0.03, 0.03, 2) * min(size) * DENSITY
        leaning = math.radians(tilt) * math.sqrt(rng.uniform())
        towards = rng.uniform(0, 2 * math.pi)
        roll = math.radians(rng.uniform(-1, 1) * (ROLL if tilt else SCAN_ROLL))
        rotation = rotation_of(leaning * math.cos(towards), leaning * math.sin(towards), roll)
        distance = focal * DENSITY * (1 + rng.uniform(-nearer, nearer))
        to_rays = np.array([[1, 0, -(size[0] - 1) / 2], [0, 1, -(size[1] - 1) / 2], [0, 0, focal]])
        forward = rotation[:, 2]
        from_where = aim - distance * forward[:2] / forward[2]
        to_wall = np.array([[distance, 0, from_where[0]], [0, distance, from_where[1]], [0, 0, 1]])
        matrix = to_wall @ rotation @ to_rays
        transforms.append(PlaneTransform(matrix / matrix[2, 2]))
    return f"{kind} {millimetres:.0f} mm" if tilt else kind, focal, transforms


def rotation_of(yaw: float, pitch: float, roll: float) -> Floats:
    """(3, 3), to the right, down and clockwise, in radians."""
    (cy, cp, cr), (sy, sp, sr) = np.cos([yaw, pitch, roll]), np.sin([yaw, pitch, roll])
    across = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    down = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    return across @ down @ np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])


def render_view(rng: np.random.Generator, seen: Scene, transform: Transform, size: tuple[int, int]) -> Pixels:
    """(H, W, 3) uint8, exposed somehow and noisy."""
    points = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), axis=-1).astype(np.float64)
    view = seen.sample(transform.to_canvas(points)) * (1 + rng.uniform(-EXPOSURE, EXPOSURE))
    return np.clip(np.rint(view + rng.normal(0, NOISE, view.shape)), 0, 255).astype(np.uint8)


def scene_for(
    rng: np.random.Generator,
    transforms: Sequence[Transform],
    size: tuple[int, int],
    photographs: Sequence[str],
    around: bool,
) -> Scene:
    """Just as large as the views need it."""
    reached = np.array([reach(transform, size) for transform in transforms])
    first = np.floor(reached[:, 0].min(axis=0)).astype(int) - 2 * _MARGIN
    last = np.ceil(reached[:, 1].max(axis=0)).astype(int) + 2 * _MARGIN
    width, height = last - first
    if around:
        first[0], width = 0, round(2 * math.pi * transforms[0].radius)  # type: ignore[attr-defined]
    pixels = _painted(rng, int(height), int(width), photographs, around)
    return Scene(pixels, int(first[0]), int(first[1]), around)


def _painted(
    rng: np.random.Generator, height: int, width: int, photographs: Sequence[str], around: bool
) -> Pixels:
    """(height, width, 3) uint8."""
    scene = np.zeros((height, width, 3), np.float32)
    rows, columns = -(-height // CELL), -(-width // CELL)
    cells = [(row, column) for row in range(rows) for column in range(columns)]
    deck: list[tuple[str, int]] = []
    for row, column in rng.permutation(cells):
        if not deck:
            deck = [(name, again) for again in range(4)[::-1] for name in rng.permutation(photographs)]
        name, again = deck.pop()
        photograph = _again(photograph_of(name), again)
        side = min(photograph.shape[:2])
        top, left = (int(rng.integers(0, whole - side + 1)) for whole in photograph.shape[:2])
        part = _resized(photograph[top : top + side, left : left + side], PIECE, PIECE)
        middle = (np.array([row, column]) + 0.5) * (height / rows, width / columns)
        _lay(scene, rng, np.rot90(part, int(rng.integers(4))), middle + rng.uniform(-30, 30, 2), around)
    covered = 0.0
    while covered < COVERED * height * width:
        photograph = photograph_of(photographs[int(rng.integers(len(photographs)))])
        sides = np.exp(rng.uniform(*np.log(SMALL), 2))
        scale = rng.uniform(0.8, 1.6)
        cut = np.minimum(np.rint(sides / scale).astype(int), photograph.shape[:2])
        top, left = (int(rng.integers(0, w - c + 1)) for w, c in zip(photograph.shape[:2], cut, strict=True))
        part = _again(photograph[top : top + cut[0], left : left + cut[1]], int(rng.integers(2)))
        part = _resized(part, *(int(side * scale) for side in cut))
        part = np.clip(part * rng.uniform(0.8, 1.1, 3), 0, 255)
        middle = rng.uniform(0, 1, 2) * (height, width)
        _lay(scene, rng, np.rot90(part, int(rng.integers(4))), middle, around)
        covered += part.shape[0] * part.shape[1] / 2
    scene += _detail(rng, height, width, around)[..., np.newaxis]
    mode = ("nearest", "wrap" if around else "nearest", "nearest")
    return np.clip(ndimage.gaussian_filter(scene, (BLUR, BLUR, 0), mode=mode), 0, 255).astype(np.uint8)


@cache
def photograph_of(name: str) -> Pixels:
    """(H, W, 3) uint8."""
    whole = getattr(data, name)()
    whole = whole[0] if isinstance(whole, tuple) else whole
    return whole if whole.ndim == 3 else np.repeat(whole[..., np.newaxis], 3, axis=2)


def _again(photograph: Pixels, time: int) -> Pixels:
    """As it is, mirrored, as a negative, or both."""
    photograph = photograph[:, ::-1] if time % 2 else photograph
    return 255 - photograph if time >= 2 else photograph


def _resized(part: Pixels, height: int, width: int) -> Pixels:
    image = Image.fromarray(np.ascontiguousarray(part))
    return np.asarray(image.resize((width, height), Image.Resampling.BICUBIC))


def _lay(scene: Pixels, rng: np.random.Generator, part: Pixels, middle: Floats, around: bool) -> None:
    """Put a part into the scene, its borders rough as those of things."""
    height, width = part.shape[:2]
    v, u = np.abs(np.linspace(-1, 1, height)), np.abs(np.linspace(-1, 1, width))
    knots = Image.fromarray(rng.uniform(0, 0.3, (5, 5)).astype(np.float32))
    rough = np.asarray(knots.resize((width, height), Image.Resampling.BICUBIC))
    inside = 1 - np.maximum(v[:, np.newaxis], u) - rough
    shown = np.clip(inside * min(height, width) / 4, 0, 1)[..., np.newaxis]
    rows = np.arange(height) + int(middle[0] - height / 2)
    columns = np.arange(width) + int(middle[1] - width / 2)
    kept = (rows >= 0) & (rows < len(scene))
    if around:
        columns %= scene.shape[1]
        chosen = np.ones(width, bool)
    else:
        chosen = (columns >= 0) & (columns < scene.shape[1])
    at, shown = np.ix_(rows[kept], columns[chosen]), shown[kept][:, chosen]
    scene[at] += shown * (part[kept][:, chosen] - scene[at])


def _detail(rng: np.random.Generator, height: int, width: int, around: bool) -> Floats:
    """(height, width) float32: noise at every scale, here strong and there weak, 8-bit levels."""
    total = np.zeros((height, width), np.float32)
    for period in (1, 2, 4, 8, 16, 32):
        total += _wide(rng, height, width, period, around) * 2.5 * period**0.4
    return total * np.abs(_wide(rng, height, width, 150, around)) ** 1.5


def _wide(rng: np.random.Generator, height: int, width: int, period: int, around: bool) -> Floats:
    """Noise with a grain of so many px."""
    coarse = rng.standard_normal((height // period + 2, max(4, width // period)), np.float32)
    if around:  # each end goes on as the other one begins
        coarse = np.concatenate([coarse, coarse[:, :2]], axis=1)
    box = (0.5, 0.5, coarse.shape[1] - 1.5, coarse.shape[0] - 0.5)
    return np.asarray(Image.fromarray(coarse).resize((width, height), Image.Resampling.BILINEAR, box=box))
