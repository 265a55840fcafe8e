"""Moves in which one layer recedes along several others at once, and what would nearly change.

An expansion lets one layer take what it wants. Where a layer had better leave what it shows to several
others, none of these may gain by taking its part alone, and expansions end. So each layer is asked whether it
recedes: expansions tell what the others would show where it does if it showed nothing there, and one *fusion
move* (Lempitsky, Rother, Roth and Blake 2010, doi:10.1109/TPAMI.2009.143) where that replaces it. With x = 1
for a pixel that layer k leaves, i and j what would show at p and q instead, two pixels of k cost ::

    M_ik x_p (1 - x_q) + M_kj (1 - x_p) x_q + M_ij x_p x_q

which is submodular while M_ij ≤ M_ik + M_kj. All layers are asked together, on copies of the solution one
below the other, in each of which just what one layer shows may change.

What would change if what there is cost some per cent more is where costs that are reduced may be wrong. As
the cost of what there is rises, more turns, and nothing turns back: what gains as it is lies within that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from toposeam.images import Mask
from toposeam.layers.choices import Choices, Indices
from toposeam.layers.deciding import Decide
from toposeam.layers.edges import Edges
from toposeam.layers.pieces import pieces_of

#: Of each layer by itself, rows and columns of pixels.
Hints = dict[tuple[int, ...], tuple[Indices, Indices]]
#: Pixels by flat index, and which layers would show there.
Left = tuple[Indices, npt.NDArray[np.int16]]

#: Times at most that all layers are asked, and rounds of expansions after each.
_TIMES, _MOST = 3, 100
#: A layer is worth asking at the next size where it would leave so many pixels to others than the one that
#: takes most: what one layer takes an expansion finds.
_SEVERAL = 30


def settle(choices: Choices, decide: Decide, order: Sequence[int], dearer: float) -> list[int]:
    """Let layers recede until none gains by it; which are worth asking again at the next size, since they
    would recede along several others if what there is cost more by a share.
    """
    left: dict[int, Left] = {}
    for _ in range(_TIMES):
        gained, left = recede(choices, decide, order, range(len(choices.layers)), dearer)
        if not gained:
            break
        choices.run(decide, _MOST, order)
    taken = {k: np.sort(np.bincount(others)) for k, (_, others) in left.items()}
    return [k for k, counts in taken.items() if counts[:-1].sum() >= _SEVERAL]


def nearly(
    choices: Choices,
    decide: Decide,
    order: Sequence[int],
    asked: Sequence[int],
    dearer: tuple[float, float],
) -> Hints:
    """Of each layer where it would show if what there is cost more by a share: the first one where some
    layers that are asked recede, the second one where any expands. What gains as it is turns.
    """
    gained, left = recede(choices, decide, order, asked, dearer[0])
    if gained:
        choices.run(decide, 1, order)
    found: dict[int, list[Indices]] = {k: [] for k in range(len(choices.layers))}
    for at, others in left.values():
        for k in np.unique(others).tolist():
            found[k].append(at[others == k])
    for k, own in found.items():
        turned = choices.would_expand(k, decide, dearer[1])
        own.append(turned)
        other = choices.shows.copy()
        other[turned] = k
        turned, gains = fusion(choices, other, decide)
        choices.shows[turned[gains]] = k
    width = choices.box.shape[1]
    return {(choices.layers[k],): np.divmod(np.concatenate(own), width) for k, own in found.items()}


def recede(
    choices: Choices, decide: Decide, order: Sequence[int], asked: Sequence[int], dearer: float
) -> tuple[bool, dict[int, Left]]:
    """Let layers recede where that gains; whether any did, and of each what it would leave to which others if
    what there is cost more by a share.
    """
    which = [k for k in asked if (choices.shows == k).any()]
    if not which:
        return False, {}
    stack, pixels = _copies(choices, which)
    now = stack.shows.copy()
    for k in order:
        stack.shows[stack.may[k]] = k
    stack.run(decide, 1, order)
    without, stack.shows = stack.shows, now
    turned, gains = fusion(stack, without, decide, dearer)
    ends = np.searchsorted(turned, np.arange(len(which) + 1) * pixels).tolist()
    left = {
        k: (turned[first:last] - place * pixels, without[turned[first:last]])
        for place, (k, first, last) in enumerate(zip(which, ends, ends[1:], strict=False))
    }
    if dearer and len(turned):
        other = now.copy()
        other[turned] = without[turned]
        turned, gains = fusion(stack, other, decide)
    turned, before = turned[gains], choices.shows
    for place in range(len(which)):
        own = turned[turned // pixels == place]
        if len(own):
            other = choices.shows.copy()
            other[own - place * pixels] = without[own]
            choices.fuse(other)
    return bool((choices.shows != before).any()), left


def fusion(
    choices: Choices, other: npt.NDArray[np.int16], decide: Decide, dearer: float = 0.0
) -> tuple[Indices, Mask]:
    """The pixels that turn to what another solution, (h w,), shows if what there is cost more by a share,
    and of each whether its piece gains as it is.
    """
    shows, nothing = choices.shows, len(choices.layers)
    free = (shows != other) & (other != nothing) & (shows != nothing)
    piece, count = pieces_of(free.reshape(choices.box.shape))
    piece = piece.ravel()
    if not count:
        return np.zeros(0, np.intp), np.zeros(0, bool)
    p, q, _ = choices.edges
    own = (piece[p] > 0) | (piece[q] > 0)
    own &= (shows[p] != nothing) & (shows[q] != nothing)
    edges = choices.edges.some(np.flatnonzero(own))
    turned, gains = choices.turned(other, piece, count, edges, decide, dearer)
    return turned, gains[piece[turned]]


def _copies(choices: Choices, which: Sequence[int]) -> tuple[Choices, int]:
    """Copies of the solution, one for each of some layers, in which just what that shows may change; how many
    pixels each has.
    """
    stack, count = choices.copies(len(which)), len(choices.layers)
    size, pixels = len(choices.shows), len(choices.shows) + choices.box.shape[1]
    stack.may = np.zeros((count, len(which) * pixels), bool)
    stack.shows = np.full(len(which) * pixels, count, np.int16)
    p, q, _ = choices.edges
    edges = []
    for first, k in zip(range(0, len(stack.shows), pixels), which, strict=True):
        part = slice(first, first + size)
        own = (choices.shows == k) & choices.several
        stack.shows[part] = choices.shows
        stack.may[:, part] = choices.may & own
        stack.may[k, part] = False
        near = choices.edges.some(np.flatnonzero(own[p] | own[q]))
        edges.append((near.p + first, near.q + first, near.column))
    stack.edges = Edges(*(np.concatenate(ends) for ends in zip(*edges, strict=True)))
    return stack, pixels
