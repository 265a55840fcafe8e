"""Diagnosis of a plug-in missing from the menu: one finding after another, each with its remedy."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import toposeam as ts
from toposeam_cli.gimp.folders import PLUG_IN, Profile
from toposeam_cli.gimp.programs import Program, programs
from toposeam_gimp.engine.launching import absolute_entries, run

_INSTALL = "run: toposeam gimp install"
_PROBE_S = 180.0
#: Code for GIMP's own Python: does GIMP know the procedure?
_PROBE = "print('TOPOSEAM', Gimp.get_pdb().procedure_exists('plug-in-toposeam-stitch'))"


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of one check."""

    well: bool
    text: str
    remedy: str = ""


def examine(profiles: Sequence[Profile]) -> Iterator[Finding]:
    """Check every GIMP, every profile and the engine, and ask each GIMP with the profile that it reads."""
    found = programs()
    yield from _gimps(found)
    for profile in profiles:
        missing = _missing(profile)
        if missing is not None:
            yield missing
            continue
        yield Finding(True, f"{profile.title}: the plug-in is in {profile.plug_in}")
        yield from _folder(profile)
        yield from _engine(profile)
        yield from _asked(found, profile, profiles)
        yield from _registered(profile)


def _gimps(found: Sequence[Program]) -> Iterator[Finding]:
    """List the GIMPs found."""
    for program in found:
        where = program.console or program.kind
        if program.is_3:
            yield Finding(True, f"GIMP {program.version} is installed: {where}")
        else:
            yield Finding(
                True,
                f"GIMP {program.version} is installed too: {where}",
                "TopoSeam does not work there; start GIMP 3",
            )
    if not any(program.is_3 for program in found):
        remedy = "install GIMP 3 from gimp.org or your system's packages; TopoSeam does not work in GIMP 2.10"
        yield Finding(False, "no GIMP 3 was found on this machine", remedy)


def _asked(found: Sequence[Program], profile: Profile, profiles: Sequence[Profile]) -> Iterator[Finding]:
    """Ask every GIMP that reads a profile whether it loads the plug-in from there."""
    there = [program for program in found if program.is_3]
    readers = [program for program in there if _reads(program, profile)]
    if there and not readers:
        served = all(
            any(_reads(program, other) and _missing(other) is None for other in profiles) for program in there
        )
        others = " and ".join(sorted({program.version for program in there}))
        text = (
            f"{profile.title} was not found; the GIMP on this machine is {others}, which does not read this "
            "profile"
        )
        remedy = "run: toposeam gimp install (without --gimp-version), which installs for every GIMP there is"
        yield Finding(served, text, "it has one of its own, so this one does no harm" if served else remedy)
    for program in readers:
        if program.console is not None:
            yield _probe(program, profile)
        elif program.kind == "Flatpak":
            yield Finding(
                True,
                f"GIMP {program.version} runs in a Flatpak and could not be asked",
                "its sandbox cannot run this Python: give it one of its own, see “Flatpak” in docs/gimp.md",
            )


def _reads(program: Program, profile: Profile) -> bool:
    """Test whether a GIMP 3 looks for plug-ins in a profile."""
    return profile.version in (None, program.version) and profile.kind in (
        "folder",
        "GIMP3_DIRECTORY",
        program.kind,
    )


def _missing(profile: Profile) -> Finding | None:
    if (profile.plug_in / f"{PLUG_IN}.py").is_file():
        return None
    if (profile.plug_in / PLUG_IN / f"{PLUG_IN}.py").is_file():
        return Finding(
            False,
            f"{profile.title}: the folder {profile.plug_in} holds another one of that name",
            "move the inner folder up, to the place of the outer",
        )
    if (profile.plug_ins / f"{PLUG_IN}.py").is_file():
        return Finding(
            False,
            f"{profile.title}: {PLUG_IN}.py lies in {profile.plug_ins} itself; GIMP wants it in a folder of "
            "its own",
            _INSTALL,
        )
    return Finding(False, f"{profile.title}: the plug-in is not in {profile.plug_ins}", _INSTALL)


def _folder(profile: Profile) -> Iterator[Finding]:
    main = profile.plug_in / f"{PLUG_IN}.py"
    if sys.platform != "win32" and not os.access(main, os.X_OK):
        yield Finding(
            False, f"{main} may not be executed, so GIMP ignores it", f"{_INSTALL}, or: chmod +x '{main}'"
        )
    try:
        text = (profile.plug_in / "__init__.py").read_text(encoding="utf-8")
        version = match[1] if (match := re.search(r'__version__ = "([^"]+)"', text)) else "unknown"
    except OSError:
        version = "unknown"
    if version != ts.__version__:
        yield Finding(
            False,
            f"the plug-in there is of TopoSeam {version}, and this is {ts.__version__}",
            f"{_INSTALL} and start GIMP again",
        )


