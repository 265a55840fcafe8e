"""Results as picture files: 8 bits by Pillow, other depths by tifffile, on which scikit-image depends.

The modules that draw and write are loaded when a picture is saved.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.errors import OptionError, Term

#: Suffix of a file: Pillow's name of the format.
_FORMATS = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".webp": "WEBP",
    ".tif": "TIFF",
    ".tiff": "TIFF",
}


class PictureResult:
    """A result that is a picture, and can be written as a file."""

    __slots__ = ()

    def save(self, path: str | Path) -> None:
        """Write the picture as PNG, JPEG, WebP or TIFF, by the suffix of the file's name.

        An existing file is replaced. TIFF keeps every depth; the others hold 8 bits, to which floats in
        [0, 1] are rounded. Motifs are rounded to 8 bits in every format.

        Parameters
        ----------
        path : str or Path

        Raises
        ------
        OptionError
            For other suffixes; for integers of more than 8 bits, or an opacity, in formats that cannot hold
            them.
        OSError
            When the file cannot be written; an existing file is unchanged.
        """
        from toposeam.saving import path_of, save

        save(path, _encoded(self, path_of(path)))


def _encoded(result: Any, path: Path) -> bytes:
    """Encode a result as the format of a file's suffix."""
    from toposeam.display import to_pil, to_rgba8

    kind = _FORMATS.get(path.suffix.lower())
    if kind is None:
        raise OptionError(
            "{value} ends in no known format; save as {allowed}",
            kind="format",
            parameter=Term("path"),
            value=path.name,
            allowed=tuple(_FORMATS),
        )
    image = to_rgba8(result.image()) if callable(result.image) else np.asarray(result.image)  # inks: 8 bits
    alpha = getattr(result, "alpha", None)
    buffer = io.BytesIO()
    if kind == "TIFF":
        import tifffile

        planes = [image if image.ndim == 3 else image[..., np.newaxis]]
        planes += [] if alpha is None else [alpha[..., np.newaxis]]
        colour = "rgb" if planes[0].shape[2] >= 3 else "minisblack"
        extra = ["unassalpha"] if alpha is not None else None
        values = np.concatenate(planes, axis=2)
        tifffile.imwrite(
            buffer,
            values if values.shape[2] > 1 else values[..., 0],
            photometric=colour,
            planarconfig="contig" if values.shape[2] > 1 else None,
            extrasamples=extra,
            compression="zlib",
        )
        return buffer.getvalue()
    if image.dtype.kind in "iu" and image.dtype.itemsize > 1:
        raise OptionError(
            "{value} holds 8 bits, and the picture is {dtype}; save it as .tif",
            kind="format",
            parameter=Term("path"),
            value=path.name,
            dtype=str(image.dtype),
        )
    if kind == "JPEG" and alpha is not None:
        raise OptionError(
            "{value} cannot be transparent, as the picture is in places; save it as .png",
            kind="format",
            parameter=Term("path"),
            value=path.name,
        )
    to_pil(result).save(buffer, kind, **({"quality": 95} if kind != "PNG" else {}))
    return buffer.getvalue()
