"""The thesis's ground structure: one conductor on every pixel interface of the overlap, seen from corners and
from pixels.

*From corners* (thesis 3.2.1, Figure 3.3): nodes are pixel corners, an element of conductance k joins the two
corners of an interface, and heat flows along the seam. The corners beside a gap, where neither patch has
pixels, are one ideal terminal: the source at one end of the seam, the sink at the other. An m × n strip has
(m + 1)(n + 1) corners and m(n + 1) + n(m + 1) elements.

*From pixels* (the planar dual): nodes are pixels, the same element has conductance 1/k and joins the two
pixels on either side, and the terminals are the ground of only ``a`` and of only ``b``. A label potential
between 0 and 1 jumps, across each interface, by the flux along it when the whole seam carries unit heat. This
view has no ends to find; it holds for rings, islands and several gaps alike.

*Outermost elements.* The border pixels of the overlap, which are fixed to the patch beyond them, may change
sides here, at M_max = 10⁶ per interface (Figure 3.6). Elements along a gap join a terminal to itself: they
belong to the ground structure, but no heat runs through them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from toposeam.arrays import AnyInts, Floats, Indices, Mask
from toposeam.errors import SolverError
from toposeam.heat.network import Network
from toposeam.seam.problem.overlap import FREE, NONE, TOUCHING, A, B, neighbours
from toposeam.seam.problem.seam_problem import M_MAX, SeamProblem, geometry

#: The match cost of the outermost elements, M_max.
OUTERMOST = M_MAX


@dataclass(frozen=True, slots=True, eq=False)
class GroundStructure:
    """The conductors of an overlap of h × w pixels (window included), numbered as drawn in
    :mod:`toposeam.seam.problem.seam_problem`.
    """

    #: (h, w) uint8: the overlap's sides, the border pixels free.
    side: npt.NDArray[np.uint8]
    #: (E,) flat index of the left or upper pixel.
    first: Indices
    #: (E,) flat index of the right or lower pixel.
    second: Indices
    #: (E,) flat index of the upper or left corner.
    start: Indices
    #: (E,) flat index of the lower or right corner.
    end: Indices
    #: (E,) match cost M.
    cost: Floats

    @property
    def along_gap(self) -> Mask:
        """(E,) bool: elements beside a gap, which join a terminal to itself."""
        flat = self.side.ravel()
        beside: Mask = (flat[self.first] == NONE) | (flat[self.second] == NONE)
        return beside

    def zigzag(self) -> int:
        """Count the elements of a zigzag seam, the first N_q: width + height of the overlap (thesis 3.3.2).

        Several components add up. A component counts once for each of its seams, and twice if its seam is
        closed, which leads there and back.
        """
        component, count = scipy.ndimage.label(self.side == FREE)
        if count == 0:
            return 0
        ends = np.zeros(count + 1, int)
        within, _ = self._ends(component)
        np.add.at(ends, within, 1)
        total = 0
        for index, box in enumerate(scipy.ndimage.find_objects(component), start=1):
            lines = max(1, ends[index] // 2) if ends[index] else 2
            total += lines * sum(part.stop - part.start for part in box)
        return total

    def _ends(self, component: npt.NDArray[np.int32]) -> tuple[Indices, Indices]:
        """Find the ends of seams: the component and the corner of each."""
        node = self.merged_corners()
        flat = self.side.ravel()
        to_b = (flat[self.first] == B) | (flat[self.second] == B)
        # One valid cut gives all free pixels to `a`. Every other cut has the same ends: the corners that this
        # one meets an odd number of times.
        within = np.maximum(component.ravel()[self.first], component.ravel()[self.second])[to_b]
        size = (self.side.shape[0] + 1) * (self.side.shape[1] + 1)
        key = np.concatenate([within * size + node[self.start[to_b]], within * size + node[self.end[to_b]]])
        key, times = np.unique(key, return_counts=True)
        odd = key[times % 2 == 1]
        return odd // size, odd % size

    def merged_corners(self) -> Indices:
        """Return the node of every corner: itself, or the first of the corners along the same gap."""
        h, w = self.side.shape
        gap = self.along_gap
        size = (h + 1) * (w + 1)
        if not gap.any():
            return np.arange(size)
        graph = coo_array(
            (np.ones(np.count_nonzero(gap), np.int8), (self.start[gap], self.end[gap])), shape=(size, size)
        )
        count, region = connected_components(graph, directed=False)
        lowest = np.full(count, size)
        np.minimum.at(lowest, region, np.arange(size))
        node: Indices = lowest[region]
        return node

    def spread(
        self, values: npt.NDArray[np.floating]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Spread values of elements to interfaces: ``right`` (h, w - 1) and ``down`` (h - 1, w), else 0."""
        h, w = self.side.shape
        right, down = np.zeros((h, w - 1), np.float32), np.zeros((h - 1, w), np.float32)
        across = self.second == self.first + 1
        row, column = np.divmod(self.first, w)
        right[row[across], column[across]] = values[across]
        down[row[~across], column[~across]] = values[~across]
        return right, down


