"""Write ``portrait_left.jpg`` and ``portrait_right.jpg`` beside this file: two views of a person before a
bookshelf, as if taken by hand (needs ``pip install opencv-python-headless``).

The shelf is the joined still life of this folder, CC0; the person is Eileen Collins, photographed by NASA
(``skimage.data.astronaut``, public domain), cut out here. Each view has a perspective of its own, another
exposure, and noise; between the two the person has moved by 48 px against the shelf.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from scipy.ndimage import binary_fill_holes
from skimage import data

import toposeam as ts

HERE = Path(__file__).resolve().parent
#: How large the person is, by the photograph, and how far it moves, px.
PERSON, MOVED = 0.66, 48


def main() -> None:
    shelf, person, alpha = bookshelf(), data.astronaut().astype(np.float32), cut_out(data.astronaut())
    rng = np.random.default_rng(3)
    views = {
        "left": (30, 800, 415, 3e-5, 1.0, 0.8),
        "right": (345, 780, 415 + MOVED, -4e-5, 0.86, -1.1),
    }
    for name, (left, width, place, turn, gain, tilt) in views.items():
        seen = view(
            shelf, person, alpha, camera(left, (width, shelf.shape[0] - 90), turn, tilt), width, place
        )
        noisy = np.clip(seen * gain + rng.normal(0, 1.5, seen.shape), 0, 255).astype(np.uint8)
        Image.fromarray(noisy).save(HERE / f"portrait_{name}.jpg", quality=93)


def bookshelf() -> np.ndarray:
    """(H, W, 3) float32: the upper part of the still life, joined and enlarged."""
    left, right = (
        np.asarray(Image.open(HERE / f"still_life_{side}.png").convert("RGB")) for side in ("left", "right")
    )
    joined = Image.fromarray(ts.stitch([ts.Layer(left), ts.Layer(right, at=(270, 0))]).image[:350])
    return np.asarray(
        joined.resize((joined.width * 3 // 2, joined.height * 3 // 2), Image.Resampling.LANCZOS), np.float32
    )


def cut_out(picture: np.ndarray) -> np.ndarray:
    """(H, W) float32 opacity of the person, by GrabCut from boxes and a collar drawn here."""
    known = np.full(picture.shape[:2], cv2.GC_PR_BGD, np.uint8)
    known[:, 60:420] = cv2.GC_PR_FGD
    for rows, columns in (
        (np.s_[:170], np.s_[:145]),
        (np.s_[:], np.s_[:21]),
        (np.s_[:300], np.s_[:50]),
        (np.s_[:190], np.s_[310:]),
        (np.s_[:215], np.s_[:110]),
        (np.s_[:340], np.s_[362:]),
        (np.s_[:430], np.s_[497:]),
        (np.s_[100:175], np.s_[285:]),
    ):
        known[rows, columns] = cv2.GC_BGD
    collar = [
        (118, 195), (150, 158), (185, 165), (262, 180), (292, 200),
        (303, 250), (285, 275), (215, 292), (150, 262), (122, 225),
    ]  # fmt: skip
    known[60:180, 185:262] = known[28:60, 200:255] = cv2.GC_FGD
    known[260:, 100:300] = known[380:, 300:470] = cv2.GC_FGD
    cv2.fillPoly(known, [np.array(collar)], cv2.GC_FGD)
    cv2.grabCut(
        picture[:, :, ::-1].copy(),
        known,
        None,
        np.zeros((1, 65)),
        np.zeros((1, 65)),
        8,
        cv2.GC_INIT_WITH_MASK,
    )
    shown = ((known == cv2.GC_FGD) | (known == cv2.GC_PR_FGD)).astype(np.uint8)
    _count, label, about, _centres = cv2.connectedComponentsWithStats(shown)
    whole = binary_fill_holes(label == 1 + np.argmax(about[1:, 4])).astype(np.uint8)
    smooth = cv2.erode(cv2.morphologyEx(whole, cv2.MORPH_OPEN, np.ones((5, 5))), np.ones((3, 3)))
    return cv2.GaussianBlur(smooth.astype(np.float32), (0, 0), 1.0)


def camera(left: int, size: tuple[int, int], turn: float, tilt: float) -> np.ndarray:
    """(3, 3) homography from the shelf to a view whose camera turned (1/px) and tilted (degrees)."""
    cosine, sine = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    x, y = size[0] / 2, size[1] / 2
    about = np.array(
        [[cosine, -sine, x - cosine * x + sine * y], [sine, cosine, y - sine * x - cosine * y], [0, 0, 1]]
    )
    return (
        about
        @ np.array([[1, 0, 0], [0, 1, 0], [turn, 0, 1]])
        @ np.array([[1, 0, -left], [0, 1, -40], [0, 0, 1.0]])
    )


def view(
    shelf: np.ndarray, person: np.ndarray, alpha: np.ndarray, seen: np.ndarray, width: int, place: int
) -> np.ndarray:
    """What a camera sees of the shelf, and of the person before it."""
    size = width, shelf.shape[0] - 90
    before = np.array([[PERSON, 0, place], [0, PERSON, shelf.shape[0] - len(person) * PERSON], [0, 0, 1]])
    behind = cv2.warpPerspective(shelf, seen, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    nearer = cv2.warpPerspective(person, seen @ before, size, flags=cv2.INTER_AREA)
    share = cv2.warpPerspective(alpha, seen @ before, size)[..., np.newaxis]
    return behind * (1 - share) + nearer * share


if __name__ == "__main__":
    main()
