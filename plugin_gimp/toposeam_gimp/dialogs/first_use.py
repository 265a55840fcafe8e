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
#: What is fetched, and what it needs on the disk, MB.
_FETCHED_MB, _SIZE_MB = 90, 370
#: Width of the window, characters, so that it stays as it is.
_WIDE = 60
_STEPS = (
    _("Step 1 of 3: a place for it is made …"),
    _("Step 2 of 3: it is fetched, {fetched} of about {all} MB …"),
    _("Step 3 of 3: it is installed …"),
)
#: Share of the time after which each step begins, and the end.
_BEGINS = (0.0, 0.1, 0.7, 1.0)


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
    dialog = Gtk.MessageDialog(text=_("TopoSeam is set up once"), message_type=Gtk.MessageType.QUESTION)
    dialog.set_title("TopoSeam")
    wheel = bundled()
    offer = _(
        "It fetches what it needs from the Internet, about {fetched} MB, and puts it into {folder}, about "
        "{size} MB. That takes some minutes. Nothing else on your computer changes, and pictures stay on it."
    ).format(fetched=_FETCHED_MB, size=_SIZE_MB, folder=_folder())
    dialog.format_secondary_text(offer if wheel is not None else f"{reason}\n\n{offer}")
    dialog.add_button(_("_Cancel"), Gtk.ResponseType.CANCEL)
    if wheel is None:
        dialog.add_button(_("_Choose TopoSeam…"), _CHOOSE)
    else:
        dialog.add_button(_("_Set Up"), _SET_UP)
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
    """Install the engine while a window shows how far it is; return False if the user stopped it."""
    dialog = Gtk.Dialog(title="TopoSeam")
    dialog.add_button(_("_Cancel"), Gtk.ResponseType.CANCEL)
    column = Gtk.Box(orientation=Gtk.Orientation.VERTICAL, spacing=12, margin=18)
    label, bar = Gtk.Label(xalign=0), Gtk.ProgressBar()
    label.set_width_chars(_WIDE)
    column.pack_start(label, False, False, 0)
    column.pack_start(bar, False, False, 0)
    dialog.get_content_area().add(column)
    dialog.show_all()
    setting_up, failures = SettingUp(), []

    def show(step: int, fetched: float) -> None:
        label.set_text(_STEPS[step].format(fetched=round(fetched), all=_FETCHED_MB))
        bar.set_fraction(_shares(step, fetched))

    def work() -> None:
        try:
            setting_up.make(_folder(), source, lambda *now: GLib.idle_add(show, *now))
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


def _shares(step: int, fetched: float) -> float:
    """Return the share of the work that is done, about, from the step and the megabytes fetched."""
    begin, end = _BEGINS[step : step + 2]
    return begin + (end - begin) * (min(fetched / _FETCHED_MB, 1.0) if step == 1 else 0.0)
