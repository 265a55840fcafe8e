"""Stacks in TIFF files: plain ones, ImageJ's and OME's, which may be several files."""

from __future__ import annotations

import itertools
import logging
import math
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import defusedxml.ElementTree
import numpy as np

from toposeam.errors import ImageError
from toposeam_cli.files.regular import real_path
from toposeam_cli.media.stacks.parts import Mapped, check_voxels, damage_reported, needs, ordered
from toposeam_cli.media.stacks.stack import Stack
from toposeam_cli.media.stacks.unpacking import unpacks_within

#: Micrometres per unit, as OME and ImageJ write them.
_UNITS = {"µm": 1.0, "um": 1.0, "micron": 1.0, "microns": 1.0, "nm": 1e-3, "mm": 1e3}
#: Most slices, and most compressed pieces of a slice.
_MOST_SLICES = 1_000_000
#: Options that turn off the readers of kinds of TIFF that open other files by names that we cannot check.
_WITH_OTHERS = {"is_mmstack": False, "is_ndtiff": False}
#: Compressions of unbounded ratio, by TIFF's numbers.
_METHODS = {8: "zlib", 32946: "zlib", 34925: "lzma", 34926: "zstd", 50000: "zstd"}
#: Slices that are read at a time.
_SLICES = 16
#: Tolerance of a piece's unpacked size, bytes; some writers pad the last piece.
_SLACK = 1 << 16


def read_tiff(path: Path, most: float) -> Stack:
    """Open a stack of at most `most` voxels.

    Raises
    ------
    ImageError
    """
    tifffile = needs("tifffile", path)
    with damage_reported(path):
        with _errors_of(tifffile.logger()) as errors, tifffile.TiffFile(path, **_WITH_OTHERS) as file:
            if file.is_ome and file.ome_metadata:
                _check_ome(path, file.ome_metadata, most)
            series = file.series[0]
            if errors:
                raise ImageError(f"{path} is damaged or cut short; copy it again")
            axes, shape = series.axes, tuple(map(int, series.shape))
            check_voxels(path, shape, most)
            spacing, unit = _spacing(file)
            _check_slices(path, series)
            if series.dataoffset is not None and series.keyframe.compression == 1:
                dtype, offset = series.dtype.newbyteorder(file.byteorder), series.dataoffset
                voxels: Any = Mapped(path, lambda: np.memmap(path, dtype, "r", offset, shape))
            else:
                voxels = _lazy(path, series).reshape(shape)
        kept = [axis for axis, length in zip(axes, shape, strict=True) if length > 1 or axis in "YX"]
        voxels = ordered(voxels, axes, kept, path)
    return Stack(voxels=voxels, spacing=spacing, unit=unit, source=path)


@contextmanager
def _errors_of(logger: logging.Logger) -> Iterator[list[str]]:
    """Collect a reader's logged errors instead of printing them, since it continues after them; warnings are
    dropped.
    """
    found: list[str] = []

    def note(record: logging.LogRecord) -> bool:
        if record.levelno >= logging.ERROR:
            found.append(record.getMessage())
        return False

    logger.addFilter(note)
    try:
        yield found
    finally:
        logger.removeFilter(note)


def _check_ome(path: Path, text: str, most: float) -> None:
    """Check OME's description: refuse too many slices, and files that are not in the same folder.

    Raises
    ------
    ImageError
    """
    total = 0
    for node in defusedxml.ElementTree.fromstring(text).iter():
        kind = str(node.tag).rpartition("}")[2]
        if kind == "Pixels":
            sizes = [int(node.get(f"Size{axis}", 1)) for axis in "TCZYX"]
            check_voxels(path, sizes, most)
            total += math.prod(sizes[:3])
        elif kind == "TiffData":
            total += int(node.get("PlaneCount", node.get("NumPlanes", 1)))
        elif kind.startswith("Along") and "Start" in node.attrib:
            begin, end = float(node.get("Start", 0)), float(node.get("End", 0))
            total += int((end - begin) / float(node.get("Step", 1)))
        elif kind == "UUID" and node.get("FileName"):
            _check_beside(path, str(node.get("FileName")))
        if not 0 <= total <= _MOST_SLICES:
            raise ImageError(f"{path} says that it has {total:.4g} slices; save it again")


