"""Image files in and out: the only place that knows file formats. Everything between is arrays.

What survives from input to output: 8 and 16 bits per channel and 32-bit float, gray or RGB, alpha, the colour profile byte for byte,
the resolution, and the orientation, which is applied to the pixels. EXIF and XMP are not copied: exposure, place and thumbnail describe
the source, not what was made of it.
"""

import os
import stat
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from toposeam.errors import ImageError

from toposeam_cli.colour import DEPTHS, INTENT, channels, convert_profile, fits_profile, load_vips, to_depth, to_vips
from toposeam_cli.output import OutputError, check_output, replacing

#: Pictures with more pixels are refused unless the user asks: 500 megapixels are 3 GB as 16-bit RGB.
MAX_PIXELS = 500_000_000

#: libvips loaders that decode pictures; it also reads tables, drawings and its own dumps.
_PICTURE_LOADERS = {"png", "jpeg", "tiff", "webp", "gif", "heif", "jxl", "jp2k", "ppm", "openexr"}

#: Pixels per mm that mean "not stated": every writer that has to put something puts 72 per inch.
_UNSTATED = 72 / 25.4


@dataclass(frozen=True, slots=True, kw_only=True)
class _Format:
    """What a file format can hold, and how we write it."""

    saver: str  #: The libvips operation.
    depths: tuple[np.dtype, ...]  #: Shallowest first.
    max_side: int = 100_000_000  #: px; libvips' own bound where the format has none.
    has_alpha: bool = True
    has_gray: bool = True
    options: dict[str, Any] = field(default_factory=dict)  #: Of the saver.


_PNG = _Format(saver="pngsave", depths=DEPTHS[:2], options={"compression": 6, "filter": "all"})
_TIFF = _Format(saver="tiffsave", depths=DEPTHS, options={"compression": "deflate"})
_JPEG = _Format(
    saver="jpegsave",
    depths=DEPTHS[:1],
    max_side=65_500,
    has_alpha=False,
    options={"Q": 95, "subsample_mode": "off", "optimize_coding": True},
)
# Lossy WebP always halves the colour's resolution, so seams would show; `exact` keeps the colour of transparent pixels.
_WEBP = _Format(
    saver="webpsave", depths=DEPTHS[:1], max_side=16_383, has_gray=False, options={"lossless": True, "exact": True, "effort": 2}
)

_FORMATS = {".png": _PNG, ".tif": _TIFF, ".tiff": _TIFF, ".jpg": _JPEG, ".jpeg": _JPEG, ".webp": _WEBP}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Picture:
    """A picture in memory, upright, its alpha apart and not multiplied in.

    Derive one from another with :func:`dataclasses.replace`, which keeps profile and resolution.
    """

    #: (H, W) gray or (H, W, 3) RGB ndarray: uint8, uint16, or finite float32 with 1.0 as white.
    pixels: np.ndarray
    #: (H, W) ndarray of the same dtype, from 0 to full scale; None if every pixel is opaque by nature.
    alpha: np.ndarray | None = None
    #: The ICC profile of `pixels`; None means sRGB.
    icc: bytes | None = None
    #: (horizontal, vertical) in pixels per mm; None if unknown.
    resolution: tuple[float, float] | None = None
    #: The file it came from, for messages.
    source: Path | None = None

    def __post_init__(self) -> None:
        name = f"'{self.source}'" if self.source else "the picture"
        shape, dtype = self.pixels.shape, self.pixels.dtype
        if not (len(shape) == 2 or (len(shape) == 3 and shape[2] == 3)) or 0 in shape:
            raise ImageError(f"{name} has shape {shape}; give gray (H, W) or RGB (H, W, 3) pixels")
        if dtype not in DEPTHS:
            raise ImageError(f"{name} has {dtype} pixels; convert them to uint8, uint16 or float32")
        if self.alpha is not None and (self.alpha.shape != shape[:2] or self.alpha.dtype != dtype):
            raise ImageError(f"{name} has {self.alpha.dtype} alpha of shape {self.alpha.shape}; give {dtype} of shape {shape[:2]}")
        if dtype == np.float32 and not all(np.isfinite(values).all() for values in (self.pixels, self.alpha) if values is not None):
            raise ImageError(f"{name} contains NaN or infinite values; replace them with numbers first")

    def covered(self) -> np.ndarray:
        """(H, W) bool, True where the picture has pixels: alpha above 0."""
        return np.ones(self.pixels.shape[:2], bool) if self.alpha is None else self.alpha > 0


