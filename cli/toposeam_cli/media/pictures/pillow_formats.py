"""Formats that libvips does not know, or not on every machine, read by Pillow: BMP, JPEG 2000, AVIF, and HEIC
where pillow-heif is installed.

The picture is passed on as a PNG in memory, so that it is handled like any file that libvips reads.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.errors import ImageError
from toposeam_cli.media.pictures.libvips import evaluate, load_vips, to_vips, with_profile

#: Pillow's names of the formats; no others are tried.
_FORMATS = ("BMP", "JPEG2000", "AVIF")
#: Most pixels that a byte of a file may hold, and how many a file of any size may: their decoders take a
#: second for some ten megapixels, whatever these show. Photographs have 1 to 30 a byte, scans up to 200.
_DENSEST, _HARMLESS = 256, 16_000_000


def pillow_size(path: Path) -> tuple[int, int] | None:
    """Read the width and height of a picture from its header; None if Pillow does not know the format."""
    with _opened(path) as image:
        return None if image is None else image.size


def as_png(path: Path, check: Callable[[int, int], None]) -> bytes | None:
    """Return a picture as PNG with its depth, alpha, profile, orientation and metadata; None if Pillow does
    not know the format.

    Parameters
    ----------
    path : Path
    check : callable
        Called with width and height before decoding; raises if they are too large.

    Raises
    ------
    ImageError
        If it is damaged.
    """
    with _opened(path) as image:
        if image is None:
            return None
        check(*image.size)
        _check_density(path, *image.size)
        try:
            values = _values(image)
        except Exception as error:  # Pillow's decoders raise errors of all kinds
            why = " ".join(str(error).split()) or "damaged"
            raise ImageError(
                f"cannot read '{path}' ({why}): it is damaged, or of a kind that Pillow does not read; "
                "export it again as PNG or TIFF"
            ) from error
        return _encoded(values, image.info)


def _check_density(path: Path, width: int, height: int) -> None:
    """Refuse a large picture in a small file, before a decoder spends minutes on what is not there.

    Raises
    ------
    ImageError
    """
    size = path.stat().st_size
    if width * height > max(_HARMLESS, _DENSEST * size):
        raise ImageError(
            f"'{path}' says that its {size} bytes hold {width} x {height} pixels, which no photograph needs "
            "so few for; export it as PNG or TIFF if it is one"
        )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a picture for the block, without reading its pixels; yield None if neither Pillow nor pillow-heif
    knows the format.
    """
    from PIL import Image

    limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None  # we check sizes ourselves
    try:
        with warnings.catch_warnings(), ExitStack() as opened:
            warnings.simplefilter("ignore")
            try:
                image: Any = opened.enter_context(Image.open(path, formats=_FORMATS))
            except Exception:
                image = _heif(path)
            yield image
    finally:
        Image.MAX_IMAGE_PIXELS = limit


def _heif(path: Path) -> Any:
    """Open a HEIC file at its full depth, upright; None without pi-heif, or if it is no HEIC file."""
    try:
        try:
            import pi_heif
        except ImportError:
            import pillow_heif as pi_heif  # which also writes

        image = pi_heif.open_heif(path, convert_hdr_to_8bit=False)
        pi_heif.set_orientation(image.info)  # libheif has turned it upright
        return image
    except Exception:
        return None


def _values(image: Any) -> np.ndarray:
    """Decode the pixels: (H, W) or (H, W, C), uint8 or uint16."""
    if image.mode == "P":
        image = image.convert("RGBA" if "transparency" in image.info else "RGB")
    elif image.mode == "1":
        image = image.convert("L")
    elif image.mode not in ("L", "LA", "RGB", "RGBA", "I;16", "RGB;16", "RGBA;16"):
        raise ValueError(f"its pixels are {image.mode}")
    return np.asarray(image)


def _encoded(values: np.ndarray, info: dict[str, Any]) -> bytes:
    """Return the bytes of a PNG with metadata, compressed fast."""
    values = np.atleast_3d(values)
    colours = 1 if values.shape[2] < 3 else 3
    image = to_vips(values[:, :, 0] if colours == 1 else values[:, :, :3])
    if values.shape[2] > colours:
        image = image.bandjoin(to_vips(values[:, :, colours]))
    if info.get("icc_profile"):
        image = with_profile(image, info["icc_profile"])
    image = image.copy()
    values_of = load_vips().GValue
    for name, block in (("exif-data", info.get("exif")), ("xmp-data", info.get("xmp"))):
        if block:
            image.set_type(values_of.blob_type, name, block)
    x, y = (float(value) / 25.4 for value in info.get("dpi", (72, 72)))  # 72 means unknown
    image = image.copy(xres=x, yres=y)
    content: bytes = evaluate(image, lambda: image.pngsave_buffer(compression=1))
    return content
