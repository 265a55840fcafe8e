"""``toposeam doctor``: find out what works on this machine, and what is missing for the rest."""

from __future__ import annotations

import platform
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

import click
import numpy as np

import toposeam as ts
from toposeam import _kernels
from toposeam.sentence import counted, sentence
from toposeam_cli.app.progress import say
from toposeam_cli.gimp.doctor import Finding, examine
from toposeam_cli.gimp.folders import profiles
from toposeam_cli.gimp.programs import programs
from toposeam_cli.jobs.crew import processes_of

#: What else can be installed: its name in brackets, the modules, and what they are for.
_EXTRAS = {
    "edit": (("starlette", "uvicorn", "websockets"), "the page of toposeam edit"),
    "video": (("av",), "MP4, MOV and WebM in loop"),
    "volumes": (("zarr", "numcodecs", "dask", "tifffile"), "OME-Zarr in volume"),
    "plot": (("matplotlib",), "--history as a figure"),
    "dask": (("distributed", "cryptography"), "--dask"),
    "graphcut": (("maxflow",), "--method graph-cut"),
}
#: Free space below which large pictures may not fit, bytes.
_LITTLE_SPACE = 2**30


@click.command()
def doctor() -> None:
    """Check what works here, and say what the rest needs."""
    healthy = True
    for finding in (*_basis(), *_extras(), *_gimp()):
        healthy = healthy and finding.well
        mark = "PROBLEM" if not finding.well else "missing" if finding.remedy else "ok     "
        say(f"{mark}  {finding.text}")
        if finding.remedy:
            say(f"         → {finding.remedy}")
    say("Everything needed is here." if healthy else "Something is wrong: see PROBLEM above.")
    if not healthy:
        raise click.exceptions.Exit(1)


def _basis() -> Iterator[Finding]:
    """Check what every command needs: numerics, pictures, and room for them."""
    system = f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
    yield Finding(
        True, f"TopoSeam {version('toposeam')}, {system}, {counted(processes_of(None), 'processor')}"
    )
    try:
        values = np.random.default_rng(0).random((24, 60)).astype(np.float32)
        joined = ts.stitch([ts.Layer(values[:, :40]), ts.Layer(values[:, 20:], at=(20, 0))])
        same = np.array_equal(joined.image, values)
        wrongly = "" if same else " wrongly"
        yield Finding(same, f"two pictures are joined{wrongly}", wrongly and "install toposeam again")
    except Exception as error:
        yield Finding(False, f"two pictures are not joined: {sentence(error)}", "install toposeam again")
    yield Finding(
        True,
        "the kernels are here" if _kernels.library else "no compiled kernels: NumPy does their work, slower",
        "" if _kernels.library else "install a C compiler and toposeam again",
    )
    yield from _pictures()
    folder = Path(tempfile.gettempdir())
    free = shutil.disk_usage(folder).free
    text = f"{free / 2**30:.0f} GiB are free in {folder}, for temporary files"
    yield Finding(free >= _LITTLE_SPACE, text, "" if free >= _LITTLE_SPACE else "free some, or set TMPDIR")


def _pictures() -> Iterator[Finding]:
    """Check that pictures are written and read."""
    from toposeam_cli.media.pictures.libvips import load_vips
    from toposeam_cli.media.pictures.picture import Picture, read_picture, write_picture

    try:
        vips = load_vips()
        with tempfile.TemporaryDirectory() as folder:
            for suffix in (".png", ".tif", ".jpg", ".webp"):
                file = Path(folder, f"a{suffix}")
                write_picture(file, Picture(pixels=np.zeros((8, 8, 3), np.uint8)))
                read_picture(file)
        library = ".".join(str(vips.version(part)) for part in range(3))
        yield Finding(True, f"PNG, TIFF, JPEG and WebP are read and written, by libvips {library}")
    except Exception as error:
        yield Finding(False, f"pictures are not read or written: {sentence(error)}")
    if any(map(_is_there, ("pi_heif", "pillow_heif"))):
        yield Finding(True, "HEIC is read")
    else:
        yield Finding(True, "HEIC: photographs of telephones are not read", "pip install pi-heif")


def _is_there(module: str) -> bool:
    return find_spec(module) is not None


def _extras() -> Iterator[Finding]:
    """List the extras that are installed, and those that are not."""
    for extra, (modules, use) in _EXTRAS.items():
        missing = [module for module in modules if not _is_there(module)]
        remedy = f"in the checkout: pip install '.[cli,{extra}]'" if missing else ""
        yield Finding(True, f"{extra}: {use}", remedy)


def _gimp() -> Iterator[Finding]:
    """Check the plug-in where it is installed."""
    known = []
    with suppress(ts.OptionError):  # there is neither a GIMP nor a profile of one
        known = [one for one in profiles(None) if (one.plug_in / f"{one.plug_in.name}.py").exists()]
    if known:
        yield from examine(known)
    elif any(program.is_3 for program in programs()):
        yield Finding(True, "GIMP 3 is here, without the plug-in", "toposeam gimp install")
    else:
        yield Finding(True, "GIMP: no GIMP 3 was found, so nothing was looked at")