def read_picture(path: str | Path, max_pixels: int = MAX_PIXELS) -> Picture:
    """Read an image file as gray or RGB, upright.

    Palettes and single bits become 8-bit RGB and gray; CMYK becomes sRGB through its embedded profile, or a typical press profile
    without one; LAB becomes 16-bit sRGB. 8 and 16 bits and 32-bit floats stay as they are. Other depths become float32: integers are
    divided by their largest value (so signed ones cover [-1, 1]), doubles are rounded. Of several pages or frames the first is read.
    A profile that does not fit the channels is ignored.

    Parameters
    ----------
    path : str or Path
        PNG, TIFF, JPEG, WebP, GIF, and what else this libvips decodes.
    max_pixels : int
        Width times height above which the file is refused before it is decoded.

    Returns
    -------
    Picture

    Raises
    ------
    ImageError
        If there is no such file, or it is no picture, damaged, cut short or too large.
    """
    path = Path(path)
    _check_input(path)
    vips = load_vips()
    try:
        image = vips.Image.new_from_source(vips.Source.new_from_file(os.fsencode(path)), "", access="sequential", fail_on="error")
        _check_header(path, image, max_pixels)
        resolution = _resolution(image)
        orientation = image.get("orientation") if "orientation" in image.get_fields() else 1
        if orientation != 1:
            image = image.copy_memory().autorot()  # turning needs the last rows first
        image = _gray_or_rgb(image)
        values = _known_depth(image.numpy())
        icc = image.get("icc-profile-data") if "icc-profile-data" in image.get_fields() else None
    except vips.Error as error:
        raise ImageError(
            f"cannot read '{path}' ({_reason(error)}): it is no picture, damaged or of a kind libvips does not know; export it again as"
            " PNG or TIFF"
        ) from error
    pixels, alpha = _split_alpha(path, values)
    if orientation in (5, 6, 7, 8) and resolution is not None:
        resolution = resolution[::-1]  # turned by 90 degrees
    icc = icc if fits_profile(icc, channels(pixels)) else None
    return Picture(pixels=pixels, alpha=alpha, icc=icc, resolution=resolution, source=path)


def write_picture(path: str | Path, picture: Picture, force: bool = False) -> None:
    """Write a picture in the format its extension names, completely or not at all.

    ==================  ==================================================================================================
    ``.png``            8 or 16 bits; float is clipped to [0, 1] and rounded to 16 bits
    ``.tif .tiff``      8 or 16 bits or float, deflate compression (BigTIFF above 3.5 GB)
    ``.jpg .jpeg``      rounded to 8 bits, quality 95 without colour subsampling; full alpha is dropped, any other refused
    ``.webp``           rounded to 8 bits, RGB, lossless
    ==================  ==================================================================================================

    Parameters
    ----------
    path : str or Path
        The file to be written.
    picture : Picture
        A picture without resolution is written as 72 per inch, the customary "unknown".
    force : bool
        Whether an existing file may be replaced.

    Raises
    ------
    OptionError
        If the file cannot go there; see :func:`toposeam_cli.output.check_output`.
    ImageError
        If the format cannot hold the picture: too large, or transparent for JPEG.
    OutputError
        If writing fails; an existing file is then still there, unchanged.
    """
    path = check_output(path, force)
    kind = _FORMATS[path.suffix.lower()]
    picture = _fit(path, picture, kind)
    options = dict(kind.options)
    if kind is _TIFF:
        size = picture.pixels.nbytes + (0 if picture.alpha is None else picture.alpha.nbytes)
        options["bigtiff"] = size > 3.5e9
        # The floating point predictor packs better, but many readers lack it.
        options["predictor"] = "none" if picture.pixels.dtype == np.float32 else "horizontal"
    vips = load_vips()
    image = _vips_image(picture)
    with replacing(path, force) as temporary:
        try:
            getattr(image, kind.saver)(os.fsencode(temporary), **options)
        except vips.Error as error:
            raise OutputError(f"cannot write '{path}' ({_reason(error)}); free some space or choose another folder") from error


def match_pictures(pictures: Sequence[Picture]) -> list[Picture]:
    """Give pictures the same channels, depth and colour profile, so that their pixels can be compared.

    - Gray next to RGB becomes RGB.
    - All take the deepest depth among them: uint8, then uint16, then float32; alpha too.
    - All take the profile of the first picture, or of the first RGB picture where a gray one leads. A picture without profile is sRGB
      (gray: with sRGB's tone curve). Profiles that differ only in spelling change no pixel.

    Parameters
    ----------
    pictures : sequence of Picture
        Of any sizes.

    Returns
    -------
    list of Picture
        In the same order, with alpha, size and resolution as they were.

    Raises
    ------
    ImageError
        If a profile cannot be applied; see :func:`toposeam_cli.colour.convert_profile`.
    """
    if not pictures:
        return []
    n_channels = max(channels(picture.pixels) for picture in pictures)
    dtype = max((picture.pixels.dtype for picture in pictures), key=DEPTHS.index)
    icc = next(picture.icc for picture in pictures if channels(picture.pixels) == n_channels)
    return [_convert(picture, dtype, icc, n_channels) for picture in pictures]


def _convert(picture: Picture, dtype: np.dtype, icc: bytes | None, n_channels: int) -> Picture:
    try:
        pixels = convert_profile(to_depth(picture.pixels, dtype), picture.icc, icc, n_channels)
    except ImageError as error:
        raise ImageError(f"'{picture.source}': {error}" if picture.source else str(error)) from error
    alpha = None if picture.alpha is None else to_depth(picture.alpha, dtype)
    return replace(picture, pixels=pixels, alpha=alpha, icc=icc)


