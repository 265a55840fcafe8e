"""Tones of neighbouring pictures matched: how bright the whole is before and after, and what step is left.

    python benchmarks/tones.py                         photographs rendered at two exposures
    python benchmarks/tones.py FOLDER --out PNGS       and each picture of a folder with the next one

The rendered ones are the two halves of a photograph, which overlap by 40 %, both darkened towards their
corners (by 35 % of the light), one with more light than the other, encoded as sRGB with a little noise.
Pictures of a folder are laid over each other by one homography of SIFT features; pairs of which none is found
are left out.

*Brightness* is the mean of the multiband composite, *step* how far the two pictures differ at the seam of the
hard cut, at the scale of light (averaged over about 9 px), *change* that of the mean of the picture which
changed the most; 8-bit levels. *White* is the share of pixels of which a channel is burnt out and was not.
OpenCV's are the gains of ``BlocksGainCompensator``, the default of its stitcher, under the same blending.
"""

from __future__ import annotations

import argparse
import itertools
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy import ndimage
from skimage import color, data, feature, io, measure, transform

import toposeam as ts
from stamp import stamp
from toposeam.layers.exposure.linear_light import decoded, encoded

try:
    import cv2
except ImportError:
    cv2 = None

PHOTOGRAPHS = ("coffee", "chelsea", "astronaut", "rocket")
RATIOS, DARKER, NOISE = (1.5, 2.5), 0.35, 1.0
SEEN = 5e5  # pixels that features are looked for in
Pair = list[ts.Layer]


def exposures() -> Iterator[tuple[str, Pair]]:
    """Halves of photographs, each at its own exposure."""
    for name in PHOTOGRAPHS:
        whole = decoded(getattr(data, name)()[..., :3] / 255)
        height, width = whole.shape[:2]
        wide = int(0.7 * width)
        y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : wide * 1j]
        lens = 1 - DARKER * (x * x + y * y)[..., np.newaxis] / 2
        for ratio in RATIOS:
            rng = np.random.default_rng(0)
            layers = []
            for left, gain in ((0, ratio**-0.5), (width - wide, ratio**0.5)):
                light = whole[:, left : left + wide] * lens * gain
                values = 255 * encoded(np.clip(light, 0, 1)) + rng.normal(0, NOISE, light.shape)
                layers.append(ts.Layer(np.clip(np.rint(values), 0, 255).astype(np.uint8), at=(left, 0)))
            yield f"{name} × {ratio}", layers


def neighbours(folder: Path) -> Iterator[tuple[str, Pair]]:
    """Each picture of a folder, with the next one laid over it."""
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in (".jpg", ".jpeg", ".png"))
    for (left, a), (right, b) in itertools.pairwise((path, look(path)) for path in paths):
        if (layers := laid(a, b)) is None:
            print(f"{left.name} and {right.name}: no homography")
        else:
            yield f"{left.stem} {right.stem}", layers


