"""Focal lengths that cameras note in their files."""

from __future__ import annotations

import math
from pathlib import Path

#: Tags of EXIF.
_SUB_IFD, _FOCAL_MM, _FOCAL_35 = 0x8769, 0x920A, 0xA405
_PLANE_RESOLUTION, _PLANE_UNIT, _PLANE_WIDTH = 0xA20E, 0xA210, 0xA002
_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
#: Diagonal of film of 24 × 36 mm.
DIAGONAL_MM = math.hypot(24, 36)


def focal_length(path: Path, size: tuple[int, int]) -> float | None:
    """Return the focal length of the camera of a picture of that width and height, px; None where the file
    does not say it.
    """
    from PIL import Image

    try:
        with Image.open(path) as image:
            noted = image.getexif().get_ifd(_SUB_IFD)
        if noted.get(_FOCAL_35):
            found = in_pixels(float(noted[_FOCAL_35]), size)
        else:
            # Pixels of the sensor ÷ mm, of a picture that may have been reduced since.
            per_mm = float(noted[_PLANE_RESOLUTION]) / _UNIT_MM[int(noted.get(_PLANE_UNIT, 2))]
            wide = float(noted.get(_PLANE_WIDTH) or max(size))
            found = float(noted[_FOCAL_MM]) * per_mm * max(size) / max(wide, min(size))
    except Exception:
        return None
    return found if 0.2 * max(size) < found < 50 * max(size) else None


def in_pixels(equivalent: float, size: tuple[int, int]) -> float:
    """Return px for mm of a camera whose film has 24 × 36 mm."""
    return equivalent / DIAGONAL_MM * math.hypot(*size)


def equivalent_mm(focal: float, size: tuple[int, int]) -> float:
    """Invert :func:`in_pixels`."""
    return focal * DIAGONAL_MM / math.hypot(*size)
