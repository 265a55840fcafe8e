"""Refinement of a seam in a band: the best one of all seams that stay near it, or near other flows.

Pixels that coarse networks have merged are never divided again; most of the cost of that comes from missed
detours of ten to sixty pixels. So when heat has found where the seam runs, all pixels near it are free again,
and those near the other ways that heat could still take; the best cut divides them. Where the seam leads from
one gap to another, that cut is a shortest path between corners (:mod:`toposeam.seam.exact.optimum`), which
takes a small part of the time that the heat took. A seam that closes on itself is opened at one place after
another: a line of pixels across it keeps its labels, so that the seam passes there as before, and the rest is
a path. Where several seams divide an overlap, each is refined alone, in a corridor so narrow that they do not
meet.
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

#: Half width of the corridor along other flows, in cells of `toposeam.seam.problem.grid`.
FLOW_CELLS = 3
#: Number of places at which a closed seam is opened in turn.
_OPENINGS = 2
#: Places tried, about, for each opening: from islands of a labelling no line leads across the seam.
_PLACES_TRIED = 8

_Box = tuple[slice, slice]


def best_nearby(problem: SeamProblem, labels: Mask, open_pixels: Mask) -> Mask:
    """Find the best labelling whose seam stays near a given one, or near other pixels; never a dearer one.

    Parameters
    ----------
    problem : SeamProblem
        Without unary costs, which no path can express.
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
            found = _refine_closed(problem, here, piece, best, zone)
        if found is not None:
            best = _cheaper(problem, best, here, piece, found)
            continue
        for cells in (SEAM_CELLS, SEAM_CELLS // 2, 1):
            best, parted = _divide_corridors(problem, best, here, piece & grown(seam, cells))
            if parted:
                break
    return best


def beside_seam(labels: Mask, piece: Mask, covered: Mask) -> Mask:
    """Return the pixels of a piece that the labels divide from a covered neighbour."""
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


def _divide_corridors(problem: SeamProblem, best: Mask, box: _Box, near: Mask) -> tuple[Mask, bool]:
    """Divide each corridor of a box anew, while the rest keeps its labels.

    Returns the labelling, and whether every corridor could be divided.
    """
    free = np.zeros(best.shape, bool)
    free[box] = near
    narrowed = fix_labels(problem, free, best)
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
            found = _refine_closed(narrowed, here, piece, best)
        if found is None:
            parted = False
        else:
            best = _cheaper(problem, best, here, piece, found)
    return best, parted


def fix_labels(problem: SeamProblem, free: Mask, labels: Mask) -> SeamProblem:
    """Fix the labels of all but some free pixels: the same problem with fewer free pixels."""
    side = problem.overlap.side
    kept = np.where((side == FREE) & ~free, labels, side).astype(np.uint8)
    return dataclasses.replace(problem, overlap=dataclasses.replace(problem.overlap, side=kept))


def _refine_closed(
    problem: SeamProblem, box: _Box, piece: Mask, labels: Mask, zone: Mask | None = None
) -> Mask | None:
    """Improve a closed seam in a box by opening it at one place after another.

    Returns the labels of the box; None where no place makes a path of the seam.
    """
    best, done = labels[box].copy(), None
    place = None
    for _ in range(_OPENINGS):
        places = np.argwhere(piece[:, :-1] & piece[:, 1:] & (best[:, 1:] != best[:, :-1]))
        if place is not None:  # the farthest from the last one come first
            places = places[np.argsort(-((places - place) ** 2).sum(axis=1), kind="stable")]
        across = None
        for place in places[:: max(1, len(places) // _PLACES_TRIED)]:
            across = _line_across(best, problem.overlap.side[box], piece, place)
            if across is not None:
                break
        if across is None:
            break
        opened, whole = np.zeros(labels.shape, bool), labels.copy()
        opened[box], whole[box] = piece & ~across, best
        found = shortest_path(fix_labels(problem, opened, whole), box, opened[box], zone=zone)
        if found is None:
            break
        done = best = np.where(opened[box], found, best)
    return done


def _line_across(
    labels: Mask, side: npt.NDArray[np.uint8], piece: Mask, place: npt.NDArray[np.intp]
) -> Mask | None:
    """Find a line of pixels across the seam, from ground fixed to ``a`` to ground fixed to ``b``.

    It crosses the seam once, between two neighbouring pixels at the given place. None where there is none.
    """
    from skimage.graph import MCP  # takes a while to load

    line = np.zeros(labels.shape, bool)
    for pixel in (place, place + np.array([0, 1])):
        shows = bool(labels[tuple(pixel)])
        ground = side == (B if shows else A)
        cost = np.where((piece & (labels == shows)) | ground, 1.0, -1.0)  # no way through negative costs
        ways = MCP(cost, fully_connected=False)
        far, _ = ways.find_costs([tuple(pixel)])
        far = np.where(ground, far, np.inf)
        end = np.unravel_index(int(far.argmin()), far.shape)
        if not np.isfinite(far[end]):
            return None
        line[tuple(np.transpose(ways.traceback(end)))] = True
    return line
