"""Exact solution of symmetric positive systems whose pattern stays and whose values change.

The pattern, the pairs of unknowns that are coupled, is analysed once; then each new set of values costs one
pass over them and one factorisation: dense, banded (reverse Cuthill-McKee) or sparse (QDLDL, else SuperLU),
depending on the size and the bandwidth.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpbtrf, dpbtrs, dpotrf, dpotrs
from scipy.sparse import csc_array, csr_array, triu
from scipy.sparse.csgraph import reverse_cuthill_mckee

from toposeam.arrays import AnyInts, Floats
from toposeam.errors import SolverError

try:
    import qdldl
except ImportError:  # there are no wheels for every platform (musl)
    qdldl = None

#: A solver of a factorised system: from a load (n,) to its solution (n,).
Factor = Callable[[Floats], Floats]

#: Up to this many unknowns a dense factorisation beats setting up a banded one.
DENSE_NODES = 48
#: Largest half-bandwidth at which a banded factorisation beats sparse elimination.
WIDEST_BAND = 100
#: Factor on that for a full band, such as that of an overlap solved whole.
_FULL_BAND_FACTOR = 2.5
#: Least mean width of the rows of a full band, as a share of the band's width.
_FULL_BAND_SHARE = 0.5
#: Most products of a factorisation that costs less than reordering the unknowns.
_CHEAP_PRODUCTS = 1e6
#: Least number of unknowns at which it pays to eliminate first those that are apart; and their least share.
CONDENSED_NODES = 1500
_APART_SHARE = 0.3
#: Least number of unknowns at which an irregular network is factorised without looking for a narrow band.
SPARSE_NODES = 4000
#: Most unknowns that one which is eliminated first may be coupled to.
_MOST_NEIGHBOURS = 6


class System(Protocol):
    """A pattern of n unknowns with coupled pairs (i, j)."""

    #: Whether the same values always give the same bits. The first factorisation of QDLDL, which finds the
    #: order of elimination, rounds differently from later ones.
    repeatable: bool

    def factor(self, coupling: Floats, diagonal: Floats) -> Factor:
        """Factorise A, with `diagonal` (n,) and, at (i, j) and (j, i), minus `coupling` (E,).

        Returns the solver of A x = load.
        """


def system(n: int, i: AnyInts, j: AnyInts, apart: npt.NDArray[np.bool_] | None = None) -> System:
    """Choose the cheapest solver for a pattern.

    Parameters
    ----------
    n : int
    i, j : (E,) int arrays
        Coupled pairs, each once, i ≠ j.
    apart : (n,) bool array, optional
        Unknowns of which no two are coupled.
    """
    if n <= DENSE_NODES:
        return _Dense(n, i, j)
    if n >= CONDENSED_NODES and apart is not None and np.count_nonzero(apart) > _APART_SHARE * n:
        return _Condensed(n, i, j, apart)
    if n >= SPARSE_NODES and apart is None:
        return _Sparse(n, i, j)
    width = int(np.abs(i - j).max(initial=0))
    if width <= WIDEST_BAND and width * width <= min(
        n, _CHEAP_PRODUCTS / n
    ):  # as good as any order could be, or cheaper than finding a better one
        return _Banded(n, np.arange(n), i, j, width)
    graph = csr_array(
        (np.ones(2 * len(i), np.int8), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(n, n)
    )
    rank = np.empty(n, np.intp)
    rank[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(n)
    width = int(np.abs(rank[i] - rank[j]).max(initial=0))
    if WIDEST_BAND < width <= _FULL_BAND_FACTOR * WIDEST_BAND:
        reach = np.zeros(n, np.intp)
        np.maximum.at(reach, np.maximum(rank[i], rank[j]), np.abs(rank[i] - rank[j]))
        banded = float(reach.mean()) >= _FULL_BAND_SHARE * width
    else:
        banded = width <= WIDEST_BAND
    return _Banded(n, rank, rank[i], rank[j], width) if banded else _Sparse(n, i, j)


class _Dense:
    repeatable = True

    def __init__(self, n: int, i: AnyInts, j: AnyInts) -> None:
        self.n, self.i, self.j = n, i, j

    def factor(self, coupling: Floats, diagonal: Floats) -> Factor:
        n = self.n
        if n == 0:
            return lambda load: load
        matrix = np.zeros((n, n), order="F")
        matrix[self.j, self.i] = matrix[self.i, self.j] = -coupling
        matrix[np.arange(n), np.arange(n)] = diagonal
        triangle, info = dpotrf(matrix, overwrite_a=1)
        _check(info)
        return lambda load: dpotrs(triangle, load)[0]


class _Banded:
    repeatable = True

    def __init__(self, n: int, rank: AnyInts, i: AnyInts, j: AnyInts, width: int) -> None:
        self.n, self.rank, self.rows = n, rank, width + 1
        # Lower band storage by columns: A[i, j] lies at row i - j of column j.
        self.position = np.minimum(i, j).astype(np.int64) * self.rows + np.abs(i - j)
        self.diagonal_position = rank.astype(np.int64) * self.rows

    def factor(self, coupling: Floats, diagonal: Floats) -> Factor:
        band = np.zeros(self.rows * self.n)
        band[self.position] = -coupling
        band[self.diagonal_position] = diagonal
        triangle, info = dpbtrf(band.reshape(self.rows, self.n, order="F"), lower=1, overwrite_ab=1)
        _check(info)

        def solve(load: Floats) -> Floats:
            right = np.empty(self.n)
            right[self.rank] = load
            x: Floats = dpbtrs(triangle, right, lower=1, overwrite_b=1)[0].take(self.rank)
            return x

        return solve


class _Sparse:
    """L D Lᵀ by QDLDL in an order of approximate minimum degree (Stellato et al. 2020,
    doi:10.1007/s12532-020-00179-2).
    """

    repeatable = False

    def __init__(self, n: int, i: AnyInts, j: AnyInts) -> None:
        # The upper triangle by columns, the diagonal last in each; pairs come sorted or are sorted here.
        low, high = np.minimum(i, j), np.maximum(i, j)
        order = np.argsort(high.astype(np.int64) * n + low, kind="stable")
        count = np.bincount(high, minlength=n)
        self.indptr = np.concatenate([[0], np.cumsum(count + 1)]).astype(np.int32)
        self.diagonal = self.indptr[1:] - 1
        self.position = np.empty(len(order), np.intp)
        self.position[order] = np.arange(len(order)) + high[order]
        self.indices = np.empty(len(order) + n, np.int32)
        self.indices[self.position], self.indices[self.diagonal] = low, np.arange(n)
        self.n = n
        self.solver: Any = None

    def factor(self, coupling: Floats, diagonal: Floats) -> Factor:
        data = np.empty(len(self.indices))
        data[self.position] = -coupling
        data[self.diagonal] = diagonal
        matrix = csc_array((data, self.indices, self.indptr), shape=(self.n, self.n))
        try:
            if qdldl is None:
                return _unsymmetric(matrix)
            if self.solver is None:
                self.solver = qdldl.Solver(matrix, upper=True)
            else:
                self.solver.update(matrix, upper=True)
        except (RuntimeError, ValueError) as error:
            raise SolverError(
                "the heat network cannot be solved: {reason}", kind="unsolved", reason=str(error)
            ) from error
        return self.solver.solve  # type: ignore[no-any-return]


def _unsymmetric(upper: Any) -> Factor:
    """Factorise by SuperLU instead, which takes five to ten times as long."""
    from scipy.sparse.linalg import splu

    whole = (upper + triu(upper, 1).T).tocsc()
    return splu(  # type: ignore[no-any-return]
        whole, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    ).solve


class _Condensed:
    """Elimination of all unknowns that are apart, at once, before the others.

    In a pixel grid these are half of the unknowns, and the rest is half the work.

    Eliminating r with diagonal d and couplings c_a, c_b … couples each two of its neighbours by c_a c_b / d.
    """

    def __init__(self, n: int, i: AnyInts, j: AnyInts, apart: npt.NDArray[np.bool_]) -> None:
        degree = np.bincount(i, minlength=n) + np.bincount(j, minlength=n)
        gone = apart & (degree <= _MOST_NEIGHBOURS)
        self.gone, self.stay = np.flatnonzero(gone), np.flatnonzero(~gone)
        number = np.empty(n, i.dtype)
        number[self.gone], number[self.stay] = np.arange(len(self.gone)), np.arange(len(self.stay))
        swap = gone[j]
        from_gone = gone[i] | swap
        self.direct = np.flatnonzero(~from_gone)
        legs = np.flatnonzero(from_gone)
        hub, foot = number[np.where(swap, j, i)[legs]], number[np.where(swap, i, j)[legs]]
        short = len(self.gone) <= 1 << 16  # those of two bytes are sorted in a few passes
        by_hub = np.argsort(hub.astype(np.uint16) if short else hub, kind="stable")
        self.legs, self.hub, self.foot = legs[by_hub], hub[by_hub], foot[by_hub]
        # Pairs of legs of one hub: the k-th leg with the one `step` places on, while that is still the same
        # hub.
        pairs = []
        for step in range(1, _MOST_NEIGHBOURS):
            first = (
                np.flatnonzero(self.hub[:-step] == self.hub[step:])
                if len(self.hub) > step
                else np.zeros(0, np.intp)
            )
            pairs.append((first, first + step))
        self.one, self.other = (np.concatenate(part) for part in zip(*pairs, strict=True))
        low = np.concatenate([number[i[self.direct]], self.foot[self.one]])
        high = np.concatenate([number[j[self.direct]], self.foot[self.other]])
        low, high = np.minimum(low, high), np.maximum(low, high)
        size = len(self.stay)
        key, self.slot = np.unique(low.astype(np.int64) * size + high, return_inverse=True)
        self.pairs = len(key)
        self.rest = system(size, (key // size).astype(i.dtype), (key % size).astype(i.dtype))
        self.repeatable = self.rest.repeatable

    def factor(self, coupling: Floats, diagonal: Floats) -> Factor:
        d = diagonal.take(self.gone)
        if not (d > 0).all():
            raise SolverError(
                "the heat network cannot be solved: a node is not connected to a terminal", kind="unsolved"
            )
        leg = coupling.take(self.legs)
        share = leg / d.take(self.hub)
        added = np.concatenate([coupling.take(self.direct), share.take(self.one) * leg.take(self.other)])
        size = len(self.stay)
        rest = self.rest.factor(
            np.bincount(self.slot, added, self.pairs).astype(np.float64, copy=False),
            diagonal.take(self.stay) - np.bincount(self.foot, share * leg, size),
        )

        def solve(load: Floats) -> Floats:
            hub_load = load.take(self.gone)
            x = np.empty(len(load))
            x[self.stay] = found = rest(
                load.take(self.stay) + np.bincount(self.foot, share * hub_load.take(self.hub), size)
            )
            x[self.gone] = (hub_load + np.bincount(self.hub, leg * found.take(self.foot), len(self.gone))) / d
            return x

        return solve


def _check(info: int) -> None:
    if info:
        raise SolverError(
            "the heat network cannot be solved: Cholesky stopped at row {row}; "
            "a node is not connected to a terminal, or the conductances differ too much",
            kind="unsolved",
            row=int(info),
        )