def ground_structure(problem: SeamProblem) -> GroundStructure:
    """Build the ground structure of an overlap: the interfaces beside components with free pixels."""
    side, shared = problem.overlap.side, problem.overlap.shared
    component, count = scipy.ndimage.label(shared, TOUCHING)
    undecided = np.zeros(count + 1, bool)
    undecided[component[side == FREE]] = True
    undecided[0] = False
    border = np.zeros(side.shape, bool)
    for own in (A, B):
        border |= (side == own) & neighbours((side == own) & ~shared)
    opened = np.where(border & undecided[component], np.uint8(FREE), side)
    free, ground = opened == FREE, ~shared & (side != NONE)
    chosen, match = [], []
    for cost, s, t in ((problem.right, np.s_[:, :-1], np.s_[:, 1:]), (problem.down, np.s_[:-1], np.s_[1:])):
        gap = (side[s] == NONE) | (side[t] == NONE)
        outermost = (cost == 0) & (ground[s] | ground[t] | gap)
        here = (free[s] | free[t]) & ((cost > 0) | outermost)
        chosen.append(here)
        match.append(np.where(outermost, OUTERMOST, cost)[here])
    return GroundStructure(opened, *geometry(chosen[0], chosen[1]), np.concatenate(match).astype(np.float64))


@dataclass(frozen=True, slots=True, eq=False)
class _Conductors:
    """Elements between numbered nodes; unlike those of a `Network` they may be parallel, join a node to
    itself, or join the terminals.
    """

    n: int
    tail: AnyInts
    head: AnyInts
    network: Network
    group: AnyInts  #: (E,) element of the network each one is part of, -1 for none

    def temperature(self, conductance: Floats) -> Floats:
        part = self.group >= 0
        grouped: Floats = np.bincount(self.group[part], conductance[part], len(self.network.tail)).astype(
            np.float64, copy=False
        )
        return self.network.solve(grouped)


def _conductors(tail: AnyInts, head: AnyInts, n: int, apart: Mask | None = None) -> _Conductors:
    network, group = Network(n, tail, head, apart).quotient(np.arange(n + 2))
    return _Conductors(n, tail, head, network, group)


@dataclass(frozen=True, slots=True, eq=False)
class CornerNetwork:
    """The ground structure, or part of it, from corners. Build it with :func:`corner_network`."""

    #: (E,) which elements of the ground structure this network has.
    elements: Indices
    conductors: _Conductors

    @property
    def unknowns(self) -> int:
        """Number of temperatures solved for."""
        return self.conductors.n

    def flow(self, conductance: Floats) -> tuple[Floats, float]:
        """Compute the flux of every element and the thermal compliance θᵀKθ (3.10), for unit heat.

        Parameters
        ----------
        conductance : (E,) float array, positive

        Returns
        -------
        flux : (E,) float array in [0, 1]
        compliance : float

        Raises
        ------
        SolverError
        """
        c = self.conductors
        theta = c.temperature(
            conductance
        )  # K θ = F (3.6), for a temperature difference of 1 instead of unit heat
        flux = conductance * np.abs(theta[c.head] - theta[c.tail])  # (3.19)
        at_source = (c.tail == c.n + 1) != (c.head == c.n + 1)
        heat = float(flux[at_source].sum())
        if not (np.isfinite(heat) and heat > 0):
            raise SolverError(
                "no heat flows from source to sink (total flux {heat}); the conductances differ too much",
                kind="unsolved",
                heat=heat,
            )
        return flux / heat, 1.0 / heat

    def restricted(self, alive: Mask) -> CornerNetwork:
        """Build the network of some elements only, less those that are not connected to the terminals.

        Raises
        ------
        SolverError
            When the elements do not connect source and sink.
        """
        c = self.conductors
        kept = np.flatnonzero(alive)
        tail, head = c.tail[kept], c.head[kept]
        graph = coo_array((np.ones(len(kept), np.int8), (tail, head)), shape=(c.n + 2, c.n + 2))
        _, region = connected_components(graph, directed=False)
        if region[c.n] != region[c.n + 1]:
            raise SolverError("the elements do not connect source and sink", kind="unsolved")
        connected = region[tail] == region[c.n]
        kept, tail, head = kept[connected], tail[connected], head[connected]
        number = np.zeros(c.n + 2, np.int32)
        used = np.zeros(c.n + 2, bool)
        used[tail], used[head] = True, True
        used[c.n :] = True
        number[used] = np.arange(np.count_nonzero(used), dtype=np.int32)
        apart = None if c.network.apart is None else c.network.apart[used[:-2]]
        return CornerNetwork(
            self.elements[kept],
            _conductors(number[tail], number[head], int(np.count_nonzero(used)) - 2, apart),
        )


