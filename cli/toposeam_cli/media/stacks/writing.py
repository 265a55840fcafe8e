"""Stacks written slice by slice, whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.errors import OptionError
from toposeam_cli.files.writing import check_output, is_expected, replacing
from toposeam_cli.media.stacks.parts import needs
from toposeam_cli.media.stacks.stack import SUFFIXES
from toposeam_cli.media.stacks.zarr_folder import METADATA

#: Slices that are computed at a time.
_SLICES = 16
#: Largest stack that ImageJ's own TIFF holds, bytes.
_IMAGEJ_BYTES = 4_000_000_000


def check_stack_output(path: Path, force: bool) -> Path:
    """Refuse an output that cannot be written, before any work.

    Raises
    ------
    OptionError, MissingPackageError
    """
    if path.suffix.lower() == ".zarr":
        needs("zarr", path)
        if not path.absolute().parent.is_dir():
            raise OptionError(
                f"there is no folder '{path.absolute().parent}'; create it or choose another one"
            )
        if os.path.lexists(path) and not (force or is_expected(path)):
            raise OptionError(f"'{path}' exists already; pass --force to replace it, or choose another name")
        if os.path.lexists(path) and not any((path / name).is_file() for name in METADATA):
            raise OptionError(f"'{path}' is no zarr array or group, and is left alone; choose another name")
        return path
    if path.suffix.lower() != ".npy":
        needs("tifffile", path)
    return check_output(path, force, SUFFIXES)


def write_stack(
    path: Path,
    voxels: Any,
    spacing: tuple[float, float, float] | None,
    force: bool = False,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Write a stack in the format of its extension: ``.ome.tif`` as OME-TIFF, other ``.tif`` as ImageJ's TIFF
    if it is not too large for it, ``.npy``, or ``.zarr`` as OME-Zarr.

    Parameters
    ----------
    path : Path
    voxels : (D, H, W) or (D, H, W, C) array
        Voxels; a dask array is computed some slices at a time.
    spacing : (float, float, float), optional
        Depth, height and width of a voxel in µm; NumPy's format cannot keep it.
    force : bool
        Whether an existing file may be replaced.
    progress : callable, optional
        Called with the written share, in [0, 1].

    Raises
    ------
    OptionError, OutputError
    """
    check_stack_output(path, force)
    if path.suffix.lower() == ".zarr":
        with replacing(path, force, folder=True) as temporary:
            _write_zarr(temporary, voxels, spacing, progress)
        return
    with replacing(path, force) as temporary:
        if path.suffix.lower() == ".npy":
            _write_npy(temporary, voxels, progress)
        else:
            _write_tiff(
                temporary, voxels, spacing, path.name.lower().endswith((".ome.tif", ".ome.tiff")), progress
            )


def _slabs(voxels: Any, progress: Callable[[float], None] | None) -> Iterator[np.ndarray]:
    depth = len(voxels)
    for start in range(0, depth, _SLICES):
        part = voxels[start : start + _SLICES]
        yield np.ascontiguousarray(part.compute() if hasattr(part, "dask") else part)
        if progress is not None:
            progress(min(1.0, (start + _SLICES) / depth))


def _write_npy(path: Path, voxels: Any, progress: Callable[[float], None] | None) -> None:
    with path.open("wb") as file:
        header = {
            "descr": np.lib.format.dtype_to_descr(voxels.dtype),
            "fortran_order": False,
            "shape": voxels.shape,
        }
        np.lib.format.write_array_header_2_0(file, header)
        for slab in _slabs(voxels, progress):
            file.write(slab.tobytes())


def _write_tiff(
    path: Path,
    voxels: Any,
    spacing: tuple[float, float, float] | None,
    ome: bool,
    progress: Callable[[float], None] | None,
) -> None:
    tifffile = needs("tifffile", path)
    flat = voxels.ndim == 3
    # Readers of neither kind know floats of 16 bits.
    dtype = np.dtype(np.float32) if voxels.dtype == np.float16 else voxels.dtype
    size = int(np.prod(voxels.shape)) * dtype.itemsize
    imagej = not ome and size < _IMAGEJ_BYTES and dtype.str[1:] in ("u1", "u2", "f4")
    metadata: dict[str, Any] = {"axes": "ZYX" if flat else "ZCYX"}
    options: dict[str, Any] = {}
    if spacing is not None and imagej:
        metadata |= {"spacing": spacing[0], "unit": "um"}
        options |= {"resolution": (1 / spacing[2], 1 / spacing[1])}
    elif spacing is not None:
        metadata |= {f"PhysicalSize{axis}": side for axis, side in zip("ZYX", spacing, strict=True)}
        metadata |= {f"PhysicalSize{axis}Unit": "µm" for axis in "ZYX"}
    kind = {"imagej": True} if imagej else {"ome": True}
    shape = voxels.shape if flat else (voxels.shape[0], voxels.shape[3], *voxels.shape[1:3])

    def pages() -> Iterator[np.ndarray]:
        for slab in _slabs(voxels, progress):
            for plane in slab.astype(dtype, copy=False):
                yield from [plane] if flat else np.moveaxis(plane, -1, 0)

    tifffile.imwrite(
        path,
        pages(),
        shape=shape,
        dtype=dtype,
        photometric="minisblack",
        metadata=metadata,
        **options,
        **kind,
    )


def _write_zarr(
    folder: Path,
    voxels: Any,
    spacing: tuple[float, float, float] | None,
    progress: Callable[[float], None] | None,
) -> None:
    zarr = needs("zarr", folder)
    group = zarr.open_group(str(folder), mode="w", zarr_format=2)
    chunks = tuple(
        min(length, side) for length, side in zip(voxels.shape, (_SLICES, 256, 256, 8), strict=False)
    )
    array = group.create_array("0", shape=voxels.shape, dtype=voxels.dtype, chunks=chunks)
    start = 0
    for slab in _slabs(voxels, progress):
        array[start : start + len(slab)] = slab
        start += len(slab)
    names = "zyxc"[: voxels.ndim]
    axes = [{"name": name, "type": "channel" if name == "c" else "space"} for name in names]
    for axis in axes[:3]:
        axis["unit"] = "micrometer"
    scale = [*(spacing or (1.0, 1.0, 1.0)), 1.0][: voxels.ndim]
    dataset = {"path": "0", "coordinateTransformations": [{"type": "scale", "scale": scale}]}
    group.attrs["multiscales"] = [{"version": "0.4", "axes": axes, "datasets": [dataset]}]
