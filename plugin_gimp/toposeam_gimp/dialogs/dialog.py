"""The dialogs: common options first, the others under “Advanced”, and a preview beside them."""

from __future__ import annotations

import random
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any

import gi

for _name, _version in (("Gtk", "3.0"), ("Gdk", "3.0"), ("GimpUi", "3.0")):
    gi.require_version(_name, _version)
from gi.repository import Gimp, GimpUi, Gio, GLib, GObject, Gtk  # noqa: E402

from toposeam_gimp.dialogs.drawable_choice import DrawableChoice  # noqa: E402
from toposeam_gimp.dialogs.picture_choice import PictureChoice, picture  # noqa: E402
from toposeam_gimp.dialogs.preview_pane import PreviewPane  # noqa: E402
from toposeam_gimp.engine.call import GoneError, check_there  # noqa: E402
from toposeam_gimp.engine.folder import users_folder  # noqa: E402
from toposeam_gimp.engine.process import missing_methods  # noqa: E402
from toposeam_gimp.entries.entry import Option, Procedure  # noqa: E402
from toposeam_gimp.entries.help_page import write_help_page  # noqa: E402
from toposeam_gimp.entries.table import PROCEDURES  # noqa: E402
from toposeam_gimp.image.layers import RefusedError, all_alike  # noqa: E402
from toposeam_gimp.texts import _  # noqa: E402

_SPACE = 12
#: Side of the dice on its button, px.
_DICE = 20
#: Largest range of a number that is set with a slider.
_NARROW = 10
#: Opacity of insensitive sliders, which GIMP draws like the others.
_FADED = 0.45
#: GIMP's own buttons, where its translation has gaps.
_BUTTONS = {
    "_OK": _("_OK"),
    "_Cancel": _("_Cancel"),
    "_Load Saved Settings": _("_Load Saved Settings"),
    "_Save Settings": _("_Save Settings"),
}


