"""Decoding of an image file to one array of gray or RGB, upright. An unusable file is refused in one
sentence.
"""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path

import numpy as np

from toposeam.errors import ImageError
from toposeam_cli.files.regular import check_input
from toposeam_cli.files.writing import EXR
from toposeam_cli.media.pictures.colour import DEPTHS, INTENT
from toposeam_cli.media.pictures.libvips import VipsImage, evaluate, load_vips, reason

_HEIC = {".heic", ".heif", ".hif"}

#: Resolution that means "unknown", px per mm: writers whose format needs one write 72 per inch.
UNSTATED_RESOLUTION = 72 / 25.4

#: First bytes of EXIF's entry of the horizontal resolution, in either byte order. libvips reports a
#: resolution also where this is missing.
_X_RESOLUTION = (b"\x1a\x01\x05\0", b"\x01\x1a\0\x05")

_BLOCKS = ("icc-profile", "exif", "xmp")

#: Approximate size of a strip, bytes.
STRIP_BYTES = 1 << 20
_DTYPES = {
    name: np.dtype(kind)
    for name, kind in {
        "uchar": np.uint8,
        "char": np.int8,
        "ushort": np.uint16,
        "short": np.int16,
        "uint": np.uint32,
        "int": np.int32,
        "float": np.float32,
        "complex": np.complex64,
        "double": np.float64,
        "dpcomplex": np.complex128,
    }.items()
}

#: The XML namespace of a recipe in an XMP packet. A recipe describes one picture only, so outputs made from
#: it do not inherit it.
RECIPE_NAMESPACE = "urn:x-toposeam:1.0:"