def look(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A picture, its features' places and what they look like."""
    image = io.imread(path)[..., :3]
    gray = color.rgb2gray(image)
    scale = min(1.0, (SEEN / gray.size) ** 0.5)
    if scale < 1:
        gray = transform.rescale(gray, scale, anti_aliasing=True)
    sift = feature.SIFT()
    sift.detect_and_extract(gray)
    return image, sift.keypoints[:, ::-1] / scale, sift.descriptors


def laid(a: tuple, b: tuple) -> Pair | None:
    """Two pictures on one canvas."""
    matches = feature.match_descriptors(a[2], b[2], max_ratio=0.8, cross_check=True)
    kind = transform.ProjectiveTransform
    there, here = a[1][matches[:, 0]], b[1][matches[:, 1]]
    if len(matches) < 12:
        return None
    found, _ = measure.ransac(
        (here, there), kind, min_samples=4, residual_threshold=4, max_trials=4000, rng=0
    )
    if found is None:
        return None
    (h, w), (high, wide) = a[0].shape[:2], b[0].shape[:2]
    corners = np.array([[0, 0], [wide, 0], [0, high], [wide, high]])
    if ((np.c_[corners, np.ones(4)] @ found.params.T)[:, 2] < 0.2).any():
        return None
    corners = np.concatenate([found(corners), [[0, 0], [w, h]]])
    first, last = np.floor(corners.min(axis=0)), np.ceil(corners.max(axis=0))
    shape = tuple((last - first).astype(int)[::-1])
    move = transform.EuclideanTransform(translation=first)
    layers = []
    for image, back in ((a[0], move), (b[0], move + found.inverse)):
        inside = transform.warp(np.ones(image.shape[:2]), back, output_shape=shape) > 0.999
        inside = ndimage.binary_erosion(inside, iterations=2)  # some have a frame
        warped = np.rint(255 * np.clip(transform.warp(image, back, output_shape=shape, order=3), 0, 1))
        layers.append(ts.Layer(warped.astype(np.uint8), mask=inside))
    return layers


def by_opencv(layers: Pair) -> Pair:
    """The layers as OpenCV's gains by blocks make them."""
    corners = [layer.at for layer in layers]
    images = [np.ascontiguousarray(layer.image) for layer in layers]
    masks = [255 * layer.covered.astype(np.uint8) for layer in layers]
    compensator = cv2.detail.ExposureCompensator.createDefault(cv2.detail.ExposureCompensator_GAIN_BLOCKS)
    compensator.feed(corners, [cv2.UMat(image) for image in images], [cv2.UMat(mask) for mask in masks])
    return [
        ts.Layer(compensator.apply(k, corners[k], images[k].copy(), masks[k]), at=layer.at, mask=layer.mask)
        for k, layer in enumerate(layers)
    ]


WAYS = {
    "off": list,
    "tones": ts.layers.match_tones,
    "shading": lambda layers: ts.layers.match_tones(layers, shading=True),
    **({"OpenCV": by_opencv} if cv2 is not None else {}),
}


def on_canvas(layer: ts.Layer) -> tuple[np.ndarray, np.ndarray]:
    """A layer's brightness on the canvas's rows, and where it is."""
    brightness = np.asarray(layer.image) @ [0.2126, 0.7152, 0.0722]
    pads = ((0, 0), (layer.at[0], 0))
    return np.pad(brightness, pads), np.pad(layer.covered, pads)


def step(layers: Pair, seam: np.ndarray) -> float:
    """How far two layers differ at a seam, at the scale of light."""
    (a, on_a), (b, on_b) = map(on_canvas, layers)
    width = min(a.shape[1], b.shape[1])
    both = on_a[:, :width] & on_b[:, :width]
    difference = np.where(both, a[:, :width] - b[:, :width], 0)
    smooth = ndimage.gaussian_filter(difference, 4) / np.maximum(ndimage.gaussian_filter(both * 1.0, 4), 1e-6)
    return float(np.abs(smooth[seam[:, :width] & both]).mean())


def measured(layers: Pair, out: Path | None, name: str) -> dict[str, tuple[float, ...]]:
    """Brightness, step, change and white of every way."""
    label_map = ts.stitch(layers).label_map
    seam = np.zeros(label_map.shape, bool)
    for axis in (0, 1):
        ends = np.take(label_map, range(label_map.shape[axis] - 1), axis), np.delete(label_map, 0, axis)
        divided = (ends[0] != ends[1]) & (ends[0] >= 0) & (ends[1] >= 0)
        seam |= np.pad(divided, [(0, int(k == axis)) for k in (0, 1)])
    covered = label_map >= 0
    before = [float(values[on].mean()) for values, on in map(on_canvas, layers)]
    found, burnt = {}, None
    for way, done in WAYS.items():
        made = done(layers)
        image = ts.stitch(made, blend="multiband").image
        white = (image == 255).any(axis=2) & covered
        burnt = white if burnt is None else burnt
        after = [float(values[on].mean()) for values, on in map(on_canvas, made)]
        found[way] = (
            float((image @ [0.2126, 0.7152, 0.0722])[covered].mean()),
            step(made, seam),
            max((x - y for x, y in zip(after, before, strict=True)), key=abs),
            100 * float((white & ~burnt).sum() / covered.sum()),
        )
        if out is not None:
            io.imsave(out / f"{name.replace(' ', '_')}_{way}.png", image, check_contrast=False)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--out", type=Path, help="write the composites to a folder")
    options = parser.parse_args()
    warnings.filterwarnings("ignore", category=RuntimeWarning)
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
    print(stamp())
    print(f"{'':<24}{'':<9}{'brightness':>11}{'step':>8}{'change':>8}{'white, %':>10}")
    for name, layers in exposures() if options.folder is None else neighbours(options.folder):
        for way, values in measured(layers, options.out, name).items():
            brightness, jump, change, white = values
            print(
                f"{name:<24}{way:<9}{brightness:>11.1f}{jump:>8.2f}{change:>+8.1f}{white:>10.2f}", flush=True
            )
            name = ""


if __name__ == "__main__":
    main()
