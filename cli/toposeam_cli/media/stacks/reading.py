"""Stacks read from files: opened, not loaded."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toposeam.errors import ImageError
from toposeam_cli.media.stacks.parts import Mapped, check_voxels, damage_reported
from toposeam_cli.media.stacks.stack import Stack
from toposeam_cli.media.stacks.tiff import read_tiff
from toposeam_cli.media.stacks.zarr_folder import read_zarr

#: Most voxels of a stack by default.
MOST_VOXELS = 10_000_000_000


def read_stack(path: Path, most: float = MOST_VOXELS) -> Stack:
    """Open a stack of at most `most` voxels, each channel counted.

    Raises
    ------
    ImageError
        If there is no such file, or it is no stack, damaged, too large, or has further axes.
    MissingPackageError
        Without tifffile, or zarr.
    """
    if not path.exists():
        raise ImageError(f"there is no file '{path}'; check the name")
    if path.is_file() and not path.stat().st_size:
        raise ImageError(f"{path} is empty; save or copy the stack again")
    if path.suffix.lower() in (".tif", ".tiff"):
        return _checked(read_tiff(path, most))
    if path.suffix.lower() == ".npy":
        return _checked(_read_npy(path, most))
    if path.is_dir() or path.suffix.lower() == ".zarr":
        return _checked(read_zarr(path, most))
    raise ImageError(f"{path} is no stack; give .tif, .ome.tif, .npy or .zarr")


def _read_npy(path: Path, most: float) -> Stack:
    def opened() -> np.ndarray:
        found: np.ndarray = np.lib.format.open_memmap(path, mode="r")
        return found

    with path.open("rb") as file:
        if file.read(2) == b"PK":
            raise ImageError(
                f"{path} is a NumPy archive (.npz) of several arrays; save the one that is meant"
            )
    with damage_reported(path):
        voxels = Mapped(path, opened)
        check_voxels(path, voxels.shape, most)
    return Stack(voxels=voxels, source=path)


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
