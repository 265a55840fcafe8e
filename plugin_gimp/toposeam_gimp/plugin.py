"""The plug-in's class for GIMP: procedures made from the table, dialogs, and the one place where errors
become messages.
"""

from __future__ import annotations

import traceback
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from gi.repository import Gegl, Gimp, Gio, GLib, GObject

from toposeam_gimp.engine.call import Call, GoneError
from toposeam_gimp.engine.folder import FolderError, is_full
from toposeam_gimp.engine.process import EngineError
from toposeam_gimp.entries.entry import LAYERS, TEXTURES, WALLPAPERS, Option, Procedure
from toposeam_gimp.entries.table import PROCEDURES
from toposeam_gimp.image.layers import RefusedError
from toposeam_gimp.image.path_choice import UnclearError
from toposeam_gimp.texts import _

_MENU = "<Image>/Filters/TopoSeam"
_SENSITIVE = {
    "layer": Gimp.ProcedureSensitivityMask.DRAWABLE,
    "layers": Gimp.ProcedureSensitivityMask.DRAWABLE | Gimp.ProcedureSensitivityMask.DRAWABLES,
    "several": Gimp.ProcedureSensitivityMask.DRAWABLES,
    "nothing": Gimp.ProcedureSensitivityMask.ALWAYS,
}
_PICTURES = Path(__file__).parent / "pictures"
_ICONS = {LAYERS: "layers", TEXTURES: "textures", WALLPAPERS: "wallpapers"}
_READ_WRITE = GObject.ParamFlags.READWRITE
#: Size of GEGL's tile cache, bytes. Pixels are read and written once, block by block, so that a larger one is
#: useless.
_TILES_KEPT = 16 << 20


class TopoSeam(Gimp.PlugIn):  # type: ignore[misc]
    """The plug-in Filters → TopoSeam."""

    def do_set_i18n(self, _name: str) -> bool:
        """Return False, as :mod:`toposeam_gimp.texts` translates the texts."""
        return False

    def do_query_procedures(self) -> list[str]:
        """Return the names of all procedures."""
        return list(PROCEDURES)

    def do_create_procedure(self, name: str) -> Gimp.Procedure:
        """Make one procedure, from the table."""
        entry = PROCEDURES[name]
        procedure = Gimp.ImageProcedure.new(self, name, Gimp.PDBProcType.PLUGIN, _run, None)
        procedure.set_image_types("*" if entry.needs == "nothing" else "RGB*, GRAY*")
        procedure.set_sensitivity_mask(_SENSITIVE[entry.needs])
        procedure.set_menu_label(entry.label)
        procedure.set_icon_file(Gio.File.new_for_path(str(_PICTURES / f"icon-{_ICONS[entry.menu]}.svg")))
        # GIMP sorts by name; sections, which are hidden, keep the order of the table.
        procedure.add_menu_path(f"{_MENU}/{entry.menu}/[{list(PROCEDURES).index(name):02}]")
        if entry.also:
            procedure.add_menu_path(entry.also)
        procedure.set_documentation(entry.blurb, entry.help, name)
        procedure.set_attribution("The TopoSeam developers", "The TopoSeam developers", "2026")
        for option in entry.options:
            _add(procedure, option)
        procedure.add_layer_return_value(
            entry.returns[0], entry.returns[0].capitalize(), entry.returns[1], True, _READ_WRITE
        )
        return procedure


def _add(procedure: Gimp.Procedure, option: Option) -> None:
    value, text = option.default, (option.name, option.label, option.help)
    if value is None:
        procedure.add_drawable_argument(*text, True, _READ_WRITE)
    elif isinstance(value, bool):
        procedure.add_boolean_argument(*text, value, _READ_WRITE)
    elif isinstance(value, int):
        procedure.add_int_argument(*text, int(option.low), int(option.high), value, _READ_WRITE)
    elif isinstance(value, float):
        procedure.add_double_argument(*text, option.low, option.high, value, _READ_WRITE)
    elif not option.choices:
        procedure.add_string_argument(*text, value, _READ_WRITE)
    else:
        choice = Gimp.Choice.new()
        for index, (nick, label) in enumerate(option.choices):
            choice.add(nick, index, label, "")
        procedure.add_choice_argument(*text, choice, value, _READ_WRITE)


