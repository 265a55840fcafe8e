"""Pictures of which nobody says where they belong: placed within half a pixel, or refused, never wrong.

Each set is 4 to 20 crops of one of scikit-image's photographs, in any order: exposed by ±10 %, with noise,
shifted by parts of a pixel, in every other set turned by up to ±2° each. `ts.find_places` gets nothing but
their pixels. What it says is compared with the truth at the four corners of every picture, after the one
similarity (of which pictures cannot know) that fits best.

    python benchmarks/placing.py
    python benchmarks/placing.py --sets 6 --first 12
"""

import argparse
import time
from pathlib import Path

import numpy as np
import skimage.data
from scipy import ndimage
from skimage.io import imread

import toposeam as ts

PHOTOGRAPHS = (
    *("astronaut.png", "camera.png", "chelsea.png", "coffee.png", "coins.png"),
    *("hubble_deep_field.jpg", "ihc.png", "motorcycle_left.png", "retina.jpg", "rocket.jpg"),
)
SETS, EXPOSURE, NOISE, TURN = 30, 0.10, 2.0, 2.0
#: A picture that is farther off than this is placed wrong, px.
WITHIN_PX = 0.5


def crops(number: int) -> tuple[list[ts.Layer], np.ndarray]:
    """The pictures of a set, and where their corners lie in the photograph, (N, 4) complex, x + iy."""
    rng = np.random.default_rng([number, 19])
    name = PHOTOGRAPHS[number % len(PHOTOGRAPHS)]
    whole = np.atleast_3d(imread(Path(skimage.data.__file__).parent / name))[:760, :1000, :3].astype(float)
    columns, rows = [(2, 2), (3, 2), (4, 2), (3, 3), (4, 3), (4, 4), (5, 4)][number % 7]
    turns = rng.uniform(-TURN, TURN, columns * rows) * (number % 2)
    overlap = rng.uniform(0.25, 0.4)
    # The largest pictures of which so many, turned, fit into the photograph.
    height, width = (
        int((side - 24) / (count - (count - 1) * overlap))
        for side, count in zip(whole.shape[:2], (rows, columns), strict=True)
    )
    layers, corners = [], []
    y, x = np.mgrid[:height, :width] + 0.5
    local = (x - width / 2) + 1j * (y - height / 2)
    for index, turn in enumerate(np.radians(turns)):
        row, column = divmod(index, columns)
        middle = complex(
            12 + width / 2 + column * (1 - overlap) * width, 12 + height / 2 + row * (1 - overlap) * height
        ) + complex(*rng.uniform(-4, 4, 2))
        places = middle + local * np.exp(1j * turn)
        at = [places.imag - 0.5, places.real - 0.5]
        channels = [
            ndimage.map_coordinates(whole[..., c], at, order=3, mode="mirror") for c in range(whole.shape[2])
        ]
        seen = np.stack(channels, axis=2) * rng.uniform(1 - EXPOSURE, 1 + EXPOSURE)
        seen = np.clip(np.round(seen + rng.normal(0, NOISE, seen.shape)), 0, 255).astype(np.uint8)
        layers.append(ts.Layer(seen, name=f"{row}, {column}"))
        ends = np.array([0, width, width + 1j * height, 1j * height]) - complex(width, height) / 2
        corners.append(middle + ends * np.exp(1j * turn))
    order = rng.permutation(len(layers))
    return [layers[index] for index in order], np.array(corners)[order]


def largest_error(found: ts.Placement, layers: list[ts.Layer], corners: np.ndarray) -> float:
    """px, at the worst corner of the worst picture."""
    height, width = layers[0].image.shape[:2]
    ends = np.array([0, width, width + 1j * height, 1j * height])
    said = (found.places @ [1, 1j])[:, np.newaxis] + ends * (
        found.scales * np.exp(1j * np.radians(found.turns))
    )[:, np.newaxis]
    basis = np.stack([said.ravel(), np.ones(said.size)], axis=1)
    fitted = basis @ np.linalg.lstsq(basis, corners.ravel(), rcond=None)[0]
    return float(np.abs(fitted - corners.ravel()).max())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=SETS)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    placed, refused, wrong, spent = [], 0, 0, 0.0
    for number in range(options.first, options.first + options.sets):
        layers, corners = crops(number)
        name = PHOTOGRAPHS[number % len(PHOTOGRAPHS)]
        height, width = layers[0].image.shape[:2]
        what = (
            f"{number:2}  {len(layers):2} of {name:22} {width:3} × {height:3} px{', turned' * (number % 2):8}"
        )
        started = time.process_time()
        try:
            found = ts.find_places(layers)
        except ts.OverlapError as error:
            refused += 1
            print(f"{what}  refused: {error}", flush=True)
            spent += time.process_time() - started
            continue
        seconds = time.process_time() - started
        spent += seconds
        error = largest_error(found, layers, corners)
        wrong += error > WITHIN_PX
        placed.append(error)
        print(f"{what}  {error:.2f} px  {seconds:5.1f} s{'   WRONG' * (error > WITHIN_PX)}", flush=True)
    print(
        f"{len(placed)} placed, {wrong} of them farther off than {WITHIN_PX} px; {refused} refused; error "
        f"{np.median(placed):.2f} px in the median, {max(placed):.2f} at worst; {spent:.0f} s of processor"
    )


if __name__ == "__main__":
    main()
