"""A seam opened again along its whole length: the best one of all that stay near it, or near other flows.

What coarse networks merged on the way to a seam never comes back by itself, and most of what that costs are
detours of ten to sixty pixels. So when heat has found where the seam runs, everything near it is open again,
and near the other ways that heat was still free to take, and divided by its best cut. Where the seam leads
from one gap to another that is a shortest path between corners (:mod:`toposeam.seam.exact.optimum`), which
takes a small part of the time that the heat took. A seam that closes on itself is opened at one place after
another: a line of pixels across it keeps what it shows, so that the seam passes there as before, and the rest
is a path. Of overlaps that several seams divide each is opened alone, in a corridor so narrow that they do
not meet.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Mask
from toposeam.seam.exact.optimum import cut_cost, pieces, shortest_path
from toposeam.seam.problem.grid import SEAM_CELLS, grown
from toposeam.seam.problem.overlap import FREE, NONE, A, B
from toposeam.seam.problem.seam_problem import SeamProblem

#: So many cells on either side of what else heat was free to choose from are open, too.
FLOW_CELLS = 3
#: At so many places a closed seam is opened in turn.
_OPENINGS = 2
#: Places at which that is tried each time; islands of a labelling have no way across.
_TRIES = 8

_Box = tuple[slice, slice]


def best_nearby(problem: SeamProblem, labels: Mask, open_pixels: Mask) -> Mask:
    """The best labelling whose seam stays near a given one, or near other pixels; never a dearer one.

    Parameters
    ----------
    problem : SeamProblem
        Without unary costs, which belong to no path.
    labels : (h, w) bool array
    open_pixels : (h, w) bool array

    Returns
    -------
    (h, w) bool array
    """
    best = problem.complete(labels).astype(bool, copy=False)
    flows = grown(open_pixels, FLOW_CELLS)
    for here, piece, _ in pieces(problem.overlap.side == FREE):
        seam = beside_seam(best[here], piece, problem.overlap.side[here] != NONE)
        zone = grown(seam, SEAM_CELLS) | flows[here]
        found = shortest_path(problem, here, piece, cut_cost(problem, here, piece, best[here]), zone)
        if found is None:
            found = _closed(problem, here, piece, best, zone)
        if found is not None:
            best = _cheaper(problem, best, here, piece, found)
            continue
        for cells in (SEAM_CELLS, SEAM_CELLS // 2, 1):
            best, parted = _apart(problem, best, here, piece & grown(seam, cells))
            if parted:
                break
    return best


def beside_seam(labels: Mask, piece: Mask, covered: Mask) -> Mask:
    """Pixels of a piece that the labels divide from a covered neighbour."""
    beside = np.zeros(labels.shape, bool)
    for s, t in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        differ = (labels[s] != labels[t]) & covered[s] & covered[t]
        beside[s] |= differ
        beside[t] |= differ
    return beside & piece


def _cheaper(problem: SeamProblem, best: Mask, box: _Box, piece: Mask, found: Mask) -> Mask:
    changed = best.copy()
    changed[box][piece] = found[piece]
    return changed if problem.cost(changed) < problem.cost(best) else best


def _apart(problem: SeamProblem, best: Mask, box: _Box, near: Mask) -> tuple[Mask, bool]:
    """The labelling after each corridor of a box has been divided anew, the rest keeping what it shows; and
    whether all of them could be.
    """
    free = np.zeros(best.shape, bool)
    free[box] = near
    narrowed = keeping(problem, free, best)
    component, count = scipy.ndimage.label(near)
    top, left = box[0].start, box[1].start
    parted = True
    for index, (rows, columns) in enumerate(scipy.ndimage.find_objects(component, count), 1):
        here = (
            slice(top + rows.start - 1, top + rows.stop + 1),
            slice(left + columns.start - 1, left + columns.stop + 1),
        )
        piece = np.zeros((here[0].stop - here[0].start, here[1].stop - here[1].start), bool)
        piece[1:-1, 1:-1] = component[rows, columns] == index
        found = shortest_path(narrowed, here, piece)
        if found is None:
            found = _closed(narrowed, here, piece, best)
        if found is None:
            parted = False
        else:
            best = _cheaper(problem, best, here, piece, found)
    return best, parted


def keeping(problem: SeamProblem, free: Mask, labels: Mask) -> SeamProblem:
    """The problem in which only some free pixels still are; the others keep their labels."""
    side = problem.overlap.side
    kept = np.where((side == FREE) & ~free, labels, side).astype(np.uint8)
    return dataclasses.replace(problem, overlap=dataclasses.replace(problem.overlap, side=kept))


def _closed(
    problem: SeamProblem, box: _Box, piece: Mask, labels: Mask, zone: Mask | None = None
) -> Mask | None:
    """The labels of a box after its piece was opened at one place of the seam after another; None where that
    makes no path of it.
    """
    best, done = labels[box].copy(), None
    place = None
    for _ in range(_OPENINGS):
        places = np.argwhere(piece[:, :-1] & piece[:, 1:] & (best[:, 1:] != best[:, :-1]))
        if place is not None:  # as far from the last one as can be
            places = places[np.argsort(-((places - place) ** 2).sum(axis=1), kind="stable")]
        across = None
        for place in places[:: max(1, len(places) // _TRIES)]:
            across = _across(best, problem.overlap.side[box], piece, place)
            if across is not None:
                break
        if across is None:
            break
        opened, whole = np.zeros(labels.shape, bool), labels.copy()
        opened[box], whole[box] = piece & ~across, best
        found = shortest_path(keeping(problem, opened, whole), box, opened[box], zone=zone)
        if found is None:
            break
        done = best = np.where(opened[box], found, best)
    return done


def _across(
    labels: Mask, side: npt.NDArray[np.uint8], piece: Mask, place: npt.NDArray[np.intp]
) -> Mask | None:
    """A line of pixels from what shows ``a`` for good to what shows ``b`` for good, through two neighbours at
    a place of the seam; it never crosses the seam again. None where there is none.
    """
    from skimage.graph import MCP  # takes a while to load

    line = np.zeros(labels.shape, bool)
    for pixel in (place, place + np.array([0, 1])):
        shows = bool(labels[tuple(pixel)])
        ground = side == (B if shows else A)
        cost = np.where((piece & (labels == shows)) | ground, 1.0, -1.0)  # what is negative is no way
        ways = MCP(cost, fully_connected=False)
        far, _ = ways.find_costs([tuple(pixel)])
        far = np.where(ground, far, np.inf)
        end = np.unravel_index(int(far.argmin()), far.shape)
        if not np.isfinite(far[end]):
            return None
        line[tuple(np.transpose(ways.traceback(end)))] = True
    return line
