"""Stacks read from files: opened, not loaded."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import defusedxml.ElementTree
import numpy as np

from toposeam.errors import ImageError, MissingPackageError
from toposeam_cli.files.regular import check_regular_below
from toposeam_cli.media.stacks.stack import Stack

#: Micrometres per unit, as OME and ImageJ write them.
_UNITS = {"µm": 1.0, "um": 1.0, "micron": 1.0, "microns": 1.0, "nm": 1e-3, "mm": 1e3}


#: What a folder has one of that is a zarr.
_ZARR = (".zgroup", ".zarray", "zarr.json")


def read_stack(path: Path) -> Stack:
    """Open a stack.

    Raises
    ------
    ImageError
        If there is no such file, or it is no stack, damaged, or has further axes.
    MissingPackageError
        Without tifffile, or zarr.
    """
    if not path.exists():
        raise ImageError(f"there is no file '{path}'; check the name")
    if path.is_file() and not path.stat().st_size:
        raise ImageError(f"{path} is empty; save or copy the stack again")
    if path.suffix.lower() in (".tif", ".tiff"):
        return _read_tiff(path)
    if path.suffix.lower() == ".npy":
        return _read_npy(path)
    if path.is_dir() or path.suffix.lower() == ".zarr":
        return _read_zarr(path)
    raise ImageError(f"{path} is no stack; give .tif, .ome.tif, .npy or .zarr")


def needs(package: str, path: Path) -> Any:
    """Return an optional package.

    Raises
    ------
    MissingPackageError
    """
    import importlib

    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise MissingPackageError(
            f"{path.name} needs {package.partition('.')[0]}; install it with: pip install 'toposeam[volumes]'"
        ) from error


def _read_npy(path: Path) -> Stack:
    def opened() -> np.ndarray:
        found: np.ndarray = np.load(path, mmap_mode="r", allow_pickle=False)
        return found

    try:
        voxels = _Mapped(opened)
    except (OSError, ValueError, EOFError) as error:
        raise ImageError(f"{path} is no NumPy array, or cut short ({error}); save it again") from error
    return _checked(Stack(voxels=voxels, source=path))


class _Mapped:
    """An array in a file, mapped anew for every part that is read: parts that were read do not stay in
    memory.
    """

    def __init__(self, opened: Callable[[], np.ndarray]) -> None:
        voxels = opened()
        self.shape, self.dtype, self.ndim = voxels.shape, voxels.dtype, voxels.ndim
        self._opened = opened

    def __getitem__(self, key: Any) -> np.ndarray:
        return np.array(self._opened()[key])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.asarray(self[...], dtype)

    def squeeze(self, axes: tuple[int, ...]) -> _Mapped:
        return _Mapped(lambda: self._opened().squeeze(axes))

    def transpose(self, order: list[int]) -> _Mapped:
        return _Mapped(lambda: self._opened().transpose(order))


def _read_tiff(path: Path) -> Stack:
    tifffile = needs("tifffile", path)
    try:
        with _damage_told(tifffile.logger()) as damage, tifffile.TiffFile(path) as file:
            series = file.series[0]
            if damage:
                raise ImageError(f"{path} is damaged or cut short; copy it again")
            axes, shape = series.axes, series.shape
            spacing, unit = _tiff_spacing(file)
            kept = [axis for axis, length in zip(axes, shape, strict=True) if length > 1 or axis in "YX"]
            if len(file.pages) < len(series.pages) or any(page is None for page in series.pages):
                raise ImageError(f"{path} lacks some of its slices; copy it again")
            last = file.pages[-1]
            needed = max(map(sum, zip(last.dataoffsets, last.databytecounts, strict=True)), default=0)
            if needed > path.stat().st_size:
                raise ImageError(f"{path} is cut short: its last slice is missing; copy it again")
            memory_mapped = series.dataoffset is not None and series.keyframe.compression == 1
        if memory_mapped:
            found = tifffile.memmap(path, mode="r")
            dtype, offset = found.dtype, found.offset
            voxels: Any = _Mapped(lambda: np.memmap(path, dtype, "r", offset, shape))
        else:
            voxels = _lazy(tifffile, path).reshape(shape)
    except ImageError:
        raise
    except (OSError, ValueError, IndexError, KeyError, tifffile.TiffFileError) as error:
        raise ImageError(f"{path} cannot be read as a stack ({error}); copy or save it again") from error
    return _checked(Stack(voxels=_ordered(voxels, axes, kept, path), spacing=spacing, unit=unit, source=path))


@contextmanager
def _damage_told(logger: logging.Logger) -> Iterator[list[str]]:
    """Collect what a reader logs as errors, instead of printing it; it goes on with what it can read,
    warnings are of no consequence.
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


