"""What the page of ``toposeam edit`` costs, and whether what it saves is what was seen.

    python benchmarks/edit.py FOLDER_OR_PICTURE... [--strokes 20] [--scipy] [--saves] [--megapixels 2]

Each folder is one panorama; pictures that are named one by one make one together. A session is driven as the
page drives it, without a browser: random strokes start beside a seam and run over it, 60 to 180 px of the
preview long. Times are those of the processor. Columns:

pictures     those that were placed
print        s until the first small picture can be shown
placed       s until all pictures are placed and their seams are found
window       ms from a part of a stroke to the new seam, median and largest
release      ms to search everything again when the stroke has ended, likewise
MiB          most memory of the process
same         with ``--saves``: whether ``toposeam stitch`` of the saved layout makes the same bytes
near         with ``--saves``: share of the saved seams' length within 3 px of the preview of those seen
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from PIL import Image

from stamp import stamp
from toposeam import _kernels
from toposeam_cli.edit import preview
from toposeam_cli.edit.session import Session
from toposeam_cli.edit.work import Work

#: Radius of the brush, px of the preview.
RADIUS = 14.0


def between(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of pixels whose right or lower neighbour belongs to another picture."""
    found = np.zeros(labels.shape, bool)
    for first, second, at in (
        (labels[:, :-1], labels[:, 1:], found[:, :-1]),
        (labels[:-1], labels[1:], found[:-1]),
    ):
        at |= (first != second) & (first >= 0) & (second >= 0)
    return np.nonzero(found)


def a_stroke(session: Session, rng: np.random.Generator) -> dict[str, Any]:
    """A stroke from beside a seam over it, as the page sends it."""
    rows, columns = between(session.labels)
    k = rng.integers(len(rows))
    start, angle = np.array([columns[k], rows[k]], float), rng.uniform(0, 2 * np.pi)
    way = np.array([np.cos(angle), np.sin(angle)])
    x, y = np.clip(start - RADIUS * way, 0, np.array(session.shape[::-1]) - 1).astype(int)
    length = rng.uniform(60, 180)
    points = start + np.linspace(-RADIUS, length, 12)[:, np.newaxis] * way
    layer = max(int(session.labels[y, x]), 0)
    return {"kind": "show", "layer": layer, "radius": RADIUS, "points": points.tolist()}


def timed(work: Any, *given: Any) -> tuple[float, Any]:
    """Processor time of a call, s, and what it returns."""
    started = time.process_time()
    result = work(*given)
    return time.process_time() - started, result


def saved(session: Session, folder: Path) -> tuple[bool, float]:
    """Whether Save and a stitch of its layout agree, and how much of the seam lies near the one seen."""
    first, again = folder / "all.png", folder / "again.png"
    layout, labels = folder / "all.toml", folder / "labels.png"
    stitch = [sys.executable, "-m", "toposeam", "stitch", "-q", "--force"]
    subprocess.run([*stitch, session.work.layout, "-o", first, "--save-layout", layout], check=True)
    subprocess.run([*stitch, layout, "-o", again], check=True)
    told = [*stitch, layout, "-o", folder / "whole.png", "--labels", labels, "--json"]
    left, top, _, _ = json.loads(subprocess.run(told, check=True, capture_output=True).stdout)["crop"]
    digests = {hashlib.sha256(path.read_bytes()).hexdigest() for path in (first, again)}
    whole = np.rint(np.asarray(Image.open(labels)) / 255.0 * (len(session.layers) - 1))
    seen = np.ones(session.shape, bool)
    seen[between(session.labels)] = False
    distances = scipy.ndimage.distance_transform_edt(seen)
    points = (np.array(between(whole)) + np.array([[top], [left]]) + 0.5) * session.opened.scale
    at = tuple(np.clip(points, 0, np.array(session.shape)[:, np.newaxis] - 1).astype(int))
    # beside what no picture has, labels mean nothing
    known = ~scipy.ndimage.binary_dilation(session.labels < 0, iterations=4)[at]
    at = tuple(one[known] for one in at)
    return len(digests) == 1, float((distances[at] <= 3).mean())


def measured(files: list[Path], strokes: int, saves: bool) -> None:
    """Drive one work and print its row."""
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["TOPOSEAM_WORKS"] = name
        first, _ = timed(preview.small_print, files[0])
        placed, session = timed(Session, Work(folder=folder / "work", files=[one.resolve() for one in files]))
        window, release = [], []
        for _ in range(strokes):
            stroke = a_stroke(session, rng)
            for k in (4, 8, 12):
                part = stroke | {"points": stroke["points"][:k]}
                window.append(timed(session.push, part)[0] * 1e3)
            session.paint([stroke])
            release.append(timed(session.settle)[0] * 1e3)
            if len(session.gestures) >= 4:
                session.undo()
                session.undo()
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        row = f"{len(session.layers):8d} {first:6.2f} {placed:7.2f} "
        row += f"{np.median(window):7.0f} {max(window):5.0f} {np.median(release):7.0f} {max(release):5.0f} "
        row += f"{memory:5.0f} "
        if saves:
            same, near = saved(session, folder)
            row += f"{'yes' if same else 'NO':>5} {near:6.3f}"
        print(row, f" {files[0].parent.name}/{files[0].name}", flush=True)


def main() -> None:
    """Measure all works, each in a process of its own for its memory."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("pictures", nargs="+", type=Path)
    parser.add_argument("--strokes", type=int, default=20)
    parser.add_argument("--scipy", action="store_true")
    parser.add_argument("--saves", action="store_true")
    parser.add_argument("--megapixels", type=float, default=2.0, help="of the preview")
    given = parser.parse_args()
    preview.PREVIEW_PIXELS = round(given.megapixels * 1e6)
    if given.scipy:
        _kernels.library = None
    print(stamp())
    sets = [sorted(path.iterdir()) for path in given.pictures if path.is_dir()]
    single = [path for path in given.pictures if path.is_file()]
    print("pictures  print  placed    window  max  release  max   MiB  same   near")
    for files in [*sets, *([single] if single else [])]:
        child = os.fork()
        if not child:
            measured(files, given.strokes, given.saves)
            os._exit(0)
        os.waitpid(child, 0)


if __name__ == "__main__":
    main()
