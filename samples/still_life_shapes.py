"""The shapes of the still life: boxes, what a lathe makes, tubes, leaves, blossoms."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
from scipy import ndimage
from scipy.interpolate import PchipInterpolator
from still_life_materials import T, glazed, matt, pages, rgb_of, spine

Dict = dict[str, Any]


def box(low: tuple, high: tuple, bsdf: Any, at: Any = None) -> Dict:
    low, high = np.array(low, float), np.array(high, float)
    place = T().translate(list((low + high) / 2)) @ T().scale(list((high - low) / 2))
    return {"type": "cube", "to_world": place if at is None else at @ place, "bsdf": bsdf}


def book(rng: np.random.Generator, at: tuple, size: tuple) -> Dict:
    """A book that shows its rounded back, and its pages from above."""
    (x, y, z), (w, d, h) = at, size
    colour = rgb_of(rng, 0.04, 0.55)
    a = np.linspace(0, np.pi, 20)
    px = np.concatenate([[x, *(x + w / 2 - w / 2 * np.cos(a)), x + w]])
    py = np.concatenate([[y + d, *(y + 0.012 - 0.011 * np.sin(a)), y + d]])
    s = np.linspace(0, 1, len(px))
    zz, _ = np.meshgrid(np.array([z, z + h]), s, indexing="ij")
    back = surface(
        np.tile(px, (2, 1)),
        np.tile(py, (2, 1)),
        zz,
        glazed(spine(rng, colour), rng.uniform(0.2, 0.45)),
        u=np.tile(np.clip((px - x) / w, 0, 1), (2, 1)),
    )
    return {
        "back": back,
        "pages": box((x + 0.002, y + 0.014, z), (x + w - 0.002, y + d, z + h - 0.004), matt(pages())),
    }


def surface(x: np.ndarray, y: np.ndarray, z: np.ndarray, bsdf: Any, u: np.ndarray | None = None) -> Any:
    """A sheet through (n, m) points."""
    n, m = x.shape
    v, own = np.mgrid[0 : 1 : 1j * n, 0 : 1 : 1j * m]
    return mesh(np.stack([x, y, z], -1), np.stack([own if u is None else u, v], -1), bsdf)


def mesh(points: np.ndarray, uv: np.ndarray, bsdf: Any) -> Any:
    n, m = points.shape[:2]
    index = np.arange(n * m).reshape(n, m)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.concatenate([np.stack([a, b, d], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(
        bsdf
        if bsdf["type"] == "twosided" or bsdf["type"] == "dielectric"
        else {"type": "twosided", "bsdf": bsdf}
    )
    made = mi.Mesh(
        "mesh", n * m, len(faces), has_vertex_normals=True, has_vertex_texcoords=True, props=properties
    )
    along, across = np.gradient(points, axis=0), np.gradient(points, axis=1)
    normal = np.cross(across, along)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    values = mi.traverse(made)
    values["vertex_positions"] = points.reshape(-1).astype(np.float32)
    values["vertex_normals"] = normal.reshape(-1).astype(np.float32)
    values["vertex_texcoords"] = uv.reshape(-1).astype(np.float32)
    values["faces"] = faces.reshape(-1).astype(np.uint32)
    values.update()
    return made


def smooth(profile: list, count: int = 80) -> list:
    """A profile with its corners rounded, by a spline through its points."""
    points = np.array(profile, float)
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    fine = np.linspace(0, s[-1], count)
    dense = PchipInterpolator(s, points)(fine)
    return [tuple(p) for p in ndimage.gaussian_filter1d(dense, 1.0, axis=0, mode="nearest")]


def turned(
    at: tuple, profile: list, bsdf: Any, around: int = 64, tilt: tuple | None = None, about: float = 0.0
) -> Any:
    """What a lathe makes of a profile of (radius, height)."""
    points = np.array(profile if len(profile) >= 40 else smooth(profile), float)
    angle = np.linspace(0, 2 * np.pi, around)
    r, h = points[:, :1], points[:, 1:]
    shape = np.stack([r * np.cos(angle), r * np.sin(angle), h + 0 * angle], -1)
    if tilt is not None:
        spin, lean = np.radians(tilt)
        shape = shape - [0, 0, about]
        shape = (
            shape @ np.array([[np.cos(lean), 0, np.sin(lean)], [0, 1, 0], [-np.sin(lean), 0, np.cos(lean)]]).T
        )
        shape = (
            shape @ np.array([[np.cos(spin), -np.sin(spin), 0], [np.sin(spin), np.cos(spin), 0], [0, 0, 1]]).T
        )
        shape += [0, 0, about]
    v, u = np.mgrid[0 : 1 : 1j * len(points), 0 : 1 : 1j * around]
    return mesh(shape + np.array(at), np.stack([u, v], -1), bsdf)


def ring(at: tuple, radius: float, thick: float, bsdf: Any) -> Any:
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0, 2 * np.pi, 16), indexing="ij")
    out = radius + thick * np.cos(b)
    points = np.stack([out * np.cos(a), thick * np.sin(b), 1.15 * out * np.sin(a)], -1)
    return mesh(points + np.array(at), np.stack([a, b], -1) / (2 * np.pi), bsdf)


def tube(line: np.ndarray, radius: np.ndarray, bsdf: Any) -> Any:
    b = np.linspace(0, 2 * np.pi, 9)
    along = np.gradient(line, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [0.1, 0.97, 0.2])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(along, side)
    points = line[:, None] + radius[:, None, None] * (
        np.cos(b)[:, None] * side[:, None] + np.sin(b)[:, None] * other[:, None]
    )
    v, u = np.mgrid[0 : 1 : 1j * len(line), 0:1:9j]
    return mesh(points, np.stack([u, v], -1), bsdf)


def blade(root: np.ndarray, direction: np.ndarray, long: float, rng: np.random.Generator, bsdf: Any) -> Any:
    """A leaf, folded along its middle and bent down."""
    d = direction / np.linalg.norm(direction)
    side = np.cross(d, [rng.normal(0, 0.3), rng.normal(0, 0.3), 1.0])
    side /= np.linalg.norm(side)
    up = np.cross(side, d)
    t, s = np.mgrid[0:1:10j, -1:1:7j]
    wide = 0.27 * np.sin(np.pi * t**0.75) ** 0.9
    bend = rng.uniform(0.05, 0.4)
    points = root + long * (
        t[..., None] * d
        + (s * wide)[..., None] * side
        + (0.10 * s**2 * wide / 0.27 - bend * t**2)[..., None] * up
    )
    return mesh(points, np.stack([(s + 1) / 2, t], -1), bsdf)


def blossom(
    at: np.ndarray, face: np.ndarray, size: float, petal: Any, heart: Any, rng: np.random.Generator
) -> list:
    f = face / np.linalg.norm(face)
    e = np.cross(f, [0, 0, 1.0])
    e /= np.linalg.norm(e)
    g = np.cross(e, f)
    shapes = []
    for k in range(5):
        a = 2 * np.pi * k / 5 + rng.uniform(-0.1, 0.1)
        d, side = np.cos(a) * e + np.sin(a) * g, -np.sin(a) * e + np.cos(a) * g
        t, s = np.mgrid[0:1:9j, -1:1:9j]
        wide = 0.62 * np.sin(np.pi * np.clip(0.08 + 0.8 * t, 0, 1)) * (1 - 0.12 * (t > 0.99))
        points = at + size * (
            t[..., None] * d + (s * wide)[..., None] * side + (0.45 * t**2 + 0.22 * s**2 * t)[..., None] * f
        )
        shapes.append(mesh(points, np.stack([(s + 1) / 2, t], -1), petal))
    shapes.append(
        {
            "type": "sphere",
            "center": list(map(float, at + 0.12 * size * f)),
            "radius": float(0.2 * size),
            "bsdf": heart,
        }
    )
    return shapes
