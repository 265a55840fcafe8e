"""Pictures read from files, matched and written. Only this module and `decode` know file formats.

Outputs keep 8 and 16 bits per channel and 32-bit float, gray or RGB, alpha, the colour profile byte for byte,
the resolution, the orientation, which is applied to the pixels, and EXIF and XMP as far as libvips writes
them in the format: no EXIF in TIFF, no blocks above 60 kB in JPEG. The thumbnail is dropped, as it shows the
source.
"""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.errors import ImageError
from toposeam.images import full_scale
from toposeam_cli.files.writing import EXR, OutputError, check_output, replacing
from toposeam_cli.media.pictures.colour import DEPTHS, convert_profile, to_depth
from toposeam_cli.media.pictures.decode import (
    UNSTATED_RESOLUTION,
    Decoding,
    decoding,
    refuse_large,
    size_of,
)
from toposeam_cli.media.pictures.libvips import (
    VipsImage,
    channels,
    evaluate,
    fits_profile,
    load_vips,
    reason,
    to_vips,
    with_profile,
)

#: Largest picture by default, pixels: 3 GB as 16-bit RGB.
MAX_PIXELS = 500_000_000
#: Largest picture, in pixels, of which a motif, a palette or a theme is made; no option raises it.
MAX_MOTIF = 64_000_000

#: Size of the pixels above which a BigTIFF is written, bytes: a classic TIFF has at most 4 GiB, and
#: compression may enlarge noise.
_BIGTIFF_BYTES = 3_500_000_000

#: Largest JPEG whose Huffman codes are optimized, pixels. That saves a tenth of the file, but needs all
#: coefficients in memory.
_CODED_PIXELS = 64_000_000


#: Tolerance of floats beyond [0, 1], half a step of 16 bits: values within it are clipped without an error.
_SLACK = 0.5 / 65535


@dataclass(frozen=True, slots=True, kw_only=True)
class _Format:
    """Capabilities of a file format, and its writer."""

    saver: str  #: The libvips operation.
    depths: tuple[np.dtype, ...]  #: Shallowest first.
    max_side: int = 100_000_000  #: px; libvips' own bound where the format has none.
    has_alpha: bool = True
    has_gray: bool = True
    options: dict[str, Any] = field(default_factory=dict)  #: Options of the saver.


_PNG = _Format(saver="pngsave", depths=DEPTHS[:2], options={"compression": 6, "filter": "all"})
_TIFF = _Format(saver="tiffsave", depths=DEPTHS, options={"compression": "deflate"})
_JPEG = _Format(
    saver="jpegsave",
    depths=DEPTHS[:1],
    max_side=65_500,
    has_alpha=False,
    options={"Q": 95, "subsample_mode": "off"},
)
# Lossy WebP always halves the colour's resolution, so seams would show; `exact` keeps the colour of
# transparent pixels.
_WEBP = _Format(
    saver="webpsave",
    depths=DEPTHS[:1],
    max_side=16_383,
    has_gray=False,
    options={"lossless": True, "exact": True, "effort": 2},
)

_EXR = _Format(saver="", depths=DEPTHS[2:])

_FORMATS = {".png": _PNG, ".tif": _TIFF, ".tiff": _TIFF, ".jpg": _JPEG, ".jpeg": _JPEG, ".webp": _WEBP}
_FORMATS |= {EXR: _EXR}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """A picture in memory, upright, with its alpha apart and not premultiplied.

    Derive one from another with :func:`dataclasses.replace`, which keeps profile, resolution and metadata.
    """

    #: (H, W) gray or (H, W, 3) RGB ndarray: uint8, uint16, or finite float32 with 1.0 as white.
    pixels: np.ndarray
    #: (H, W) ndarray of the same dtype, from 0 to full scale; None if the picture has no alpha.
    alpha: np.ndarray | None = None
    #: The ICC profile of `pixels`; None means sRGB.
    icc: bytes | None = None
    #: (horizontal, vertical) in pixels per mm; None if unknown.
    resolution: tuple[float, float] | None = None
    #: Blocks of metadata. EXIF's orientation is ignored; size and resolution are those of the pixels.
    exif: bytes | None = None
    xmp: bytes | None = None
    #: The file from which it was read, for messages.
    source: Path | None = None

    def __post_init__(self) -> None:
        name = f"'{self.source}'" if self.source else "the picture"
        shape, dtype = self.pixels.shape, self.pixels.dtype
        if not (len(shape) == 2 or (len(shape) == 3 and shape[2] == 3)) or 0 in shape:
            raise ImageError(f"{name} has shape {shape}; give gray (H, W) or RGB (H, W, 3) pixels")
        if dtype not in DEPTHS:
            raise ImageError(f"{name} has {dtype} pixels; convert them to uint8, uint16 or float32")
        if self.alpha is not None and (self.alpha.shape != shape[:2] or self.alpha.dtype != dtype):
            raise ImageError(
                f"{name} has {self.alpha.dtype} alpha of shape {self.alpha.shape}; give {dtype} of shape "
                f"{shape[:2]}"
            )
        if dtype == np.float32 and not all(
            np.isfinite(values).all()
            for values in (self.pixels, self.alpha)
            if isinstance(values, np.ndarray)
        ):
            raise ImageError(f"{name} contains NaN or infinite values; replace them with numbers first")
        if self.resolution is not None and not all(0 < value < np.inf for value in self.resolution):
            raise ImageError(
                f"{name} has resolution {self.resolution}; give two positive numbers of pixels per mm, or "
                "None"
            )

    def covered(self) -> np.ndarray:
        """Return the (H, W) bool mask of the picture's pixels: alpha above 0."""
        return np.ones(self.pixels.shape[:2], bool) if self.alpha is None else self.alpha > 0


