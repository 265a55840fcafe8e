"""Whole stitches that a change of how stitching is organised must not change: what they cost, the pictures,
the keys of ``--json``, and how much memory they take.

They go through what users call only: the command line, ``ts.stitch``, ``ts.layers.restitch``, and the engine
of GIMP. ``python tests/golden_plans.py --write`` stores what this version makes, in ``golden_plans/``;
``--write-keys`` the keys of the JSON alone. Names of jobs may follow: only these are stored, then.
"""

from __future__ import annotations

import io
import json
import math
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tifffile
from PIL import Image
from scipy import ndimage
from skimage import data

import toposeam as ts

TESTS = Path(__file__).parent
STORED = TESTS / "golden_plans"
PLANS, KEYS = STORED / "plans.json", STORED / "keys.json"

#: The command, with pictures of any size in files where the first word says so; in ``peak`` what memory it
#: took, kB, which only Linux tells of a process alone.
COMMAND = """
import sys
from pathlib import Path
from toposeam_cli.app.main import main
from toposeam_cli.stitching import inputs
if sys.argv.pop(1) == "files":
    assert inputs.STORED_PIXELS > 0, "pictures would not wait in files if this were elsewhere"
    inputs.STORED_PIXELS = 0
try:
    main()
finally:
    status = Path("/proc/self/status")
    if status.exists():
        (line,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        Path("peak").write_text(line.split()[1])
"""
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "VIPS_CONCURRENCY": "1"}

#: Width of the scene that goes round, px.
PERIOD = 300
#: Of large pictures every tenth pixel of every tenth row is stored.
EVERY = 10


@dataclass(frozen=True)
class Made:
    """What a job makes."""

    picture: np.ndarray
    cost: float | None = None
    keys: list[str] = field(default_factory=list)
    peak_mb: float | None = None


@dataclass(frozen=True)
class Job:
    make: Callable[[Path], Made]
    #: Another job, whose picture it must make.
    like: str | None = None
    slow: bool = False
    #: A package without which it is not done.
    needs: str | None = None


def seen(x: int, y: int, width: int, height: int, number: int, bend: float = 2.5) -> np.ndarray:
    """What picture `number` shows of the coffee: a little darker or brighter from left to right, and shifted
    row by row, as what stands near is when the camera moves.
    """
    rows, columns = np.mgrid[y : y + height, x : x + width]
    columns = columns + np.rint(bend * np.sin(rows / 17 + 2 * number)).astype(int)
    tone = 1 + 0.05 * np.sin(columns / 90 + number)
    return toned(data.coffee()[rows, columns], tone)


def toned(pixels: np.ndarray, tone: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(pixels * tone[..., None], 0, 255)).astype(np.uint8)


#: x, y, width and height of three pictures in the coffee; all three overlap in the middle.
PLACES = ((110, 60, 190, 130), (230, 72, 190, 130), (170, 130, 190, 110))
#: Where they lie on the canvas.
AT = tuple((x - 110, y - 60) for x, y, _, _ in PLACES)
THREE = ("a.png", "b.png", "c.png")
PLACED = (*THREE, *(word for x, y in AT for word in ("--at", f"{x},{y}")))


def three_pictures() -> list[np.ndarray]:
    return [seen(*place, number) for number, place in enumerate(PLACES)]


def write_three(folder: Path) -> None:
    for name, pixels in zip(THREE, three_pictures(), strict=True):
        Image.fromarray(pixels).save(folder / name)


def three_layers() -> list[ts.Layer]:
    names_at = zip(three_pictures(), AT, THREE, strict=True)
    return [ts.Layer(pixels, at=at, name=name) for pixels, at, name in names_at]