def _check_input(path: Path) -> None:
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            raise ImageError(f"'{path}' is a folder; name a picture inside it")
        if not stat.S_ISREG(mode):
            raise ImageError(f"'{path}' is not a regular file; save the picture to disk first")
        with open(path, "rb") as file:
            if not file.read(1):
                raise ImageError(f"'{path}' is empty; export the picture again")
    except ImageError:
        raise
    except (FileNotFoundError, NotADirectoryError) as error:
        raise ImageError(f"there is no file '{path}'; check its name and folder") from error
    except (OSError, ValueError) as error:
        raise ImageError(f"cannot read '{path}' ({error}); check its name and your right to read it") from error


def _check_header(path: Path, image, max_pixels: int) -> None:
    loader = image.get("vips-loader").split("load")[0]
    if loader not in _PICTURE_LOADERS:
        raise ImageError(f"'{path}' is {loader.upper()}, not a picture made of pixels; export it as PNG or TIFF")
    if image.width * image.height > max_pixels:
        raise ImageError(
            f"'{path}' is {image.width} x {image.height} pixels, more than the {max_pixels / 1e6:g} megapixels allowed; raise"
            " --max-megapixels if the file is trusted"
        )


def _resolution(image) -> tuple[float, float] | None:
    fields = image.get_fields()
    resolution = None
    if image.xres == image.yres == 1 and "exif-ifd0-XResolution" in fields and "exif-ifd0-YResolution" in fields:
        # WebP states it nowhere else, and libvips leaves it there.
        unit_mm = 10.0 if image.get_typeof("exif-ifd0-ResolutionUnit") and image.get("exif-ifd0-ResolutionUnit").startswith("3") else 25.4
        try:
            x, y = (float(Fraction(image.get(f"exif-ifd0-{axis}Resolution").split()[0])) / unit_mm for axis in "XY")
        except (ValueError, IndexError, ZeroDivisionError):
            return None
        resolution = (x, y)
    elif "resolution-unit" in fields or image.get("vips-loader").startswith("png"):
        resolution = (image.xres, image.yres)
    if resolution is None or min(resolution) <= 0 or all(abs(value - _UNSTATED) < 2e-3 for value in resolution):
        return None
    return resolution


def _gray_or_rgb(image):
    """Convert what is neither gray nor RGB; a last band of alpha stays."""
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
    with np.errstate(over="ignore"):  # too large for a float is infinite, which Picture refuses
        return values.astype(np.float32)


def _split_alpha(path: Path, values: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    values = np.atleast_3d(values)
    n_channels = values.shape[2]
    if n_channels not in (1, 2, 3, 4):
        raise ImageError(f"'{path}' has {n_channels} channels; export it as gray or RGB, with at most one alpha channel")
    n_colours = 1 if n_channels < 3 else 3
    pixels = values if n_colours == n_channels else np.ascontiguousarray(values[:, :, :n_colours])
    alpha = None if n_colours == n_channels else np.ascontiguousarray(values[:, :, -1])
    if alpha is not None and alpha.dtype == np.float32:
        np.clip(alpha, 0, 1, out=alpha)
    return (pixels[:, :, 0] if n_colours == 1 else pixels), alpha


def _fit(path: Path, picture: Picture, kind: _Format) -> Picture:
    """Reduce a picture to what the format can hold, or refuse."""
    height, width = picture.pixels.shape[:2]
    if max(height, width) > kind.max_side:
        raise ImageError(
            f"'{path}' would be {width} x {height} pixels, but {path.suffix} ends at {kind.max_side} a side; write .png or .tif instead"
        )
    dtype = picture.pixels.dtype
    alpha = picture.alpha
    if alpha is not None and not kind.has_alpha:
        if (alpha < (1 if dtype == np.float32 else np.iinfo(dtype).max)).any():
            raise ImageError(
                f"'{path}' cannot be written: the picture is partly transparent, which {path.suffix} cannot hold; use .png or .tif"
            )
        picture = replace(picture, alpha=None)
    icc = picture.icc if fits_profile(picture.icc, channels(picture.pixels)) else None
    if channels(picture.pixels) == 1 and icc is not None and not kind.has_gray:
        picture = _convert(picture, dtype, None, 3)
    return picture if dtype in kind.depths else _convert(picture, kind.depths[-1], picture.icc, channels(picture.pixels))


def _vips_image(picture: Picture):
    image = to_vips(picture.pixels)
    if picture.alpha is not None:
        image = image.bandjoin(to_vips(picture.alpha))
    x, y = picture.resolution or (_UNSTATED, _UNSTATED)
    image = image.copy(xres=x, yres=y)
    if picture.icc is not None:
        image.set_type(load_vips().GValue.blob_type, "icc-profile-data", picture.icc)
    return image


def _reason(error: Exception) -> str:
    """Pick the cause from what libvips says: the operating system's, else the first line."""
    lines = [line.strip() for line in getattr(error, "detail", "").splitlines() if line.strip()]
    system = [line.removeprefix("system error: ") for line in lines if line.startswith("system error: ")]
    return (system or lines or ["unreadable header"])[0]