#: Converts a picture and stores the result. Its arguments are the picture and the conversion, which works on
#: any of its rows.
Keep = Callable[[Picture, Callable[[Picture], Picture]], Picture]


def read_picture(path: str | Path, max_pixels: int = MAX_PIXELS) -> Picture:
    """Read an image file as gray or RGB, upright.

    Palettes and single bits become 8-bit RGB and gray; CMYK becomes sRGB through its embedded profile, or a
    typical press profile without one; LAB becomes 16-bit sRGB. 8 and 16 bits and 32-bit floats stay as they
    are. Other depths become float32: integers are divided by their largest value (so signed ones cover [-1,
    1]), doubles are rounded. Of several frames the first is read. A profile that does not fit the channels
    is ignored.

    Parameters
    ----------
    path : str or Path
        PNG, TIFF, JPEG, WebP, GIF, or another format that this libvips decodes.
    max_pixels : int
        Largest width times height; larger files are refused before they are decoded.

    Returns
    -------
    Picture

    Raises
    ------
    ImageError
        If there is no such file, or it is no picture, damaged, cut short or too large, or a TIFF of pages.
    """
    path = Path(path)
    with decoding(path, max_pixels) as file:
        return _decoded(path, file, file.values())


def read_within(path: Path, max_pixels: int) -> Picture:
    """Read a picture as :func:`read_picture` does, with a limit that no option raises.

    Raises
    ------
    ImageError
    """
    refuse_large(path, *size_of(path), max_pixels, raisable=False)
    return read_picture(path, max_pixels)


def read_strips(path: Path, max_pixels: int = MAX_PIXELS) -> Iterator[Picture]:
    """Read a picture as :func:`read_picture` does, a few rows at a time."""
    with decoding(path, max_pixels) as file:
        for values in file.strips():
            yield _decoded(path, file, values)


def _decoded(path: Path, file: Decoding, values: np.ndarray) -> Picture:
    pixels, alpha = _split_alpha(path, values)
    icc = file.icc if fits_profile(file.icc, channels(pixels)) else None
    return Picture(
        pixels=pixels,
        alpha=alpha,
        icc=icc,
        resolution=file.resolution,
        exif=file.exif,
        xmp=file.xmp,
        source=path,
    )


def check_size(path: Path, width: int, height: int) -> None:
    """Refuse a picture that is too large for the format of that extension, before it is computed.

    Raises
    ------
    ImageError
    """
    kind = _FORMATS.get(path.suffix.lower())
    if kind is not None and max(height, width) > kind.max_side:
        raise ImageError(
            f"'{path}' would be {width} x {height} pixels, but {path.suffix} ends at {kind.max_side} a side; "
            "write .png or .tif instead"
        )


def check_values(path: Path, picture: Picture) -> None:
    """Refuse a picture of floats whose values the format of that extension would clip, before any work.

    Raises
    ------
    ImageError
    """
    kind = _FORMATS.get(path.suffix.lower())
    if kind is None or picture.pixels.dtype != np.float32 or picture.pixels.dtype in kind.depths:
        return
    low, high = float(picture.pixels.min()), float(picture.pixels.max())
    if low < -_SLACK or high > 1 + _SLACK:
        name = picture.source.name if picture.source else "the picture"
        raise ImageError(
            f"'{path}' cannot hold the values of {name}, {low:g} to {high:g}: {path.suffix} ends at 0 and 1; "
            "write .tif instead"
        )


