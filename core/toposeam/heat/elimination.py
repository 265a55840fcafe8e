"""Exact solution of symmetric positive systems whose pattern stays and whose values change.

The pattern, the pairs of unknowns that are coupled, is analysed once; then each new set of values costs one pass over them and one
factorisation: dense, banded (reverse Cuthill-McKee) or sparse (SuperLU), whichever the size and the bandwidth favour.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dpbtrf, dpbtrs, dpotrf, dpotrs
from scipy.sparse import csc_array, csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import splu

from toposeam.errors import SolverError

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.signedinteger[Any]]
#: From loads (n,) to the solutions for them.
Factor = Callable[[Floats], Floats]

#: Up to this many unknowns a dense factorisation beats setting up a banded one.
DENSE_NODES = 48
#: Beyond this half-bandwidth sparse elimination beats a banded factorisation …
WIDEST_BAND = 100
#: … but for a full band, as of an overlap solved whole, only beyond so many times that.
_FULL_BAND = 2.5
#: A band is full when rows reach this share of its width in the mean.
_FULL = 0.5
#: A factorisation of this many products costs less than reordering the unknowns.
_CHEAP = 1e6
#: From this many unknowns on, eliminating those that are apart pays, if they are at least this share of all.
CONDENSED_NODES = 1500
_APART_SHARE = 0.15
#: An unknown coupled to more others than this is not eliminated early.
_MOST_NEIGHBOURS = 6


class System(Protocol):
    """A pattern of n unknowns with coupled pairs (i, j)."""

    #: Whether the same values always give the same bits; an order of elimination found on the way rounds differently.
    repeatable: bool

    def factor(self, coupling: Floats, diagonal: Floats) -> Factor:
        """What solves A x = load, where A has `diagonal` (n,) and, at (i, j) and (j, i), minus `coupling` (E,)."""


def system(n: int, i: Ints, j: Ints, apart: npt.NDArray[np.bool_] | None = None) -> System:
    """The cheapest solver for a pattern.

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
    if n >= CONDENSED_NODES:
        if apart is None or np.count_nonzero(apart) <= 0.3 * n:
            apart = _independent(n, i, j)
        if np.count_nonzero(apart) > _APART_SHARE * n:
            return _Condensed(n, i, j, apart)
    width = int(np.abs(i - j).max(initial=0))
    if width <= WIDEST_BAND and width * width <= min(n, _CHEAP / n):  # as good as any order could be, or cheaper than finding a better one
        return _Banded(n, np.arange(n), i, j, width)
    graph = csr_array((np.ones(2 * len(i), np.int8), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(n, n))
    rank = np.empty(n, np.intp)
    rank[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(n)
    width = int(np.abs(rank[i] - rank[j]).max(initial=0))
    if WIDEST_BAND < width <= _FULL_BAND * WIDEST_BAND:
        reach = np.zeros(n, np.intp)
        np.maximum.at(reach, np.maximum(rank[i], rank[j]), np.abs(rank[i] - rank[j]))
        banded = float(reach.mean()) >= _FULL * width
    else:
        banded = width <= WIDEST_BAND
    return _Banded(n, rank, rank[i], rank[j], width) if banded else _Sparse(n, i, j)


def _independent(n: int, i: Ints, j: Ints) -> npt.NDArray[np.bool_]:
    """Unknowns with few neighbours, no two of which are coupled, (n,) bool: those with fewer than their neighbours, over and over."""
    degree = np.bincount(i, minlength=n) + np.bincount(j, minlength=n)
    # A golden-ratio sequence decides between equals.
    priority = np.where(degree <= _MOST_NEIGHBOURS, degree + (np.arange(n) * 0.6180339887498949) % 1.0, np.inf)
    chosen = np.zeros(n, bool)
    for _ in range(3):
        least = np.full(n, np.inf)
        np.minimum.at(least, i, priority.take(j))
        np.minimum.at(least, j, priority.take(i))
        first = priority < least
        chosen |= first
        priority[first] = np.inf
        priority[i[first[j]]] = np.inf
        priority[j[first[i]]] = np.inf
    return chosen


class _Dense:
    repeatable = True

    def __init__(self, n: int, i: Ints, j: Ints) -> None:
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

    def __init__(self, n: int, rank: Ints, i: Ints, j: Ints, width: int) -> None:
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
    repeatable = False

    def __init__(self, n: int, i: Ints, j: Ints) -> None:
        self.n, self.i, self.j = n, i, j
        self.ordered = False
        self._place(np.arange(n, dtype=np.int32))

    def _place(self, rank: Ints) -> None:
        """Positions in compressed columns, diagonal included, once the unknowns are numbered by rank."""
        i, j = rank[self.i], rank[self.j]
        rows, columns = np.concatenate([i, j, rank]), np.concatenate([j, i, rank])
        # Compressed by rows and then by columns, the entries come in order.
        table = csr_array((np.arange(len(rows)), (rows, columns)), shape=(self.n, self.n)).tocsc()
        self.indices, self.indptr = table.indices, table.indptr
        self.position = np.empty(len(rows), np.intp)
        self.position[table.data] = np.arange(len(rows))
        self.rank = rank

    def factor(self, coupling: Floats, diagonal: Floats) -> Factor:
        data = np.empty(len(self.indices))
        data[self.position] = np.concatenate([-coupling, -coupling, diagonal])
        matrix = csc_array((data, self.indices, self.indptr), shape=(self.n, self.n))
        # The first factorisation finds an elimination order, which the later ones take as it is.
        order = "NATURAL" if self.ordered else "MMD_AT_PLUS_A"
        try:
            # One column a panel: the supernodes of these matrices are narrow.
            factor = splu(matrix, order, diag_pivot_thresh=0.0, relax=8, panel_size=1, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise SolverError(f"the heat network cannot be solved: {error}") from error
        rank = self.rank
        if not self.ordered:
            self._place(factor.perm_c[rank].astype(np.int32))
            self.ordered = True

        def solve(load: Floats) -> Floats:
            right = np.empty(self.n)
            right[rank] = load
            x: Floats = factor.solve(right)[rank]
            return x

        return solve


class _Condensed:
    """Unknowns that are apart are eliminated first, all at once; half of a pixel grid is, and the rest is half the work.

    Eliminating r with diagonal d and couplings c_a, c_b … couples each two of its neighbours by c_a c_b / d.
    """

    def __init__(self, n: int, i: Ints, j: Ints, apart: npt.NDArray[np.bool_]) -> None:
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
        by_hub = np.argsort(hub, kind="stable")
        self.legs, self.hub, self.foot = legs[by_hub], hub[by_hub], foot[by_hub]
        # Pairs of legs of one hub: the k-th leg with the one `step` places on, while that is still the same hub.
        pairs = []
        for step in range(1, _MOST_NEIGHBOURS):
            first = np.flatnonzero(self.hub[:-step] == self.hub[step:]) if len(self.hub) > step else np.zeros(0, np.intp)
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
            raise SolverError("the heat network cannot be solved: a node is not connected to a terminal")
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
            x[self.stay] = found = rest(load.take(self.stay) + np.bincount(self.foot, share * hub_load.take(self.hub), size))
            x[self.gone] = (hub_load + np.bincount(self.hub, leg * found.take(self.foot), len(self.gone))) / d
            return x

        return solve


def _check(info: int) -> None:
    if info:
        raise SolverError(
            f"the heat network cannot be solved: Cholesky stopped at row {info}; "
            "a node is not connected to a terminal, or the conductances differ too much"
        )