def round_views() -> Iterator[tuple[int, np.ndarray]]:
    """First columns and pixels of five views of a scene whose right edge goes on at its left: everywhere two
    or three of them lie beside each other.
    """
    half = data.coffee()[150:250, 200 : 200 + PERIOD // 2]
    scene = np.hstack([half, half[:, ::-1]])
    for number in range(5):
        x, width = 60 * number + 10, 140
        rows, columns = np.mgrid[:100, x : x + width]
        shift = np.rint(2 * np.sin(rows / 30 + 2 * number)).astype(int)
        tone = 1 + 0.05 * np.sin(columns / 60 + number)
        yield x, toned(scene[rows, (columns + shift) % PERIOD], tone)


def write_views(folder: Path) -> list[str]:
    """The views as nona writes them: with the place of each in its tags, and those across the edge as wide as
    the canvas, both ends in it.
    """
    names = []
    for x, view in round_views():
        height, width = view.shape[:2]
        across = x + width > PERIOD
        rgba = np.zeros((height, PERIOD if across else width, 4), np.uint8)
        columns = (np.arange(width) + x) % PERIOD if across else np.arange(width)
        rgba[:, columns, :3], rgba[:, columns, 3] = view, 255
        names.append(f"view{len(names)}.tif")
        tags = [(286, 5, 1, (0 if across else x, 150), True), (287, 5, 1, (20, 150), True)]
        tags += [(33300, 4, 1, PERIOD, True), (33301, 4, 1, 150, True)]
        options = {"resolution": (150, 150), "resolutionunit": "INCH", "metadata": None, "extratags": tags}
        tifffile.imwrite(folder / names[-1], rgba, photometric="rgb", extrasamples=["unassalpha"], **options)
    return names


def ran(folder: Path, *words: Any, in_files: bool = False) -> tuple[str, float | None]:
    """What the command printed, and the most memory it took, MB, where that is known."""
    command = [sys.executable, "-c", COMMAND, "files" if in_files else "memory", *map(str, words)]
    options: dict[str, Any] = {"cwd": folder, "env": os.environ | ONE_THREAD, "capture_output": True}
    done = subprocess.run(command, text=True, check=False, **options)
    assert done.returncode == 0, done.stderr
    peak = folder / "peak"
    return done.stdout, int(peak.read_text()) / 1000 if peak.exists() else None


def keys_of(told: dict[str, Any], parent: str = "") -> Iterator[str]:
    """All keys, those of items with the key of their list before them."""
    for key, value in told.items():
        yield parent + key
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, dict):
                yield from keys_of(item, f"{parent}{key}.")


def pixels_of(file: Any) -> np.ndarray:
    with Image.open(file) as image:
        return np.asarray(image)


def stitched(folder: Path, *words: Any, output: str = "out.png", in_files: bool = False) -> Made:
    """What ``toposeam stitch`` makes of files in a folder."""
    said, peak = ran(folder, "stitch", *words, "-o", output, "--json", in_files=in_files)
    told = json.loads(said)
    picture = layers_of(folder / output) if output.endswith(".ora") else pixels_of(folder / output)
    return Made(picture, told["cost"], sorted(set(keys_of(told))), peak)


def layers_of(path: Path) -> np.ndarray:
    """The merged picture of an OpenRaster file, and to its right where each of its layers shows."""
    with zipfile.ZipFile(path) as archive:

        def read(name: str) -> np.ndarray:
            return pixels_of(io.BytesIO(archive.read(name)))

        merged = read("mergedimage.png")
        stack = archive.read("stack.xml").decode()
        parts = [merged]
        for name, x, y in re.findall(r'src="(\S+-shown.png)" x="(\d+)" y="(\d+)"', stack):
            alpha = read(name)[..., 3]
            shown = np.zeros_like(merged)
            shown[int(y) : int(y) + alpha.shape[0], int(x) : int(x) + alpha.shape[1]] = alpha[..., None]
            parts.append(shown)
    return np.hstack(parts)


def two(folder: Path) -> Made:
    write_three(folder)
    return stitched(folder, *THREE[:2], "--offset", f"{AT[1][0]},{AT[1][1]}")


def three(folder: Path, *words: Any, **options: Any) -> Made:
    write_three(folder)
    return stitched(folder, *PLACED, *words, **options)


def give(folder: Path) -> Made:
    """Two pictures whose seam what stood near the camera crosses."""
    for number, name in enumerate(THREE[:2]):
        Image.fromarray(seen(110 + 100 * number, 60 + 6 * number, 220, 160, number)).save(folder / name)
    options = ("--offset", "100,6", "--give", "6", "--blend", "multiband")
    return stitched(folder, *THREE[:2], *options)


def three_in_python(_: Path) -> Made:
    made = ts.stitch(three_layers())
    return Made(with_alpha(made), made.cost)


def with_alpha(made: ts.layers.Composition) -> np.ndarray:
    return made.image if made.alpha is None else np.dstack([made.image, made.alpha])


