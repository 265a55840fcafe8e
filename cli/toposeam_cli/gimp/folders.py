"""GIMP 3's plug-in folders on each system; installing and removing the plug-in."""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from toposeam.errors import MissingPackageError, OptionError
from toposeam_cli.files.writing import OutputError
from toposeam_cli.gimp.programs import programs

#: Name of the folder and of the file in it that GIMP runs; GIMP wants them equal.
PLUG_IN = "toposeam_gimp"
#: File beside it that names the Python of the engine and the installed files.
_RECORD = "engine.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """A plug-ins folder of GIMP."""

    plug_ins: Path
    #: "3.0"; None where only the folder is known.
    version: str | None
    #: Kind of GIMP's installation, as far as the folder shows it: "GIMP", "Flatpak", "Snap", or "folder".
    kind: str

    @property
    def plug_in(self) -> Path:
        """Path of the plug-in, installed or not."""
        return self.plug_ins / PLUG_IN

    @property
    def title(self) -> str:
        """Name of the profile in messages."""
        return f"{self.kind} {self.version}" if self.version else str(self.plug_ins)


def source() -> Path:
    """Return the folder of the plug-in in this installation of TopoSeam."""
    found = find_spec(PLUG_IN)
    if found is None or not found.submodule_search_locations:
        raise MissingPackageError(
            "this installation lacks the GIMP plug-in; install TopoSeam again, as README says"
        )
    return Path(found.submodule_search_locations[0])


def roots(
    environment: Mapping[str, str] | None = None, platform: str | None = None, home: Path | None = None
) -> Iterator[tuple[str, Path]]:
    """Yield the kind of GIMP's installation and the folder that then holds one profile per minor version."""
    environment = os.environ if environment is None else environment
    platform = sys.platform if platform is None else platform
    home = Path.home() if home is None else home
    if platform == "win32":
        yield "GIMP", Path(environment.get("APPDATA") or home / "AppData" / "Roaming") / "GIMP"
    elif platform == "darwin":
        yield "GIMP", home / "Library" / "Application Support" / "GIMP"
    else:
        yield "GIMP", Path(environment.get("XDG_CONFIG_HOME") or home / ".config") / "GIMP"
        yield "Flatpak", home / ".var" / "app" / "org.gimp.GIMP" / "config" / "GIMP"
        yield "Snap", home / "snap" / "gimp" / "current" / ".config" / "GIMP"


def profiles(
    version: str | None = None,
    environment: Mapping[str, str] | None = None,
    platform: str | None = None,
    home: Path | None = None,
) -> list[Profile]:
    """Return the GIMP 3 profiles of this user: those that exist, and those that an installed GIMP would make
    at its first start. With `version` only that version's.

    Raises
    ------
    OptionError
        When there is none, or `version` is no version of GIMP 3.
    """
    environment = os.environ if environment is None else environment
    if version is not None and not re.fullmatch(r"3\.\d+", version):
        raise OptionError(f"--gimp-version is {version!r}; TopoSeam is for GIMP 3: write 3.0 or 3.2")
    directory = environment.get("GIMP3_DIRECTORY")
    if directory:
        place = (
            Path(directory)
            if Path(directory).is_absolute()
            else (Path.home() if home is None else home) / directory
        )
        return [Profile(plug_ins=place / "plug-ins", version=version, kind="GIMP3_DIRECTORY")]
    places = list(roots(environment, platform, home))
    found = [
        Profile(plug_ins=folder / "plug-ins", version=folder.name, kind=kind)
        for kind, root in places
        for folder in sorted(root.glob("3.*"))
        if re.fullmatch(r"3\.\d+", folder.name) and version in (None, folder.name)
    ]
    known = {(profile.kind, profile.version) for profile in found}
    for kind, minor in _wanted(version, [kind for kind, _ in places]):
        if (kind, minor) not in known:
            root = dict(places)[kind]
            found.append(Profile(plug_ins=root / minor / "plug-ins", version=minor, kind=kind))
    if not found:
        looked = " and ".join(str(root) for _, root in places)
        raise OptionError(
            f"neither a GIMP 3 nor a profile of one was found (in {looked}); install GIMP 3, or say "
            "--gimp-version 3.0 or --dir FOLDER"
        )
    return found


