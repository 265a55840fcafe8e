"""Options of the choice and the cutting of patches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypedDict

import numpy as np

from toposeam.checks import check_choice, check_number, check_whole
from toposeam.errors import OptionError, Term
from toposeam.seam.find import METHODS, Method
from toposeam.seam.problem.match_cost import MatchCost, check_no_reach


class LayKeywords(TypedDict, total=False):
    """Fields of :class:`LayOptions`."""

    tolerance: float
    candidates: int
    context: int
    context_weight: float
    most: float
    variety: float
    copy_patches: float
    copy_share: float
    mend: float
    close: bool
    method: Method
    cost: MatchCost | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LayOptions:
    """Options of the choice and the cutting of patches.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> sample = np.random.default_rng(0).random((48, 48))
    >>> ts.synth(sample, (60, 60), patch=20, options=ts.texture.LayOptions(mend=0)).image.shape
    (60, 60)
    """

    #: A patch is drawn at random from those whose error is at most 1 + tolerance times the least.
    tolerance: float = 0.1
    #: Number of different places that are compared.
    candidates: int = 8
    #: px round the patch in which known pixels are compared too.
    context: int = 8
    #: Weight of a pixel of the context; one of the overlap has weight 1.
    context_weight: float = 0.5
    #: Without a guide no source pixel shows more often than this many times the average.
    most: float = 2.5
    #: Strength of the penalties on places that show often already, or near by.
    variety: float = 0.5
    #: Largest area of a connected copy: this many patches, and this share of the pixels that may be copied.
    copy_patches: float = 3.0
    copy_share: float = 0.2
    #: Number of further patches that are tried over the worst seams, as a share of the patches laid; where
    #: there are objects on a ground, those that are cut or come twice near by are replaced instead, unless it
    #: is 0.
    mend: float = 0.2
    #: Whether ordered textures keep step with their order (:mod:`toposeam.texture.periodicity.phase`).
    close: bool = True
    #: Method by which the seam is found.
    method: Method = "auto"
    cost: MatchCost | None = None

    def __post_init__(self) -> None:
        for name, low, high in (
            ("tolerance", 0, 10),
            ("context_weight", 0, 1),
            ("most", 1, np.inf),
            ("variety", 0, 100),
            ("copy_patches", 0, np.inf),
            ("copy_share", 0, 1),
            ("mend", 0, 10),
        ):
            check_number(name, getattr(self, name), low, high, infinite=high == np.inf)
        check_whole("candidates", self.candidates, 1, 1000)
        check_whole("context", self.context, 0, 64)
        check_choice("method", self.method, METHODS)
        check_choice("close", self.close, (True, False))
        if self.cost is not None and not isinstance(self.cost, MatchCost):
            raise OptionError(
                "{parameter} is of class {type}; pass a MatchCost",
                kind="type",
                parameter=Term("cost"),
                value=self.cost,
                type=type(self.cost).__name__,
            )
        if self.cost is not None:
            check_no_reach(self.cost, "textures")


#: The options that a variation stands for.
VARIED = ("tolerance", "candidates", "most", "variety")


def varied(options: LayOptions, variation: float) -> LayOptions:
    """Derive options from a variation in [0, 1], 0.5 being the usual one.

    Raises
    ------
    OptionError

    Examples
    --------
    >>> varied(LayOptions(), 0.5) == LayOptions()
    True
    >>> low, high = varied(LayOptions(), 0), varied(LayOptions(), 1)
    >>> (low.tolerance, low.candidates, low.variety), (high.tolerance, high.candidates, high.variety)
    ((0.0, 1, 0.0), (1.0, 64, 2.0))
    """
    value = check_number("variation", variation, 0, 1)
    usual = LayOptions()
    return replace(
        options,
        tolerance=usual.tolerance * (2 * value if value <= 0.5 else 10 ** (2 * value - 1)),
        candidates=round(usual.candidates ** (2 * value)),
        most=usual.most * 0.6 ** (2 * value - 1),
        variety=usual.variety * (2 * value) ** 2,
    )
