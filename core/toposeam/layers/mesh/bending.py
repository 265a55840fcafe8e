"""Bend two pictures by meshes until their seam is cheap.

Matches of all planes give a first mesh. A flow near the seam that it allows gives more, and the mesh is found
again, twice. The cheapest of all seams is taken, the plain one included, and nothing that folds.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toposeam.arrays import Floats
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.transforms import MeshTransform, ReducedTransform, Transform, enlarged
from toposeam.layers.canvas.warping import inside
from toposeam.layers.mesh.equations import Matches, finer, flat_meshes, solved
from toposeam.layers.mesh.flow import flow_near
from toposeam.layers.mesh.lines import find_lines
from toposeam.layers.mesh.trial import is_seen, trial_seam
from toposeam.seam.result.seam import Seam

#: px: scales of the robust weights of matches, first on coarse meshes, which tell the weights as well.
_COARSE_SCALES, _SCALES = (1e9, 10.0, 3.0), (3.0,)
#: Largest cost of the first and of the second seam of bent pictures ÷ that of the plain one, for another
#: round to follow: no later round was seen to take more than a quarter away.
_DEARER = 1.1, 0.8
#: Rounds of flow.
_ROUNDS = 2
#: Least length of a line, px of the reduced picture.
_LINE = 20.0
#: Distance from the seam within which a flow counts, as a share of the reduced picture's diagonal.
_NEAR = 0.1
#: Largest cost of a seam of bent pictures ÷ that of the plain one, and least share to which an area may
#: shrink.
_GAIN, _LEAST_AREA = 0.6, 0.15


def bent(
    copies: Sequence[Layer],
    scales: Sequence[int],
    transforms: Sequence[Transform],
    sizes: Sequence[tuple[int, int]],
    matches: tuple[Floats, Floats],
    cost: float,
) -> tuple[tuple[Transform, ...], bool]:
    """Bend two pictures.

    Parameters
    ----------
    copies : two of Layer
    scales : two of int
        Of :func:`toposeam.layers.mesh.trial.reduced_copies`.
    transforms : two of Transform
        To the canvas.
    sizes : two of (int, int)
        Width and height of the pictures, px.
    matches : two of (M, 2) arrays
        Points of each picture that show the same, px.
    cost : float
        Of the trial seam of the pictures as they are.

    Returns
    -------
    transforms : tuple of Transform
        The given ones where bending does not pay.
    seen : bool
        Whether the trial seam of the bent pictures may be seen; True where they are not bent.
    """
    most = max(scales)
    lines = [
        enlarged(find_lines(np.asarray(copy.image).mean(axis=2), _LINE), scale)
        for copy, scale in zip(copies, scales, strict=True)
    ]
    zeros = np.zeros(len(matches[0]), np.intp)
    points = (zeros, zeros + 1, *matches)
    coarse = solved(flat_meshes(transforms, sizes, coarse=True), lines, points, _COARSE_SCALES)
    meshes = solved(finer(coarse), lines, points, _SCALES)
    best, least, best_seen = tuple(transforms), _GAIN * cost, True
    for number in range(_ROUNDS + 1):
        trial = trial_seam(copies, scales, meshes, most)
        if trial is None:
            break
        seam, layers = trial
        own, seen = float(seam.cost), is_seen(seam, most)
        if own < least and folding(meshes) > _LEAST_AREA:
            best, least, best_seen = tuple(meshes), own, seen
        if number == _ROUNDS or own > _DEARER[number] * cost or not seen:
            break
        flow = _flow(copies, scales, meshes, (seam, layers))
        meshes = solved(meshes, lines, points, _SCALES, flow)
    return best, best_seen


def _flow(
    copies: Sequence[Layer],
    scales: Sequence[int],
    meshes: Sequence[MeshTransform],
    trial: tuple[Seam, Sequence[Layer]],
) -> tuple[Matches, Floats, Floats]:
    """Find points of the pictures, px, that show the same near a trial seam, as :func:`solved` takes them."""
    seam, layers = trial
    reach = _NEAR * float(np.hypot(*copies[0].image.shape[:2]))
    one, other, normal, weight = flow_near(layers, seam.labels, reach)
    p, q = (
        enlarged(ReducedTransform(mesh, max(scales), scale).to_picture(points), scale)
        for mesh, scale, points in zip(meshes, scales, (one, other), strict=True)
    )
    known = inside(p, meshes[0].size) & inside(q, meshes[1].size)
    zeros = np.zeros(int(known.sum()), np.intp)
    return (zeros, zeros + 1, p[known], q[known]), normal[known], weight[known]


def folding(meshes: Sequence[MeshTransform]) -> float:
    """Return the least factor by which meshes change areas anywhere; negative where one folds."""
    least = 1.0
    for mesh in meshes:
        width, height = mesh.size
        x, y = np.meshgrid(np.arange(0, width - 1, mesh.cell / 2), np.arange(0, height - 1, mesh.cell / 2))
        grid = np.stack([x, y], axis=-1)
        areas = []
        for one in (mesh.base, mesh):
            here, right, down = (one.to_canvas(grid + step) for step in ((0, 0), (1, 0), (0, 1)))
            (a, c), (b, d) = (np.moveaxis(step - here, -1, 0) for step in (right, down))
            areas.append(a * d - b * c)
        ratio = areas[1] / areas[0]
        least = min(least, float(np.nanmin(ratio)))
    return least
