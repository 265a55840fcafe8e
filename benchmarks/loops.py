"""Loops to be judged by eye, beside cross-fades of the same frames; and a loop of a large video.

    python benchmarks/loops.py FOLDER [CLIP …]   a strip of each clip's transition in FOLDER, and its verdict
    python benchmarks/loops.py FOLDER --large    1080p, 150 frames, by the command: processor time and memory

Without clips, those of ``samples/clips.py`` with seeds that were not tuned on, and a ball that crosses the
picture once, which no loop can hide. Of each moment a strip shows the loop, which stretch shows where (orange
the end, blue the beginning), and the cross-fade. Files are read at 320 px.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "samples"))

import clips  # noqa: E402

import toposeam as ts  # noqa: E402
from stamp import stamp  # noqa: E402
from toposeam_cli.media.clips.clip import Clip  # noqa: E402
from toposeam_cli.media.clips.cut import Cut  # noqa: E402
from toposeam_cli.media.clips.reading import open_clip  # noqa: E402
from toposeam_cli.media.clips.writing import write_clip  # noqa: E402

Frames = npt.NDArray[np.uint8]
#: Longer side at which files are read, px, and moments of a strip.
SIDE, MOMENTS = 320, 12


def ball(frames: int = 100, seed: int = 31) -> Frames:
    """Make a ball that crosses the picture once."""
    rng = np.random.default_rng(seed)
    ground = 0.45 + 0.1 * clips.field((180, 320), 1.6, rng)
    y, x = np.indices(ground.shape)
    made = []
    for t in range(frames):
        picture = np.repeat(ground[..., np.newaxis] + 0.01 * rng.standard_normal((180, 320, 1)), 3, axis=2)
        picture[(x - 20 - 2.8 * t) ** 2 + (y - 90 - 30 * np.sin(t / 9)) ** 2 < 22**2] = (0.8, 0.2, 0.1)
        made.append(np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8))
    return np.stack(made)


def drawn() -> Iterator[tuple[str, Frames]]:
    """Yield clips that are made here."""
    for seed in (31, 32, 33):
        for name, make in clips.CLIPS.items():
            yield f"{name}{seed}", make(100, 180, 320, seed=seed)
    yield "ball", ball()


def read(path: Path) -> Frames:
    """Read a file at a small size."""
    first = open_clip(path, None, 10**12, 10**9).frames
    scale = min(1.0, SIDE / max(first.shape[1:3]))
    return np.asarray(open_clip(path, None, 10**12, 10**9, Cut(scale=scale)).frames[:])


def strip(clip: Frames, made: ts.volume.Loop, path: Path) -> None:
    """Draw moments of the transition."""
    from PIL import Image

    jump, depth = made.jumps[0], made.transition
    columns = []
    for at in np.unique(np.linspace(0, depth - 1, MOMENTS).round().astype(int)):
        left, entered = (clip[first + at].astype(float) for first in (jump.leaves, jump.enters))
        there = made.source[at] == jump.enters + at
        tinted = 0.6 * made.frames[at] + 0.4 * np.where(there[..., np.newaxis], (0, 90, 255), (255, 120, 0))
        share = (at + 1) / (depth + 1)
        faded = (1 - share) * left + share * entered
        columns.append(np.concatenate([made.frames[at], tinted, faded]).astype(np.uint8))
    rows = [np.concatenate(columns[first : first + 4], axis=1) for first in range(0, len(columns), 4)]
    width = max(row.shape[1] for row in rows)
    sheet = np.concatenate([np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0))) for row in rows])
    Image.fromarray(sheet).save(path)


def judged(folder: Path, paths: list[Path]) -> None:
    """Print the verdict on each loop, and draw its strip."""
    given = ((path.stem, read(path)) for path in paths) if paths else drawn()
    for name, clip in given:
        started = time.process_time()
        made = ts.loop(clip)
        spent = time.process_time() - started
        strip(clip, made, folder / f"{name}.png")
        verdict = made.verdict
        print(
            f"{name:14s} {len(made):4d} of {len(clip):4d} frames, shows {verdict.shows:.2f}: {verdict}"
            f"{', camera moves' if verdict.moved else ''}, {spent:.1f} s",
            flush=True,
        )


def large(folder: Path) -> None:
    """Measure the command on a large video."""
    flag = clips.flag(150, 270, 480, seed=31)
    tall = (np.repeat(np.repeat(frame, 4, axis=0), 4, axis=1) for frame in flag)
    source = folder / "large.mp4"
    write_clip(source, Clip(frames=tall, rate=Fraction(30)), force=True)
    command = ["-m", "toposeam_cli", "loop", str(source), "-o", str(folder / "loop.mp4"), "--force"]
    subprocess.run([sys.executable, *command], check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{used.ru_utime + used.ru_stime:.1f} s of processor time, {used.ru_maxrss / 2**20:.2f} GiB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("clips", type=Path, nargs="*")
    parser.add_argument("--large", action="store_true")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    print(stamp())
    if options.large:
        large(options.folder)
    else:
        judged(options.folder, options.clips)
