"""Loops to be judged by eye, beside cross-fades of the same frames; and a loop of a large video.

    python benchmarks/loops.py FOLDER [CLIP …]    verdicts; strips, loops, cross-fades in FOLDER, and a sheet
    python benchmarks/loops.py FOLDER --seeds 81  the same of clips that are drawn with such seeds
    python benchmarks/loops.py FOLDER --quarters  loops of quarters, of those whose loop is seen
    python benchmarks/loops.py FOLDER --large     1080p, 150 frames, by the command: processor time, memory
    python benchmarks/loops.py FOLDER --long      60 s of 720p, likewise

Without clips, those of ``samples/clips.py``, a pendulum, people who walk, and leaves above water, with seeds
that were not tuned on, and a ball that crosses the picture once, which no loop can hide. Of each moment a
strip shows the loop, which stretch shows where (orange the end, blue the beginning), and the cross-fade; the
sheet shows six moments of each loop above those of its cross-fade. Files are read at 320 px, at most 250
frames of them: ``CLIP@100`` begins with frame 100, ``CLIP@100-220`` also ends.

Quarters tell what loops of regions, each with a start and a period of its own, could win at most: each is
looped alone, while the rest stands still and is not judged.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

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
#: Frames that are read of a file, at most, and frames per second of all clips.
MOST_FRAMES, RATE = 250, Fraction(25)


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


def ground(rng: np.random.Generator) -> npt.NDArray[np.float64]:
    """Make a calm ground."""
    gray = 0.45 + 0.08 * clips.field((180, 320), 1.6, rng)
    return np.stack([gray * tint for tint in rng.uniform(0.8, 1.1, 3)], axis=-1)


def noisy(picture: npt.NDArray[np.float64], rng: np.random.Generator) -> Frames:
    """Add a camera's noise."""
    grain = 0.008 * rng.standard_normal((*picture.shape[:2], 1))
    return np.rint(255 * np.clip(picture + grain, 0, 1)).astype(np.uint8)


def pendulum(frames: int = 100, seed: int = 31) -> Frames:
    """Make a pendulum that swings less and less."""
    rng = np.random.default_rng(seed)
    behind = ground(rng)
    y, x = np.indices(behind.shape[:2])
    period, radius, most, colour = (
        rng.uniform(27, 45),
        rng.uniform(7, 13),
        rng.uniform(0.35, 0.7),
        rng.random(3),
    )
    made = []
    for t in range(frames):
        picture = behind.copy()
        turn = most * np.sin(2 * np.pi * t / period) * (1 - 0.002 * t)
        aside = (x - 160) * np.cos(turn) - (y - 10) * np.sin(turn)
        picture[(np.abs(aside) < 1.2) & (y > 10) & (np.hypot(x - 160, y - 10) < 120)] = 0.15
        picture[np.hypot(x - 160 - 120 * np.sin(turn), y - 10 - 120 * np.cos(turn)) < radius] = colour
        made.append(noisy(picture, rng))
    return np.stack(made)


def walkers(frames: int = 110, seed: int = 31) -> Frames:
    """Make people who walk before a calm ground, each at a pace of its own."""
    rng = np.random.default_rng(seed)
    behind = ground(rng)
    y, x = np.indices(behind.shape[:2])
    people = [
        (
            rng.uniform(-60, 380),
            rng.uniform(60, 165),
            rng.choice([-1, 1]) * rng.uniform(0.8, 2.2),
            rng.uniform(14, 30),
            rng.random(3),
        )
        for _ in range(int(rng.integers(3, 8)))
    ]
    made = []
    for t in range(frames):
        picture = behind.copy()
        for begin, feet, pace, height, colour in sorted(people, key=lambda one: one[1]):
            at, swing = begin + pace * t, np.sin(0.35 * abs(pace) * t + begin)
            hip, top = feet - 0.3 * height, feet - height - abs(swing)
            body = np.hypot((x - at) / (0.2 * height), (y - top - 0.5 * height) / (0.38 * height)) < 1
            down = np.clip((y - hip) / (0.42 * height), 0, 1)
            legs = np.zeros_like(body)
            for side in (-1, 1):
                legs |= np.abs(x - at - 0.22 * height * side * swing * down) < 0.06 * height + 0.6
            picture[body] = colour
            picture[np.hypot(x - at, y - top) < 0.15 * height] = (0.8, 0.62, 0.5)
            picture[legs & (y > hip) & (y < feet + 0.12 * height)] = (0.12, 0.12, 0.2)
        made.append(noisy(picture, rng))
    return np.stack(made)


def leaves(frames: int = 100, seed: int = 31) -> Frames:
    """Make leaves that sway above water, at a period that the water does not have."""
    rng = np.random.default_rng(seed)
    made = clips.water(frames, 180, 320, seed=seed)
    behind, period = ground(rng)[:90], rng.uniform(18, 34)
    y, x = np.indices(behind.shape[:2])
    stems = list(zip(rng.uniform(10, 310, 9), rng.uniform(0, 30, 9), rng.uniform(0, 6, 9), strict=True))
    for t, frame in enumerate(made):
        picture = behind.copy()
        for right, down, phase in stems:
            turn = 0.5 * np.sin(2 * np.pi * t / period + phase)
            along = (x - right) * np.sin(turn) + (y - down) * np.cos(turn)
            across = (x - right) * np.cos(turn) - (y - down) * np.sin(turn)
            picture[((along - 26) / 26) ** 2 + (across / 9) ** 2 < 1] = (0.2, 0.5, 0.15)
        frame[:90] = noisy(picture, rng)
    return made


