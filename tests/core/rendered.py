"""Views rendered from a photograph, of which it is known where each pixel lies."""

import numpy as np
from scipy import ndimage
from skimage import data

import toposeam as ts
from toposeam.layers.canvas import CameraTransform, PlaneTransform


def turn(yaw, pitch=0.0, roll=0.0):
    """(3, 3): to the right, down and clockwise, degrees."""
    (cy, cp, cr), (sy, sp, sr) = (function(np.radians([yaw, pitch, roll])) for function in (np.cos, np.sin))
    across = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    down = np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]])
    return across @ down @ np.array([[cr, -sr, 0], [sr, cr, 0], [0, 0, 1]])


def grid(size, count=17):
    """(count, count, 2) points of a picture of that width and height, its corners among them."""
    return np.stack(np.meshgrid(*(np.linspace(0, side - 1, count) for side in size)), axis=-1)


def around(focal, turns, size, lens=0.0):
    """Cameras on one sphere, as many px per radian."""
    return [
        CameraTransform(
            size=size,
            rotation=turn(*angles),
            focal=focal,
            projection="sphere",
            radius=focal,
            lens=(0.0, lens, 0.0),
        )
        for angles in turns
    ]


def before_a_wall(focal, stands, size):
    """Cameras that look at (x, y) of a plane from some distance, in focal lengths, turned as :func:`turn`."""
    transforms = []
    for x, y, distance, *angles in stands:
        rotation = turn(*angles)
        to_rays = np.array([[1, 0, -(size[0] - 1) / 2], [0, 1, -(size[1] - 1) / 2], [0, 0, focal]])
        off = np.array([x, y]) - distance * focal * rotation[:2, 2] / rotation[2, 2]
        matrix = np.array([[distance * focal, 0, off[0]], [0, distance * focal, off[1]], [0, 0, 1]])
        matrix = matrix @ rotation @ to_rays
        transforms.append(PlaneTransform(matrix / matrix[2, 2]))
    return transforms


def views(scene, transforms, size, names="abcdefghijkl", noise=1.0):
    """Layers that show a scene; (0, 0) of the transforms is its middle."""
    rng = np.random.default_rng(0)
    height, width = scene.shape[:2]
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    points = np.stack([x, y], axis=-1).astype(float)
    layers = []
    for name, transform in zip(names, transforms, strict=False):
        seen = transform.to_canvas(points) + np.array([(width - 1) / 2, (height - 1) / 2])
        view = np.stack(
            [
                ndimage.map_coordinates(scene[..., k].astype(np.float32), seen[..., ::-1].transpose(2, 0, 1))
                for k in range(scene.shape[2])
            ],
            axis=-1,
        )
        assert np.isfinite(seen).all()
        assert (seen >= 0).all()
        assert (seen <= [width - 1, height - 1]).all()
        view = np.clip(np.rint(view + rng.normal(0, noise, view.shape)), 0, 255).astype(np.uint8)
        layers.append(ts.Layer(view, name=name))
    return layers


def corner_error(found, truth, sizes):
    """Largest distance, px, between where pairs of transforms put the corners of the second in the first."""
    worst = 0.0
    for i in range(len(found)):
        for j in range(len(found)):
            points = grid(sizes[j], 9).reshape(-1, 2)
            exact = truth[i].to_picture(truth[j].to_canvas(points))
            common = ((exact >= 0) & (exact <= np.array(sizes[i]) - 1)).all(axis=1)
            if i != j and common.any():
                off = found[i].to_picture(found[j].to_canvas(points[common])) - exact[common]
                worst = max(worst, float(np.hypot(*off.T).max()))
    return worst


def panorama_scene():
    """(400, 600, 3) uint8: a photograph with something everywhere."""
    return data.coffee()


def ring_scene(width, height):
    """(height, width, 3) uint8 photographs side by side, all the way round."""
    parts = [
        data.astronaut()[:, :400],
        data.coffee(),
        255 - data.astronaut()[::-1, 40:440],
        data.coffee()[::-1],
    ]
    each = -(-width // len(parts))
    row = [
        ndimage.zoom(
            part, (height / part.shape[0], each / part.shape[1], 1), order=1, mode="nearest", grid_mode=True
        )
        for part in parts
    ]
    return np.concatenate(row, axis=1)[:, :width]