@dataclass(frozen=True, slots=True, eq=False)
class Decoding:
    """Contents of a file, its pixels not yet read."""

    #: Gray or RGB, upright; read from top to bottom.
    image: VipsImage
    #: The profile of its pixels; it may not fit the channels.
    icc: bytes | None
    #: Horizontal and vertical resolution, px per mm.
    resolution: tuple[float, float] | None
    #: Blocks of metadata, as of :class:`toposeam_cli.media.pictures.picture.Picture`.
    exif: bytes | None
    xmp: bytes | None

    def values(self) -> np.ndarray:
        """Read all pixels; this works once. Return an (H, W) or (H, W, C) ndarray of gray or RGB, alpha last,
        of one of the types of `DEPTHS`.
        """
        return _known_depth(evaluate(self.image, self.image.numpy))

    def strips(self) -> Iterator[np.ndarray]:
        """Yield the same pixels, a few rows at a time."""
        image = self.image
        width, height, bands, dtype = image.width, image.height, image.bands, _DTYPES[image.format]
        rows = max(1, STRIP_BYTES // (width * bands * dtype.itemsize))
        region = load_vips().Region.new(image)
        for top in range(0, height, rows):
            fetch = partial(region.fetch, 0, top, width, min(rows, height - top))
            yield _known_depth(np.frombuffer(evaluate(image, fetch), dtype).reshape(-1, width, bands))


@contextmanager
def decoding(path: Path, max_pixels: int) -> Iterator[Decoding]:
    """Open the picture in a file, to be decoded within the block; the rules are those of
    :func:`toposeam_cli.media.pictures.picture.read_picture`.

    Raises
    ------
    ImageError
        If there is no such file, or it is no picture, damaged, cut short or larger than `max_pixels`, or a
        TIFF of several pages.
    """
    check_input(path)
    vips = load_vips()
    try:
        image = _opened(path, max_pixels)
        _check_pages(path, image)
        resolution = _resolution(image)
        orientation = image.get("orientation") if "orientation" in image.get_fields() else 1
        if orientation != 1:
            image = evaluate(image, image.copy_memory).autorot()  # a rotation needs the last rows first
        if orientation in (5, 6, 7, 8) and resolution is not None:
            resolution = resolution[::-1]  # turned by 90 degrees
        image = _gray_or_rgb(image)
        fields = set(image.get_fields())
        if not any(name.startswith("exif-ifd") for name in fields):
            fields.discard("exif-data")  # damaged
        icc, exif, xmp = (image.get(f"{name}-data") if f"{name}-data" in fields else None for name in _BLOCKS)
        yield Decoding(image, icc, resolution, exif, _xmp(xmp))
    except vips.Error as error:
        raise _unreadable(path, error) from error


def _opened(path: Path, max_pixels: int) -> VipsImage:
    """Open a picture by libvips, or by Pillow or OpenEXR if libvips does not know its format."""
    vips = load_vips()
    too_large = partial(refuse_large, path, max_pixels=max_pixels)
    reading = {"access": "sequential", "fail_on": "error"}
    if path.suffix.lower() == EXR:
        from toposeam_cli.media.pictures.openexr import exr_as_tiff

        content = exr_as_tiff(path, too_large)
        return vips.Image.new_from_source(vips.Source.new_from_memory(content), "", **reading)
    try:
        image = vips.Image.new_from_source(vips.Source.new_from_file(os.fsencode(path)), "", **reading)
        too_large(image.width, image.height)
        if "heif-compression" in image.get_fields() and image.get("heif-compression") == "hevc":
            image = evaluate(image, image.copy_memory)  # fails here if libvips has no decoder for it
    except vips.Error:
        from toposeam_cli.media.pictures.pillow_formats import as_png

        png = as_png(path, too_large)
        if png is None:
            raise
        return vips.Image.new_from_source(vips.Source.new_from_memory(png), "", **reading)
    return image


def refuse_large(path: Path, width: int, height: int, max_pixels: int, raisable: bool = True) -> None:
    """Refuse a picture with too many pixels. `raisable` says whether ``--max-megapixels`` can raise the
    limit.

    Raises
    ------
    ImageError
    """
    if width * height > max_pixels:
        remedy = "raise --max-megapixels if the file is trusted" if raisable else "make it smaller first"
        raise ImageError(
            f"'{path}' is {width} x {height} pixels, more than the {max_pixels / 1e6:g} megapixels allowed; "
            f"{remedy}"
        )


def size_of(path: Path) -> tuple[int, int]:
    """Read the width and height of the picture in a file, px, from its header.

    Raises
    ------
    ImageError
        If there is no such file, or it is no picture.
    """
    check_input(path)
    if path.suffix.lower() == EXR:
        from toposeam_cli.media.pictures.openexr import exr_size

        return exr_size(path)
    vips = load_vips()
    try:
        image = vips.Image.new_from_source(vips.Source.new_from_file(os.fsencode(path)), "")
    except vips.Error as error:
        from toposeam_cli.media.pictures.pillow_formats import pillow_size

        size = pillow_size(path)
        if size is None:
            raise _unreadable(path, error) from error
        return size
    return image.width, image.height


def check_together(paths: Sequence[Path], max_pixels: int) -> None:
    """Refuse pictures that are too large together, before one of them is decoded.

    Raises
    ------
    ImageError
    """
    known = {path: size_of(path) for path in dict.fromkeys(paths)}
    for path, (width, height) in known.items():
        refuse_large(path, width, height, max_pixels)
    if len(paths) > 1:
        refuse_together(len(paths), sum(known[path][0] * known[path][1] for path in paths), max_pixels)


def refuse_together(count: int, total: int, max_pixels: int, where: str = "") -> None:
    """Refuse pictures that have too many pixels together.

    Raises
    ------
    ImageError
    """
    if total > max_pixels:
        raise ImageError(
            f"{where}the {count} pictures have {total / 1e6:.0f} megapixels together, more than the "
            f"{max_pixels / 1e6:g} allowed; raise --max-megapixels if they are trusted"
        )


def _unreadable(path: Path, error: Exception) -> ImageError:
    """Compose the error for a file that libvips does not read."""
    why = reason(error)
    if "samples out of range" in why:
        return ImageError(
            f"cannot read '{path}': its samples are of a kind libvips does not read, like 64-bit floats; "
            "export it again with 32 bits"
        )
    if path.suffix.lower() in _HEIC:
        return ImageError(
            f"cannot read '{path}' ({why}): this libvips does not decode most HEIC files; install "
            "pi-heif (pip install pi-heif), make a JPEG of it first, as with 'heif-convert', or let "
            "the camera save JPEG (Most Compatible)"
        )
    if "known format" in why:
        why = "it is none of PNG, TIFF, JPEG, WebP, GIF, AVIF, BMP and JPEG 2000"
    return ImageError(
        f"cannot read '{path}' ({why}): it is no picture or damaged; export it again as PNG or TIFF"
    )


def _check_pages(path: Path, image: VipsImage) -> None:
    """Refuse a TIFF file of several pictures, as scanned pages or a stack. Smaller pages are allowed, as they
    are previews of the first. Of an animation the first frame is taken.
    """
    if not image.get("vips-loader").startswith("tiff") or image.get("n-pages") == 1:
        return
    vips = load_vips()
    second = vips.Image.new_from_source(vips.Source.new_from_file(os.fsencode(path)), "", page=1)
    if (second.width, second.height) == (image.width, image.height):
        raise ImageError(
            f"'{path}' holds {image.get('n-pages')} pages; save the one that is meant as a file of its own, "
            "or join whole stacks with toposeam volume"
        )


def _resolution(image: VipsImage) -> tuple[float, float] | None:
    fields = image.get_fields()
    resolution = None
    if (
        image.xres == image.yres == 1
        and "exif-data" in fields
        and any(tag in image.get("exif-data") for tag in _X_RESOLUTION)
    ):
        # WebP states it in EXIF only, and libvips does not read it from there.
        unit_mm = (
            10.0
            if image.get_typeof("exif-ifd0-ResolutionUnit")
            and image.get("exif-ifd0-ResolutionUnit").startswith("3")
            else 25.4
        )
        try:
            x, y = (
                float(Fraction(image.get(f"exif-ifd0-{axis}Resolution").split()[0])) / unit_mm
                for axis in "XY"
            )
        except (ValueError, IndexError, ZeroDivisionError):
            return None
        resolution = (x, y)
    elif "resolution-unit" in fields or image.get("vips-loader").startswith("png"):
        resolution = (image.xres, image.yres)
    if resolution is None or not all(0 < value < 1e5 for value in resolution):  # 0, infinite or absurd
        return None
    if all(abs(value - UNSTATED_RESOLUTION) < 2e-3 for value in resolution):
        return None
    return resolution


def _xmp(packet: bytes | None) -> bytes | None:
    """Return an XMP packet without orientation; None for one with a recipe."""
    if packet is None or RECIPE_NAMESPACE.encode() in packet:
        return None
    return re.sub(rb"""(tiff:Orientation\s*(?:=\s*["']|>)\s*)[2-8]""", rb"\g<1>1", packet)


def _gray_or_rgb(image: VipsImage) -> VipsImage:
    """Convert an image that is neither gray nor RGB; a last band of alpha stays."""
    if image.interpretation in ("lab", "labs"):
        return image.colourspace("rgb16")
    if image.interpretation != "cmyk":
        return image
    colour = image.extract_band(0, n=image.bands - 1) if image.hasalpha() else image
    depth = 8 if image.format == "uchar" else 16
    colour = colour.icc_transform("srgb", embedded=True, input_profile="cmyk", depth=depth, **INTENT)
    return colour.bandjoin(image.extract_band(image.bands - 1)) if image.hasalpha() else colour


def _known_depth(values: np.ndarray) -> np.ndarray:
    if values.dtype in DEPTHS or np.iscomplexobj(values):
        return values
    if np.issubdtype(values.dtype, np.integer):
        values = values / np.iinfo(values.dtype).max
    with np.errstate(over="ignore"):  # values too large for a float become infinite, which Picture refuses
        return values.astype(np.float32)
