"""Sheets of pictures to look at: rows of pictures beside one another."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from PIL import Image, ImageDraw

#: Between pictures, px.
_GAP = 8


def sheet_of(groups: Sequence[Sequence[np.ndarray]], wide: int = 1) -> Image.Image:
    """Put the pictures of each group beside one another, and so many groups in a row."""
    sizes = [(max(len(one) for one in group), sum(one.shape[1] + _GAP for one in group)) for group in groups]
    height, width = (max(side) + _GAP for side in zip(*sizes, strict=True))
    wide = min(wide, len(groups))
    sheet = Image.new("RGB", (wide * width, -(-len(groups) // wide) * height), "white")
    for place, group in enumerate(groups):
        left, top = place % wide * width, place // wide * height
        for one in group:
            sheet.paste(Image.fromarray(np.ascontiguousarray(one)), (left, top))
            left += one.shape[1] + _GAP
    return sheet


def framed(image: np.ndarray, boxes: Iterable[tuple[slice, slice]]) -> np.ndarray:
    """Draw a red frame round each box of rows and columns."""
    picture = Image.fromarray(image)
    for rows, columns in boxes:
        frame = [columns.start - 3, rows.start - 3, columns.stop + 3, rows.stop + 3]
        ImageDraw.Draw(picture).rectangle(frame, outline=(255, 0, 0))
    return np.asarray(picture)
