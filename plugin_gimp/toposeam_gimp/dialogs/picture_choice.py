"""A choice by pictures: a button with the chosen one, and a menu of all."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gi.repository import Gimp, Gio, Gtk

from toposeam_gimp.entries.entry import Option

_FOLDER = Path(__file__).parents[1] / "pictures"
#: Sides of the pictures on the button and in the menu, logical px; the files have twice as many.
_SMALL, _LARGE = 32, 56
_COLUMNS = 6


def picture(name: str, size: int) -> Gtk.Image | None:
    """Return a picture from the plug-in's folder; None if there is none of that name."""
    for file in (_FOLDER / f"{name}.png", _FOLDER / f"{name}-symbolic.svg"):
        if file.is_file():
            icon = Gio.FileIcon.new(Gio.File.new_for_path(str(file)))
            image = Gtk.Image.new_from_gicon(icon, Gtk.IconSize.DIALOG)
            image.set_pixel_size(size)
            return image
    return None


class PictureChoice:
    """A button that shows the value of an option and sets it."""

    def __init__(self, config: Gimp.ProcedureConfig, option: Option) -> None:
        self._config, self._option = config, option
        self._inside = Gtk.Box(spacing=9)
        self.widget = Gtk.MenuButton(hexpand=True)
        self.widget.add(self._inside)
        self.widget.set_popup(self._menu())
        config.connect(f"notify::{option.name}", lambda *_event: self._show())
        self._show()

    def _menu(self) -> Gtk.Menu:
        menu = Gtk.Menu()
        for index, (nick, label) in enumerate(self._option.choices):
            item = Gtk.MenuItem(tooltip_text=label)
            inside = Gtk.Box(orientation=Gtk.Orientation.VERTICAL, spacing=3)
            image = self._picture(nick, _LARGE)
            if image is not None:
                inside.pack_start(image, False, False, 0)
            # Short names under the pictures; the tooltip and the button have the whole text.
            name = Gtk.Label(label=label.partition(":")[0])
            inside.pack_end(name, image is None, False, 0)
            item.add(inside)
            item.connect("activate", lambda _item, nick=nick: self._choose(nick))
            row, column = divmod(index, _COLUMNS)
            menu.attach(item, column, column + 1, row, row + 1)
        menu.show_all()
        return menu

    def _picture(self, nick: str, size: int) -> Gtk.Image | None:
        return picture("dice" if nick == "random" else f"{self._option.pictures}-{nick}", size)

    def _choose(self, nick: str) -> None:
        self._config.set_property(self._option.name, nick)

    def _show(self) -> None:
        nick: Any = self._config.get_property(self._option.name)
        for child in self._inside.get_children():
            self._inside.remove(child)
        image = self._picture(nick, _SMALL)
        if image is not None:
            self._inside.pack_start(image, False, False, 0)
        label = Gtk.Label(label=dict(self._option.choices).get(nick, nick), xalign=0)
        self._inside.pack_start(label, True, True, 0)
        arrow = Gtk.Image.new_from_icon_name("pan-down-symbolic", Gtk.IconSize.BUTTON)
        self._inside.pack_end(arrow, False, False, 0)
        self._inside.show_all()
