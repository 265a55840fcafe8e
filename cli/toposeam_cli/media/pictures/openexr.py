"""OpenEXR, which renderers and painting programs exchange maps in: floats without limits, read and written by
the package OpenEXR where it is installed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.errors import ImageError, MissingPackageError
from toposeam_cli.files.writing import EXR
from toposeam_cli.media.pictures.libvips import evaluate, to_vips

#: Sets of channels that are read, in the order of the array's.
_CHANNELS = ("RGB", "RGBA", "Y", "YA")


def check_openexr(path: Path) -> None:
    """Refuse a file that OpenEXR has to write, where that is missing.

    Raises
    ------
    MissingPackageError
    """
    if path.suffix.lower() == EXR:
        _package(path)


def exr_size(path: Path) -> tuple[int, int]:
    """Read the width and height of a picture, px, from its header.

    Raises
    ------
    ImageError, MissingPackageError
    """
    parts = _opened(path, header_only=True).parts
    if len(parts) != 1:
        raise ImageError(f"'{path}' holds {len(parts)} pictures; export the one that is wanted alone")
    header = parts[0].header
    (left, top), (right, bottom) = header["dataWindow"]
    if not all(map(np.array_equal, header["dataWindow"], header["displayWindow"])):
        raise ImageError(f"'{path}' holds only a part of its picture's pixels; export it whole, not cropped")
    return int(right) - int(left) + 1, int(bottom) - int(top) + 1


def exr_as_tiff(path: Path, check: Callable[[int, int], None]) -> bytes:
    """Return a picture as TIFF of floats, gray or RGB and opacity; its colours are not multiplied by that, as
    they are in the file.

    Parameters
    ----------
    path : Path
    check : callable
        Called with width and height before decoding; raises if they are too large.

    Raises
    ------
    ImageError, MissingPackageError
    """
    width, height = exr_size(path)
    check(width, height)
    file = _opened(path, separate_channels=True)
    planes = {name: one.pixels for part in file.parts for name, one in part.channels.items()}
    found = next((names for names in _CHANNELS if set(names) == set(planes)), None)
    if found is None and len(planes) == 1:
        found = next(iter(planes))  # one map, whatever it is called
    if not planes or any(plane is None or plane.shape != (height, width) for plane in planes.values()):
        raise ImageError(f"cannot read '{path}': it is damaged or cut short; export it again")
    if found is None:
        raise ImageError(
            f"'{path}' has the channels {', '.join(planes)}; export it with R, G, B, maybe A, or one alone"
        )
    names = [found] if len(planes) == 1 else list(found)
    values = np.stack([planes[name].astype(np.float32) for name in names], axis=2)
    if names[-1] == "A" and len(names) > 1:
        values[..., :-1] /= np.where(values[..., -1:] > 0, values[..., -1:], 1)
    colours = 1 if len(names) < 3 else 3
    image = to_vips(values[..., 0] if colours == 1 else values[..., :3])
    if len(names) > colours:
        image = image.bandjoin(to_vips(np.ascontiguousarray(values[..., -1])))
    content: bytes = evaluate(image, image.tiffsave_buffer)
    return content


def write_exr(path: Path, pixels: np.ndarray, alpha: np.ndarray | None) -> None:
    """Write (H, W) or (H, W, 3) float32 pixels and (H, W) opacity, as 32 bits that are compressed without
    loss.

    Raises
    ------
    OSError, MissingPackageError
    """
    exr = _package(path)
    names = "RGB" if pixels.ndim == 3 and pixels.shape[2] == 3 else "Y"
    planes = np.atleast_3d(pixels) if alpha is None else np.atleast_3d(pixels) * alpha[..., np.newaxis]
    channels = {name: np.ascontiguousarray(planes[..., k]) for k, name in enumerate(names)}
    if alpha is not None:
        channels["A"] = np.ascontiguousarray(alpha)
    header = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}
    try:
        exr.File(header, channels).write(str(path))
    except RuntimeError as error:
        raise OSError(str(error)) from error


def _opened(path: Path, **options: bool) -> Any:
    exr = _package(path)
    try:
        with _silent():
            return exr.File(str(path), **options)
    except Exception as error:
        why = " ".join(str(error).split()) or "damaged"
        raise ImageError(f"cannot read '{path}' ({why}): it is damaged; export it again") from error


@contextmanager
def _silent() -> Iterator[None]:
    """Keep what the package and its C library print about damaged files off the terminal."""
    with redirect_stdout(StringIO()), Path(os.devnull).open("wb") as nowhere:
        kept = os.dup(2)
        try:
            os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            os.dup2(kept, 2)
            os.close(kept)


def _package(path: Path) -> Any:
    try:
        import OpenEXR
    except ImportError as error:
        raise MissingPackageError(
            f"'{path}' needs OpenEXR; install it with: pip install OpenEXR, or use .tif"
        ) from error
    return OpenEXR