def _lazy(tifffile: Any, path: Path) -> Any:
    """Return slices of a compressed file, each read when it is wanted."""
    array = needs("dask.array", path)
    delayed = needs("dask", path).delayed
    with tifffile.TiffFile(path) as file:
        series = file.series[0]
        shape, dtype, pages = series.keyframe.shape, series.dtype, len(series.pages)

    def read(index: int) -> Any:
        with tifffile.TiffFile(path) as file:
            return file.series[0].asarray(key=index).reshape(shape)

    return array.stack([array.from_delayed(delayed(read)(index), shape, dtype) for index in range(pages)])


def _ordered(voxels: Any, axes: str, kept: list[str], path: Path) -> Any:
    """Return voxels as (z, y, x) or (z, y, x, channels)."""
    singles = tuple(place for place, axis in enumerate(axes) if axis not in kept)
    voxels = voxels.squeeze(singles) if singles else voxels
    named = "".join(kept).replace("I", "Z").replace("Q", "Z")
    channels = [axis for axis in named if axis in "CS"]
    others = [axis for axis in named if axis not in "CSYX"]
    if len(others) != 1 or len(channels) > 1:
        raise ImageError(
            f"{path} has axes {''.join(kept)}; give one stack of slices: Z, Y, X and perhaps channels"
        )
    order = [
        named.index(others[0]),
        named.index("Y"),
        named.index("X"),
        *(named.index(axis) for axis in channels),
    ]
    return voxels.transpose(order)


def _tiff_spacing(file: Any) -> tuple[tuple[float, float, float] | None, str]:
    """Read a voxel's size from OME's or ImageJ's description, in µm where possible."""
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
        return _known(sizes)
    if file.is_imagej:
        said = file.imagej_metadata or {}
        unit = str(said.get("unit", "")).strip()
        page = file.pages[0]
        per_unit = [_ratio(page.tags, tag) for tag in ("YResolution", "XResolution")]
        scale = _UNITS.get(unit)
        if scale is None:
            return None, "µm"
        sizes = [float(said.get("spacing", "nan")) * scale]
        return _known(sizes + [scale / number if number else np.nan for number in per_unit])
    return None, "µm"


def _ratio(tags: Any, name: str) -> float:
    value = tags[name].value if name in tags else (0, 1)
    return float(value[0]) / float(value[1]) if value[1] else 0.0


def _known(sizes: list[float]) -> tuple[tuple[float, float, float] | None, str]:
    if all(np.isfinite(size) and size > 0 for size in sizes):
        return (sizes[0], sizes[1], sizes[2]), "µm"
    return None, "µm"


def _read_zarr(path: Path) -> Stack:
    check_regular_below(path, "all of the stack")
    zarr = needs("zarr", path)
    array = needs("dask.array", path)
    if not any((path / name).exists() for name in _ZARR):
        raise ImageError(
            f"{path} is no zarr; give one of the stacks in that folder, or export the stack again"
        )
    try:
        node = zarr.open(str(path), mode="r")
        spacing, axes = None, None
        if hasattr(node, "attrs") and not hasattr(node, "shape"):
            said = dict(node.attrs)
            scales = (said.get("ome") or said).get("multiscales")
            if scales:
                first = scales[0]["datasets"][0]
                axes = "".join(str(axis["name"]).upper() for axis in scales[0].get("axes", []))
                for change in first.get("coordinateTransformations", []):
                    if change.get("type") == "scale":
                        named = dict(zip(axes, change["scale"], strict=False))
                        spacing = _known([float(named.get(axis, np.nan)) for axis in "ZYX"])[0]
                node = node[first["path"]]
            else:
                names = sorted(node.array_keys())
                if not names:
                    raise ImageError(f"{path} holds no array; give a zarr array, or an OME-Zarr")
                node = node[names[0]]
        voxels = array.from_zarr(node)
    except ImageError:
        raise
    except Exception as error:  # zarr raises whatever its stores do
        reason = " ".join(str(error).split())
        raise ImageError(f"{path} cannot be read as zarr ({reason}); check it") from error
    if axes and len(axes) == voxels.ndim:
        kept = [axis for axis, length in zip(axes, voxels.shape, strict=True) if length > 1 or axis in "YX"]
        voxels = _ordered(voxels, axes, kept, path)
    return _checked(Stack(voxels=voxels, spacing=spacing, source=path))


def _checked(stack: Stack) -> Stack:
    voxels, path = stack.voxels, stack.source
    if voxels.ndim not in (3, 4) or 0 in voxels.shape:
        raise ImageError(
            f"{path} has shape {'×'.join(map(str, voxels.shape))}; give a stack of slices: z×y×x, or "
            "z×y×x×channels"
        )
    if voxels.dtype.kind not in "uf" or voxels.dtype.itemsize > 4:
        raise ImageError(f"{path} has {voxels.dtype} voxels; save it as uint8, uint16 or float32")
    return stack
