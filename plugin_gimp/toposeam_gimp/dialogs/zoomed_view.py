"""A view of a picture that fills its room, is zoomed by the mouse wheel and moved by dragging."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gi.repository import Gdk, GLib, Gtk

_STEP, _MOST = 1.25, 8.0
#: Margin of the room, px, so that no scroll bars appear where the picture fits.
_MARGIN = 4


class ZoomedView:
    """A scrolled view round a picture that its owner draws.

    Parameters
    ----------
    picture : Gtk.Widget
    least : (int, int)
        Least width and height, px.
    refresh : callable
        Draws the picture again for a new :attr:`room` or :attr:`zoom`.
    paint : callable
        Called with a place that the pressed pointer passes, as shares of the picture's width and height, and
        whether it is let go there. If it returns False, the picture is moved instead.
    """

    def __init__(
        self,
        picture: Gtk.Widget,
        least: tuple[int, int],
        refresh: Callable[[], object],
        paint: Callable[[float, float, bool], bool],
    ) -> None:
        self._picture, self._refresh, self._paint, self._least = picture, refresh, paint, least
        #: Enlargement relative to a picture that fills the room.
        self.zoom = 1.0
        self._seen = least
        self._held: tuple[float, float] | None = None
        self._paints = False
        box = Gtk.EventBox()
        box.add(picture)
        box.add_events(
            Gdk.EventMask.SCROLL_MASK
            | Gdk.EventMask.SMOOTH_SCROLL_MASK
            | Gdk.EventMask.BUTTON_PRESS_MASK
            | Gdk.EventMask.BUTTON_RELEASE_MASK
            | Gdk.EventMask.POINTER_MOTION_MASK
        )
        box.connect("scroll-event", self._scrolled)
        box.connect("button-press-event", self._pressed)
        box.connect("button-release-event", self._released)
        box.connect("motion-notify-event", self._moved)
        self.widget = Gtk.ScrolledWindow(hexpand=True, vexpand=True)
        self.widget.set_size_request(*least)
        self.widget.add(box)
        self.widget.connect("size-allocate", self._allocated)

    @property
    def room(self) -> tuple[int, int]:
        """Available width and height, px."""
        return self._seen[0] - _MARGIN, self._seen[1] - _MARGIN

    def _allocated(self, _widget: Gtk.Widget, room: Any) -> None:
        now = max(room.width, self._least[0]), max(room.height, self._least[1])
        if now != self._seen:
            self._seen = now
            GLib.idle_add(self._draw)

    def _draw(self) -> bool:
        self._refresh()
        return False

    def _scrolled(self, _widget: Gtk.Widget, event: Any) -> bool:
        _smooth, _across, down = event.get_scroll_deltas()
        up = event.direction == Gdk.ScrollDirection.UP or down < 0
        self.zoom = min(max(self.zoom * (_STEP if up else 1 / _STEP), 1.0), _MOST)
        self._refresh()
        return True

    def _pressed(self, _widget: Gtk.Widget, event: Any) -> bool:
        self._held, self._paints = (event.x_root, event.y_root), self._at(event, False)
        return True

    def _released(self, _widget: Gtk.Widget, event: Any) -> bool:
        self._held = None
        if self._paints:
            self._at(event, True)
        return True

    def _at(self, event: Any, ends: bool) -> bool:
        room = self._picture.get_allocation()
        return self._paint((event.x - room.x) / room.width, (event.y - room.y) / room.height, ends)

    def centre(self) -> bool:
        """Show the middle of the picture."""
        for bar in (self.widget.get_hadjustment(), self.widget.get_vadjustment()):
            bar.set_value((bar.get_upper() - bar.get_page_size()) / 2)
        return False

    def _moved(self, _widget: Gtk.Widget, event: Any) -> bool:
        if self._held is None:
            return False
        if self._paints:
            return self._at(event, False)
        for bar, before, now in zip(
            (self.widget.get_hadjustment(), self.widget.get_vadjustment()),
            self._held,
            (event.x_root, event.y_root),
            strict=True,
        ):
            bar.set_value(bar.get_value() + before - now)
        self._held = event.x_root, event.y_root
        return True