def thirty(folder: Path) -> Made:
    names = [f"{number:02}.png" for number in range(30)]
    for number, name in enumerate(names):
        row, column = divmod(number, 6)
        part = seen(40 + 60 * column, 30 + 48 * row, 80, 64, number, bend=1.6)
        Image.fromarray(part).save(folder / name)
    return stitched(folder, *names, "--grid", "6x5", "--overlap", "25%")


def whole_turn(folder: Path, blend: str, *words: str) -> Made:
    return stitched(folder, *write_views(folder), "--wrap", PERIOD, "--blend", blend, *words)


def enblended(folder: Path) -> Made:
    names = write_views(folder)
    _, peak = ran(folder, "enblend", "--wrap=horizontal", f"-f{PERIOD}x150", "-o", "out.tif", *names)
    return Made(pixels_of(folder / "out.tif"), peak_mb=peak)


#: How far the seam of the first two pictures is bent at its middle, px.
BEND = 9


def bent(drawing: ts.vector.SvgSeam) -> ts.vector.SvgSeam:
    """The seam between the first two pictures, bent to the right; its ends stay."""
    (points,) = (
        line.points
        for line, name in zip(drawing.polylines, drawing.names, strict=True)
        if name.startswith("a.png : b.png")
    )
    along = np.linspace(0, math.pi, len(points))
    moved = points + np.stack([np.rint(BEND * np.sin(along)), np.zeros(len(points))], axis=1)
    line = ts.vector.Polyline([tuple(point) for point in moved])
    return ts.vector.SvgSeam((line,), drawing.width, drawing.height, None, ("bent",))


def by_path(folder: Path) -> Made:
    """A seam that was written, bent and given back."""
    three(folder, "--seam", "found.svg")
    drawing = bent(ts.vector.read_svg(folder / "found.svg"))
    (line,) = drawing.polylines
    steps = " ".join(f"{x:g},{y:g}" for x, y in line.points)
    (folder / "bent.svg").write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{drawing.width:g}" height="{drawing.height:g}">'
        f'<path fill="none" d="M{steps}"/></svg>'
    )
    return stitched(folder, *PLACED, "--use-seam", "0:1=bent.svg", "--force")


def by_path_in_python(_: Path) -> Made:
    layers = three_layers()
    found = ts.stitch(layers)
    paths = {(0, 1): bent(ts.vector.read_svg(found.to_svg()))}
    made = ts.layers.restitch(layers, found.masks, paths, blend="feather", blend_width=8)
    return Made(with_alpha(made), made.cost)


#: x, y, width and height of two wide pictures in the coffee, of which strokes open a part only.
WIDE = ((30, 120, 530, 110), (50, 160, 530, 110))


def by_stroke(folder: Path) -> Made:
    """What GIMP shows after a stroke for each of two layers that a straight line divides: near its left end
    the seam is found anew, and stays straight elsewhere.
    """
    from engine_requests import Request, points_of, result_of

    parts = [seen(*place, number) for number, place in enumerate(WIDE)]
    places = [(x - WIDE[0][0], y - WIDE[0][1]) for x, y, _, _ in WIDE]
    layers = [ts.Layer(part, at=at) for part, at in zip(parts, places, strict=True)]
    on_canvas = [
        np.s_[y : y + height, x : x + width]
        for (x, y), (height, width) in zip(places, (part.shape[:2] for part in parts), strict=True)
    ]
    shape = ts.layers.common_canvas(layers).shape
    upper = np.full(parts[1].shape[:2], 255, np.uint8)
    upper[:35, : WIDE[0][2] - places[1][0]] = 0
    opaque = [np.dstack([part, np.full(part.shape[:2], 255, np.uint8)]) for part in parts]
    strokes = np.zeros((66, 60, 4), np.uint8)
    strokes[8:14, :20], strokes[50:58, 35:] = (255, 0, 0, 255), (0, 0, 255, 255)
    request = Request(folder / "request")
    try:
        result = result_of(
            request.ask_process(
                operation="restitch",
                layers=[
                    request.raster(f"layer{number}", pixels, places[number])
                    for number, pixels in enumerate(opaque)
                ],
                shown=[None, request.raster("shown", upper)],
                hints=request.raster("hints", strokes, (40, 42)),
                colours=[[0, 0, 255], [255, 0, 0]],
                seams=[],
                options={"blend": "feather", "blend_width": 8},
            )
        )
    finally:
        request.close()
    shows = request.seen(result["masks"], on_canvas, shape)
    picture = np.zeros((*shape, 4), np.uint8)
    for number, place in enumerate(on_canvas):
        np.copyto(picture[place], opaque[number], where=(shows[place] == number)[..., None])
    (x, y), over = result["blended"]["at"], request.pixels(result["blended"])
    part = picture[y : y + over.shape[0], x : x + over.shape[1]]
    np.copyto(part, over, where=over[..., 3:] > 0)
    (seam,) = result["seams"]
    lines = tuple(ts.vector.Polyline(points_of(line), line["closed"]) for line in seam["lines"])
    drawing = ts.vector.SvgSeam(lines, shape[1], shape[0], None, ("seam",) * len(lines))
    cost = ts.layers.restitch(layers, [shows == 0, shows == 1], {(0, 1): drawing}).cost
    return Made(picture, cost, sorted(set(keys_of(result))))


