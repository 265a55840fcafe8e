"""``toposeam gimp``: install and uninstall the plug-in, and find out why it is not in the menu."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from toposeam.errors import OptionError
from toposeam_cli.app.options import FILE
from toposeam_cli.app.progress import say
from toposeam_cli.gimp.doctor import examine
from toposeam_cli.gimp.environment import check_python, is_temporary, make_environment, usual_folder
from toposeam_cli.gimp.folders import (
    PLUG_IN,
    Profile,
    install_into,
    is_new,
    older_profiles,
    profiles,
    uninstall_from,
)

_VERSION = click.option(
    "--gimp-version", metavar="3.x", help="Only this version's profile; made if it is not there yet."
)
_FOLDER = click.option(
    "--dir",
    "folder",
    type=FILE,
    help="This plug-ins folder instead (see GIMP: Preferences > Folders > Plug-ins).",
)


@click.group()
def gimp() -> None:
    """Filters > TopoSeam in GIMP 3."""


@gimp.command()
@_VERSION
@_FOLDER
@click.option(
    "--python",
    type=FILE,
    help="The Python that does the work in GIMP, if not the one that runs this command.",
)
@click.option(
    "--venv",
    type=FILE,
    is_flag=False,
    flag_value=Path(),
    help="Make an environment of its own for that, in a folder of this user or in the one given.",
)
def install(gimp_version: str | None, folder: Path | None, python: Path | None, venv: Path | None) -> None:
    """Copy the plug-in into the profile of every GIMP 3 of this user."""
    if python is not None and venv is not None:
        raise OptionError("--python and --venv both say which Python does the work; give one of them")
    if folder is not None and (folder.expanduser() / "plug-ins").is_dir():
        raise OptionError(
            f"--dir is {folder}, a GIMP profile, where GIMP looks for no plug-ins; give {folder / 'plug-ins'}"
        )
    chosen = _chosen(gimp_version, folder)
    engine = _python(python) if venv is None else _environment(venv)
    without = check_python(engine)
    for profile in chosen:
        if is_new(profile) and (older := older_profiles(profile)):
            say(
                f"{profile.title} was never started; with its folder made now it will not take over the "
                f"settings of {older[-1]}"
            )
        say(f"installed {install_into(profile, engine, without)}")
    if is_temporary(engine):
        say(
            f"But {engine} is in a temporary environment, and GIMP will miss it. Use one that stays: "
            "toposeam gimp install --venv",
            err=True,
        )
    say("Start GIMP (again): the entries are in Filters > TopoSeam. If they are not: toposeam gimp doctor")


@gimp.command()
@_VERSION
@_FOLDER
def uninstall(gimp_version: str | None, folder: Path | None) -> None:
    """Remove the plug-in from GIMP."""
    removed = [
        place for profile in _chosen(gimp_version, folder) if (place := uninstall_from(profile)) is not None
    ]
    for place in removed:
        say(f"removed {place}")
    if not removed:
        say("The plug-in is not installed; there is nothing to remove.")


@gimp.command()
@_VERSION
@_FOLDER
def doctor(gimp_version: str | None, folder: Path | None) -> None:
    """Find out why the plug-in is not in the menu, or does not work."""
    healthy = True
    for finding in examine(_chosen(gimp_version, folder)):
        healthy = healthy and finding.well
        say(f"{'ok     ' if finding.well else 'PROBLEM'}  {finding.text}")
        if finding.remedy:
            say(f"         → {finding.remedy}")
    if not healthy:
        raise click.exceptions.Exit(1)


def _chosen(gimp_version: str | None, folder: Path | None) -> list[Profile]:
    if folder is not None:
        if gimp_version is not None:
            raise OptionError("--dir and --gimp-version both say where; give one of them")
        return [Profile(plug_ins=folder.expanduser().absolute(), version=None, kind="folder")]
    return profiles(gimp_version)


def _environment(folder: Path) -> Path:
    place = usual_folder() if folder == Path() else folder.expanduser().absolute()
    say(f"making an environment in {place} …")
    return make_environment(place)


def _python(path: Path | None) -> Path:
    if path is None:
        return Path(sys.executable)
    path = path.expanduser().absolute()
    if not path.is_file():
        raise OptionError(
            f"--python is {path}, but there is no such program; give the python of an environment that has "
            f"{PLUG_IN.split('_')[0]}"
        )
    return path
