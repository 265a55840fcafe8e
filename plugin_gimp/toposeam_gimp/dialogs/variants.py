"""Variants of a result, each with a seed of its own, one of which is shown and taken."""

from __future__ import annotations

from collections.abc import Callable

from gi.repository import GdkPixbuf, Gtk

from toposeam_gimp.texts import _

_COUNT = 3


class Variants:
    """The variants of a preview, and a button for each, also for those that are still drawn.

    Parameters
    ----------
    take : callable
        Called with the seed of the variant that is chosen.
    """

    def __init__(self, take: Callable[[int], object]) -> None:
        self._first, self._take = 0, take
        self._pictures: list[GdkPixbuf.Pixbuf] = []
        #: The buttons.
        self.widget = Gtk.Box()
        self.widget.get_style_context().add_class("linked")
        self._buttons: list[Gtk.RadioButton] = []
        for index in range(_COUNT):
            button = Gtk.RadioButton.new_with_mnemonic_from_widget(
                (self._buttons or [None])[0], f"_{index + 1}"
            )
            button.set_mode(False)
            button.set_tooltip_text(_("Shows this variant, which OK takes"))
            button.connect("toggled", self._chosen, index)
            self.widget.pack_start(button, False, False, 0)
            self._buttons.append(button)

    def begin(self, seed: int, most: int) -> int:
        """Start anew with variants that include that of a seed; return the first one's seed."""
        if not self._first <= seed < self._first + _COUNT:
            self._first = min(seed, most - _COUNT)
        self._pictures = []
        self._buttons[seed - self._first].set_active(True)
        return self._first

    def add(self, picture: GdkPixbuf.Pixbuf) -> int | None:
        """Add a variant; return the seed of the next one, or None after the last."""
        self._pictures.append(picture)
        done = len(self._pictures)
        return self._first + done if done < _COUNT else None

    def picture(self, seed: int) -> GdkPixbuf.Pixbuf | None:
        """Return the variant of a seed, or the last one that is there; None without any."""
        return self._pictures[min(seed - self._first, len(self._pictures) - 1)] if self._pictures else None

    def _chosen(self, button: Gtk.RadioButton, index: int) -> None:
        if button.get_active():
            self._take(self._first + index)
