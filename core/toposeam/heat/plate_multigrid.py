r"""Conjugate gradients with a geometric multigrid V-cycle, for plates of four-node elements.

*Coarsening.* A coarse element covers 2 × 2 fine ones. With P the bilinear interpolation from its corners, its
matrix is the exact Galerkin product Σ Pᵀ K_e P over its children: a fixed linear map on the ten entries of a
symmetric 4 × 4 matrix. An odd number of elements is filled up with empty ones, which is exact as well, but
only where the border is free; elsewhere coarsening ends there.

*Corners* of an element, and the ten entries in their order::

    0 ── 1      00 01 02 03
    │    │         11 12 13
    2 ── 3            22 23
                         33

*Smoothing.* Two damped Jacobi sweeps before and two after, with the dampings of the Chebyshev polynomial of
degree two. The largest eigenvalue of D⁻¹K is at most that of an element, 3/2 for a square, at any
contrast. Sweeps run in single precision, the conjugate gradients around them in double.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import coo_array, dia_array
from scipy.sparse.linalg import splu

from toposeam.arrays import Floats, Floats32, Ints32
from toposeam.errors import SolverError
from toposeam.heat.conjugate import DAMPING, Solved, conjugate_gradients
from toposeam.heat.plate_joints import Groups, Joint, Shift

#: The ten entries of a symmetric 4 × 4 element matrix.
ENTRIES = [(a, b) for a in range(4) for b in range(a, 4)]
#: Most nodes of the coarsest level, where the plate can be coarsened so far.
_COARSEST_NODES = 400
#: Most unknowns of a system that is factorised as a dense matrix.
_DENSE_NODES = 500


def pack(matrix: Floats) -> Floats:
    """Return the ten entries of a symmetric 4 × 4 matrix."""
    return np.array([matrix[a, b] for a, b in ENTRIES])


@lru_cache(maxsize=1)
def _galerkin() -> Floats:
    """Compute the maps from the ten entries of each of 2 × 2 children to those of the coarse element.

    Returns a (4, 10, 10) array.
    """
    maps = np.zeros((4, len(ENTRIES), len(ENTRIES)))
    for child in range(4):
        cy, cx = divmod(child, 2)
        weights = np.zeros((4, 4))
        for corner in range(4):
            ny, nx = divmod(corner, 2)
            y, x = (cy + ny) / 2, (cx + nx) / 2
            weights[corner] = [(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x]
        for column, (a, b) in enumerate(ENTRIES):
            unit = np.zeros((4, 4))
            unit[a, b] = unit[b, a] = 1.0
            maps[child, :, column] = pack(weights.T @ unit @ weights)
    return maps


def coarsen(elements: npt.NDArray[np.floating], patterns: Floats) -> Floats:
    """Compute the element matrices of the next coarser plate.

    Parameters
    ----------
    elements : (P, h, w) float array
        Coefficients of `patterns` for every element.
    patterns : (10, P) float array
        The element matrix of an element is the sum of the patterns with its coefficients.

    Returns
    -------
    (10, ceil(h / 2), ceil(w / 2)) float array
    """
    _, h, w = elements.shape
    if h % 2 or w % 2:
        elements = np.pad(elements, ((0, 0), (0, h % 2), (0, w % 2)))
    shape = elements.shape[1] // 2, elements.shape[2] // 2
    result = np.zeros((len(ENTRIES), shape[0] * shape[1]))
    for child, galerkin in enumerate(_galerkin()):
        cy, cx = divmod(child, 2)
        part = elements[:, cy::2, cx::2].reshape(len(elements), -1)
        result += (galerkin @ patterns) @ part
    return result.reshape(-1, *shape)


class Stencil:
    """A plate's matrix as nine diagonals over its (h + 1) × (w + 1) nodes.

    Parameters
    ----------
    couplings : five (h + 1, w + 1) float arrays
        The diagonal, and each node's coupling to its right, lower, lower right neighbour, and of its right
        neighbour to its lower one.
    groups : Groups
    """

    def __init__(self, couplings: tuple[Floats, Floats, Floats, Floats, Floats], groups: Groups) -> None:
        self.couplings, self.groups = couplings, groups
        self.nodes_across = couplings[0].shape[1]

    def matrix(self, dtype: type[np.floating]) -> dia_array:
        """Assemble the matrix before border nodes are joined."""
        diagonal, right, down, falling, rising = self.couplings
        n, w = diagonal.size, self.nodes_across
        offsets = np.array([0, -1, 1, -w, w, -w - 1, w + 1, -(w - 1), w - 1])
        data = np.zeros((9, n), dtype)
        data[0] = diagonal.ravel()
        for row, (values, offset) in enumerate(((right, 1), (down, w), (falling, w + 1))):
            flat = values.ravel()
            data[1 + 2 * row] = flat
            data[2 + 2 * row, offset:] = flat[: n - offset]
        flat = rising.ravel()  # stored at the upper left corner of its element: joins node + 1 to node + w
        data[7, 1:] = flat[: n - 1]
        data[8, w:] = flat[: n - w]
        return dia_array((data, offsets), shape=(n, n))

    def diagonal(self) -> Floats:
        """Compute the diagonal of the joined matrix, (N,) floats."""
        values: Floats = self.couplings[0].ravel().copy()
        self.groups.gather(values)
        return values


def stencil(elements: npt.NDArray[np.floating], groups: Groups) -> Stencil:
    """Assemble (10, h, w) element matrices."""
    _, h, w = elements.shape
    k = dict(zip(ENTRIES, elements, strict=True))
    diagonal, right, down, falling, rising = (np.zeros((h + 1, w + 1)) for _ in range(5))
    diagonal[:-1, :-1] = k[0, 0]
    diagonal[:-1, 1:] += k[1, 1]
    diagonal[1:, :-1] += k[2, 2]
    diagonal[1:, 1:] += k[3, 3]
    right[:-1, :-1] = k[0, 1]
    right[1:, :-1] += k[2, 3]
    down[:-1, :-1] = k[0, 2]
    down[:-1, 1:] += k[1, 3]
    falling[:-1, :-1] = k[0, 3]
    rising[:-1, :-1] = k[1, 2]
    return Stencil((diagonal, right, down, falling, rising), groups)


@dataclass(frozen=True, slots=True, eq=False)
class _Joined:
    """Where the entries of nine diagonals lie in the joined matrix."""

    #: Number of every node's temperature θ', a node of each temperature, and the number of temperatures.
    number: Ints32
    first: npt.NDArray[np.intp]
    count: int
    #: Flat indices of the entries within the matrix, and their rows and columns in the joined one.
    kept: npt.NDArray[np.intp]
    rows: npt.NDArray[np.int64]
    columns: npt.NDArray[np.int64]


@lru_cache(maxsize=16)
def _joined(groups: Groups, nodes: int, offsets: tuple[int, ...]) -> _Joined:
    """Return where the entries of diagonals lie in the matrix of joined nodes."""
    number, count = groups.numbering(nodes)
    column = np.arange(nodes)
    row = column - np.array(offsets)[:, np.newaxis]
    kept = np.flatnonzero((row >= 0) & (row < nodes))
    first = np.unique(number, return_index=True)[1]
    wide = number.astype(np.int64)
    return _Joined(number, first, count, kept, wide[row.ravel()[kept]], wide[kept % nodes])


class DirectSolver:
    """Factorisation of K' = TᵀKT (4.9)."""

    def __init__(self, system: Stencil) -> None:
        matrix = system.matrix(np.float64)
        joined = _joined(system.groups, matrix.shape[0], tuple(matrix.offsets.tolist()))
        self._number, self._first, count = joined.number, joined.first, joined.count
        values = matrix.data.ravel()[joined.kept]
        self._dense = count <= _DENSE_NODES
        try:
            if self._dense:
                whole = np.bincount(joined.rows * count + joined.columns, values, count * count)
                self._factor = cho_factor(whole.reshape(count, count))
            else:
                coordinates = (joined.rows, joined.columns)
                sparse = coo_array((values, coordinates), shape=(count, count)).tocsc()
                self._factor = splu(
                    sparse, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
                )
        except (RuntimeError, np.linalg.LinAlgError) as error:
            raise SolverError(
                "the plate's matrix is singular; give every part of the plate a way to a sink",
                kind="unsolved",
            ) from error

    def solve(self, load: npt.NDArray[np.floating]) -> Floats:
        """Solve for the temperatures of all nodes, for a load that is equal within groups."""
        reduced = load[self._first].astype(np.float64)
        theta: Floats = cho_solve(self._factor, reduced) if self._dense else self._factor.solve(reduced)
        return theta[self._number]


