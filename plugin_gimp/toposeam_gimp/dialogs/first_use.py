"""The dialog of the first use, when there is no engine yet: how to get one, and its installation after
asking.
"""

from __future__ import annotations

import threading
from pathlib import Path

import gi

for _name, _version in (("Gtk", "3.0"), ("GimpUi", "3.0")):
    gi.require_version(_name, _version)
from gi.repository import GimpUi, GLib, Gtk  # noqa: E402

from toposeam_gimp.engine.process import EngineError, NoEngineError, find_python  # noqa: E402
from toposeam_gimp.engine.setting_up import SettingUp, StoppedError, bundled, source_of  # noqa: E402
from toposeam_gimp.texts import _  # noqa: E402

_CHOOSE, _SET_UP = 1, 2


def has_engine() -> bool:
    """Return whether there is an engine; if there is none, offer to install it.

    Raises
    ------
    EngineError
        When the installation failed.
    """
    try:
        find_python()
    except NoEngineError as error:
        GimpUi.init("toposeam_gimp")
        source = _asked(str(error))
        return source is not None and _made(source)
    return True


def _folder() -> Path:
    return Path(GLib.get_user_data_dir()) / "toposeam" / "gimp-engine"


def _asked(reason: str) -> Path | None:
    """Explain what is missing; return the file from which to install an engine, None if the user declines."""
    dialog = Gtk.MessageDialog(text=_("TopoSeam needs its engine"), message_type=Gtk.MessageType.QUESTION)
    dialog.set_title("TopoSeam")
    wheel = bundled()
    offer = _(
        "Or let the plug-in make a Python environment of its own in {folder}. That takes a few minutes "
        "and some hundred megabytes; what TopoSeam builds on comes from the Python package index."
    ).format(folder=_folder())
    dialog.format_secondary_text(f"{reason}\n\n{offer}")
    dialog.add_button(_("_Cancel"), Gtk.ResponseType.CANCEL)
    dialog.add_button(_("_Choose TopoSeam…"), _CHOOSE)
    if wheel is not None:
        dialog.add_button(_("_Make It"), _SET_UP)
        dialog.set_default_response(_SET_UP)
    answer = dialog.run()
    dialog.destroy()
    if answer == _SET_UP:
        return wheel
    return _chosen() if answer == _CHOOSE else None


def _chosen() -> Path | None:
    chooser = Gtk.FileChooserDialog(
        title=_("TopoSeam's wheel, or pyproject.toml in its source folder"), action=Gtk.FileChooserAction.OPEN
    )
    chooser.add_button(_("_Cancel"), Gtk.ResponseType.CANCEL)
    chooser.add_button(_("_OK"), Gtk.ResponseType.OK)
    names = Gtk.FileFilter()
    names.set_name("TopoSeam")
    for pattern in ("toposeam*.whl", "toposeam*.zip", "toposeam*.tar.gz", "pyproject.toml"):
        names.add_pattern(pattern)
    chooser.add_filter(names)
    answer, name = chooser.run(), chooser.get_filename()
    chooser.destroy()
    return source_of(Path(name)) if answer == Gtk.ResponseType.OK and name else None


def _made(source: Path) -> bool:
    """Install the engine while a window shows it; return False if the user stopped it."""
    dialog = Gtk.Dialog(title="TopoSeam")
    dialog.add_button(_("_Cancel"), Gtk.ResponseType.CANCEL)
    row = Gtk.Box(spacing=12, margin=18)
    spinner = Gtk.Spinner()
    spinner.start()
    row.pack_start(spinner, False, False, 0)
    row.pack_start(Gtk.Label(label=_("The engine is being made …")), False, False, 0)
    dialog.get_content_area().add(row)
    dialog.show_all()
    setting_up, failures = SettingUp(), []

    def work() -> None:
        try:
            setting_up.make(_folder(), source)
        except (EngineError, StoppedError) as error:
            failures.append(error)
        GLib.idle_add(dialog.response, Gtk.ResponseType.OK)

    worker = threading.Thread(target=work)
    worker.start()
    if dialog.run() != Gtk.ResponseType.OK:
        setting_up.stop()
    worker.join()
    dialog.destroy()
    for error in failures:
        if isinstance(error, EngineError):
            raise error
    return not failures
