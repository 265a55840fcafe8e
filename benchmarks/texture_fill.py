"""Holes against peers, in one run: ``python benchmarks/texture_fill.py [--sheet fill.jpg] [--only eye,man]``.

Twelve photographs with an object masked are filled by TopoSeam, by G'MIC's ``inpaint_matchpatch`` (Debian:
gmic), by OpenCV's ``inpaint`` (Telea) and by scikit-image's ``inpaint_biharmonic``: processor seconds, and a
sheet to look at. Then holes in textures, whose truth is known: PSNR inside of the hole, dB.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import skimage.data
from PIL import Image, ImageDraw
from skimage.restoration import inpaint_biharmonic

import toposeam as ts
from stamp import stamp

Case = tuple[np.ndarray, np.ndarray]


def ellipse(shape: tuple[int, ...], row: float, column: float, height: float, width: float) -> np.ndarray:
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.square((y - row) / height) + np.square((x - column) / width) < 1


def polygon(shape: tuple[int, ...], *corners: tuple[int, int]) -> np.ndarray:
    mask = Image.new("L", (shape[1], shape[0]))
    ImageDraw.Draw(mask).polygon(corners, fill=1)
    return np.asarray(mask) > 0


def photographs() -> dict[str, Case]:
    cat, man, coffee = skimage.data.chelsea(), skimage.data.camera(), skimage.data.coffee()
    portrait, rocket, moon = skimage.data.astronaut(), skimage.data.rocket(), skimage.data.moon()
    deep, retina = skimage.data.hubble_deep_field()[:600, :600], skimage.data.retina()[300:900, 300:900]
    coins, stain = skimage.data.coins(), skimage.data.immunohistochemistry()
    return {
        "eye": (cat, ellipse(cat.shape, 115, 172, 40, 46)),
        "nose": (cat, ellipse(cat.shape, 240, 262, 26, 34)),
        "man": (
            man,
            polygon(
                man.shape,
                (0, 330),
                (10, 190),
                (90, 130),
                (150, 55),
                (250, 55),
                (340, 120),
                (350, 240),
                (430, 511),
                (0, 511),
            ),
        ),
        "model": (
            portrait,
            polygon(portrait.shape, (385, 0), (445, 0), (470, 120), (478, 238), (345, 240), (360, 120)),
        ),
        "badge": (portrait, ellipse(portrait.shape, 371, 174, 46, 46)),
        "handle": (
            coffee,
            polygon(coffee.shape, (180, 225), (240, 210), (270, 250), (255, 305), (215, 318), (188, 290)),
        ),
        "rocket": (rocket, polygon(rocket.shape, (295, 60), (350, 60), (350, 400), (295, 400))),
        "galaxies": (deep, ellipse(deep.shape, 400, 125, 45, 45) | ellipse(deep.shape, 110, 290, 40, 50)),
        "macula": (retina, ellipse(retina.shape, 400, 410, 90, 100)),
        "crater": (moon, ellipse(moon.shape, 190, 300, 60, 75)),
        "coin": (coins, ellipse(coins.shape, 122, 155, 36, 36)),
        "stain": (stain, ellipse(stain.shape, 250, 250, 60, 60)),
    }


def textures() -> dict[str, Case]:
    """Each with six holes of 20 to 40 px."""
    rng, found = np.random.default_rng(0), {}
    for name in ("brick", "grass", "gravel"):
        image = getattr(skimage.data, name)()
        hole = np.zeros(image.shape, bool)
        for _ in range(6):
            row, column = rng.uniform(60, 450, 2)
            hole |= ellipse(image.shape, row, column, *rng.uniform(10, 20, 2))
        found[name] = (image, hole)
    return found


def ours(by: ts.typing.By) -> Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, float]]:
    def run(image: np.ndarray, hole: np.ndarray) -> tuple[np.ndarray, float]:
        started = time.process_time()
        made = ts.fill(image, hole, by=by).image
        return made, time.process_time() - started

    return run


def gmic(image: np.ndarray, hole: np.ndarray) -> tuple[np.ndarray, float] | None:
    if shutil.which("gmic") is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        given, mask, made = (str(Path(folder, f"{name}.png")) for name in ("given", "mask", "made"))
        Image.fromarray(image).save(given)
        Image.fromarray(hole.astype(np.uint8) * 255).save(mask)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        program = shutil.which("gmic") or "gmic"
        subprocess.run(
            [program, given, mask, "-inpaint_matchpatch[0]", "[1]", "-remove[1]", "-o", made],
            capture_output=True,
            check=True,
            env={**os.environ, "HOME": folder, "OMP_NUM_THREADS": "1"},
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        with Image.open(made) as picture:
            return np.asarray(picture.convert("L" if image.ndim == 2 else "RGB")), seconds


def opencv(image: np.ndarray, hole: np.ndarray) -> tuple[np.ndarray, float]:
    cv2.setNumThreads(1)
    started = time.process_time()
    made = cv2.inpaint(image, hole.astype(np.uint8), 5, cv2.INPAINT_TELEA)
    return made, time.process_time() - started


def biharmonic(image: np.ndarray, hole: np.ndarray) -> tuple[np.ndarray, float] | None:
    if np.count_nonzero(hole) > 20_000:  # minutes
        return None
    started = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made = inpaint_biharmonic(image, hole, channel_axis=2 if image.ndim == 3 else None)
    return np.rint(255 * np.clip(made, 0, 1)).astype(np.uint8), time.process_time() - started


def psnr(made: np.ndarray, truth: np.ndarray, hole: np.ndarray) -> float:
    return float(10 * np.log10(255**2 / np.square(made.astype(float) - truth)[hole].mean()))


def contact_sheet(rows: list[list[np.ndarray]], side: int = 260, gap: int = 6) -> Image.Image:
    sheet = Image.new("RGB", (len(rows[0]) * (side + gap), len(rows) * (side + gap)), "white")
    for line, images in enumerate(rows):
        for column, image in enumerate(images):
            picture = Image.fromarray(image).convert("RGB")
            picture.thumbnail((side, side), Image.Resampling.LANCZOS)
            sheet.paste(picture, (column * (side + gap), line * (side + gap)))
    return sheet


def window(hole: np.ndarray) -> tuple[slice, slice]:
    """The hole and as much again on every side."""
    spans = []
    for axis in (1, 0):
        line = np.flatnonzero(hole.any(axis=axis))
        length = int(line[-1] - line[0]) + 1
        spans.append(slice(max(int(line[0]) - length // 2, 0), int(line[-1]) + 1 + length // 2))
    return spans[0], spans[1]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--sheet", type=Path, help="write all results side by side, cut to the hole's surroundings"
    )
    parser.add_argument("--only", default="", help="names of photographs, with commas between")
    options = parser.parse_args()
    wanted = options.only.split(",") if options.only else None
    peers = {"toposeam": ours("auto"), "gmic": gmic, "opencv": opencv, "biharmonic": biharmonic}
    print(f"{'':10}{'px':>8}" + "".join(f"{name + ' s':>14}" for name in peers))
    rows = []
    for name, (image, hole) in photographs().items():
        if wanted and name not in wanted:
            continue
        made = {peer: run(image, hole) for peer, run in peers.items()}
        cells = "".join(f"{'–' if one is None else f'{one[1]:.2f}':>14}" for one in made.values())
        print(f"{name:10}{int(hole.sum()):8}{cells}", flush=True)
        spoiled = image.copy()
        spoiled[hole] = 255 if image.ndim == 2 else (255, 0, 255)
        part = window(hole)
        shown = [spoiled, *(np.full_like(image, 255) if one is None else one[0] for one in made.values())]
        rows.append([np.ascontiguousarray(one[part]) for one in shown])
    if options.sheet and rows:
        contact_sheet(rows).save(options.sheet, quality=82, optimize=True)
    if wanted:
        return
    methods = {"patches": ours("patches"), "shifts": ours("shifts"), **dict(list(peers.items())[1:])}
    print(f"\n{'PSNR, dB':18}" + "".join(f"{name:>14}" for name in methods))
    for name, (image, hole) in textures().items():
        spoiled = np.where(hole, 0, image).astype(np.uint8)
        values = [run(spoiled, hole) for run in methods.values()]
        print(
            f"{name:18}"
            + "".join(f"{'–' if v is None else f'{psnr(v[0], image, hole):.2f}':>14}" for v in values)
        )


if __name__ == "__main__":
    print(stamp())
    main()