class PlateLevel:
    """One plate of the hierarchy, with its smoother."""

    def __init__(self, system: Stencil, shape: tuple[int, int]) -> None:
        self.shape, self.groups = shape, system.groups
        self._system = system

    @cached_property
    def matrix(self) -> dia_array:
        """The matrix of the level; the coarsest one, which has no smoother, needs none."""
        return self._system.matrix(np.float32)

    @cached_property
    def _jacobi(self) -> Floats32:
        diagonal = self._system.diagonal()
        inverse = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)
        found: Floats32 = inverse.astype(np.float32)
        return found

    def residual(self, load: Floats32, theta: Floats32) -> Floats32:
        """Compute load - K'θ."""
        product: Floats32 = self.matrix @ theta
        self.groups.gather(product)
        np.subtract(load, product, out=product)
        return product

    def first_sweeps(self, load: Floats32) -> Floats32:
        """Run two sweeps from zero."""
        step = self._jacobi * load
        theta = step * DAMPING[0]
        step = self.residual(load, theta)
        step *= self._jacobi
        step *= DAMPING[1]
        theta += step
        return theta

    def last_sweeps(self, load: Floats32, theta: Floats32) -> None:
        """Run two sweeps, in place, in the opposite order."""
        for damping in reversed(DAMPING):
            step = self.residual(load, theta)
            step *= self._jacobi
            step *= damping
            theta += step

    def restrict(self, residual: Floats32, coarse: PlateLevel) -> Floats32:
        """Apply Pᵀ, joined: the residual on the next coarser plate."""
        self.groups.once(residual)
        (h, w), (ch, cw) = self.shape, coarse.shape
        fine = residual.reshape(h + 1, w + 1)
        across = fine[:, ::2] if w % 2 == 0 else np.pad(fine[:, ::2], ((0, 0), (0, 1)))
        half = fine[:, 1::2] * np.float32(0.5)
        across = across.copy()
        across[:, : half.shape[1]] += half
        across[:, 1 : half.shape[1] + 1] += half
        result = np.zeros((ch + 1, cw + 1), np.float32)
        result[: len(across[::2])] = across[::2]
        half = across[1::2] * np.float32(0.5)
        result[: len(half)] += half
        result[1 : len(half) + 1] += half
        flat = result.reshape(-1)
        coarse.groups.gather(flat)
        return flat

    def prolong(self, theta: Floats32, coarse: PlateLevel) -> Floats32:
        """Apply P to a correction of the next coarser plate."""
        (h, w), (ch, cw) = self.shape, coarse.shape
        field = theta.reshape(ch + 1, cw + 1)
        down = np.empty((2 * ch + 1, cw + 1), np.float32)
        down[::2] = field
        np.add(field[:-1], field[1:], out=down[1::2])
        down[1::2] *= np.float32(0.5)
        down = down[: h + 1]
        fine = np.empty((h + 1, 2 * cw + 1), np.float32)
        fine[:, ::2] = down
        np.add(down[:, :-1], down[:, 1:], out=fine[:, 1::2])
        fine[:, 1::2] *= np.float32(0.5)
        return np.ascontiguousarray(fine[:, : w + 1]).reshape(-1)