def drawn(seeds: list[int]) -> Iterator[tuple[str, Frames]]:
    """Yield clips that are made here."""
    for seed in seeds:
        for name, make in clips.CLIPS.items():
            yield f"{name}{seed}", make(100, 180, 320, seed=seed)
        yield f"pendulum{seed}", pendulum(seed=seed)
        yield f"walkers{seed}", walkers(seed=seed)
        yield f"leaves{seed}", leaves(seed=seed)
    yield "ball", ball(seed=seeds[0])


def read(named: str) -> Frames:
    """Read a file, or some frames of it, at a small size."""
    name, _, part = named.partition("@")
    first, _, last = part.partition("-")
    path, begin = Path(name), int(first or 0)
    plain = open_clip(path, RATE, 10**12, 10**9).frames
    scale = min(1.0, SIDE / max(plain.shape[1:3]))
    frames = open_clip(path, RATE, 10**12, 10**9, Cut(scale=scale)).frames
    return np.asarray(frames[begin : int(last) if last else begin + MOST_FRAMES])[..., :3]


def faded(clip: Frames, made: ts.volume.Loop) -> Frames:
    """Return the same loop with a cross-fade instead of the surface."""
    jump, depth = made.jumps[0], made.transition
    left, entered = (clip[first : first + depth].astype(float) for first in (jump.leaves, jump.enters))
    share = (np.arange(1, depth + 1) / (depth + 1))[:, np.newaxis, np.newaxis, np.newaxis]
    mixed = np.rint((1 - share) * left + share * entered).astype(np.uint8)
    return np.concatenate([mixed, clip[jump.enters + depth : jump.leaves]])


def strip(made: ts.volume.Loop, fade: Frames) -> Frames:
    """Draw moments of the transition."""
    jump, depth = made.jumps[0], made.transition
    columns = []
    for at in np.unique(np.linspace(0, depth - 1, MOMENTS).round().astype(int)):
        there = made.source[at] == jump.enters + at
        tinted = 0.6 * made.frames[at] + 0.4 * np.where(there[..., np.newaxis], (0, 90, 255), (255, 120, 0))
        columns.append(np.concatenate([made.frames[at], tinted, fade[at]]).astype(np.uint8))
    rows = [np.concatenate(columns[first : first + 4], axis=1) for first in range(0, len(columns), 4)]
    return stacked(rows)


def stacked(rows: list[Frames]) -> Frames:
    """Lay rows below each other."""
    width = max(row.shape[1] for row in rows)
    return np.concatenate([np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0))) for row in rows])


def judged(folder: Path, given: Iterable[tuple[str, Frames]]) -> None:
    """Print the verdict on each loop; write its strip, the loop, its cross-fade, and a sheet of all."""
    rows = []
    for name, clip in given:
        started = time.process_time()
        made = ts.loop(clip)
        spent = time.process_time() - started
        fade = faded(clip, made)
        Image.fromarray(strip(made, fade)).save(folder / f"{name}.png")
        for kind, frames in (("loop", made.frames), ("fade", fade)):
            write_clip(folder / f"{name}_{kind}.mp4", Clip(frames=frames, rate=RATE), force=True)
        moments = np.linspace(0, made.transition - 1, 6).round().astype(int)
        rows += [np.concatenate(list(frames[moments]), axis=1)[::2, ::2] for frames in (made.frames, fade)]
        verdict = made.verdict
        print(
            f"{name:14s} {len(made):4d} of {len(clip):4d} frames, shows {verdict.shows:.2f}: {verdict}"
            f"{', camera moves' if verdict.moved else ''}, {spent:.1f} s",
            flush=True,
        )
        Image.fromarray(stacked(rows)).save(folder / "sheet.png")


def quartered(given: Iterable[tuple[str, Frames]]) -> None:
    """Print how much shows of loops that are seen, and of their quarters alone."""
    for name, clip in given:
        made = ts.loop(clip)
        if made.verdict.unseen:
            continue
        found = []
        for rows, columns in np.ndindex(2, 2):
            still = np.ones(clip.shape[1:3], bool)
            halves = [np.array_split(np.arange(size), 2) for size in still.shape]
            still[np.ix_(halves[0][rows], halves[1][columns])] = False
            part = ts.loop(clip, still=still)
            found.append(f"{part.verdict.shows:.2f} at {len(part)}")
        print(f"{name:14s} {made.verdict.shows:.2f} at {len(made)}; quarters {', '.join(found)}", flush=True)


def measured(folder: Path, count: int, size: tuple[int, int], times: int) -> None:
    """Measure the command on a video, enlarged so many times."""
    flag = clips.flag(count, *size, seed=31)
    frames = (np.repeat(np.repeat(frame, times, axis=0), times, axis=1) for frame in flag)
    source = folder / "large.mp4"
    write_clip(source, Clip(frames=frames, rate=Fraction(30)), force=True)
    command = ["-m", "toposeam_cli", "loop", str(source), "-o", str(folder / "loop.mp4"), "--force"]
    subprocess.run([sys.executable, *command], check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{used.ru_utime + used.ru_stime:.1f} s of processor time, {used.ru_maxrss / 2**20:.2f} GiB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("clips", nargs="*")
    parser.add_argument("--seeds", type=int, nargs="+", default=[31, 32, 33])
    parser.add_argument("--quarters", action="store_true")
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--long", action="store_true")
    options = parser.parse_intermixed_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    print(stamp())
    if options.large:
        measured(options.folder, 150, (270, 480), 4)
    elif options.long:
        measured(options.folder, 1800, (180, 320), 4)
    else:
        named = ((Path(name).stem, read(name)) for name in options.clips)
        given = named if options.clips else drawn(options.seeds)
        quartered(given) if options.quarters else judged(options.folder, given)
