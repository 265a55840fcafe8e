"""Where GIMP 3 keeps plug-ins on each system, and the plug-in's way in and out."""

from __future__ import annotations

import json
import os
import re
import secrets
import shutil
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from toposeam.errors import MissingPackageError, OptionError
from toposeam_cli.output import OutputError

#: Name of the folder and of the file in it that GIMP runs; GIMP wants them equal.
PLUG_IN = "toposeam_gimp"


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """A plug-ins folder of GIMP."""

    plug_ins: Path
    #: "3.0"; None where only the folder is known.
    version: str | None
    #: How GIMP was installed, as far as the folder tells: "GIMP", "Flatpak", "Snap", or "folder".
    kind: str

    @property
    def plug_in(self) -> Path:
        """Where the plug-in is, or would be."""
        return self.plug_ins / PLUG_IN

    @property
    def title(self) -> str:
        """For people."""
        return f"{self.kind} {self.version}" if self.version else str(self.plug_ins)


def source() -> Path:
    """The plug-in as this installation brought it."""
    found = find_spec(PLUG_IN)
    if found is None or not found.submodule_search_locations:
        raise MissingPackageError(
            "this installation lacks the GIMP plug-in; install TopoSeam again: pip install --force-reinstall toposeam"
        )
    return Path(found.submodule_search_locations[0])


def roots(
    environment: Mapping[str, str] | None = None, platform: str | None = None, home: Path | None = None
) -> Iterator[tuple[str, Path]]:
    """How GIMP was installed, and the folder that then holds one profile per minor version."""
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
    version: str | None = None, environment: Mapping[str, str] | None = None, platform: str | None = None, home: Path | None = None
) -> list[Profile]:
    """The GIMP 3 profiles of this user; with `version` only that one's, whether it is there or not.

    Raises
    ------
    OptionError
        When there is none, or `version` is none of GIMP 3.
    """
    environment = os.environ if environment is None else environment
    if version is not None and not re.fullmatch(r"3\.\d+", version):
        raise OptionError(f"--gimp-version is {version!r}; TopoSeam is for GIMP 3: write 3.0 or 3.2")
    told = environment.get("GIMP3_DIRECTORY")
    if told:
        place = Path(told) if Path(told).is_absolute() else (Path.home() if home is None else home) / told
        return [Profile(plug_ins=place / "plug-ins", version=version, kind="GIMP3_DIRECTORY")]
    places = list(roots(environment, platform, home))
    found = [
        Profile(plug_ins=folder / "plug-ins", version=folder.name, kind=kind)
        for kind, root in places
        for folder in sorted(root.glob("3.*"))
        if re.fullmatch(r"3\.\d+", folder.name) and version in (None, folder.name)
    ]
    if not found and version is not None:
        kind, root = places[0]
        found = [Profile(plug_ins=root / version / "plug-ins", version=version, kind=kind)]
    if not found:
        looked = " and ".join(str(root) for _, root in places)
        raise OptionError(f"no profile of GIMP 3 was found (in {looked}); start GIMP 3 once, or say --gimp-version 3.0 or --dir FOLDER")
    return found


def install_into(profile: Profile, python: Path) -> Path:
    """Put the plug-in into a profile, in place of an older one; it is complete, or as before.

    Raises
    ------
    OutputError
        When the folder cannot be written.
    """
    target = profile.plug_in
    fresh, old = (target.with_name(f".{PLUG_IN}-{secrets.token_hex(4)}.{end}") for end in ("new", "old"))
    try:
        shutil.copytree(source(), fresh, ignore=shutil.ignore_patterns("__pycache__", "*.po", "*.pot", "engine.json"))
        (fresh / "engine.json").write_text(json.dumps({"python": str(python)}), encoding="utf-8")
        main = fresh / f"{PLUG_IN}.py"
        main.chmod(0o755)
        main.touch()  # GIMP asks a plug-in for its procedures only when this file is newer
        if target.exists():
            target.rename(old)
        fresh.rename(target)
    except OSError as error:
        if old.exists() and not target.exists():
            old.rename(target)
        raise OutputError(
            f"cannot write {target} ({error.strerror or error}); check the rights of the folder, or choose another with --dir"
        ) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)
    return target


def uninstall_from(profile: Profile) -> Path | None:
    """Remove the plug-in from a profile; where it was, None if it was not there."""
    target = profile.plug_in
    if not target.exists():
        return None
    try:
        shutil.rmtree(target)
    except OSError as error:
        raise OutputError(f"cannot remove {target} ({error.strerror or error}); close GIMP and check the rights of the folder") from error
    return target