class Hierarchy:
    """The shapes and joints of all levels of a plate."""

    def __init__(self, shape: tuple[int, int], joint: Joint | Shift) -> None:
        self.shapes, self.groups = [shape], [Groups(shape, joint)]
        while (shape[0] + 1) * (shape[1] + 1) > _COARSEST_NODES and min(shape) >= 8:
            h, w = shape
            if joint is not Joint.FREE and (h % 2 or w % 2):
                break
            shape = (h + 1) // 2, (w + 1) // 2
            if not joint.fits(shape):
                break
            self.shapes.append(shape)
            self.groups.append(Groups(shape, joint))


class Multigrid:
    """The V-cycle of one matrix, and conjugate gradients preconditioned by it.

    Parameters
    ----------
    elements : (P, h, w) float array
        Coefficients of the element matrices.
    patterns : (10, P) float array
        The element matrices that the coefficients multiply.
    hierarchy : Hierarchy
    """

    def __init__(self, elements: Floats, patterns: Floats, system: Stencil, hierarchy: Hierarchy) -> None:
        self._system = system
        self._levels: list[PlateLevel] = []
        for depth, shape in enumerate(hierarchy.shapes[1:]):
            self._levels.append(PlateLevel(system, hierarchy.shapes[depth]))
            elements = coarsen(elements, patterns)
            patterns = np.eye(len(ENTRIES))
            system = stencil(elements, hierarchy.groups[depth + 1])
            assert elements.shape[1:] == shape  # noqa: S101
        self._coarsest = system
        self._bottom = PlateLevel(system, hierarchy.shapes[-1])

    @cached_property
    def _direct(self) -> DirectSolver:
        return DirectSolver(self._coarsest)

    def cycle(self, load: Floats32, depth: int = 0) -> Floats32:
        """Run one V-cycle for a joined load, from zero."""
        if depth == len(self._levels):
            return self._direct.solve(load).astype(np.float32)
        level = self._levels[depth]
        coarse = self._levels[depth + 1] if depth + 1 < len(self._levels) else self._bottom
        theta = level.first_sweeps(load)
        correction = self.cycle(level.restrict(level.residual(load, theta), coarse), depth + 1)
        theta += level.prolong(correction, coarse)
        level.last_sweeps(load, theta)
        return theta

    def solve(
        self,
        load: Floats,
        start: Floats | None,
        *,
        tolerance: float,
        max_iterations: int,
        energy: float = 0.0,
    ) -> Solved:
        """Solve for the temperatures of a joined load.

        Parameters
        ----------
        load : (N,) float array
        start : (N,) float array, optional
            A guess, such as the temperatures of the design before.
        tolerance : float
            Stop when the residual's norm is this share of the load's.
        max_iterations : int
        energy : float
            As of `conjugate_gradients`.

        Returns
        -------
        Solved
            With more than `max_iterations` where a direct solution took over.
        """
        groups = self._system.groups
        if not self._levels:
            theta = self._direct.solve(load)
            return Solved(theta, groups.dot(load, theta), 0)
        matrix = self._system.matrix(np.float64)

        def multiply(theta: Floats) -> Floats:
            product: Floats = matrix @ theta
            groups.gather(product)
            return product

        found = conjugate_gradients(
            multiply,
            self.cycle,
            load,
            start,
            inner=groups.dot,
            tolerance=tolerance,
            max_iterations=max_iterations,
            energy=energy,
        )
        if found is not None:
            return found
        theta = DirectSolver(self._system).solve(load)
        return Solved(theta, groups.dot(load, theta), max_iterations + 1)
