"""The Seam window: a colour for each layer, and Re-stitch by itself when a stroke ends. It stays open while
people paint.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import partial

import gi

for _name, _version in (("Gtk", "3.0"), ("Gdk", "3.0"), ("GimpUi", "3.0")):
    gi.require_version(_name, _version)
from gi.repository import Gdk, GdkPixbuf, GimpUi, GLib, Gtk  # noqa: E402

from toposeam_gimp.actions.painting import Painting  # noqa: E402
from toposeam_gimp.texts import _  # noqa: E402

#: How often it looks whether a button is pressed, ms, and after how many such looks it looks at the strokes
#: in any case, as they may be painted by keys or a quick touch. A stroke counts as ended when nothing has
#: changed since the last look and no button is pressed.
_LOOK_EVERY_MS, _SELDOM = 150, 6
#: Side of the small copy by which a change is seen, px, the most that GIMP gives.
_SMALL = 1024
#: Size of a colour on its button, and space between widgets, px.
_CHIP, _SPACE = 16, 6
#: Longest name of a layer, and width of what is said, characters.
_NAME, _WIDE = 24, 36


class SeamWindow:
    """The window for the strokes of one stitched group."""

    def __init__(self, painting: Painting) -> None:
        GimpUi.init("toposeam_gimp")
        self._painting = painting
        self._busy = self._changed = self._painted = False
        self._looks, self._seen = 0, self._small()
        self._dialog = Gtk.Dialog(title=_("Seam"), border_width=_SPACE)
        self._dialog.set_keep_above(True)
        self._dialog.set_focus_on_map(False)
        column = self._dialog.get_content_area()
        column.set_spacing(_SPACE)
        first = None
        for index, name in enumerate(painting.names):
            first = self._chip(column, first, index, name)
        self._by_itself = Gtk.CheckButton.new_with_mnemonic(_("Re-stitch by _itself when a stroke ends"))
        self._by_itself.set_active(True)
        shows = Gtk.CheckButton.new_with_mnemonic(_("Show _strokes"))
        shows.set_active(True)
        shows.connect("toggled", self._show)
        again = Gtk.Button.new_with_mnemonic(_("_Re-stitch"))
        again.connect("clicked", lambda _button: self._work(painting.restitch))
        place = Gtk.Button.new_with_mnemonic(_("_Next bad place"))
        place.connect("clicked", lambda _button: self._work(painting.next_place))
        back = Gtk.Button.new_with_mnemonic(_("_Undo stroke"))
        back.connect("clicked", lambda _button: self._work(painting.undo_stroke))
        self._buttons = Gtk.Grid(column_spacing=_SPACE, row_spacing=_SPACE, column_homogeneous=True)
        for at, button in enumerate((again, back, place)):
            self._buttons.attach(button, at % 2, at // 2, 1, 1)
        self._bar = Gtk.ProgressBar()
        self._said = Gtk.Label(wrap=True, xalign=0, width_chars=_WIDE, max_width_chars=_WIDE)
        self._said.set_text(
            _(
                "Choose a layer, and paint roughly where it shall show. Ctrl+Z takes back the seam, then the "
                "stroke."
            )
        )
        for widget in (self._by_itself, shows, self._buttons, self._bar, self._said):
            column.pack_start(widget, False, False, 0)
        self._dialog.add_button(_("_Close"), Gtk.ResponseType.CLOSE)
        self._dialog.connect("response", lambda *_event: Gtk.main_quit())

    def run(self) -> None:
        """Show the window until it is closed, or the image or its strokes are gone."""
        self._dialog.show_all()
        timer = GLib.timeout_add(_LOOK_EVERY_MS, self._look)
        Gtk.main()
        GLib.source_remove(timer)
        self._dialog.destroy()
        if self._painting.goes_on:
            self._painting.finish()

    def _chip(self, column: Gtk.Box, first: Gtk.RadioButton | None, index: int, name: str) -> Gtk.RadioButton:
        """Add the button of a layer, with its colour."""
        button = Gtk.RadioButton.new_from_widget(first)
        row, label = Gtk.Box(spacing=_SPACE), Gtk.Label(label=name, xalign=0)
        label.set_max_width_chars(_NAME)
        label.set_ellipsize(3)  # Pango's END
        colour = GdkPixbuf.Pixbuf.new(GdkPixbuf.Colorspace.RGB, False, 8, _CHIP, _CHIP)
        colour.fill(int.from_bytes([*self._painting.colour_of(index), 255]))
        chip = Gtk.Image.new_from_pixbuf(colour)
        row.pack_start(chip, False, False, 0)
        row.pack_start(label, True, True, 0)
        button.add(row)
        button.get_accessible().set_name(name)
        button.set_active(self._painting.is_chosen(index))
        button.connect("clicked", lambda _button: self._choose(index) if button.get_active() else None)
        column.pack_start(button, False, False, 0)
        return first or button

    def _show(self, box: Gtk.CheckButton) -> None:
        if self._painting.goes_on:
            self._painting.show(box.get_active())

    def _choose(self, index: int) -> None:
        if self._painting.goes_on:
            self._painting.choose(index)

    def _look(self) -> bool:
        """Join the layers again when a stroke has ended."""
        if self._busy:
            return True
        if not self._painting.goes_on:
            Gtk.main_quit()
            return False
        pressed, self._looks = _presses(), self._looks + 1
        self._changed = self._changed or pressed
        if pressed or not (self._changed or self._looks % _SELDOM == 0):
            return True
        seen = self._small()
        changes, self._seen = seen != self._seen, seen
        if changes:
            self._changed = self._painted = True
            return True
        self._changed = False
        if self._painted:
            self._painted = False
            if self._by_itself.get_active():
                self._work(partial(self._painting.restitch, news_only=True))
            self._painting.note_stroke()
        return True

    def _small(self) -> bytes:
        """Return a checksum of a small copy of the strokes."""
        content = self._painting.strokes.get_thumbnail_data(_SMALL, _SMALL)[0]
        return hashlib.blake2b(content.get_data(), digest_size=16).digest()

    def _work(self, work: Callable[[Callable[[float], object]], str]) -> None:
        """Do something while the window shows how far it is."""
        self._busy = True
        self._buttons.set_sensitive(False)

        def told(share: float) -> None:
            self._bar.set_fraction(share)
            while Gtk.events_pending():
                Gtk.main_iteration()

        told(0.02)
        self._said.set_text(work(told))
        self._bar.set_fraction(0.0)
        self._buttons.set_sensitive(True)
        self._busy = False


def _presses() -> bool:
    """Test whether a button of the mouse or the pen is pressed."""
    seat = Gdk.Display.get_default().get_default_seat()
    _window, _x, _y, state = Gdk.get_default_root_window().get_device_position(seat.get_pointer())
    return bool(state & Gdk.ModifierType.BUTTON1_MASK)