def _check_beside(path: Path, name: str) -> None:
    if name.lower() == path.name.lower():
        return
    folder = real_path(path.parent)
    other = real_path(folder / name)
    if not other.is_relative_to(folder) or (other.exists() and not other.is_file()):
        raise ImageError(f"{path} names '{name}' as one of its files; only files in its own folder are read")
    if not other.exists():
        raise ImageError(
            f"{path} has slices in '{name}', which is not there; put all its files into one folder"
        )


def _check_slices(path: Path, series: Any) -> None:
    """Refuse a series that lacks slices, or ends beyond the end of a file.

    Raises
    ------
    ImageError
    """
    ends: dict[str, int] = {}
    for page in series.pages:
        if page is None:
            raise ImageError(f"{path} lacks some of its slices; copy it again")
        name = page.parent.filehandle.path
        end = max(map(sum, zip(page.dataoffsets, page.databytecounts, strict=True)), default=0)
        ends[name] = max(ends.get(name, 0), end)
    for name, end in ends.items():
        if end > Path(name).stat().st_size:
            raise ImageError(f"{name} is cut short: its last slice is missing; copy it again")


def _lazy(path: Path, series: Any) -> Any:
    """Return the slices as a dask array, which reads each when it is needed."""
    array, delayed = needs("dask.array", path), needs("dask", path).delayed
    pages, keyframe = list(series.pages), series.keyframe
    shape, dtype = keyframe.shape, series.dtype
    piece = math.prod(keyframe.chunks) * dtype.itemsize + _SLACK
    method = _METHODS.get(int(keyframe.compression), "")
    lock = threading.Lock()  # a file has one read position

    def read(first: int, last: int) -> Any:
        with damage_reported(path), lock, ExitStack() as opened:
            found = np.empty((last - first, *shape), dtype)
            for index, page in enumerate(pages[first:last]):
                handle = page.parent.filehandle
                if handle.closed:
                    opened.enter_context(_closing(handle))
                if method:
                    _check_pieces(path, page, method, piece)
                found[index] = page.asarray().reshape(shape)
        return found

    ends = [*range(0, len(pages), _SLICES), len(pages)]
    parts = [
        array.from_delayed(delayed(read)(first, last), (last - first, *shape), dtype)
        for first, last in itertools.pairwise(ends)
    ]
    return array.concatenate(parts)


@contextmanager
def _closing(handle: Any) -> Iterator[None]:
    handle.open()
    try:
        yield
    finally:
        handle.close()


def _check_pieces(path: Path, page: Any, method: str, most: int) -> None:
    """Refuse a slice whose pieces unpack to more than their size.

    Raises
    ------
    ImageError
    """
    handle = page.parent.filehandle
    for offset, count in zip(page.dataoffsets, page.databytecounts, strict=True):
        handle.seek(offset)
        if not unpacks_within(handle.read(count), method, most):
            raise ImageError(f"{path} unpacks to more than its slices hold; save it again")


def _spacing(file: Any) -> tuple[tuple[float, float, float] | None, str]:
    """Read the size of a voxel from OME's or ImageJ's description, in µm where possible."""
    if file.is_ome and file.ome_metadata:
        pixels = next(
            (
                node
                for node in defusedxml.ElementTree.fromstring(file.ome_metadata).iter()
                if node.tag.endswith("}Pixels")
            ),
            None,
        )
        if pixels is None:
            return None, "µm"
        sizes = []
        for axis in "ZYX":
            size = float(pixels.get(f"PhysicalSize{axis}", "nan"))
            sizes.append(size * _UNITS.get(pixels.get(f"PhysicalSize{axis}Unit", "µm"), np.nan))
        return known_spacing(sizes), "µm"
    if file.is_imagej:
        said = file.imagej_metadata or {}
        scale = _UNITS.get(str(said.get("unit", "")).strip())
        if scale is None:
            return None, "µm"
        per_unit = [_ratio(file.pages[0].tags, tag) for tag in ("YResolution", "XResolution")]
        sizes = [float(said.get("spacing", "nan")) * scale]
        return known_spacing(sizes + [scale / number if number else np.nan for number in per_unit]), "µm"
    return None, "µm"


def _ratio(tags: Any, name: str) -> float:
    value = tags[name].value if name in tags else (0, 1)
    return float(value[0]) / float(value[1]) if value[1] else 0.0


def known_spacing(sizes: list[float]) -> tuple[float, float, float] | None:
    """Return the depth, height and width of a voxel, or None if one is no positive number."""
    if all(np.isfinite(size) and size > 0 for size in sizes):
        return sizes[0], sizes[1], sizes[2]
    return None
