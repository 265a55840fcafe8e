"""Displacements of pictures on the canvas as one robust sparse least-squares problem.

Each picture i has a transform T_i to the canvas and a displacement D_i on it, a uniform cubic B-spline over
the picture. Wanted are displacements with which

- matches meet: T_i(p) + D_i(p) = T_j(q) + D_j(q), robustly, at most some of a cell counting fully;
- lines stay straight: a point of a line stays on the line between its moved ends;
- lines outside the overlaps, and upright ones, do not turn: what stands has one depth, so parallax moves it;
- displacements are small, and change little, least of all outside the overlaps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
from scipy import sparse
from scipy.sparse import linalg

from toposeam.arrays import Floats, Indices
from toposeam.layers.canvas.transforms import MeshTransform, Transform, unbent

#: Cells of a picture at most, and of coarse meshes, and their least side, px.
_CELLS, _FEW_CELLS, _CELL = 1200, 300, 32.0
#: Weights of a displacement, and of its first and second differences from node to node, inside the overlaps
#: and outside.
_ZERO, _FIRST, _SECOND = 1e-3, (0.002, 0.2), (0.03, 1.0)
#: Weight of a point of a line for each 100 px of its length, at most so many; and that of its direction.
_STRAIGHT, _MOST_STRAIGHT, _TURN = 4.0, 12.0, 0.5
#: Largest ratio of width to height of a line that stands upright, and the degrees that it may turn freely.
_UPRIGHT, _FREE_TURN = 0.25, 2.0
#: Matches of one cell weigh together as much as so many.
_MOST_OF_CELL = 3.0
#: Largest scale of the robust weight of a flow, px.
_FLOW_SCALE = 6.0


def flat_meshes(
    transforms: Sequence[Transform], sizes: Sequence[tuple[int, int]], *, coarse: bool = False
) -> list[MeshTransform]:
    """Return transforms with meshes that displace nothing."""
    meshes = []
    for transform, (width, height) in zip(transforms, sizes, strict=True):
        cell = max(_CELL, float(np.sqrt(width * height / (_FEW_CELLS if coarse else _CELLS))))
        shape = (int(np.ceil(height / cell)) + 3, int(np.ceil(width / cell)) + 3, 2)
        meshes.append(MeshTransform(unbent(transform), (width, height), cell, np.zeros(shape)))
    return meshes


def finer(meshes: Sequence[MeshTransform]) -> list[MeshTransform]:
    """Return meshes of smaller cells that displace about as coarse ones do, to begin with."""
    flat = flat_meshes([one.base for one in meshes], [one.size for one in meshes])
    return [
        replace(one, coefficients=coarse.shift(_nodes(one)).reshape(one.coefficients.shape))
        for one, coarse in zip(flat, meshes, strict=True)
    ]


#: Rows of points off their lines and of the lines' turns, the line of each point and its weight, and of each
#: line its span on the canvas, whether it lies outside, stands upright, and is shown.
_Lines: TypeAlias = tuple[sparse.csr_array, sparse.csr_array, Indices, Floats, Floats, Floats]
#: Numbers of two pictures, (M,), and points of each that show the same, (M, 2) px.
Matches: TypeAlias = tuple[Indices, Indices, Floats, Floats]


def solved(
    meshes: Sequence[MeshTransform],
    lines: Sequence[Floats],
    matches: Matches,
    scales: Sequence[float],
    flow: tuple[Matches, Floats, Floats] | None = None,
) -> list[MeshTransform]:
    """Find the displacements by reweighted least squares, from those of the meshes on.

    Parameters
    ----------
    meshes : sequence of MeshTransform
        Of all pictures.
    lines : sequence of (K, 4) arrays
        x and y of both ends of each picture's lines, px.
    matches : Matches
    scales : sequence of float
        px, round after round: a match that is so far off counts a quarter.
    flow : (matches, normal, weight), optional
        Points that meet across (M, 2) directions only, with (M,) weights.
    """
    total = sum(map(_count, meshes))
    rows, want = _differences(meshes, matches)
    cells = np.stack([*matches[:2], *(matches[2] // meshes[0].cell).astype(int).T], axis=1)
    _, cell, crowd = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    plain = np.minimum(1, _MOST_OF_CELL / crowd[cell.ravel()])
    coefficients = np.concatenate([one.coefficients.reshape(-1, 2) for one in meshes])
    prior, held = _prior(meshes), _line_rows(meshes, lines)
    worst = np.zeros(0 if held is None else len(held[4]))
    for scale in scales:
        left = want - rows @ coefficients
        weight = plain / (1 + (left**2).sum(axis=1) / scale**2) ** 2
        weighted = rows.T @ sparse.diags_array(weight)
        system, right = prior + weighted @ rows, (weighted @ want).T.ravel()
        both = sparse.block_diag([system, system], format="csr")
        if flow is not None and len(flow[2]):
            more, value = _flow_terms(meshes, flow, coefficients, min(scale, _FLOW_SCALE))
            both, right = both + more, right + value
        if held is not None:
            more, worst = _line_terms(held, coefficients, worst)
            both = both + more
        factors = linalg.splu(
            both.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0,
            options={"SymmetricMode": True},
        )
        coefficients = factors.solve(right).reshape(2, total).T
    parts = np.split(coefficients, np.cumsum([_count(one) for one in meshes])[:-1])
    return [
        MeshTransform(one.base, one.size, one.cell, part.reshape(one.coefficients.shape))
        for one, part in zip(meshes, parts, strict=True)
    ]


def _count(mesh: MeshTransform) -> int:
    return int(mesh.coefficients.size) // 2


def _flow_terms(
    meshes: Sequence[MeshTransform], flow: tuple[Matches, Floats, Floats], coefficients: Floats, scale: float
) -> tuple[sparse.csr_array, Floats]:
    matches, normal, weight = flow
    rows, want = _differences(meshes, matches)
    across, along = _both(rows, normal), (want * normal).sum(axis=1)
    left = along - across @ coefficients.T.ravel()
    heavy = across.T @ sparse.diags_array(weight / (1 + left**2 / scale**2) ** 2)
    return heavy @ across, heavy @ along


def _line_terms(held: _Lines, coefficients: Floats, worst: Floats) -> tuple[sparse.csr_array, Floats]:
    """Return the matrix of the lines, and the largest turn of each, degrees, up to now."""
    straight, turns, owner, weight, span, kinds = held
    now = span + turns @ coefficients
    normal = np.stack([-now[:, 1], now[:, 0]], axis=1)
    normal /= np.maximum(np.hypot(*now.T), 1e-9)[:, None]
    aside = _both(straight, normal[owner])
    unit = span / np.hypot(*span.T)[:, None]
    normal = np.stack([-unit[:, 1], unit[:, 0]], axis=1)
    turned = np.degrees(np.arctan2((now * normal).sum(axis=1), (now * unit).sum(axis=1)))
    worst = np.maximum(worst, np.abs(turned))
    # small turns of upright lines are free, as the transform itself is not exact to a degree
    outside, upright, shown = kinds.T
    stiff = _TURN * shown * np.maximum(outside, upright * worst**2 / (_FREE_TURN**2 + worst**2))
    turning = _both(turns, normal)
    return (
        aside.T @ sparse.diags_array(weight) @ aside + turning.T @ sparse.diags_array(stiff) @ turning,
        worst,
    )


def _outside(meshes: Sequence[MeshTransform], index: int, points: Floats) -> Floats:
    """Return how far points of a picture lie outside of all others: 0 in an overlap, 1 from two cells on."""
    mesh = meshes[index]
    points = np.clip(points, 0, np.array(mesh.size) - 1.0)
    there, away = mesh.base.to_canvas(points), np.full(len(points), np.inf)
    for k, other in enumerate(meshes):
        if k != index:
            at = other.base.to_picture(there)
            beyond = np.maximum(0, np.maximum(-at, at - (np.array(other.size) - 1.0)))
            away = np.fmin(away, np.hypot(*beyond.T))
    return np.clip(away / (2 * mesh.cell), 0, 1)


def _rows(meshes: Sequence[MeshTransform], index: int, points: Floats) -> sparse.csr_array:
    """Return the (N, nodes of all) matrix that takes coefficients to displacements at points."""
    mesh = meshes[index]
    height, width = mesh.coefficients.shape[:2]
    at = mesh.at(points) - 1
    whole = np.minimum(at.astype(int), np.array([width, height]) - 4)
    weights = [_weights(at[:, axis] - whole[:, axis]) for axis in (0, 1)]
    step = np.arange(4)
    columns = (whole[:, 1, None, None] + step[:, None]) * width + whole[:, 0, None, None] + step
    values = weights[1][:, :, None] * weights[0][:, None, :]
    ends = np.arange(0, 16 * len(points) + 1, 16)
    return sparse.csr_array(
        (values.ravel(), sum(map(_count, meshes[:index])) + columns.ravel(), ends),
        shape=(len(points), sum(map(_count, meshes))),
    )


def _prior(meshes: Sequence[MeshTransform]) -> sparse.csr_array:
    total, start = sum(map(_count, meshes)), 0
    outside = np.concatenate([_outside(meshes, k, _nodes(one)) for k, one in enumerate(meshes)])
    prior = _ZERO * sparse.eye_array(total, format="csr")
    for mesh in meshes:
        number = start + np.arange(_count(mesh)).reshape(mesh.coefficients.shape[:2])
        start += _count(mesh)
        for (low, high), weights, stencil in (
            (_FIRST, (-1.0, 1.0), [number[:, :-1], number[:, 1:]]),
            (_FIRST, (-1.0, 1.0), [number[:-1], number[1:]]),
            (_SECOND, (1.0, -2.0, 1.0), [number[:, :-2], number[:, 1:-1], number[:, 2:]]),
            (_SECOND, (1.0, -2.0, 1.0), [number[:-2], number[1:-1], number[2:]]),
            (
                _SECOND,
                (1.4, -1.4, -1.4, 1.4),
                [number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]],
            ),
        ):
            columns = np.stack([one.ravel() for one in stencil], axis=1)
            rows = _matrix(columns, np.broadcast_to(weights, columns.shape), total)
            far = outside[columns].mean(axis=1)
            prior = prior + rows.T @ sparse.diags_array(low * (high / low) ** far) @ rows
    return prior


def _line_rows(meshes: Sequence[MeshTransform], lines: Sequence[Floats]) -> _Lines | None:
    """Return the rows of points off their lines, and of turns, with what weighs them."""
    straight, turns, owners, weights, spans, held = [], [], [], [], [], []
    count = 0
    for index, (mesh, own) in enumerate(zip(meshes, lines, strict=True)):
        if not len(own):
            continue
        length = np.hypot(own[:, 2] - own[:, 0], own[:, 3] - own[:, 1])
        number = np.maximum(1, (length / (mesh.cell / 2)).astype(int))
        owner = np.repeat(np.arange(len(own)), number)
        first = np.repeat(np.cumsum(number) - number, number)
        share = ((np.arange(len(owner)) - first + 1) / (number[owner] + 1))[:, None]
        points = own[owner, :2] + share * (own[owner, 2:] - own[owner, :2])
        start, end, there = (mesh.base.to_canvas(one) for one in (own[:, :2], own[:, 2:], points))
        span = end - start
        known = np.isfinite(span).all(axis=1) & (np.hypot(*span.T) > 0)
        span = np.where(known[:, None], span, 1.0)
        along = np.nan_to_num(((there - start[owner]) * span[owner]).sum(axis=1))
        along = (along / (span[owner] ** 2).sum(axis=1))[:, None]
        ends = [_rows(meshes, index, one) for one in (own[:, :2], own[:, 2:])]
        middle = _rows(meshes, index, points)
        straight.append(middle - ends[0][owner] * (1 - along) - ends[1][owner] * along)
        turns.append(ends[1] - ends[0])
        owners.append(owner + count)
        heavy = _STRAIGHT * np.minimum(_MOST_STRAIGHT, length / 100) * known
        weights.append(heavy[owner])
        spans.append(span)
        upright = np.abs(span[:, 0]) < _UPRIGHT * np.abs(span[:, 1])
        off = _outside(meshes, index, (own[:, :2] + own[:, 2:]) / 2)
        held.append(np.stack([off, upright, known], axis=1))
        count += len(own)
    if not count:
        return None
    return (
        sparse.vstack(straight, format="csr"),
        sparse.vstack(turns, format="csr"),
        np.concatenate(owners),
        np.concatenate(weights),
        np.concatenate(spans),
        np.concatenate(held),
    )


def _differences(meshes: Sequence[MeshTransform], matches: Matches) -> tuple[sparse.csr_array, Floats]:
    """Return the rows of D_i(p) - D_j(q), and what they are to be: T_j(q) - T_i(p)."""
    i, j, p, q = matches
    total = sum(map(_count, meshes))
    rows, want = sparse.csr_array((len(i), total)), np.zeros((len(i), 2))
    for sign, number, points in ((1, i, p), (-1, j, q)):
        for k, mesh in enumerate(meshes):
            here = np.flatnonzero(number == k)
            if len(here):
                chosen = sparse.csr_array(
                    (np.full(len(here), float(sign)), (here, np.arange(len(here)))),
                    shape=(len(i), len(here)),
                )
                rows = rows + chosen @ _rows(meshes, k, points[here])
                want[here] -= sign * mesh.base.to_canvas(points[here])
    return rows, np.nan_to_num(want)


def _nodes(mesh: MeshTransform) -> Floats:
    """Return the points of the picture, (N, 2) px, that the coefficients belong to; some lie outside."""
    rows, columns = mesh.coefficients.shape[:2]
    x, y = np.meshgrid(np.arange(columns) - (columns - 1) / 2, np.arange(rows) - (rows - 1) / 2)
    return np.stack([x.ravel(), y.ravel()], axis=1) * mesh.cell + (np.array(mesh.size) - 1) / 2


def _weights(t: Floats) -> Floats:
    """Return the (N, 4) weights of a cubic B-spline at shares of a cell."""
    return (
        np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6
    )


def _matrix(columns: Indices, values: Floats, total: int) -> sparse.csr_array:
    each = columns.shape[1]
    ends = np.arange(0, columns.size + 1, each)
    return sparse.csr_array((values.ravel(), columns.ravel(), ends), shape=(len(columns), total))


def _both(rows: sparse.csr_array, normal: Floats) -> sparse.csr_array:
    """Return the rows of displacements along (N, 2) directions, of the x and then the y coefficients."""
    parts = [sparse.diags_array(normal[:, axis]) @ rows for axis in (0, 1)]
    return sparse.hstack(parts, format="csr")
