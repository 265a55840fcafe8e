"""The steps of the heat method: conductances follow the flux."""

from __future__ import annotations

import numpy as np

from toposeam.heat.network import Floats

#: No flux counts as less than this: it bounds the contrast of the conductances, which the Cholesky factorisation must survive.
LEAST_FLUX = 1e-9

#: Over-relaxation ω of the convex steps; 1 is the plain step, beyond 1.8 they swing.
RELAXATION = 1.5


def convex_step(strength: Floats, flux: Floats, relaxation: float = RELAXATION) -> Floats:
    """The next x = k M, over-relaxed towards the flux: x^(1-ω) |q|^ω."""
    grown = strength ** (1.0 - relaxation) * np.maximum(flux, LEAST_FLUX) ** relaxation
    return np.clip(grown, LEAST_FLUX, 1.0)


def penalising_step(flux: Floats, penalty: float) -> Floats:
    """The next x = k M once the strongest line is to win, (3.21) applied to the flux: |q|^(1+s)."""
    return np.clip(np.maximum(flux, LEAST_FLUX) ** (1.0 + penalty), LEAST_FLUX, 1.0)


def typical_flux(weight: Floats, flux: Floats) -> float:
    """The flux that the heat meets on its way, Σ M q² / Σ M q: 1 on a single line, 1/N where N equal lines share the heat."""
    return float(weight @ np.square(flux) / (weight @ flux))
