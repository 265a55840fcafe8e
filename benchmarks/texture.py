"""Texture synthesis against its peers, in one run: ``python benchmarks/texture.py [--seeds 5] [--sheet
sheet.jpg] [--clock -j 2]``.

192 × 192 px samples are grown to 512 × 512 px by TopoSeam (tileable, patches of 40 and 64 px), by G'MIC's
``syntexturize_matchpatch`` and by gimp-texturize (Kwatra's method, tileable) in GIMP 2.10, where they are
installed (Debian: gmic; gimp-texturize, xvfb). All results are measured alike, on gray values from 0 to 255:

time       CPU seconds, all threads; programs with their start, GIMP without it swd8       sliced Wasserstein
distance between the 8 × 8 patches of sample and result; far below the floor means copying wrap       mean
step across the tile border over the 98th percentile of that of inner rows (columns), the worse axis coherence
share of pixels whose right neighbour's best match in the sample is the match's right neighbour; 1 is a
verbatim copy use        how often the most used source pixel shows, over the average (TopoSeam knows where
each pixel came from) jump       99th percentile of the steps across seams, over that of the steps inside the
sample (likewise)

``--clock`` compares times by the clock instead, on an idle machine: the twenty samples of texture_samples.py
grown open, patches of 40 px, by one process and by as many as ``-j`` says, which have everything loaded, by
``toposeam synth -j``, which starts Python and reads and writes files (*command*), and by G'MIC on one thread,
which does so, too; each the best of three, and the median of TopoSeam's over G'MIC's. ``--commands`` compares
processor times of commands, on any machine: with settings tried, with two named, and G'MIC's.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import skimage.data
from numpy.lib.stride_tricks import sliding_window_view
from PIL import Image
from scipy.spatial import cKDTree

import toposeam as ts
from stamp import stamp
from texture_samples import samples

SAMPLES = Path(__file__).resolve().parent.parent / "samples"
SIZE, SOURCE = 512, 192


@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """A result and what it took."""

    image: np.ndarray
    seconds: float
    synthesis: ts.texture.Synthesis | None = None


def main() -> None:
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--seeds", type=int, default=5)
    options.add_argument(
        "--sheet", type=Path, help="write all results side by side, the tile border in the middle"
    )
    options.add_argument(
        "--clock", action="store_true", help="only times by the clock, of one and -j processes"
    )
    options.add_argument(
        "--commands", action="store_true", help="only processor times of commands, settings tried and named"
    )
    options.add_argument("-j", type=int, default=2, metavar="N", help="how many processes")
    options.add_argument("--only", default="", help="names of samples for --clock, with commas between")
    chosen = options.parse_args()
    wanted = chosen.only.split(",") if chosen.only else []
    if chosen.commands:
        commands(wanted)
        return
    if chosen.clock:
        clock(chosen.j, wanted)
        return
    sheet = []
    print(f"{'':10}{'':22}{'time s':>8}{'swd8':>7}{'wrap':>7}{'coher.':>8}{'use':>6}{'jump':>6}")
    for name, sample, floor in exemplars():
        shown = [sample]
        if floor is not None:
            line(name, "another part (floor)", [measure(sample, Made(image=floor, seconds=0.0))])
        for method, run in methods().items():
            rows = []
            for seed in range(chosen.seeds if "toposeam" in method else min(chosen.seeds, 2)):
                made = run(sample, seed)
                if made is None:
                    break
                rows.append(measure(sample, made))
                if seed == 0:
                    shown.append(made.image)
            line(name, method, rows)
        sheet.append(shown)
    if chosen.sheet:
        contact_sheet(sheet).save(chosen.sheet, quality=80, optimize=True)


def exemplars() -> list[tuple[str, np.ndarray, np.ndarray | None]]:
    """Name, sample, and another part of the same photograph."""
    found = []
    for name in ("brick", "grass", "gravel"):
        image = getattr(skimage.data, name)()
        found.append((name, image[:SOURCE, :SOURCE], image[-SOURCE:, -SOURCE:]))
    for name in ("stars", "cobbles"):
        with Image.open(SAMPLES / f"{name}.png") as image:
            found.append((name, np.asarray(image), None))
    return found


def methods() -> dict[str, Callable[[np.ndarray, int], Made | None]]:
    return {
        "toposeam, patch 40": lambda sample, seed: toposeam(sample, seed, 40),
        "toposeam, patch 64": lambda sample, seed: toposeam(sample, seed, 64),
        "gmic matchpatch": gmic,
        "gimp-texturize": texturize,
    }


def toposeam(sample: np.ndarray, seed: int, patch: int, size: int = SIZE) -> Made:
    started = time.process_time()
    made = ts.synthesize(sample, size, patch=patch, seed=seed, tileable=True)
    return Made(image=made.image, seconds=time.process_time() - started, synthesis=made)


def gmic(sample: np.ndarray, seed: int) -> Made | None:
    if shutil.which("gmic") is None:
        return None
    return _program(
        sample,
        lambda given, made: [
            "gmic",
            given,
            "-srand",
            str(seed),
            "-syntexturize_matchpatch",
            f"{SIZE},{SIZE}",
            "-o",
            made,
        ],
    )


def texturize(sample: np.ndarray, seed: int) -> Made | None:
    """GIMP cannot be seeded: runs differ. Its start is measured apart and taken off."""
    if None in (shutil.which("gimp"), shutil.which("xvfb-run")) or not list(
        Path("/usr/lib/gimp/2.0/plug-ins").glob("texturize*")
    ):
        return None

    def script(given: str, made: str) -> list[str]:
        load = f'(image (car (gimp-file-load RUN-NONINTERACTIVE "{given}" "{given}")))'
        layer = "(car (gimp-image-get-active-drawable image))"
        grow = f"(done (gimp-plugin-texturize RUN-NONINTERACTIVE image {layer} {SIZE} {SIZE} 100 1))"
        grow += "(grown (vector-ref (cadr (gimp-image-list)) 0))"
        save = (
            "(gimp-file-save RUN-NONINTERACTIVE grown (car (gimp-image-get-active-drawable grown)) "
            f'"{made}" "{made}")'
        )
        return [*start, "-b", f"(let* ({load} {grow}) {save})", "-b", "(gimp-quit 0)"]

    start = ["xvfb-run", "-a", "gimp", "-i", "-d", "-f"]  # the plug-in wants a display, be it a virtual one
    idle = _program(sample, lambda given, made: [*start, "-b", "(gimp-quit 0)"])
    made = _program(sample, script)
    return (
        None
        if made is None
        else Made(image=made.image, seconds=made.seconds - (idle.seconds if idle else 0.0))
    )


def _program(sample: np.ndarray, command: Callable[[str, str], list[str]]) -> Made | None:
    with tempfile.TemporaryDirectory() as folder:
        given, made = str(Path(folder, "given.png")), str(Path(folder, "made.png"))
        Image.fromarray(sample).save(given)
        environment = dict(os.environ)
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # installed, all has been compiled
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            command(given, made),
            capture_output=True,
            check=False,
            timeout=120,
            env=environment | {"HOME": folder, "OMP_NUM_THREADS": "1"},
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        if not Path(made).exists():
            return Made(image=sample, seconds=seconds) if done.returncode == 0 else None
        with Image.open(made) as image:
            picture = image.convert("L" if sample.ndim == 2 else "RGB")
            return Made(image=np.asarray(picture), seconds=seconds)


def measure(sample: np.ndarray, made: Made) -> tuple[float, ...]:
    exemplar, image = gray(sample), gray(made.image)
    found = [made.seconds, swd8(exemplar, image), wrap(image), coherence(exemplar, image)]
    if made.synthesis is None:
        return (*found, np.nan, np.nan)
    return (*found, most_used(made.synthesis, exemplar.shape), jump(exemplar, image, made.synthesis.labels))


def line(exemplar: str, method: str, rows: list[tuple[float, ...]]) -> None:
    if not rows:
        print(f"{exemplar:10}{method:22}{'not installed':>15}", flush=True)
        return
    formats = ("8.2f", "7.2f", "7.2f", "8.2f", "6.2f", "6.2f")
    values = np.median(np.array(rows), axis=0)
    print(
        f"{exemplar:10}{method:22}"
        + "".join(
            f"{'–':>{width[0]}}" if np.isnan(v) else f"{v:{width}}"
            for v, width in zip(values, formats, strict=True)
        ),
        flush=True,
    )


def gray(image: np.ndarray) -> np.ndarray:
    return image.astype(float) if image.ndim == 2 else image @ np.array([0.299, 0.587, 0.114])


def swd8(exemplar: np.ndarray, image: np.ndarray, side: int = 8, count: int = 6000) -> float:
    directions = np.random.default_rng(2).normal(size=(side**2, 128))
    directions /= np.linalg.norm(directions, axis=0)

    def projected(picture: np.ndarray) -> np.ndarray:
        rng = np.random.default_rng(1)
        row, column = (rng.integers(0, length - side, count) for length in picture.shape)
        return np.sort(
            sliding_window_view(picture, (side, side))[row, column].reshape(count, -1) @ directions, axis=0
        )

    return float(np.abs(projected(exemplar) - projected(image)).mean())


def wrap(image: np.ndarray) -> float:
    ratios = []
    for axis in (0, 1):
        inner = np.abs(np.diff(image, axis=axis)).mean(axis=1 - axis)
        border = np.abs(np.take(image, 0, axis) - np.take(image, -1, axis)).mean()
        ratios.append(border / np.percentile(inner, 98))
    return max(ratios)


def coherence(exemplar: np.ndarray, image: np.ndarray, side: int = 7) -> float:
    """On the lower right part of the sample's size; windows compared by their first twelve principal
    components.
    """
    windows = sliding_window_view(exemplar, (side, side))
    flat = windows.reshape(-1, side**2)
    mean = flat.mean(axis=0)
    basis = np.linalg.svd((flat - mean)[::side], full_matrices=False)[2][:12].T
    wanted = sliding_window_view(image[-SOURCE:, -SOURCE:], (side, side))
    _, match = cKDTree((flat - mean) @ basis).query((wanted.reshape(-1, side**2) - mean) @ basis)
    row, column = np.divmod(match.reshape(wanted.shape[:2]), windows.shape[1])
    return float(((np.diff(column, axis=1) == 1) & (np.diff(row, axis=1) == 0)).mean())


def most_used(made: ts.texture.Synthesis, shape: tuple[int, ...]) -> float:
    use = np.bincount(
        (made.source[..., 0] * shape[1] + made.source[..., 1]).ravel(), minlength=shape[0] * shape[1]
    )
    return float(use.max() / use.mean())


def jump(exemplar: np.ndarray, image: np.ndarray, labels: np.ndarray) -> float:
    inner, across = [], []
    for axis in (0, 1):
        inner.append(np.abs(np.diff(exemplar, axis=axis)).ravel())
        across.append(np.abs(np.diff(image, axis=axis))[np.diff(labels, axis=axis) != 0])
    return float(np.percentile(np.concatenate(across), 99) / np.percentile(np.concatenate(inner), 99))


def contact_sheet(rows: list[list[np.ndarray]], side: int = 260, gap: int = 6) -> Image.Image:
    """Sample and results in rows; results are shifted by half, so that the tile border runs through their
    middle.
    """
    scale = side / SIZE
    first = round(SOURCE * scale) + 2 * gap
    sheet = Image.new(
        "RGB", (first + (max(map(len, rows)) - 1) * (side + gap), gap + len(rows) * (side + gap)), "white"
    )
    for row, images in enumerate(rows):
        for column, image in enumerate(images):
            shifted = (
                image if column == 0 else np.roll(image, (image.shape[0] // 2, image.shape[1] // 2), (0, 1))
            )
            picture = Image.fromarray(np.ascontiguousarray(shifted)).convert("RGB")
            small = picture.resize(
                (round(picture.width * scale), round(picture.height * scale)), Image.Resampling.LANCZOS
            )
            sheet.paste(
                small, (gap if column == 0 else first + (column - 1) * (side + gap), gap + row * (side + gap))
            )
    return sheet


def clock(processes: int, wanted: list[str]) -> None:
    """Seconds by the clock of the twenty samples."""
    ours = ["-j 1", f"-j {processes}", "command"]
    print(f"{'':14}" + "".join(f"{way:>9}" for way in [*ours, "gmic", *(f"{way} ÷" for way in ours)]))
    ratios = []
    for sample in samples():
        if wanted and sample.name not in wanted:
            continue

        def grown(count: int, image: np.ndarray = sample.image) -> object:
            return ts.synthesize(image, SIZE, patch=40, seed=1, processes=count)

        ways: list[Callable[[], object]] = [
            lambda: grown(1),
            lambda: grown(processes),
            lambda image=sample.image: command(image, processes),
            lambda image=sample.image: gmic(image, 1),
        ]
        found = [min(_clocked(way) for _ in range(3)) for way in ways]
        ratios.append(np.divide(found[:-1], found[-1]))
        print(f"{sample.name:14}" + "".join(f"{value:9.2f}" for value in [*found, *ratios[-1]]), flush=True)
    print(f"{'median':50}" + "".join(f"{ratio:9.2f}" for ratio in np.median(ratios, axis=0)))


def commands(wanted: list[str]) -> None:
    """Processor seconds of commands on the twenty samples, over G'MIC's."""
    ways = ["", "--setting varied", "--setting coarse-mixed"]
    print(f"{'':14}" + "".join(f"{way or 'tried':>24}" for way in ways) + f"{'gmic':>9}")
    ratios = []
    for sample in samples():
        if wanted and sample.name not in wanted:
            continue
        made = [*(command(sample.image, 1, way) for way in ways), gmic(sample.image, 1)]
        found = [np.nan if one is None else one.seconds for one in made]
        ratios.append(np.divide(found[:-1], found[-1]))
        print(
            f"{sample.name:14}" + "".join(f"{value:24.2f}" for value in found[:-1]) + f"{found[-1]:9.2f}",
            flush=True,
        )
    print(f"{'median ÷':14}" + "".join(f"{ratio:24.2f}" for ratio in np.median(ratios, axis=0)))


def command(sample: np.ndarray, processes: int, choice: str = "--patch 40") -> Made | None:
    """``toposeam synth``, with its start."""
    options = f"--size {SIZE} {choice} --seed 1 -j {processes} --quiet".split()
    return _program(
        sample,
        lambda given, made: [sys.executable, "-m", "toposeam_cli", "synth", given, *options, "-o", made],
    )


def _clocked(way: Callable[[], object]) -> float:
    started = time.perf_counter()
    way()
    return time.perf_counter() - started


if __name__ == "__main__":
    print(stamp())
    main()
