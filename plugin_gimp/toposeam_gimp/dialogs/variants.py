"""Variants of a result side by side, each with a seed of its own, to choose from by a click."""

from __future__ import annotations

from collections.abc import Callable

from gi.repository import GdkPixbuf

COUNT = 3
#: Gap between variants, and width of the frame round the chosen one, px of the screen.
GAP, _FRAME = 6, 3
_FRAME_COLOUR = 0x3584E4FF


class Variants:
    """The variants of a preview."""

    def __init__(self) -> None:
        self._first = 0
        self._pictures: list[GdkPixbuf.Pixbuf] = []

    def begin(self, seed: int, most: int) -> int:
        """Start anew with variants that include that of a seed; return the first one's seed."""
        if not self._first <= seed < self._first + COUNT:
            self._first = min(seed, most - COUNT)
        self._pictures = []
        return self._first

    def add(self, picture: GdkPixbuf.Pixbuf) -> int | None:
        """Add a variant; return the seed of the next one, or None after the last."""
        self._pictures.append(picture)
        done = len(self._pictures)
        return self._first + done if done < COUNT else None

    def seed_at(self, share: float) -> int:
        """Return the seed of the variant at a share of the picture's width."""
        return self._first + min(max(int(share * COUNT), 0), COUNT - 1)

    def pictures(
        self, seed: int, scaled: Callable[[GdkPixbuf.Pixbuf, int], GdkPixbuf.Pixbuf], dots: int
    ) -> list[GdkPixbuf.Pixbuf]:
        """Return the variants, with a frame round that of the seed and as much room round the others.

        Parameters
        ----------
        seed : int
        scaled : callable
            Scales a variant for the screen; its second argument is the number of variants.
        dots : int
            Pixels of the screen per logical px.
        """
        framed, frame = [], _FRAME * dots
        for index, picture in enumerate(self._pictures):
            shown = scaled(picture, COUNT)
            width, height = shown.get_width(), shown.get_height()
            one = GdkPixbuf.Pixbuf.new(
                GdkPixbuf.Colorspace.RGB, True, 8, width + 2 * frame, height + 2 * frame
            )
            one.fill(_FRAME_COLOUR if self._first + index == seed else 0)
            shown.copy_area(0, 0, width, height, one, frame, frame)
            framed.append(one)
        return framed
