"""Small views of one scene, rendered so that it is known where each of their pixels lies."""

import math

import numpy as np
from scipy import ndimage
from skimage import data, transform
from skimage.registration import phase_cross_correlation

from toposeam.layers.canvas import CameraTransform

#: px of the scene for a px of a view, in its middle.
DENSITY = 1.3


def turned(yaw, pitch=0.0, roll=0.0):
    """(3, 3), degrees to the right, down and clockwise."""
    (cy, cp, cr), (sy, sp, sr) = (f(np.radians([yaw, pitch, roll])) for f in (np.cos, np.sin))
    across = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    down = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    return across @ down @ np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])


def painted(height, width):
    """(height, width, 3) float32 of photographs side by side, the last going over into the first."""
    photographs = [
        data.coffee(),
        data.astronaut()[:300],
        data.chelsea(),
        data.rocket()[:, 120:520],
        data.coffee()[:, ::-1],
        data.astronaut()[200:, ::-1],
    ]
    shape = height, math.ceil(width / len(photographs) / 0.9)
    parts = [transform.resize(one, shape, anti_aliasing=True).astype(np.float32) * 255 for one in photographs]
    scene, weights = np.zeros((height, width, 3), np.float32), np.zeros((1, width, 1), np.float32)
    ramp = np.clip(
        np.minimum(np.arange(shape[1]) + 1, shape[1] - np.arange(shape[1])) / (0.1 * shape[1]), 0, 1
    )
    for index, part in enumerate(parts):
        columns = (np.arange(shape[1]) + index * width // len(parts)) % width
        scene[:, columns] += part * ramp[:, np.newaxis].astype(np.float32)
        weights[:, columns] += ramp[:, np.newaxis].astype(np.float32)
    return scene / weights


class Scene:
    """What is seen all the way round from one point, or on a plane."""

    def __init__(self, width, height):
        self.pixels = painted(height, width)
        self.width, self.height = width, height

    @property
    def radius(self):
        """px per radian."""
        return self.width / (2 * math.pi)

    def sample(self, points):
        """(..., 3) float32 at (..., 2) points, 0,0 in the middle."""
        x = (points[..., 0] + self.width / 2) % self.width
        y = points[..., 1] + self.height / 2
        planes = [
            ndimage.map_coordinates(self.pixels[..., c], [y, x], order=3, mode="grid-wrap") for c in range(3)
        ]
        return np.clip(np.stack(planes, axis=-1), 0, 255)

    def camera(self, size, focal, *angles):
        """A camera of that focal length, px, that looks somewhere."""
        return CameraTransform(
            size=size, rotation=turned(*angles), focal=focal, projection="sphere", radius=self.radius
        )


def grid(width, height):
    """(height, width, 2) x and y of pixels."""
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(np.float64)


def view(scene, transform, size, noise=1.0):
    """(H, W, 3) uint8."""
    seen = scene.sample(transform.to_canvas(grid(*size)))
    rng = np.random.default_rng(round(1000 * abs(seen.sum())) % 2**32)
    return np.clip(np.rint(seen + rng.normal(0, noise, seen.shape)), 0, 255).astype(np.uint8)


def farthest_off(scene, joined, origin, found, true, box=56, step=40):
    """Distances, px, by which parts of a joined picture lie elsewhere than the scene has them, as one view
    tells where it belongs: found on the canvas, whose first pixel is `origin`, and truly in the scene.
    """
    height, width = joined.shape[:2]
    at = true.to_canvas(found.to_picture(grid(width, height) + np.array(origin)))
    seen = scene.sample(np.nan_to_num(at)).mean(axis=-1)
    gray = joined[..., :3].astype(float).mean(axis=-1)
    whole = np.isfinite(at).all(axis=-1) & (joined[..., 3] == 255 if joined.shape[2] == 4 else True)
    off = []
    for top in range(0, height - box + 1, step):
        for left in range(0, width - box + 1, step):
            part = np.s_[top : top + box, left : left + box]
            if whole[part].all() and min(np.abs(np.gradient(seen[part], axis=k)).mean() for k in (0, 1)) > 2:
                moved = phase_cross_correlation(seen[part], gray[part], upsample_factor=20)[0]
                off.append(float(np.hypot(*moved)))
    return off
