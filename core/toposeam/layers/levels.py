"""Seams of many layers from coarse to fine.

Large canvases are looked at reduced first (:mod:`toposeam.layers.reduction`): there rounds of moves are
made (:mod:`toposeam.layers.rounds`). Then every finer size is refined where the coarser
one says that it matters.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toposeam.layers.labelling import Labelling
from toposeam.layers.progressed import Progress, Progressed
from toposeam.layers.reduction import enlarged, opened, reduced
from toposeam.layers.rounds import Rounds
from toposeam.seam.find import Method

#: Problems in which so many pixels have several layers to choose from, or more, are reduced first.
WHOLE_PIXELS = 10_000
#: Problems are not reduced below so many pixels a side.
_SHORTEST = 32


def best_rounds(
    labelling: Labelling,
    order: Sequence[int],
    method: Method,
    options: dict[str, Any],
    most: int,
    progress: Progress | None = None,
    potentials: bool = False,
) -> tuple[Rounds, int]:
    """The cheapest label map that is found, and how many rounds were made.

    Parameters
    ----------
    labelling : Labelling
    order : sequence of int
        In which the layers are joined if no rounds are wanted.
    method, options
        How moves are solved, as for :func:`toposeam.find_seam`.
    most : int
        Rounds at most; with 0 the layers are only joined one after another, in the order.
    potentials : bool
        Whether the label potentials of all seams are wanted, however large the canvas is.
    """
    steps = Progressed(progress)
    levels = [labelling]
    while (
        levels[-1].contested(WHOLE_PIXELS + 1) > WHOLE_PIXELS and min(levels[-1].canvas.shape) > 2 * _SHORTEST
    ):
        levels.append(reduced(levels[-1]))
        steps.one()
    coarsest = levels.pop()
    rounds = Rounds(
        coarsest, coarsest.on_top(), method, options, steps=steps, finer=len(levels), keeps=potentials
    )
    number = rounds.search(order, most)
    while levels:
        finer = levels.pop()
        near = opened(rounds.beside_seams(), finer)
        hints = rounds.undecided
        rounds = Rounds(
            finer, enlarged(rounds.label_map, finer), method, options, near, steps, len(levels), potentials
        )
        rounds.refine(most, hints)
    return rounds, number
