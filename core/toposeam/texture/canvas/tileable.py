"""The borders of a texture that continue at the opposite one."""

from __future__ import annotations

from typing import Literal

from toposeam.checks import check_choice

Tileable = bool | Literal["both", "x", "y", "none"]
#: Axes along which a texture repeats.
TILEABLE: tuple[str, ...] = ("both", "x", "y", "none")


def wraps_of(tileable: Tileable) -> tuple[bool, bool]:
    """Test whether rows, and whether columns, continue at the opposite border.

    Parameters
    ----------
    tileable : {"both", "x", "y", "none"} or bool
        True stands for "both", False for "none".

    Raises
    ------
    OptionError

    Examples
    --------
    >>> wraps_of("x"), wraps_of(True)
    ((False, True), (True, True))
    """
    check_choice("tileable", tileable, (*TILEABLE, True, False) if isinstance(tileable, bool) else TILEABLE)
    return tileable in (True, "both", "y"), tileable in (True, "both", "x")