def corner_network(structure: GroundStructure) -> CornerNetwork | None:
    """Build the ground structure from corners, with source and sink at the two ends of the seam.

    Returns
    -------
    CornerNetwork or None
        None where the seam does not have exactly two ends (it is closed, or there are several): use
        :func:`pixel_network` there.
    """
    component, count = scipy.ndimage.label(structure.side == FREE)
    if count != 1:
        return None
    _, ends = structure._ends(component)
    flat = structure.side.ravel()
    has_a = ((flat[structure.first] == A) | (flat[structure.second] == A)).any()
    if len(ends) != 2 or not has_a:
        return None
    node = structure.merged_corners()
    tail, head = node[structure.start], node[structure.end]
    used, place = np.unique(np.concatenate([tail, head, ends]), return_inverse=True)
    n = len(used) - 2
    number = np.empty(len(used), np.int32)
    terminals = place[-2:]
    free = np.ones(len(used), bool)
    free[terminals] = False
    number[free] = np.arange(n, dtype=np.int32)
    number[terminals] = n, n + 1
    elements = len(tail)
    # Corners are joined along pixel sides, so no two black fields of a chessboard are joined; corners merged
    # along a gap are left out.
    row, column = np.divmod(np.arange(len(node)), structure.side.shape[1] + 1)
    black = np.zeros(len(node), bool)
    black[node[(row + column) % 2 == 0]] = True
    apart = (black & (np.bincount(node, minlength=len(node)) == 1))[used[free]]
    return CornerNetwork(
        np.arange(elements), _conductors(number[place[:elements]], number[place[elements:-2]], n, apart)
    )


@dataclass(frozen=True, slots=True, eq=False)
class PixelNetwork:
    """The ground structure, or part of it, from pixels. Build it with :func:`pixel_network`."""

    #: (E,) which elements of the ground structure this network has.
    elements: Indices
    conductors: _Conductors
    #: (P,) flat index of each free pixel.
    pixels: Indices
    #: (P,) the node it belongs to.
    node: AnyInts

    @property
    def unknowns(self) -> int:
        """Number of label potentials solved for."""
        return self.conductors.n

    def flow(self, conductance: Floats) -> tuple[Floats, float]:
        """Compute flux and thermal compliance for unit heat, as :meth:`CornerNetwork.flow` does."""
        flux, _ = self._jumps(conductance)
        return flux, float(np.sum(np.square(flux) / conductance))

    def potential(self, conductance: Floats) -> Floats:
        """Compute the label potential of every free pixel, (P,) floats in [0, 1]."""
        potential: Floats = self._jumps(conductance)[1][self.node]
        return potential

    def _jumps(self, conductance: Floats) -> tuple[Floats, Floats]:
        c = self.conductors
        psi = c.temperature(1.0 / conductance)
        return np.abs(psi[c.head] - psi[c.tail]), psi

    def restricted(self, alive: Mask) -> PixelNetwork:
        """Build the network of some elements only: the pixels on either side of the others become one node.

        Raises
        ------
        SolverError
            When the elements do not separate the two sides.
        """
        c = self.conductors
        node = Network(c.n, c.tail, c.head).components(~alive)
        kept = np.flatnonzero(alive & (node[c.tail] != node[c.head]))
        conductors = _conductors(node[c.tail[kept]], node[c.head[kept]], int(node[-1]) - 1)
        return PixelNetwork(self.elements[kept], conductors, self.pixels, node[self.node])


def pixel_network(structure: GroundStructure) -> PixelNetwork:
    """Build the ground structure from pixels, without the elements along gaps; works for every topology."""
    flat = structure.side.ravel()
    pixels = np.flatnonzero(flat == FREE)
    n = len(pixels)
    number = np.full(flat.size, -1, np.int32)
    number[pixels] = np.arange(n, dtype=np.int32)
    number[flat == A], number[flat == B] = n, n + 1
    elements = np.flatnonzero(~structure.along_gap)
    conductors = _conductors(number[structure.first[elements]], number[structure.second[elements]], n)
    return PixelNetwork(elements, conductors, pixels, np.arange(n, dtype=np.int32))