def _engine(profile: Profile) -> Iterator[Finding]:
    """Join two tiny pictures with the engine that the plug-in would use."""
    from toposeam_gimp.engine import folder
    from toposeam_gimp.engine import process as engine

    try:
        python = json.loads((profile.plug_in / "engine.json").read_text(encoding="utf-8"))["python"]
    except (OSError, ValueError, KeyError, TypeError):
        yield Finding(
            False, "the plug-in does not know which Python has TopoSeam (engine.json is missing)", _INSTALL
        )
        return
    try:
        with folder.RequestFolder() as place:
            rasters = []
            for index in range(2):
                (place.path / f"{index}.raw").write_bytes(bytes([90, 255] * 64))
                raster = {
                    "file": f"{index}.raw",
                    "width": 8,
                    "height": 8,
                    "channels": 2,
                    "dtype": "uint8",
                    "at": [4 * index, 0],
                }
                rasters.append({**raster, "name": str(index)})
            request = {"operation": "stitch", "layers": rasters}
            engine.ask(
                place,
                request,
                lambda share: None,
                command=engine.command_of(python),
                silence_s=_PROBE_S,
            )
    except (engine.EngineError, folder.FolderError) as error:
        yield Finding(False, f"the engine {python} does not work: {error}", _INSTALL)
    else:
        yield Finding(True, f"the engine works: {python}")


def _plug_in_path(profile: Profile) -> str:
    """Return the plug-in search path of a GIMP with this profile, from its gimprc."""
    folder = profile.plug_ins.parent
    path = f"{profile.plug_ins}:${{gimp_plug_in_dir}}/plug-ins"
    if profile.version is not None or profile.kind == "GIMP3_DIRECTORY":
        with suppress(OSError):
            settings = (folder / "gimprc").read_text(encoding="utf-8", errors="replace")
            if match := re.search(r'^\(plug-in-path "([^"\n]*)"\)', settings, re.MULTILINE):
                path = match[1].replace("${gimp_dir}", str(folder))
    return path


def _probe(program: Program, profile: Profile) -> Finding:
    """Ask a GIMP whether it loads the plug-in from its search path, with a temporary profile."""
    console, name = str(program.console), f"GIMP {program.version}"
    with tempfile.TemporaryDirectory(prefix="toposeam-doctor-") as scratch:
        (Path(scratch) / "gimprc").write_text(
            f'(plug-in-path "{_plug_in_path(profile)}")\n', encoding="utf-8"
        )
        command = [console, "-nidfs", "--batch-interpreter=python-fu-eval", "-b", _PROBE, "--quit"]
        own = str(Path(sys.executable).parent)  # the Python of a virtual environment lacks GIMP's modules
        path = [entry for entry in absolute_entries(os.environ.get("PATH", "")) if entry != own]
        environment = {**os.environ, "GIMP3_DIRECTORY": scratch, "PATH": os.pathsep.join(path)}
        environment.pop("PYTHONSAFEPATH", None)
        try:
            ended = run(command, environment=environment, timeout_s=_PROBE_S)
        except (OSError, subprocess.TimeoutExpired) as error:
            return Finding(
                False,
                f"{name} could not be asked ({type(error).__name__})",
                f"start it from a terminal and read what it says: {console}",
            )
    said = ended.stdout + ended.stderr
    if "TOPOSEAM True" in said:
        return Finding(True, f"{name} loads the plug-in: it is in Filters > TopoSeam after the next start")
    if "TOPOSEAM False" in said:
        errors = [line.strip() for line in said.splitlines() if re.match(r"\s*\w*Error: ", line)]
        return Finding(
            False, f"{name} does not load the plug-in{': ' + errors[-1] if errors else ''}", _INSTALL
        )
    return Finding(
        False,
        f"{name} runs no Python plug-ins at all",
        "install its Python support (Debian and Ubuntu: apt install python3-gi gir1.2-gtk-3.0; others: the "
        "full GIMP from gimp.org)",
    )


def _registered(profile: Profile) -> Iterator[Finding]:
    """Report the registration at the last start of GIMP."""
    record = profile.plug_ins.parent / "pluginrc"
    try:
        known = PLUG_IN in record.read_text(encoding="utf-8", errors="replace")
        started_since = record.stat().st_mtime > (profile.plug_in / f"{PLUG_IN}.py").stat().st_mtime
    except OSError:
        return
    if known:
        yield Finding(
            True,
            f"{profile.title} has registered it; it needs an open image, and for Stitch Layers two selected "
            "layers",
        )
    elif started_since:
        yield Finding(
            False,
            f"{profile.title} was started since, and did not register it",
            "start GIMP from a terminal and read what it says",
        )
    else:
        yield Finding(True, f"{profile.title} was not started since the installation", "start it (again)")
