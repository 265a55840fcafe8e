"""Stacks in zarr folders.

The metadata of a zarr names the code that unpacks its chunks, and their size. Both are checked here before
zarr reads them, and the unpacked size of each chunk before zarr unpacks it.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.errors import ImageError
from toposeam_cli.files.regular import check_regular_below, real_path
from toposeam_cli.media.stacks.parts import check_voxels, damage_reported, needs, ordered
from toposeam_cli.media.stacks.stack import Stack
from toposeam_cli.media.stacks.tiff import known_spacing
from toposeam_cli.media.stacks.unpacking import unpacks_within

#: Files of metadata, of which every zarr has one.
METADATA = (".zgroup", ".zarray", "zarr.json")
#: Largest metadata that is read, bytes.
_LONGEST = 1 << 24
#: Codecs that are allowed: those that unpack, and those that change values one by one. None runs code from a
#: file.
_PACKING = {"blosc", "zlib", "gzip", "zstd", "lz4", "bz2", "lzma"}
_CHANGING = {
    "adler32",
    "bitround",
    "bytes",
    "crc32",
    "crc32c",
    "delta",
    "fixedscaleoffset",
    "fletcher32",
    "quantize",
    "shuffle",
    "transpose",
}
_DTYPE = re.compile(r"[<>|][biuf][1248]|bool|u?int(8|16|32|64)|float(16|32|64)")
#: Largest chunk, bytes, and most chunks of an array.
_LARGEST_CHUNK, _MOST_CHUNKS = 1 << 32, 1_000_000
#: Tolerance of a chunk's unpacked size: a factor for filters that make values wider, and bytes.
_WIDER, _SLACK = 8, 1 << 16
#: Voxels that are read at a time, unless one chunk is larger.
_READ = (64, 256, 256)


def read_zarr(path: Path, most: float) -> Stack:
    """Open a stack of at most `most` voxels: an array, or the first array of an OME-Zarr or a group.

    Raises
    ------
    ImageError
    """
    check_regular_below(path, "all of the stack")
    zarr, array = needs("zarr", path), needs("dask.array", path)
    if not any((path / name).exists() for name in METADATA):
        raise ImageError(
            f"{path} is no zarr; give one of the stacks in that folder, or export the stack again"
        )
    with damage_reported(path):
        place, axes, spacing = _place(path)
        layout = _layout(path, place, most)
        node = zarr.open_array(str(place), mode="r", zarr_format=layout.version)
        if tuple(node.shape) != layout.shape:
            raise ImageError(f"{path} is damaged; copy it again")
        parts = tuple(
            min(length, side * max(1, wanted // side))
            for length, side, wanted in zip(layout.shape, layout.chunk, (*_READ, *layout.chunk), strict=False)
        )
        voxels = array.from_array(_Chunks(path, node, layout), chunks=parts, name=False)
        if axes and len(axes) == voxels.ndim:
            kept = [
                axis for axis, length in zip(axes, voxels.shape, strict=True) if length > 1 or axis in "YX"
            ]
            voxels = ordered(voxels, axes, kept, path)
    return Stack(voxels=voxels, spacing=spacing, source=path)


def _loaded(file: Path) -> dict[str, Any]:
    """Read a file of metadata; an empty mapping if there is none."""
    if not file.is_file():
        return {}
    if file.stat().st_size > _LONGEST:
        raise ValueError(f"{file.name} is longer than any zarr's")
    found = json.loads(file.read_bytes())
    if not isinstance(found, dict):
        raise ValueError(f"{file.name} holds no metadata")
    return found


def _place(path: Path) -> tuple[Path, str, tuple[float, float, float] | None]:
    """Return the folder of a zarr's first array, the names of its axes (empty if unknown), and the size of a
    voxel.
    """
    whole = _loaded(path / "zarr.json")
    if (path / ".zarray").exists() or whole.get("node_type") == "array":
        return path, "", None
    said = {**_loaded(path / ".zattrs"), **whole.get("attributes", {})}
    scales = said.get("ome", said).get("multiscales")
    if not scales:
        folders = sorted(child for child in path.iterdir() if child.is_dir() and _is_array(child))
        if not folders:
            raise ImageError(f"{path} holds no array; give a zarr array, or an OME-Zarr")
        return folders[0], "", None
    first, spacing = scales[0]["datasets"][0], None
    axes = "".join(str(axis["name"]).upper() for axis in scales[0].get("axes", []))
    for change in first.get("coordinateTransformations", []):
        if change.get("type") == "scale":
            named = dict(zip(axes, change["scale"], strict=False))
            spacing = known_spacing([float(named.get(axis, np.nan)) for axis in "ZYX"])
    place = path / str(first["path"])
    if not real_path(place).is_relative_to(real_path(path)):
        raise ImageError(f"{path} names '{first['path']}' as its array, which is outside of it; check it")
    if not _is_array(place):
        raise ImageError(f"{path} names '{first['path']}' as its array, which is not there; copy it again")
    return place, axes, spacing


def _is_array(folder: Path) -> bool:
    return (folder / ".zarray").is_file() or _loaded(folder / "zarr.json").get("node_type") == "array"


@dataclass(frozen=True, slots=True)
class _Layout:
    """The layout of an array in files."""

    place: Path
    version: int
    shape: tuple[int, ...]
    #: Shapes of a file, and of the inner chunks that are packed separately in it.
    chunk: tuple[int, ...]
    inner: tuple[int, ...]
    #: Least bytes of a voxel.
    itemsize: int
    #: Compression of inner chunks; empty if there is none.
    method: str
    #: Text before the numbers of a chunk in its file's name, and between them.
    prefix: str
    separator: str
    #: For a file of several chunks: whether its index comes first, and the bytes of the index's checksum.
    index_first: bool = False
    index_sum: int = 0

    @property
    def most_bytes(self) -> int:
        """Most bytes of an unpacked inner chunk."""
        return _WIDER * math.prod(self.inner) * self.itemsize + _SLACK


def _layout(path: Path, place: Path, most: float) -> _Layout:
    """Read and check the metadata of an array.

    Raises
    ------
    ImageError
    """
    said = _loaded(place / "zarr.json")
    version = 3 if said else 2
    said = said or _loaded(place / ".zarray")
    shape = _lengths(said["shape"], 0)
    check_voxels(path, shape, most)
    dtype = said["data_type" if version == 3 else "dtype"]
    if not isinstance(dtype, str) or not _DTYPE.fullmatch(dtype):
        raise ImageError(f"{path} has {dtype!s:.40} voxels; save it as uint8, uint16 or float32")
    more: dict[str, Any] = {}
    if version == 3:
        if said.get("storage_transformers") or said["chunk_grid"]["name"] != "regular":
            raise ImageError(f"{path} is laid out in a way that is not read; export it with regular chunks")
        chunk = inner = _lengths(said["chunk_grid"]["configuration"]["chunk_shape"], 1)
        codecs = said["codecs"]
        if len(codecs) == 1 and codecs[0]["name"] == "sharding_indexed":
            shard = codecs[0]["configuration"]
            inner, codecs = _lengths(shard["chunk_shape"], 1), shard["codecs"]
            more["index_first"] = shard.get("index_location", "end") == "start"
            more["index_sum"] = 4 * (
                _checked_codecs(path, shard["index_codecs"], "name") == ["bytes", "crc32c"]
            )
        names = _checked_codecs(path, codecs, "name")
        key = said.get("chunk_key_encoding", {"name": "default"})
        default = key["name"] == "default"
        separator = key.get("configuration", {}).get("separator", "/" if default else ".")
        prefix = f"c{separator}" if default else ""
    else:
        chunk = inner = _lengths(said["chunks"], 1)
        names = _checked_codecs(path, [*(said.get("filters") or []), said.get("compressor") or {}], "id")
        separator, prefix = said.get("dimension_separator", "."), ""
    packing = [name for name in names if name in _PACKING]
    if len(packing) > 1 or not len(shape) == len(chunk) == len(inner):
        raise ImageError(f"{path} is packed in a way that is not read; export it with one compressor")
    itemsize = int(re.sub(r"\D", "", dtype) or 1) // (8 if version == 3 else 1)
    layout = _Layout(
        place, version, shape, chunk, inner, max(1, itemsize), "".join(packing), prefix, separator, **more
    )
    many = math.prod(-(-length // side) for length, side in zip(shape, inner, strict=True))
    if many > _MOST_CHUNKS or math.prod(chunk) * layout.itemsize > _LARGEST_CHUNK:
        raise ImageError(
            f"{path} is cut into {many} chunks of {'×'.join(map(str, inner))} voxels; export it with "
            "chunks of about 64×128×128"
        )
    return layout


def _lengths(given: Sequence[Any], least: int) -> tuple[int, ...]:
    found = tuple(int(length) for length in given)
    if any(length < least for length in found):
        raise ValueError(f"its shape is {'×'.join(map(str, found))}")
    return found


def _checked_codecs(path: Path, codecs: Sequence[dict[str, Any]], key: str) -> list[str]:
    """Return the names of codecs; refuse those that are not allowed.

    Raises
    ------
    ImageError
    """
    names = [str(codec[key]).removeprefix("numcodecs.") for codec in codecs if codec]
    for name in names:
        if name not in _PACKING | _CHANGING:
            raise ImageError(
                f"{path} is packed with {name:.40}, which is not read; export it with blosc, zlib, gzip or "
                "zstd"
            )
    return names


class _Chunks:
    """An array in a zarr. Before a part is read, the unpacked size of its chunks is checked."""

    def __init__(self, path: Path, node: Any, layout: _Layout) -> None:
        self.shape, self.dtype, self.ndim = layout.shape, node.dtype, len(layout.shape)
        self._path, self._node, self._layout = path, node, layout

    def __getitem__(self, key: Any) -> np.ndarray:
        with damage_reported(self._path):
            if self._layout.method:
                for packed in self._packed(key):
                    if not unpacks_within(packed, self._layout.method, self._layout.most_bytes):
                        raise ImageError(
                            f"{self._path} unpacks to more than its chunks hold; export it again"
                        )
            return np.asarray(self._node[key])

    def _packed(self, key: Any) -> Iterator[bytes]:
        """Yield the packed chunks of a part."""
        layout = self._layout
        ranges = [
            range(n)[one : one + 1] if isinstance(one, int) else range(n)[one]
            for one, n in zip(key, self.shape, strict=True)
        ]
        spans = [
            range(min(part) // side, max(part) // side + 1) if part else range(0)
            for part, side in zip(ranges, layout.chunk, strict=True)
        ]
        for numbers in itertools.product(*spans):
            file = layout.place / (layout.prefix + layout.separator.join(map(str, numbers)))
            if file.is_file():
                content = file.read_bytes()
                yield from [content] if layout.inner == layout.chunk else _sharded(content, layout)


def _sharded(content: bytes, layout: _Layout) -> Iterator[bytes]:
    """Yield the packed chunks of a file of several."""
    count = math.prod(whole // side for whole, side in zip(layout.chunk, layout.inner, strict=True))
    start = 0 if layout.index_first else len(content) - 16 * count - layout.index_sum
    table = np.frombuffer(content, "<u8", 2 * count, start).reshape(-1, 2)
    for offset, length in table.tolist():
        if offset != 2**64 - 1:
            yield content[offset : offset + length]
