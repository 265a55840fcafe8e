"""A request of the plug-in, the argument of operations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

_DTYPES = ("uint8", "uint16", "float32")


@dataclass(frozen=True, slots=True, kw_only=True)
class EngineJob:
    """A request, with its pixels and the files of its results."""

    folder: Path
    request: Mapping[str, Any]
    progress: Callable[[float], None]
    #: Names what is done next: "places", "seams" or "blending".
    step: Callable[[str], None] = lambda _name: None
    _written: list[str] = field(default_factory=list)

    @property
    def options(self) -> dict[str, Any]:
        """The options of the operation."""
        return dict(self.request.get("options", {}))

    def read(self, raster: Mapping[str, Any]) -> Any:
        """Map the (H, W) or (H, W, C) pixels of a raster of the request, read-only."""
        import numpy as np

        from toposeam.errors import ImageError

        try:
            shape = (int(raster["height"]), int(raster["width"]), int(raster["channels"]))
            kind, name = str(raster["dtype"]), str(raster["file"])
        except (KeyError, TypeError, ValueError) as error:
            wanted = "file, height, width, channels and dtype"
            raise ImageError(f"the request describes its pixels by {raster!r:.200}; give {wanted}") from error
        if kind not in _DTYPES:
            raise ImageError(f"pixels of type {kind} were sent; use one of {', '.join(_DTYPES)}")
        dtype = np.dtype(kind)
        path = self._inside(name)
        if not path.is_file():
            raise ImageError(f"{path.name} is not in the request's folder; send it again")
        if min(shape) < 1 or path.stat().st_size != shape[0] * shape[1] * shape[2] * dtype.itemsize:
            raise ImageError(
                f"{path.name} has {path.stat().st_size} bytes, which is not {shape} of {dtype}; send it again"
            )
        pixels = np.memmap(path, dtype, "r", shape=shape)
        return pixels if shape[2] > 1 else pixels[..., 0]

    def read_bytes(self, name: str) -> bytes:
        """Read a file of the request."""
        return self._inside(name).read_bytes()

    def write(self, pixels: Any) -> dict[str, Any]:
        """Write (H, W) or (H, W, C) pixels to a new file; return its description for the result."""
        import numpy as np

        name = f"result-{len(self._written)}.raw"
        self._written.append(name)
        array = np.asarray(pixels)
        with (self.folder / name).open("wb") as file:
            for top in range(0, array.shape[0], 256):
                file.write(np.ascontiguousarray(array[top : top + 256]).data)
        channels = 1 if array.ndim == 2 else array.shape[2]
        return {
            "file": name,
            "width": array.shape[1],
            "height": array.shape[0],
            "channels": channels,
            "dtype": str(array.dtype),
        }

    def _inside(self, name: str) -> Path:
        from toposeam.errors import OptionError

        if Path(name).name != name:
            raise OptionError(f"{name!r} is not the name of a file in the request's folder")
        return self.folder / name
