"""Why is the plug-in not in the menu? One finding after another, each with its remedy."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import toposeam as ts
from toposeam_cli.gimp_folders import PLUG_IN, Profile

_INSTALL = "run: toposeam gimp install"
_PROBE_S = 180.0
#: What GIMP itself is asked in its own Python: is the procedure there?
_PROBE = "print('TOPOSEAM', Gimp.get_pdb().procedure_exists('plug-in-toposeam-stitch'))"


@dataclass(frozen=True, slots=True)
class Finding:
    """Something that was looked at."""

    well: bool
    text: str
    remedy: str = ""


def examine(profiles: Sequence[Profile]) -> Iterator[Finding]:
    """Look at GIMP, at every profile, at the engine, and ask GIMP itself."""
    console, finding = _find_gimp()
    yield finding
    for profile in profiles:
        missing = _missing(profile)
        if missing is not None:
            yield missing
            continue
        yield Finding(True, f"{profile.title}: the plug-in is in {profile.plug_in}")
        yield from _folder(profile)
        yield from _engine(profile)
        if console is not None:
            yield _probe(console, profile)
        yield from _registered(profile)


def _find_gimp() -> tuple[str | None, Finding]:
    """The console program of GIMP 3, if there is one to ask."""
    names = {entry.name for folder in _program_folders() for entry in folder.glob("gimp-console-3*")}
    names = {name for name in names if re.fullmatch(r"gimp-console-3(\.\d+)?(\.exe)?", name)}
    search = os.pathsep.join(map(str, _program_folders()))
    for name in sorted(names, key=lambda text: [int(part) for part in re.findall(r"\d+", text)], reverse=True):
        path = shutil.which(name, path=search)
        if path is not None:
            return path, Finding(True, f"GIMP 3 is installed: {path}")
    flatpak = shutil.which("flatpak")
    if flatpak is not None and subprocess.run([flatpak, "info", "org.gimp.GIMP"], capture_output=True, check=False).returncode == 0:  # noqa: S603
        return None, Finding(
            True, "GIMP is installed as a Flatpak",
            "its sandbox cannot run this Python: give it one of its own, see “Flatpak” in docs/gimp.md",
        )  # fmt: skip
    remedy = "install GIMP 3 from gimp.org or your system's packages; TopoSeam does not work in GIMP 2.10"
    return None, Finding(False, "no GIMP 3 was found on this machine (its console program, that is)", remedy)


def _program_folders() -> list[Path]:
    folders = [Path(part) for part in os.environ.get("PATH", "").split(os.pathsep) if part]
    if sys.platform == "darwin":
        folders.append(Path("/Applications/GIMP.app/Contents/MacOS"))
    if sys.platform == "win32":
        local = Path(os.environ.get("LOCALAPPDATA", "")) / "Programs"
        folders += [root / "GIMP 3" / "bin" for root in (Path(os.environ.get("PROGRAMFILES", "C:/Program Files")), local)]
    return [folder for folder in folders if folder.is_dir()]


def _missing(profile: Profile) -> Finding | None:
    if (profile.plug_in / f"{PLUG_IN}.py").is_file():
        return None
    if (profile.plug_in / PLUG_IN / f"{PLUG_IN}.py").is_file():
        return Finding(
            False, f"{profile.title}: the folder {profile.plug_in} holds another one of that name",
            "move the inner folder up, to the place of the outer"
        )  # fmt: skip
    if (profile.plug_ins / f"{PLUG_IN}.py").is_file():
        return Finding(
            False, f"{profile.title}: {PLUG_IN}.py lies in {profile.plug_ins} itself; GIMP wants it in a folder of its own", _INSTALL
        )
    return Finding(False, f"{profile.title}: the plug-in is not in {profile.plug_ins}", _INSTALL)


def _folder(profile: Profile) -> Iterator[Finding]:
    main = profile.plug_in / f"{PLUG_IN}.py"
    if sys.platform != "win32" and not os.access(main, os.X_OK):
        yield Finding(False, f"{main} may not be executed, so GIMP ignores it", f"{_INSTALL}, or: chmod +x '{main}'")
    try:
        text = (profile.plug_in / "__init__.py").read_text(encoding="utf-8")
        version = match[1] if (match := re.search(r'__version__ = "([^"]+)"', text)) else "unknown"
    except OSError:
        version = "unknown"
    if version != ts.__version__:
        yield Finding(
            False, f"the plug-in there is of TopoSeam {version}, and this is {ts.__version__}", f"{_INSTALL} and start GIMP again"
        )


def _engine(profile: Profile) -> Iterator[Finding]:
    """Join two tiny pictures with the engine that the plug-in would use."""
    from toposeam_gimp import engine, folder

    try:
        python = json.loads((profile.plug_in / "engine.json").read_text(encoding="utf-8"))["python"]
    except (OSError, ValueError, KeyError, TypeError):
        yield Finding(False, "the plug-in does not know which Python has TopoSeam (engine.json is missing)", _INSTALL)
        return
    try:
        with folder.RequestFolder() as place:
            rasters = []
            for index in range(2):
                (place.path / f"{index}.raw").write_bytes(bytes([90, 255] * 64))
                raster = {"file": f"{index}.raw", "width": 8, "height": 8, "channels": 2, "dtype": "uint8", "offset": [4 * index, 0]}
                rasters.append({**raster, "name": str(index)})
            request = {"operation": "stitch", "layers": rasters}
            engine.ask(place, request, lambda share: None, command=[python, "-P", "-m", "toposeam_cli.engine"], silence_s=_PROBE_S)
    except (engine.EngineError, folder.FolderError) as error:
        yield Finding(False, f"the engine {python} does not work: {error}", _INSTALL)
    else:
        yield Finding(True, f"the engine works: {python}")


def _probe(console: str, profile: Profile) -> Finding:
    """Let GIMP load the plug-in, with a profile of its own that is thrown away."""
    with tempfile.TemporaryDirectory(prefix="toposeam-doctor-") as scratch:
        (Path(scratch) / "gimprc").write_text(f'(plug-in-path "{profile.plug_ins}:${{gimp_plug_in_dir}}/plug-ins")\n', encoding="utf-8")
        command = [console, "-nidfs", "--batch-interpreter=python-fu-eval", "-b", _PROBE, "--quit"]
        own = str(Path(sys.executable).parent)  # a virtual environment's Python has none of GIMP's modules
        path = os.pathsep.join(part for part in os.environ.get("PATH", "").split(os.pathsep) if part != own)
        environment = {**os.environ, "GIMP3_DIRECTORY": scratch, "PATH": path}
        try:
            ended = subprocess.run(command, env=environment, capture_output=True, timeout=_PROBE_S, stdin=subprocess.DEVNULL, check=False)  # noqa: S603
        except (OSError, subprocess.TimeoutExpired) as error:
            return Finding(
                False, f"GIMP could not be asked ({type(error).__name__})", f"start it from a terminal and read what it says: {console}"
            )
    said = (ended.stdout + ended.stderr).decode(errors="replace")
    if "TOPOSEAM True" in said:
        return Finding(True, "GIMP loads the plug-in: it is in Filters > TopoSeam after the next start")
    if "TOPOSEAM False" in said:
        errors = [line.strip() for line in said.splitlines() if re.match(r"\s*\w*Error: ", line)]
        return Finding(False, f"GIMP does not load the plug-in{': ' + errors[-1] if errors else ''}", _INSTALL)
    return Finding(
        False, "this GIMP runs no Python plug-ins at all",
        "install its Python support (Debian and Ubuntu: apt install python3-gi gir1.2-gtk-3.0; others: the full GIMP from gimp.org)",
    )  # fmt: skip


def _registered(profile: Profile) -> Iterator[Finding]:
    """What the last start of GIMP made of it."""
    record = profile.plug_ins.parent / "pluginrc"
    try:
        known = PLUG_IN in record.read_text(encoding="utf-8", errors="replace")
        started_since = record.stat().st_mtime > (profile.plug_in / f"{PLUG_IN}.py").stat().st_mtime
    except OSError:
        return
    if known:
        yield Finding(True, f"{profile.title} has registered it; it needs an open image, and for Stitch Layers two selected layers")
    elif started_since:
        yield Finding(
            False, f"{profile.title} was started since, and did not register it", "start GIMP from a terminal and read what it says"
        )
    else:
        yield Finding(True, f"{profile.title} was not started since the installation", "start it (again)")