def write_picture(
    path: str | Path,
    picture: Picture,
    force: bool = False,
    *,
    quality: int | None = None,
    compression: str | None = None,
    pyramid: bool = False,
    keep: Keep | None = None,
) -> None:
    """Write a picture in the format its extension names, completely or not at all.

    - ``.png``: 8 or 16 bits; float is clipped to [0, 1] and rounded to 16 bits.
    - ``.tif``, ``.tiff``: 8 or 16 bits or float, deflate compression, BigTIFF above 3.5 GB.
    - ``.jpg``, ``.jpeg``: rounded to 8 bits, quality 95 without colour subsampling; full alpha is
      dropped, any other refused.
    - ``.webp``: rounded to 8 bits, RGB, lossless.
    - ``.exr``: float, without profile and metadata; only of textures.

    Parameters
    ----------
    path : str or Path
        The file to be written.
    picture : Picture
        A picture without resolution is written as 72 per inch, the customary "unknown".
    force : bool
        Whether an existing file may be replaced.
    quality : int, optional
        Quality of JPEG, 1 to 100; 95 by default.
    compression : str, optional
        Compression of TIFF, one of :data:`toposeam_cli.files.writing.COMPRESSIONS`; deflate by default.
    pyramid : bool
        Whether a TIFF has tiles and further pages at half the size, a quarter and so on.
    keep : callable, optional
        Converts a picture that the format cannot hold as it is; see :func:`match_pictures`.

    Raises
    ------
    OptionError
        If the file cannot go there; see :func:`toposeam_cli.files.writing.check_output`.
    ImageError
        If the format cannot hold the picture: too large, or transparent for JPEG.
    OutputError
        If writing fails; an existing file is then still there, unchanged.
    """
    path = check_output(path, force, tuple(_FORMATS))
    kind = _FORMATS[path.suffix.lower()]
    picture = _fit(path, picture, kind, keep)
    options = dict(kind.options)
    if kind is _TIFF:
        bands = channels(picture.pixels) + (picture.alpha is not None)
        size = math.prod(picture.pixels.shape[:2]) * bands * picture.pixels.dtype.itemsize
        options["bigtiff"] = size > (_BIGTIFF_BYTES // 2 if pyramid else _BIGTIFF_BYTES)
        if pyramid:
            options |= {"pyramid": True, "tile": True, "tile_width": 256, "tile_height": 256}
        options["compression"] = compression or "deflate"
        # The floating point predictor compresses better, but many readers lack it.
        options["predictor"] = "none" if picture.pixels.dtype == np.float32 else "horizontal"
    if kind is _JPEG:
        options["optimize_coding"] = math.prod(picture.pixels.shape[:2]) <= _CODED_PIXELS
        options["Q"] = quality or options["Q"]
    vips = load_vips()
    image = vips_image(picture)
    with replacing(path, force) as temporary:
        if kind is _EXR:
            from toposeam_cli.media.pictures.openexr import write_exr

            write_exr(temporary, picture.pixels, picture.alpha)
            return
        try:
            evaluate(image, lambda: getattr(image, kind.saver)(os.fsencode(temporary), **options))
        except vips.Error as error:
            raise OutputError(
                f"cannot write '{path}' ({reason(error)}); free some space or choose another folder"
            ) from error


def encode_png(picture: Picture) -> bytes:
    """Return the bytes of the PNG that :func:`write_picture` would write."""
    image = vips_image(_fit(Path("picture.png"), picture, _PNG))
    content: bytes = evaluate(image, lambda: image.pngsave_buffer(**_PNG.options))
    return content


def match_pictures(
    pictures: Sequence[Picture],
    keep: Keep | None = None,
) -> list[Picture]:
    """Give pictures the same channels, depth and colour profile, so that their pixels can be compared.

    - Gray next to RGB becomes RGB.
    - All take the deepest depth among them: uint8, then uint16, then float32; alpha too.
    - All take the profile of the first picture, or of the first RGB picture where a gray one leads. A picture
      without profile is sRGB (gray: with sRGB's tone curve). Profiles that differ only in spelling change no
      pixel.

    Parameters
    ----------
    pictures : sequence of Picture
        Pictures of any sizes.
    keep : callable, optional
        Converts each picture that needs it, one after the other; without it they are converted in memory.

    Returns
    -------
    list of Picture
        In the same order, with alpha, size and resolution as they were.

    Raises
    ------
    ImageError
        If a profile cannot be applied; see :func:`toposeam_cli.media.pictures.colour.convert_profile`.
    """
    if not pictures:
        return []
    n_channels = max(channels(picture.pixels) for picture in pictures)
    dtype = max((picture.pixels.dtype for picture in pictures), key=DEPTHS.index)
    icc = next(picture.icc for picture in pictures if channels(picture.pixels) == n_channels)
    return [_as(picture, dtype, icc, n_channels, keep) for picture in pictures]


def in_eight_bits(picture: Picture, keep: Keep | None = None) -> Picture:
    """Return the picture with uint8 pixels, rounded."""
    return _as(picture, np.dtype(np.uint8), picture.icc, channels(picture.pixels), keep)


def _as(picture: Picture, dtype: np.dtype, icc: bytes | None, n_channels: int, keep: Keep | None) -> Picture:
    if (picture.pixels.dtype, picture.icc, channels(picture.pixels)) == (dtype, icc, n_channels):
        return picture
    convert = partial(_convert, dtype=dtype, icc=icc, n_channels=n_channels)
    return convert(picture) if keep is None else keep(picture, convert)


def _convert(picture: Picture, dtype: np.dtype, icc: bytes | None, n_channels: int) -> Picture:
    try:
        pixels = convert_profile(to_depth(np.asarray(picture.pixels), dtype), picture.icc, icc, n_channels)
    except ImageError as error:
        raise ImageError(f"'{picture.source}': {error}" if picture.source else str(error)) from error
    alpha = None if picture.alpha is None else to_depth(np.asarray(picture.alpha), dtype)
    return replace(picture, pixels=pixels, alpha=alpha, icc=icc)


def _split_alpha(path: Path, values: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    values = np.atleast_3d(values)
    n_channels = values.shape[2]
    if n_channels not in (1, 2, 3, 4):
        raise ImageError(
            f"'{path}' has {n_channels} channels; export it as gray or RGB, with at most one alpha channel"
        )
    n_colours = 1 if n_channels < 3 else 3
    pixels = values
    if n_colours < n_channels:  # channel by channel, in a quarter of the time
        pixels = np.empty((*values.shape[:2], n_colours), values.dtype)
        for channel in range(n_colours):
            pixels[:, :, channel] = values[:, :, channel]
    alpha = None if n_colours == n_channels else np.ascontiguousarray(values[:, :, -1])
    if alpha is not None and alpha.dtype == np.float32:
        np.clip(alpha, 0, 1, out=alpha)
    return (pixels[:, :, 0] if n_colours == 1 else pixels), alpha


def _fit(path: Path, picture: Picture, kind: _Format, keep: Keep | None = None) -> Picture:
    """Reduce a picture to the depth and channels of the format, or refuse it."""
    height, width = picture.pixels.shape[:2]
    check_size(path, width, height)
    dtype = picture.pixels.dtype
    alpha = picture.alpha
    if alpha is not None and not kind.has_alpha:
        if (alpha < full_scale(dtype)).any():
            raise ImageError(
                f"'{path}' cannot be written: the picture is partly transparent, which {path.suffix} cannot "
                "hold; use .png or .tif"
            )
        picture = replace(picture, alpha=None)
    dtype = dtype if dtype in kind.depths else kind.depths[-1]
    if channels(picture.pixels) == 1 and fits_profile(picture.icc, 1) and not kind.has_gray:
        return _as(picture, dtype, None, 3, keep)
    return _as(picture, dtype, picture.icc, channels(picture.pixels), keep)


def vips_image(picture: Picture) -> VipsImage:
    """Return the picture as a libvips image with its metadata."""
    image = to_vips(picture.pixels)
    if picture.alpha is not None:
        image = image.bandjoin(to_vips(picture.alpha))
    image = image.copy()
    for name, value in (("exif-data", picture.exif), ("xmp-data", picture.xmp)):
        if value:  # libvips cannot write empty ones
            image.set_type(load_vips().GValue.blob_type, name, value)
    # libvips has parsed the EXIF block. Size, resolution and orientation of the source are replaced, its
    # thumbnail is removed.
    image.set_type(load_vips().GValue.gint_type, "orientation", 1)
    for name in image.get_fields():
        if name == "jpeg-thumbnail-data" or name.startswith("exif-ifd1-"):
            image.remove(name)
    x, y = picture.resolution or (UNSTATED_RESOLUTION, UNSTATED_RESOLUTION)
    image = image.copy(xres=x, yres=y)
    return image if picture.icc is None else with_profile(image, picture.icc)
