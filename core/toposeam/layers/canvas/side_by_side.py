"""Place two layers side by side by the length of their overlap."""

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
    """Place two pictures so that the second one continues the first at one side.

    Parameters
    ----------
    a, b : (H, W) or (H, W, C) array_like, or Layer
        A layer ``a`` keeps its place, and a layer ``b`` is moved.
    overlap : float or str
        Length of the overlap: whole px, or a percentage of ``a`` like "25%".
    side : {"right", "left", "bottom", "top"}
        The side of ``a`` at which ``b`` continues; the two are aligned at the top, or at the left.

    Returns
    -------
    (Layer, Layer)
        The layers, for :func:`toposeam.stitch`; arrays are named "a" and "b".

    Raises
    ------
    OptionError
        If the overlap is not a length, or larger than one of the pictures.

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
    """Compute (x, y), px, by which the second of two pictures must be moved.

    `whole` and `other` are the sizes, px, of the first and second picture across that side.

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
