"""Meshes: surfaces as triangles, and as PLY and STL files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Mask
from toposeam.errors import OverlapError
from toposeam.saving import save


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of a surface.

    Iterating gives vertices and faces.

    Examples
    --------
    >>> mesh = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32))
    >>> mesh
    Mesh(3 vertices, 1 faces)
    >>> round(mesh.area, 3)
    0.866
    """

    #: (V, 3) float32, in units of the spacing, along axes 0, 1, 2 (z, y, x); voxel (0, 0, 0) has its middle
    #: at the origin.
    vertices: npt.NDArray[np.float32]
    #: (F, 3) int32, indices of vertices.
    faces: npt.NDArray[np.int32]

    def __repr__(self) -> str:
        return f"Mesh({len(self.vertices)} vertices, {len(self.faces)} faces)"

    def __iter__(self):  # type: ignore[no-untyped-def]
        return iter((self.vertices, self.faces))

    @property
    def area(self) -> float:
        """Area of all triangles, in the spacing's unit squared."""
        return float(np.linalg.norm(self._crosses(), axis=1).sum() / 2)

    @property
    def volume(self) -> float:
        """Volume inside a closed mesh; positive if faces run anticlockwise, seen from outside, x first."""
        x = self.vertices[:, ::-1].astype(np.float64)[self.faces]
        return float(np.einsum("ij,ij->", x[:, 0], np.cross(x[:, 1], x[:, 2])) / 6)

    @property
    def closed(self) -> bool:
        """True if every edge lies between two faces that run along it in opposite directions."""
        ends = self.faces.astype(np.int64)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        along, back = (ends @ step for step in ((len(self.vertices), 1), (1, len(self.vertices))))
        return len(np.unique(along)) == len(along) and np.array_equal(np.sort(along), np.sort(back))

    def to_ply(self, path: str | Path) -> None:
        """Write a binary PLY file, x first; an existing one is replaced.

        Raises
        ------
        OSError
            When the file cannot be written; an existing file is unchanged.
        """
        header = (
            "ply\nformat binary_little_endian 1.0\ncomment made by TopoSeam\n"
            f"element vertex {len(self.vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
            f"element face {len(self.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
        )
        table = np.empty(len(self.faces), [("count", "u1"), ("index", "<i4", 3)])
        table["count"], table["index"] = 3, self.faces
        points = np.ascontiguousarray(self.vertices[:, ::-1], "<f4")
        save(path, header.encode() + points.tobytes() + table.tobytes())

    def to_stl(self, path: str | Path) -> None:
        """Write a binary STL file, x first; an existing one is replaced.

        Raises
        ------
        OSError
            When the file cannot be written; an existing file is unchanged.
        """
        table = np.zeros(
            len(self.faces), [("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("attribute", "<u2")]
        )
        table["corner"] = self.vertices[:, ::-1][self.faces]
        corner = table["corner"].astype(np.float64)
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        table["normal"] = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
        head = b"surface made by TopoSeam".ljust(80) + np.uint32(len(self.faces)).astype("<u4").tobytes()
        save(path, head + table.tobytes())

    def _crosses(self) -> npt.NDArray[np.float64]:
        corner = self.vertices.astype(np.float64)[self.faces]
        return np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def mesh_of(
    labels: Mask,
    spacing: Sequence[float],
    smooth: float = 1.0,
    start: Sequence[int] | npt.NDArray[np.intp] = (0, 0, 0),
    within: Mask | None = None,
) -> Mesh:
    """Triangulate the surface where labels change, by marching cubes.

    Parameters
    ----------
    labels : (d, h, w) bool array
    spacing : three floats
        Depth, height and width of a voxel.
    smooth : float
        Standard deviation, in voxels, of the Gaussian on the labels.
    start : three int
        Index, on the canvas, of the first voxel of `labels`.
    within : (d, h, w) bool array, optional
        Voxels in which the surface is searched; all by default.

    Raises
    ------
    OverlapError
        When the labels are constant.
    """
    from skimage.measure import marching_cubes

    values = labels.astype(np.float32)
    if smooth:
        values = ndimage.gaussian_filter(values, smooth, mode="nearest", truncate=3)
    try:
        vertices, faces, _, _ = marching_cubes(  # type: ignore[no-untyped-call]
            values, 0.5, spacing=tuple(spacing), mask=within
        )
    except (ValueError, RuntimeError) as error:
        raise OverlapError(
            "there is no surface inside the overlap to make a mesh of", kind="no surface"
        ) from error
    shift = np.asarray(start) * np.asarray(spacing)
    return Mesh((vertices + shift).astype(np.float32), faces.astype(np.int32))


def closed_mesh(field: npt.NDArray[np.floating], element: float) -> Mesh:
    """Triangulate the closed surface of the region where a field is above 0, facing outwards.

    Where the region reaches a side of the box, the side is part of the surface.

    Parameters
    ----------
    field : (d, h, w) float array
    element : float
        Side of one element.

    Raises
    ------
    OverlapError
        When the field is nowhere above 0.
    """
    from skimage.measure import marching_cubes

    if not (field > 0).any():
        raise OverlapError("nothing solid is left to make a mesh of; ask for more mass", kind="no surface")
    around = np.pad(field, 1, mode="edge")
    inside = np.zeros(around.shape, bool)
    inside[1:-1, 1:-1, 1:-1] = True
    # Continue the field beyond the box with the opposite sign, so that the surface runs along the box.
    around = np.where(inside, around, -np.abs(around)).astype(np.float32)
    around[around == 0] = -1e-6  # zeros at corners would make triangles without area
    vertices, faces, _, _ = marching_cubes(around, 0.0)  # type: ignore[no-untyped-call]
    mesh = Mesh(((vertices - 0.5) * element).astype(np.float32), faces.astype(np.int32))
    return mesh if mesh.volume > 0 else Mesh(mesh.vertices, mesh.faces[:, ::-1].copy())