def _wanted(version: str | None, kinds: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the profiles that should exist: of the named version, else of every GIMP 3 on this machine."""
    if version is not None:
        yield kinds[0], version
        return
    for program in programs():
        if program.is_3 and program.kind in kinds:
            yield program.kind, program.version


def is_new(profile: Profile) -> bool:
    """Test whether GIMP was never started with this profile."""
    return profile.version is not None and not profile.plug_ins.parent.is_dir()


def older_profiles(profile: Profile) -> list[str]:
    """Return the versions whose settings GIMP would take over at its first start if there were no new
    profile.
    """
    if profile.version is None:
        return []
    root, own = profile.plug_ins.parent.parent, [int(part) for part in profile.version.split(".")]
    versions = [path.name for path in root.glob("*.*") if re.fullmatch(r"\d+\.\d+", path.name)]
    return sorted(name for name in versions if [int(part) for part in name.split(".")] < own)


def _check_own(target: Path) -> None:
    """Refuse a folder that holds more than the plug-in, as it will be removed.

    The plug-in's files are those that :func:`install_into` has recorded there, and those that it would copy.
    """
    if not os.path.lexists(target):
        return
    found = []
    if target.is_dir() and not target.is_symlink():
        found = [path for path in target.rglob("*") if path.is_symlink() or not path.is_dir()]
        ours = {path.relative_to(source()).as_posix() for path in source().rglob("*")} | {_RECORD}
        with suppress(OSError, ValueError, KeyError, TypeError):
            ours |= set(json.loads((target / _RECORD).read_text(encoding="utf-8"))["files"])
        names = [path.relative_to(target).as_posix() for path in found]
        foreign = sorted(
            name
            for name in names
            if name not in ours and not re.search(r"(^|/)__pycache__/[^/]+\.pyc$", name)
        )
        if not foreign:
            return
        raise OptionError(
            f"{target} holds {foreign[0]}, which is no part of the plug-in; move it elsewhere, then do it "
            "again"
        )
    raise OptionError(f"{target} is not the plug-in's folder; move it elsewhere, then do it again")


def install_into(profile: Profile, python: Path, without: Sequence[str] = ()) -> Path:
    """Install the plug-in in a profile, in place of an older one. On failure the folder is as before.

    Parameters
    ----------
    profile : Profile
    python : Path
        The Python of the engine.
    without : sequence of str
        Methods that the engine lacks.

    Raises
    ------
    OptionError
        When the folder is not the plug-in's, or holds other files too.
    OutputError
        When the folder cannot be written.
    """
    target = profile.plug_in
    _check_own(target)
    fresh, old = (target.with_name(f".{PLUG_IN}-{secrets.token_hex(4)}.{end}") for end in ("new", "old"))
    try:
        shutil.copytree(
            source(), fresh, ignore=shutil.ignore_patterns("__pycache__", "*.po", "*.pot", "engine.json")
        )
        files = sorted(path.relative_to(fresh).as_posix() for path in fresh.rglob("*") if path.is_file())
        record = {"python": str(python), "without": list(without), "files": [*files, _RECORD]}
        (fresh / _RECORD).write_text(json.dumps(record), encoding="utf-8")
        main = fresh / f"{PLUG_IN}.py"
        main.chmod(0o755)
        main.touch()  # GIMP queries a plug-in's procedures again only when this file is newer
        if target.exists():
            target.rename(old)
        fresh.rename(target)
    except OSError as error:
        if old.exists() and not target.exists():
            old.rename(target)
        raise OutputError(
            f"cannot write {target} ({error.strerror or error}); check the rights of the folder, or choose "
            "another with --dir"
        ) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)
    return target


def uninstall_from(profile: Profile) -> Path | None:
    """Remove the plug-in from a profile; return its folder, or None if it was not installed.

    Raises
    ------
    OptionError
        When the folder is not the plug-in's, or holds other files too.
    OutputError
        When it cannot be removed.
    """
    target = profile.plug_in
    if not os.path.lexists(target):
        return None
    _check_own(target)
    try:
        shutil.rmtree(target)
    except OSError as error:
        raise OutputError(
            f"cannot remove {target} ({error.strerror or error}); close GIMP and check the rights of the "
            "folder"
        ) from error
    return target
