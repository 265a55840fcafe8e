"""Variants of a result side by side, of which people take one by a click: each has a seed of its own."""

from __future__ import annotations

from collections.abc import Callable

from gi.repository import GdkPixbuf

COUNT = 3
#: Between variants, and round the one that is taken, px of the screen.
_GAP, _FRAME = 6, 3
_FRAME_COLOUR = 0x3584E4FF


class Variants:
    """The variants of a preview."""

    def __init__(self) -> None:
        self._first = 0
        self._pictures: list[GdkPixbuf.Pixbuf] = []

    def begin(self, seed: int, most: int) -> int:
        """Start anew with variants of which a seed's is one; return the first one's seed."""
        if not self._first <= seed < self._first + COUNT:
            self._first = min(seed, most - COUNT)
        self._pictures = []
        return self._first

    def add(self, picture: GdkPixbuf.Pixbuf) -> int | None:
        """Add a variant; return the next one's seed, None if that was the last."""
        self._pictures.append(picture)
        done = len(self._pictures)
        return self._first + done if done < COUNT else None

    def seed_at(self, share: float) -> int:
        """Return the seed of the variant at a share of the picture's width."""
        return self._first + min(max(int(share * COUNT), 0), COUNT - 1)

    def picture(
        self, seed: int, scaled: Callable[[GdkPixbuf.Pixbuf, int], GdkPixbuf.Pixbuf], dots: int
    ) -> GdkPixbuf.Pixbuf:
        """Return all in a row, with a frame round that of the seed.

        Parameters
        ----------
        seed : int
        scaled : callable
            Scales a variant for the screen; also called with how many there are.
        dots : int
            Px of the screen for each of its px in layouts.
        """
        shown = [scaled(picture, COUNT) for picture in self._pictures]
        width, height, gap, frame = shown[0].get_width(), shown[0].get_height(), _GAP * dots, _FRAME * dots
        wide = COUNT * (width + 2 * frame) + (COUNT - 1) * gap
        row = GdkPixbuf.Pixbuf.new(GdkPixbuf.Colorspace.RGB, True, 8, wide, height + 2 * frame)
        row.fill(0)
        for index, one in enumerate(shown):
            left = index * (width + 2 * frame + gap)
            if self._first + index == seed:
                row.new_subpixbuf(left, 0, width + 2 * frame, height + 2 * frame).fill(_FRAME_COLOUR)
            one.copy_area(0, 0, width, height, row, left + frame, frame)
        return row
