"""How much of joined photographs is kept, what the bent boundary does to them, and what it costs.

    python benchmarks/finish.py FOLDER
    python benchmarks/finish.py FOLDER --only weir,hill --keep seen

FOLDER holds ``sets/NAME/*`` and ``pairs/NAME_l.jpg``, ``pairs/NAME_r.jpg``. Each is joined three times by
the command in a process of its own with one thread: with ``--crop inside``, with ``--crop fit``, and with
``--crop outside``, whose straight lines are found and bent as the boundary of the layout of ``fit`` says.

*Kept* is the share of the pixels shown that the picture keeps, *filled* that of its pixels that were filled,
*bent* the farthest that a line of more than 4 % of the longer side comes to lie from a straight one, px per
1000 px of width (95 % of the lines; the worst), *turned* the degrees by which lines within 12° of the axes
are turned (95 %; the worst), *stretched* the logarithm of singular values (99.5 % of the picture), *time* the
processor time of ``fit`` ÷ that of ``inside``.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from measured import measured
from stamp import stamp
from toposeam.arrays import Floats
from toposeam.layers.canvas.transforms import MeshTransform
from toposeam.layers.mesh.lines import find_lines
from toposeam_cli.media.layouts.layout import read_layout

#: Shortest line, as a share of the longer side; points along a line; degrees that count as near an axis.
LINE, POINTS, NEAR_AXIS = 0.04, 33, 12.0


def works(folder: Path, only: set[str]) -> Iterator[tuple[str, list[Path]]]:
    """Yield the sets and pairs of a folder."""
    found = {path.name: sorted(path.iterdir()) for path in sorted((folder / "sets").glob("*"))}
    for left in sorted((folder / "pairs").glob("*_l.*")):
        found[left.stem.removesuffix("_l")] = [left, *left.parent.glob(left.stem[:-1] + "r.*")]
    for name, files in found.items():
        if not only or name in only:
            yield name, files


def joined(files: list[Path], out: Path, crop: str, *more: str) -> tuple[dict[str, Any] | None, float]:
    """Join pictures; return the report of the command, None if it refuses, and its processor time, s."""
    words = [
        sys.executable,
        "-m",
        "toposeam_cli",
        "stitch",
        *(str(file.resolve()) for file in files),
        "-o",
        str(out),
        "--json",
        "--force",
    ]
    ran = measured([*words, "--crop", crop, *more], out.parent)
    return (json.loads(ran.said[ran.said.index("{\n") :]) if ran.code == 0 else None), ran.seconds


def bending(picture: np.ndarray, boundary: MeshTransform) -> dict[str, tuple[float, float]]:
    """Measure what a boundary does to the straight lines of an unbent picture, and everywhere."""
    shown = picture[..., 3] > 0
    gray = picture[..., :3].mean(axis=2, dtype=np.float32) / 255
    height, width = shown.shape
    lines = find_lines(gray, LINE * max(height, width))
    points = lines[:, None, :2] + np.linspace(0, 1, POINTS)[:, None] * (
        lines[:, None, 2:] - lines[:, None, :2]
    )
    x, y = np.moveaxis(np.rint(points).astype(int), -1, 0)
    inner = shown & ~_near_holes(shown)
    lines, points = (
        each[inner[y.clip(0, height - 1), x.clip(0, width - 1)].all(axis=1)] for each in (lines, points)
    )
    moved = boundary.to_canvas(points)
    off, turns = [], []
    for before, after in zip(points, moved, strict=True):
        middle = after.mean(axis=0)
        along = np.linalg.svd(after - middle)[2][0]
        off.append(np.abs((after - middle) @ [-along[1], along[0]]).max() / width * 1000)
        way = before[-1] - before[0]
        angle = np.degrees(np.arctan2(way[1], way[0]))
        if abs((angle + 45) % 90 - 45) < NEAR_AXIS:
            turn = np.degrees(np.arctan2(*(after[-1] - after[0])[::-1])) - angle
            turns.append(abs((turn + 180) % 360 - 180))
    return {
        "bent": _ends(off, 95),
        "turned": _ends(turns, 95),
        "stretched": _ends(_stretches(boundary, shown), 99.5),
    }


def _near_holes(shown: np.ndarray) -> np.ndarray:
    from scipy.ndimage import binary_dilation

    return np.asarray(binary_dilation(~shown, iterations=3))


def _stretches(boundary: MeshTransform, shown: np.ndarray) -> Floats:
    """Return the logarithms of singular values all over what shows."""
    y, x = np.mgrid[0 : shown.shape[0] : 16, 0 : shown.shape[1] : 16]
    at = np.stack([x, y], axis=-1)[shown[::16, ::16]].astype(float)
    here, right, down = (boundary.to_canvas(at + step) for step in ((0, 0), (1, 0), (0, 1)))
    values = np.linalg.svd(np.stack([right - here, down - here], axis=-1), compute_uv=False)
    return np.abs(np.log(values)).max(axis=1)


def _ends(values: Any, share: float) -> tuple[float, float]:
    found = np.asarray(values, float)
    return (float(np.percentile(found, share)), float(found.max())) if found.size else (0.0, 0.0)


def main() -> None:
    """Print a line for each work, and medians."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--keep", type=Path, help="a folder for the pictures")
    args = parser.parse_args()
    print(stamp())
    print(
        "name                       inside    fit  filled  bent           turned         stretched      time"
    )
    rows = []
    with tempfile.TemporaryDirectory() as made:
        folder = args.keep or Path(made)
        folder.mkdir(exist_ok=True)
        folder = folder.resolve()
        for name, files in works(args.folder, set(filter(None, args.only.split(",")))):
            layout = folder / f"{name}.toml"
            inside, usual = joined(files, folder / f"{name}-inside.png", "inside")
            fit, taken = joined(files, folder / f"{name}-fit.png", "fit", "--save-layout", str(layout))
            if inside is None or fit is None:
                print(f"{name:26} refused", flush=True)
                continue
            boundary = read_layout(layout).boundary
            figures = dict.fromkeys(("bent", "turned", "stretched"), (0.0, 0.0))
            if boundary is not None:
                joined(files, folder / f"{name}-outside.png", "outside")
                with Image.open(folder / f"{name}-outside.png") as whole:
                    figures = bending(np.asarray(whole.convert("RGBA")), boundary)
            rows.append((inside["kept"], fit["kept"], fit["filled"], taken / usual, *figures.values()))
            texts = [f"{low:5.2f} / {high:5.2f}" for low, high in figures.values()]
            print(
                f"{name:26} {100 * inside['kept']:5.1f} {100 * fit['kept']:6.1f} {100 * fit['filled']:6.1f}  "
                f"{'  '.join(texts)}  {taken / usual:.2f}",
                flush=True,
            )
    if rows:
        kept = np.array([row[:4] for row in rows])
        print(
            f"\n{len(rows)} works, medians: inside {100 * np.median(kept[:, 0]):.1f} %, fit "
            f"{100 * np.median(kept[:, 1]):.1f} %, filled {100 * np.median(kept[:, 2]):.1f} %, time "
            f"{np.median(kept[:, 3]):.2f}; below inside: {int((kept[:, 1] < kept[:, 0] - 1e-3).sum())}"
        )


if __name__ == "__main__":
    main()
