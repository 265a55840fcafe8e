"""The camera's focal length and exposure from a picture's EXIF, and a test for fisheye lenses."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from toposeam.images import full_scale

#: Tags of EXIF.
_SUB_IFD, _FOCAL_MM, _FOCAL_35, _LENS = 0x8769, 0x920A, 0xA405, 0xA434
_PLANE_RESOLUTION, _PLANE_UNIT, _PLANE_WIDTH = 0xA20E, 0xA210, 0xA002
_SECONDS, _F_NUMBER, _ISO = 0x829A, 0x829D, 0x8827
_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
#: Diagonal of film of 24 × 36 mm.
DIAGONAL_MM = math.hypot(24, 36)
#: Limits of the test for a fisheye's circle: side of the squares in the corners, as a share of the shorter
#: side; most of full scale in the corners, and least in the mean of the middle.
_CORNER, _BLACK, _LIT = 0.1, 0.04, 0.08


def noted(path: Path | None) -> Mapping[int, Any]:
    """Return the values of a camera in a file, by tags of EXIF; an empty mapping without a file."""
    from PIL import Image

    if path is None:
        return {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of damaged tags
            with Image.open(path) as image:
                return dict(image.getexif().get_ifd(_SUB_IFD))
    except Exception:
        return {}


def focal_length(notes: Mapping[int, Any], size: tuple[int, int]) -> float | None:
    """Return the focal length for a picture of that width and height, px; None where the notes do not state
    it.
    """
    try:
        if notes.get(_FOCAL_35):
            found = in_pixels(float(notes[_FOCAL_35]), size)
        else:
            # Sensor's pixels per mm; the picture may have been reduced since.
            per_mm = float(notes[_PLANE_RESOLUTION]) / _UNIT_MM[int(notes.get(_PLANE_UNIT, 2))]
            wide = float(notes.get(_PLANE_WIDTH) or max(size))
            found = float(notes[_FOCAL_MM]) * per_mm * max(size) / max(wide, min(size))
    except Exception:
        return None
    return found if 0.2 * max(size) < found < 50 * max(size) else None


def exposure(notes: Mapping[int, Any]) -> float | None:
    """Return the exposure of a picture, s × ISO ÷ f-number²; None where the notes do not state it."""
    try:
        found = float(notes[_SECONDS]) * float(notes[_ISO]) / float(notes[_F_NUMBER]) ** 2
    except Exception:
        return None
    return found if 0 < found < math.inf else None


def in_pixels(equivalent: float, size: tuple[int, int]) -> float:
    """Convert a focal length for film of 24 × 36 mm, mm, to px of a picture of that size."""
    return equivalent / DIAGONAL_MM * math.hypot(*size)


def equivalent_mm(focal: float, size: tuple[int, int]) -> float:
    """Invert :func:`in_pixels`."""
    return focal * DIAGONAL_MM / math.hypot(*size)


def is_fisheye(pixels: np.ndarray, notes: Mapping[int, Any]) -> bool:
    """Test whether a picture's notes name a fisheye lens, or its pixels show the circle of one: black corners
    round a lit middle.

    Parameters
    ----------
    pixels : (H, W) or (H, W, 3) ndarray
        uint8, uint16, or float32 with 1.0 as white.
    notes : mapping from int to object
        Values of the camera (:func:`noted`).
    """
    if "fisheye" in str(notes.get(_LENS, "")).lower():
        return True
    height, width = pixels.shape[:2]
    side = int(_CORNER * min(height, width))
    if side < 4:
        return False
    white = full_scale(pixels.dtype)
    ends = slice(0, side), slice(-side, None)
    corners = max(np.asarray(pixels[rows, columns]).max() for rows in ends for columns in ends)
    middle = np.asarray(pixels[height // 3 : 2 * height // 3, width // 3 : 2 * width // 3])
    return bool(corners < _BLACK * white and middle.mean() > _LIT * white)