class Dialog:
    """The dialog of an entry."""

    def __init__(
        self,
        procedure: Gimp.Procedure,
        config: Gimp.ProcedureConfig,
        entry: Procedure,
        image: Gimp.Image | None,
        drawables: Sequence[Gimp.Drawable],
    ) -> None:
        GimpUi.init("toposeam_gimp")
        self._config, self._entry = config, entry
        self._image, self._drawables = image, drawables
        self._options = {option.name: option for option in entry.options}
        self._dialog = GimpUi.ProcedureDialog.new(procedure, config, entry.title)
        self._ok = self._dialog.get_widget_for_response(Gtk.ResponseType.OK)
        self._rows: dict[str, Gtk.Widget] = {}
        if "places" in self._options and all_alike(drawables):
            config.set_property("places", "anywhere")
        body = Gtk.Box(spacing=2 * _SPACE, border_width=_SPACE)
        self._pane = None if entry.preview is None else PreviewPane(config, entry, image, drawables)
        if self._pane is not None:
            body.pack_start(self._pane.widget, True, True, 0)
        body.pack_start(self._fields(), self._pane is None, True, 0)
        self._dialog.get_content_area().pack_start(body, True, True, 0)
        body.show_all()
        self._reason = Gtk.Label(wrap=True, xalign=0, width_chars=60, max_width_chars=80, margin=_SPACE)
        self._reason.set_no_show_all(True)
        self._dialog.get_content_area().pack_start(self._reason, False, False, 0)
        # The selection may have changed meanwhile.
        self._focus = self._dialog.connect("focus-in-event", lambda *_event: self._check())
        self._replace_help()
        for button in _inside(self._dialog, Gtk.Button):
            if button.get_label() in _BUTTONS:
                button.set_label(_BUTTONS[button.get_label()])
        config.connect("notify", lambda *_event: self._changed())
        self._changed()

    def run(self) -> bool:
        """Show the dialog; return whether the answer is OK."""
        if self._pane is not None:
            self._pane.start()
        try:
            return bool(self._dialog.run())
        finally:
            if self._pane is not None:
                self._pane.close()
            self._dialog.disconnect(self._focus)
            self._dialog.destroy()

    def _fields(self) -> Gtk.Widget:
        """Return all fields, one below the other."""
        # A larger window enlarges the preview.
        fields = Gtk.Box(orientation=Gtk.Orientation.VERTICAL, spacing=6, hexpand=self._pane is None)
        advanced = Gtk.Box(orientation=Gtk.Orientation.VERTICAL, spacing=6, margin_top=6)
        for option in self._entry.options:
            if option.hidden:
                continue
            self._rows[option.name] = row = self._row(option)
            (advanced if option.advanced else fields).pack_start(row, False, False, 0)
        if advanced.get_children():
            expander = Gtk.Expander(label=_("A_dvanced"), use_underline=True, margin_top=6)
            expander.add(advanced)
            fields.pack_start(expander, False, False, 0)
        return fields

    def _row(self, option: Option) -> Gtk.Widget:
        """Return the field of an option, with its check box or button if it has one."""
        slides = isinstance(option.default, float) and option.high - option.low <= _NARROW
        kind = GimpUi.SpinScale.__gtype__ if slides else GObject.TYPE_NONE
        widget = self._dialog.get_widget(option.name, kind)
        if option.pictures:
            _replace(widget, PictureChoice(self._config, option).widget)
        if option.default is None:
            self._list(option, widget)
        if option.name == "method" and (absent := missing_methods()):
            widget.get_widget().set_sensitivity(lambda nick, *_data: nick not in absent, None)
        if option.automatic is None and option.name != "seed":
            return widget
        row = Gtk.Box(spacing=_SPACE)
        row.pack_start(widget, True, True, 0)
        if option.name == "seed":
            another = Gtk.Button(tooltip_text=_("Draw another seed by chance"))
            another.set_image(picture("dice", _DICE))
            another.get_accessible().set_name(_("Draw another seed by chance"))
            another.connect("clicked", lambda _button: self._draw(option))
            row.pack_end(another, False, False, 0)
        else:
            row.pack_end(self._automatic(option, widget), False, False, 0)
        return row

    def _list(self, option: Option, row: Gtk.Widget) -> None:
        """Add a list of layers, masks and channels in place of GIMP's chooser."""
        field, label = (
            DrawableChoice(self._config, option, self._image, self._drawables).widget,
            row.get_label(),
        )
        for child in row.get_children():
            if child is not label:
                child.set_no_show_all(True)
                child.hide()
        row.set_spacing(_SPACE // 2)
        row.pack_start(field, True, True, 0)
        label.set_mnemonic_widget(field)

    def _automatic(self, option: Option, widget: Gtk.Widget) -> Gtk.Widget:
        """Return a check box that sets the option to 0."""
        kind = int if isinstance(option.default, int) else float
        box = Gtk.CheckButton(label=option.automatic)
        kept = {"value": kind(option.typical)}

        def follow(*_event: Any) -> None:
            value = self._config.get_property(option.name)
            kept["value"] = value or kept["value"]
            box.set_active(not value)
            _enable(widget, bool(value))

        def toggled(_box: Gtk.CheckButton) -> None:
            if box.get_active() == bool(self._config.get_property(option.name)):
                self._config.set_property(option.name, kind(0) if box.get_active() else kept["value"])

        for spin in _inside(widget, Gtk.SpinButton):
            spin.connect("output", _nothing_for_zero)
            spin.update()
        follow()
        box.connect("toggled", toggled)
        self._config.connect(f"notify::{option.name}", follow)
        return box

    def _draw(self, option: Option) -> None:
        self._config.set_property(option.name, random.randrange(int(option.high)))  # noqa: S311 - no secret

    def _changed(self) -> None:
        for option in self._entry.options:
            if option.applies is not None:
                _enable(self._rows[option.name], self._applies(option))
        self._check()
        if self._pane is not None:
            self._pane.changed()

    def _check(self) -> None:
        """Show why the options cannot work, and disable OK until they can."""
        refusal = ""
        try:
            check_there(self._image, self._drawables)
            if self._entry.check:
                actions = import_module(f"toposeam_gimp.actions.{self._entry.work.split('.')[0]}")
                options = {name: self._config.get_property(name) for name in self._options}
                getattr(actions, self._entry.check)(self._image, self._drawables, options)
        except (RefusedError, GoneError) as error:
            refusal = str(error)
        if refusal != self._reason.get_text() and self._pane is not None:
            self._pane.changed()
        self._reason.set_text(refusal)
        self._reason.set_visible(bool(refusal))
        self._ok.set_sensitive(not refusal)

    def _applies(self, option: Option) -> bool:
        """Test whether an option has an effect with the values of those on which it depends."""
        if option.applies is None:
            return True
        name, values = option.applies
        return self._config.get_property(name) in values and self._applies(self._options[name])

    def _replace_help(self) -> None:
        """Replace GIMP's own Help button, which opens pages of GIMP's manual."""
        old = self._dialog.get_widget_for_response(Gtk.ResponseType.HELP)
        if old is None:
            return
        parent = old.get_parent()
        old.set_no_show_all(True)
        old.hide()
        button = Gtk.Button.new_with_mnemonic(_("_Help"))
        button.connect("clicked", lambda _button: self._help())
        parent.pack_start(button, False, False, 0)
        parent.set_child_secondary(button, True)
        button.show()

    def _help(self) -> None:
        page, section = "", self._entry.name.rpartition("-")[2]
        with suppress(GLib.Error, OSError, RuntimeError):
            page = write_help_page(PROCEDURES.values(), users_folder()).as_uri()
            Gio.AppInfo.launch_default_for_uri(f"{page}#{section}", None)
            return
        text = Gtk.MessageDialog(
            transient_for=self._dialog, modal=True, buttons=Gtk.ButtonsType.CLOSE, text=self._entry.title
        )
        text.format_secondary_text(f"{self._entry.help}\n\n{page}")
        text.run()
        text.destroy()


def _enable(row: Gtk.Widget, applies: bool) -> None:
    """Enable a row, or show that it does not apply."""
    row.set_sensitive(applies)
    for slider in _inside(row, GimpUi.SpinScale):
        slider.set_opacity(1 if slider.is_sensitive() else _FADED)


def _nothing_for_zero(spin: Gtk.SpinButton) -> bool:
    """Show no number for 0, which the check box beside the field names."""
    if spin.get_value():
        return False
    spin.set_text("")
    return True


def _inside(widget: Gtk.Widget, kind: type) -> list[Gtk.Widget]:
    """Return all widgets of a class in another widget, itself included."""
    found = [widget] if isinstance(widget, kind) else []
    for child in widget.get_children() if isinstance(widget, Gtk.Container) else ():
        found += _inside(child, kind)
    return found


def _replace(row: Gtk.Widget, field: Gtk.Widget) -> None:
    """Replace the field in a row of GIMP's, so that its label stays aligned with the others."""
    old = row.get_widget()
    old.set_no_show_all(True)
    old.hide()
    row.attach(field, 1, 0, 1, 1)
    row.get_label().set_mnemonic_widget(field)
