"""Conversion of bit depths and colour profiles of image arrays, so that pictures can be joined."""

import numpy as np

from toposeam.errors import ImageError
from toposeam_cli.media.pictures.libvips import channels, evaluate, load_vips, to_vips, with_profile

#: The types of a picture's values, shallowest first.
DEPTHS = (np.dtype(np.uint8), np.dtype(np.uint16), np.dtype(np.float32))

#: Rendering intent: relative to the white point, with black point compensation, as image editors do.
INTENT = {"intent": "relative", "black_point_compensation": True}

_EIGHT_BIT_STEP = 257  # of 65535


def widen(pixels: np.ndarray) -> np.ndarray:
    """Convert gray ``(H, W)`` to RGB ``(H, W, 3)`` with three equal channels; return RGB unchanged."""
    return pixels if pixels.ndim == 3 else np.repeat(pixels[:, :, None], 3, axis=2)


def to_depth(values: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Convert between uint8, uint16 and float32 with full scale kept: 255 = 65535 = 1.0.

    Integers are rounded to nearest; floats outside [0, 1] are clipped on their way to an integer. Going
    deeper and back changes nothing.
    """
    if values.dtype == dtype:
        return values
    if dtype == np.float32:
        return values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
    if values.dtype == np.float32:
        scaled: np.ndarray = np.clip(values, 0, 1)
        scaled *= np.iinfo(dtype).max
        np.rint(scaled, out=scaled)
        return scaled.astype(dtype)
    if dtype == np.uint16:
        return values.astype(np.uint16) * np.uint16(_EIGHT_BIT_STEP)
    return ((values.astype(np.uint32) + _EIGHT_BIT_STEP // 2) // _EIGHT_BIT_STEP).astype(np.uint8)


def convert_profile(
    pixels: np.ndarray, source: bytes | None, target: bytes | None, n_channels: int
) -> np.ndarray:
    """Convert gray or RGB pixels from one colour profile to another, at their own depth.

    Parameters
    ----------
    pixels : (H, W) or (H, W, 3) ndarray
        uint8, uint16 or float32.
    source, target : bytes or None
        ICC profiles; None stands for sRGB, and for gray with sRGB's tone curve.
    n_channels : {1, 3}
        Channels of the result; gray can become RGB, RGB cannot become gray.

    Returns
    -------
    (H, W) or (H, W, 3) ndarray
        The very same values where the two profiles agree within one 8-bit step: two spellings of sRGB must
        not add rounding noise.

    Raises
    ------
    ImageError
        If libvips cannot apply a profile, or float pixels lie outside [0, 1], where profiles are not defined.
    """
    if n_channels < channels(pixels):
        raise ImageError("RGB pixels cannot take a gray profile; convert the picture to gray first")
    plain = widen(pixels) if n_channels == 3 else pixels
    if source == target or _agree(source, target, channels(pixels), n_channels):
        return plain
    if pixels.dtype == np.float32 and (pixels.min() < 0 or pixels.max() > 1):
        raise ImageError(
            f"float pixels from {pixels.min():.4g} to {pixels.max():.4g} cannot be converted to another "
            "colour profile, which covers 0 to 1 only; give all pictures the same profile first"
        )
    converted = _transform(to_depth(pixels, np.dtype(np.uint16)), source, target, n_channels)
    return to_depth(converted, pixels.dtype)


def _agree(source: bytes | None, target: bytes | None, n_source: int, n_target: int) -> bool:
    levels = np.linspace(0, 65535, 256 if n_source == 1 else 9).round().astype(np.uint16)
    grid = (
        levels[None]
        if n_source == 1
        else np.stack(np.meshgrid(levels, levels, levels), axis=-1).reshape(1, -1, 3)
    )
    converted = _transform(grid, source, target, n_target)
    return bool(
        np.abs(converted.astype(int) - (widen(grid) if n_target == 3 else grid)).max() <= _EIGHT_BIT_STEP
    )


def _transform(pixels: np.ndarray, source: bytes | None, target: bytes | None, n_channels: int) -> np.ndarray:
    vips = load_vips()
    srgb = vips.Image.profile_load("srgb")
    try:
        image = with_profile(to_vips(widen(pixels) if source is None else pixels), source or srgb)
        # Through XYZ: on the way to LAB, lcms samples a gray profile's curve so coarsely that dark grays are
        # off by 2 % of full scale.
        image = with_profile(image.icc_import(embedded=True, pcs="xyz", **INTENT), target or srgb)
        image = image.icc_export(depth=16, pcs="xyz", **INTENT)
        converted: np.ndarray = evaluate(image, image.numpy)
    except vips.Error as error:
        raise ImageError("a colour profile cannot be applied; convert the pictures to sRGB first") from error
    return converted[:, :, 1] if n_channels == 1 and converted.ndim == 3 else converted