def _run(
    procedure: Gimp.Procedure,
    run_mode: Gimp.RunMode,
    image: Gimp.Image,
    drawables: list[Gimp.Drawable],
    config: Gimp.ProcedureConfig,
    _data: Any,
) -> Gimp.ValueArray:
    Gegl.config().set_property("tile-cache-size", _TILES_KEPT)
    entry = PROCEDURES[procedure.get_name()]
    interactive = run_mode == Gimp.RunMode.INTERACTIVE
    call = Call(
        image=image,
        drawables=drawables,
        options={},
        entry=entry,
        interactive=interactive,
        show_progress=Gimp.progress_update,
        show_step=Gimp.progress_set_text,
    )
    try:
        name, function = entry.work.split(".")
        if interactive and not _has_engine():
            return procedure.new_return_values(Gimp.PDBStatusType.CANCEL, None)
        if interactive and entry.options and not _ask_user(procedure, config, entry, image, drawables):
            return procedure.new_return_values(Gimp.PDBStatusType.CANCEL, None)
        call = replace(call, options={one.name: config.get_property(one.name) for one in entry.options})
        for option in entry.options:
            if option.default is None:  # GIMP cannot save which layer it was, and would print a warning
                config.set_property(option.name, None)
        Gimp.progress_init(entry.title)
        layer = getattr(import_module(f"toposeam_gimp.actions.{name}"), function)(call)
        Gimp.displays_flush()
        if interactive and entry.paints:
            _open_window(call, layer)
        if call.interactive and call.remarks:
            Gimp.message("\n".join(call.remarks))
    except (RefusedError, UnclearError, GoneError, EngineError, FolderError) as error:
        return _failure(procedure, str(error))
    except MemoryError:
        return _failure(
            procedure, _("There is not enough memory for these pictures; close others, or use smaller ones.")
        )
    except OSError as error:
        hint = _("free some space") if is_full(error) else _("check the rights of the temporary folder")
        return _failure(procedure, f"{error.strerror or error}: {error.filename or ''}; {hint}.")
    except Exception as error:
        try:
            call.check_image()
        except GoneError as gone:
            return _failure(procedure, str(gone))
        traceback.print_exc()
        return _failure(
            procedure,
            _("Something went wrong inside TopoSeam; please report it:")
            + f" {type(error).__name__}: {error}",
        )
    result = procedure.new_return_values(Gimp.PDBStatusType.SUCCESS, None)
    result.remove(1)
    value = GObject.Value(Gimp.Layer, layer)
    result.insert(1, value)
    return result


def _has_engine() -> bool:
    from toposeam_gimp.dialogs.first_use import has_engine

    return has_engine()


def _ask_user(
    procedure: Gimp.Procedure,
    config: Gimp.ProcedureConfig,
    entry: Procedure,
    image: Gimp.Image | None,
    drawables: list[Gimp.Drawable],
) -> bool:
    from toposeam_gimp.dialogs.dialog import Dialog

    return Dialog(procedure, config, entry, image, drawables).run()


def _open_window(call: Call, strokes: Gimp.Layer) -> None:
    from toposeam_gimp.actions.painting import Painting
    from toposeam_gimp.dialogs.seam_window import SeamWindow

    Gimp.progress_end()
    SeamWindow(Painting(call, strokes)).run()


def _failure(procedure: Gimp.Procedure, message: str) -> Gimp.ValueArray:
    return procedure.new_return_values(Gimp.PDBStatusType.EXECUTION_ERROR, GLib.Error(message))
