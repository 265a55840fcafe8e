"""Two layers placed by how far they overlap."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

from toposeam.checks import check_choice, check_number
from toposeam.errors import OptionError, Term
from toposeam.layers.canvas.layer import Layer
from toposeam.seam.problem.overlap import SIDES, Side

_PERCENT = re.compile(r"\s*(\d+(?:\.\d+)?)\s*%\s*")


def overlapping(a: Any, b: Any, *, overlap: float | str, side: Side = "right") -> tuple[Layer, Layer]:
    """Two pictures as layers, the second one continuing at one side of the first.

    Parameters
    ----------
    a, b : (H, W) or (H, W, C) array_like, or Layer
        Of layers only the place is changed: ``a`` stays where it is.
    overlap : float or str
        How far they overlap: whole px, or a share of ``a`` like "25%".
    side : {"right", "left", "bottom", "top"}
        Where ``b`` continues; the two are aligned at the top, or at the left.

    Returns
    -------
    (Layer, Layer)
        For :func:`toposeam.stitch`, named "a" and "b".

    Raises
    ------
    OptionError
        When the overlap is no length, or larger than one of the pictures.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> ts.stitch(ts.layers.overlapping(a, b, overlap="25%")).image.shape
    (30, 70)
    """
    check_choice("side", side, SIDES)
    first, second = (
        given if isinstance(given, Layer) else Layer(given, name=name) for given, name in ((a, "a"), (b, "b"))
    )
    across = 1 if side in ("right", "left") else 0
    x, y = shift(first.image.shape[across], second.image.shape[across], overlap, side)
    left, top = first.at
    return first, dataclasses.replace(second, at=(left + x, top + y))


def shift(whole: int, other: int, overlap: float | str, side: Side) -> tuple[int, int]:
    """(x, y) by which a picture of `other` px across a side of one of `whole` px must be moved to overlap it.

    Raises
    ------
    OptionError
        As for :func:`overlapping`.
    """
    percent = _PERCENT.fullmatch(overlap) if isinstance(overlap, str) else None
    if isinstance(overlap, str) and (percent is None or float(percent[1]) > 100):
        raise OptionError(
            "{parameter} is {value!r}; give px, like 120, or a share, like '25%'",
            kind="number",
            parameter=Term("overlap"),
            value=overlap,
        )
    length = round(
        whole * float(percent[1]) / 100 if percent is not None else check_number("overlap", overlap)
    )
    if not 0 < length <= min(whole, other) or (percent is None and length != overlap):
        raise OptionError(
            "{parameter} comes to {length} px, but across that side the first picture has "
            "{whole} px and the second {other} px; choose 1 to {most} px in whole numbers",
            kind="number",
            parameter=Term("overlap"),
            value=overlap,
            length=f"{overlap:.10g}" if percent is None else length,
            whole=whole,
            other=other,
            most=min(whole, other),
        )
    along = whole - length if side in ("right", "bottom") else length - other
    return (along, 0) if side in ("right", "left") else (0, along)
