"""The steps of the heat method: conductances follow the flux, and the network shrinks to where heat flows."""

from __future__ import annotations

import numpy as np

from toposeam.errors import SolverError
from toposeam.heat.network import Floats, Ints, Network

#: No flux counts as less than this: it bounds the contrast of the conductances, which the Cholesky factorisation must survive.
LEAST_FLUX = 1e-9

#: Over-relaxation ω of the convex steps; 1 is the plain step, beyond 1.8 they swing.
RELAXATION = 1.5


def convex_step(strength: Floats, flux: Floats, relaxation: float = RELAXATION) -> Floats:
    """The next x = k M, over-relaxed towards the flux: x^(1-ω) |q|^ω."""
    grown = strength ** (1.0 - relaxation) * np.maximum(flux, LEAST_FLUX) ** relaxation
    return np.clip(grown, LEAST_FLUX, 1.0)


def typical_flux(weight: Floats, flux: Floats) -> float:
    """The flux that the heat meets on its way, Σ M q² / Σ M q: 1 on a single line, 1/N where N equal lines share the heat."""
    return float(weight @ np.square(flux) / (weight @ flux))


def contract(
    network: Network, weight: Floats, flux: Floats, strength: Floats, multiplicity: Floats, threshold: float
) -> tuple[Network, Floats, Floats, Floats, Floats, Ints, Floats] | None:
    """The network without the interfaces that carry next to no flux, or None where that would not make it much smaller.

    Parallel elements add their weights and multiplicities; their flux is one and the same, their strength that of the strongest. Elements
    left between the two terminals carry all the heat for good; the last result is their weight and number.
    """
    threshold *= typical_flux(weight, flux)
    while True:
        closed = flux < threshold
        try:
            node_map = network.components(closed)
            break
        except SolverError:  # so many faint paths that closing them all joins the two sides
            threshold /= 4
    if node_map[-1] - 1 > 0.8 * network.n:
        return None
    smaller, element_map = network.quotient(node_map)
    kept = np.flatnonzero(element_map >= 0)
    target = element_map[kept]
    size = len(smaller.tail)
    summed = [np.bincount(target, values[kept], size).astype(np.float64) for values in (weight, multiplicity)]
    strongest = np.zeros((2, size))
    for row, values in zip(strongest, (flux, strength), strict=True):
        np.maximum.at(row, target, values[kept])
    ends = np.stack([node_map[network.tail], node_map[network.head]])
    between_terminals = (ends.min(axis=0) == smaller.n) & (ends.max(axis=0) == smaller.n + 1)
    settled = np.array([weight[between_terminals].sum(), multiplicity[between_terminals].sum()])
    return smaller, summed[0], strongest[0], strongest[1], summed[1], node_map, settled
