"""What is open between two layers divided anew, here or in another process."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.heat.threads import one_thread
from toposeam.images import Mask
from toposeam.layers.band import band_of
from toposeam.layers.labelling import Labelling, Pair
from toposeam.layers.painting import LabelMap
from toposeam.optimize.history import Termination
from toposeam.seam.gathering import Heat, gather_heat
from toposeam.seam.heat import HeatOptions
from toposeam.seam.solution import Solution

#: Rows and columns of pixels of the canvas.
Pixels = tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]
#: The label potential of some of them.
Potential = tuple[*Pixels, npt.NDArray[np.float32]]

#: A move counts when it lowers the cost of its region by this share.
LEAST_GAIN = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class Division:
    """Two layers, and what is open between them."""

    labelling: Labelling
    label_map: LabelMap
    #: (H, W) bool: what is open.
    near: Mask
    pair: Pair
    options: HeatOptions
    #: Pixels beside larger steps of the label potential are told.
    undecided: float | None
    #: Whether the potential itself is.
    keeps: bool


@dataclass(frozen=True, slots=True, eq=False)
class Divided:
    """What came of it."""

    solution: Solution
    seconds: float
    #: Pixels that change, and what shows there.
    pixels: Pixels
    values: npt.NDArray[np.int16]
    #: Pixels beside flow that the heat had not decided.
    flows: Pixels | None
    potential: Potential | None


def divided(division: Division) -> Divided | None:
    """The best seam among the pixels that are open; None where there are none."""
    pair, options = division.pair, division.options
    band = band_of(division.labelling, division.label_map, pair, division.near)
    if band is None:
        return None
    started = time.perf_counter()
    network, cost, chosen = band.network()
    with one_thread():
        heat = gather_heat(network, cost, options.tolerance, options.max_iterations)
    seconds = time.perf_counter() - started
    second = band.labels(chosen, heat.hot[:-2])
    soft = second.astype(np.float64)
    soft[chosen] = np.clip(heat.soft[:-2], 0.0, 1.0)
    flows = potential = None
    if division.undecided is not None:
        flows = band.across(soft, division.undecided)
    elif division.keeps:
        potential = band.rows, band.columns, soft.astype(np.float32)
    gains = band.total(second) < band.total(band.second) * (1 - LEAST_GAIN)
    changed = np.flatnonzero(second != band.second) if gains else np.zeros(0, np.intp)
    values = np.where(second[changed], np.int16(pair[1]), np.int16(pair[0]))
    pixels = band.rows[changed], band.columns[changed]
    return Divided(undescribed(heat, "heat"), seconds, pixels, values, flows, potential)


def undescribed(heat: Heat | None, engine: str) -> Solution:
    """How a seam was found, and by which engine, but not what it is."""
    nothing = np.zeros((0, 0), bool)
    return Solution(
        labels=nothing,
        soft=nothing.astype(np.float32),
        contracted=True,
        method=engine,
        history=() if heat is None else heat.history,
        termination=Termination.SINGLE_LINE if heat is None else heat.termination,
    )
