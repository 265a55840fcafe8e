"""A list of the layers, masks and channels of an image; GIMP's own chooser has no masks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from gi.repository import GdkPixbuf, Gimp, Gtk

from toposeam_gimp.entries.entry import Option
from toposeam_gimp.texts import _

_THUMBNAIL = 28


class DrawableChoice:
    """A list that sets an option to one of several drawables."""

    def __init__(
        self,
        config: Gimp.ProcedureConfig,
        option: Option,
        image: Gimp.Image | None,
        besides: Sequence[Gimp.Drawable],
    ) -> None:
        self._config, self._option = config, option
        self._choices: list[tuple[Gimp.Drawable | None, str]] = [(None, option.none)] if option.none else []
        if image is not None:
            self._choices += choices(image, _all(image.get_layers()) if option.none else besides)
        store = Gtk.ListStore(GdkPixbuf.Pixbuf, str)
        for drawable, name in self._choices:
            store.append([drawable and _thumbnail(drawable), name])
        self.widget = Gtk.ComboBox(model=store, hexpand=True)
        picture, text = Gtk.CellRendererPixbuf(), Gtk.CellRendererText()
        self.widget.pack_start(picture, False)
        self.widget.add_attribute(picture, "pixbuf", 0)
        self.widget.pack_start(text, True)
        self.widget.add_attribute(text, "text", 1)
        known = [drawable and drawable.get_id() for drawable, _name in self._choices]
        chosen = config.get_property(option.name)
        self.widget.set_active(known.index(chosen.get_id()) if chosen and chosen.get_id() in known else 0)
        self.widget.connect("changed", lambda _list: self._choose())
        self._choose()

    def _choose(self) -> None:
        index = self.widget.get_active()
        if 0 <= index < len(self._choices):
            self._config.set_property(self._option.name, self._choices[index][0])


def choices(image: Gimp.Image, besides: Iterable[Gimp.Drawable]) -> Iterator[tuple[Gimp.Drawable, str]]:
    """Yield the drawables of an image that can be a source, with their names: layers, masks, channels."""
    own = {drawable.get_id() for drawable in besides}
    layers = list(_all(image.get_layers()))
    for layer in layers:
        if layer.get_id() not in own:
            yield layer, layer.get_name()
    for layer in layers:
        if layer.get_mask() is not None:
            yield layer.get_mask(), _("Mask of {name}").format(name=layer.get_name())
    for channel in image.get_channels():
        yield channel, _("Channel {name}").format(name=channel.get_name())


def _all(layers: Sequence[Gimp.Layer]) -> Iterator[Gimp.Layer]:
    for layer in layers:
        yield layer
        if layer.is_group():
            yield from _all(layer.get_children())


def _thumbnail(drawable: Gimp.Drawable) -> GdkPixbuf.Pixbuf | None:
    return drawable.get_thumbnail(_THUMBNAIL, _THUMBNAIL, Gimp.PixbufTransparency.SMALL_CHECKS)