def large(folder: Path, *words: Any, in_files: bool) -> Made:
    """Four large pictures, two by two, on a canvas of several windows."""
    names = [f"{number}.tif" for number in range(4)]
    at: list[str] = []
    for number, name in enumerate(names):
        x, y = 170 * (number % 2), 125 * (number // 2)
        small = seen(60 + x, 40 + y, 230, 175, number)
        tifffile.imwrite(folder / name, ndimage.zoom(small, (6, 6, 1), order=1))
        at += ["--at", f"{6 * x},{6 * y}"]
    options = ("--match-tones", "--blend", "multiband", *words)
    made = stitched(folder, *names, *at, *options, output="out.tif", in_files=in_files)
    return Made(np.ascontiguousarray(made.picture[::EVERY, ::EVERY]), made.cost, made.keys, made.peak_mb)


def found(folder: Path) -> Made:
    samples = TESTS.parent / "samples"
    names = samples / "portrait_left.jpg", samples / "portrait_right.jpg"
    made = stitched(folder, *names, "--crop", "inside")
    return Made(np.ascontiguousarray(made.picture[::2, ::2]), made.cost, made.keys, made.peak_mb)


JOBS = {
    "two": Job(two),
    "three": Job(three),
    "three in Python": Job(three_in_python, like="three"),
    "thirty": Job(thirty),
    "round": Job(lambda folder: whole_turn(folder, "none")),
    "round and soft": Job(lambda folder: whole_turn(folder, "soft")),
    "round and give": Job(lambda folder: whole_turn(folder, "none", "--give", "6")),
    "give": Job(give),
    "path": Job(by_path),
    "path in Python": Job(by_path_in_python),
    "stroke": Job(by_stroke),
    "OpenRaster": Job(lambda folder: three(folder, "--match-tones", output="out.ora")),
    "large": Job(lambda folder: large(folder, in_files=False), slow=True),
    "windows": Job(lambda folder: large(folder, "-j", "1", in_files=True), like="large", slow=True),
    "Dask": Job(
        lambda folder: large(folder, "-j", "2", "--dask", "local", in_files=True),
        like="large",
        slow=True,
        needs="distributed",
    ),
    "enblend": Job(enblended),
    "found": Job(found),
}


def picture_of(name: str) -> Path:
    return STORED / f"{(JOBS[name].like or name).replace(' ', '_')}.png"


def write(names: list[str], *, only_keys: bool) -> None:
    """Store what this version makes."""
    STORED.mkdir(exist_ok=True)
    plans, keys = (json.loads(path.read_text()) if path.exists() else {} for path in (PLANS, KEYS))
    for name in names:
        with TemporaryDirectory() as folder:
            made = JOBS[name].make(Path(folder))
        keys[name] = made.keys
        plans[name] = {"cost": made.cost, "peak_mb": made.peak_mb and round(made.peak_mb)}
        if not (only_keys or JOBS[name].like):
            Image.fromarray(made.picture).save(picture_of(name), optimize=True)
    for path, values in ((KEYS, keys), (PLANS, plans)):
        if path == KEYS or not only_keys:
            values = {name: values[name] for name in JOBS if name in values}
            path.write_text(json.dumps(values, indent=1) + "\n")


if __name__ == "__main__":
    sys.path.append(str(TESTS / "cli"))
    chosen = [word for word in sys.argv[1:] if not word.startswith("--")]
    if {"--write", "--write-keys"} & set(sys.argv):
        write(chosen or list(JOBS), only_keys="--write" not in sys.argv)
