"""Stitch Layers in a real GIMP against the command line on the same pictures: time, memory, start-up of the
engine; strokes and Re-stitch, Heal Selection, and the dialogs' previews.
``make bench-gimp``; ``python benchmarks/gimp.py previews`` needs no GIMP.
"""

import dataclasses
import json
import os
import queue
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyvips

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "gimp"))
from pictures import photograph
from processes import descendants
from running import Gimp

import toposeam as ts
from stamp import stamp
from toposeam_engine.job import EngineJob
from toposeam_engine.previews import preview
from toposeam_engine.serving import PROTOCOL
from toposeam_gimp.dialogs.rehearsal import Rehearsal
from toposeam_gimp.entries.table import PROCEDURES

WIDTH, HEIGHT, OVERLAP = 4000, 3000, 1000


def main():
    if sys.argv[1:] == ["previews"]:
        previews(3)
        return
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    start_up(5)
    previews(3)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        files = pictures(folder)
        (folder / "gimp").mkdir()
        gimp = Gimp(folder / "gimp")
        try:
            print(
                f"two layers of {WIDTH} × {HEIGHT} px, {OVERLAP} px of overlap, 8 bits RGB; GIMP "
                f"{gimp.version()}"
            )
            times, most = {"command line": [], "GIMP": []}, 0
            for _ in range(rounds):
                times["command line"].append(command_line(folder, files))
                loaded = gimp.load(
                    files=[str(file) for file in files], offsets=[[0, 0], [WIDTH - OVERLAP, 0]], alpha=False
                )
                with Peak(gimp.process.pid) as peak:
                    started = time.perf_counter()
                    result = gimp.stitch(loaded)
                    times["GIMP"].append(time.perf_counter() - started)
                check(result)
                most = max(most, peak.most)
                gimp.delete(image=loaded["image"])
            for name, values in times.items():
                print(
                    f"  {name:13} {statistics.median(values):6.2f} s   "
                    f"({', '.join(f'{value:.2f}' for value in values)})"
                )
            ratio = statistics.median(
                gimp_ / line for gimp_, line in zip(times["GIMP"], times["command line"], strict=True)
            )
            print(f"  GIMP ÷ command line: {ratio:.2f}   (aim: at most 1.2)")
            print(f"  peak memory of plug-in and engine together: {most >> 20} MiB   (aim: at most 500)")
            for blend in ("none", "multiband"):
                strokes(gimp, files, blend)
            fill(gimp, files[0])
        finally:
            gimp.close()


def check(result):
    if result["status"] != "success":
        raise SystemExit(result["message"])


def strokes(gimp, files, blend):
    """From Re-stitch to the new border, for strokes here and there that want the other layer."""
    offsets = [[0, 0], [WIDTH - OVERLAP, 0]]
    loaded = gimp.load(files=[str(file) for file in files], offsets=offsets, alpha=False)
    group = gimp.stitch(loaded, {"blend": blend})
    check(group)
    for number in range(4):
        hints = gimp.run(procedure="plug-in-toposeam-hints", image=loaded["image"], layers=[group["layer"]])
        check(hints)
        place = [3300 + 60 * number, 600 * number + 300]
        gimp.python(code=STROKE, image=loaded["image"], layer=hints["layer"], at=place)
        started, worked = time.perf_counter(), processor_s(gimp.process.pid)
        check(gimp.run(procedure="plug-in-toposeam-restitch", image=loaded["image"], layers=[hints["layer"]]))
        wall = time.perf_counter() - started
        time.sleep(1)  # until GIMP has seen the end of the plug-in
        work = processor_s(gimp.process.pid) - worked
        about = f"{blend}: stroke {number + 1}, of 120 × 200 px, and Re-stitch"
        print(f"  {about}: {wall:.2f} s by the clock, {work:.2f} s of the processor   (aim: 1)", flush=True)
    gimp.delete(image=loaded["image"])


def processor_s(gimp):
    """The processor time of a GIMP, its plug-ins that have ended, and the engine that is kept for it."""
    kept = [b"--listen", str(gimp).encode()]
    ticks = 0
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has just ended
            words = (place / "cmdline").read_bytes().split(b"\0")
            if place.name == str(gimp) or (kept[0] in words and kept[1] in words):
                ticks += sum(map(int, (place / "stat").read_text().rpartition(")")[2].split()[11:15]))
    return ticks / os.sysconf("SC_CLK_TCK")


#: Paints with the colours of both layers, side by side: one of them is not obeyed yet.
STROKE = """
for colour, left in (("#336cde", at[0]), ("#f08c14", at[0] - 200)):
    Gimp.context_set_foreground(Gegl.Color.new(colour))
    image_of(image).select_ellipse(Gimp.ChannelOps.REPLACE, left, at[1], 120, 200)
    item(layer).edit_fill(Gimp.FillType.FOREGROUND)
Gimp.Selection.none(image_of(image))
"""


def fill(gimp, file):
    """420 × 820 px of a large layer, filled."""
    loaded = gimp.load(files=[str(file)], alpha=False)
    gimp.python(code=HOLE, image=loaded["image"])
    with Peak(gimp.process.pid) as peak:
        started = time.perf_counter()
        check(gimp.run(procedure="plug-in-toposeam-fill", **loaded))
        wall = time.perf_counter() - started
    print(
        f"420 × 820 px of {WIDTH} × {HEIGHT} filled: {wall:.1f} s   (aim: at most 10)\n"
        f"  peak memory of plug-in and engine together: {peak.most >> 20} MiB   (aim: at most 600)"
    )


HOLE = "image_of(image).select_rectangle(Gimp.ChannelOps.REPLACE, 1500, 1000, 420, 820)"


def pictures(folder):
    """Two crops of one large picture, with noise of their own."""
    rng = np.random.default_rng(1)
    base = np.kron(photograph(HEIGHT // 4, (2 * WIDTH - OVERLAP) // 4), np.ones((4, 4, 1), np.uint8)).astype(
        np.int16
    )
    files = []
    for index, left in enumerate((0, WIDTH - OVERLAP)):
        noisy = base[:, left : left + WIDTH] + rng.integers(-12, 13, (HEIGHT, WIDTH, 3), np.int16)
        files.append(folder / f"{index}.png")
        pyvips.Image.new_from_array(np.clip(noisy, 0, 255).astype(np.uint8)).write_to_file(
            str(files[-1]), compression=1
        )
    return files


def command_line(folder, files):
    started = time.perf_counter()
    command = [
        sys.executable,
        "-m",
        "toposeam_cli",
        "stitch",
        *map(str, files),
        "--offset",
        f"{WIDTH - OVERLAP},0",
        "--force",
        "-q",
    ]
    subprocess.run([*command, "-o", str(folder / "joined.png")], check=True)
    return time.perf_counter() - started


def start_up(rounds):
    """From starting the engine to its answer for two tiny layers, against loading the libraries."""
    times = {"numpy, scipy.linalg": [], "engine": []}
    for _ in range(rounds):
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", "import numpy, scipy.linalg"], check=True)
        times["numpy, scipy.linalg"].append(time.perf_counter() - started)
        with tempfile.TemporaryDirectory() as scratch:
            raster = {"width": 8, "height": 8, "channels": 2, "dtype": "uint8", "file": "a.raw", "name": "a"}
            (Path(scratch) / "a.raw").write_bytes(bytes([90, 255] * 64))
            layers = [{**raster, "at": [x, 0]} for x in (0, 4)]
            request = {
                "protocol": PROTOCOL,
                "version": ts.__version__,
                "operation": "stitch",
                "layers": layers,
            }
            (Path(scratch) / "toposeam-request").write_text("nonce")
            (Path(scratch) / "request.json").write_text(json.dumps(request))
            started = time.perf_counter()
            command = [sys.executable, "-P", "-m", "toposeam_engine", scratch]
            subprocess.run(command, check=True, stdin=open_pipe(), stdout=subprocess.DEVNULL)
            times["engine"].append(time.perf_counter() - started)
    ratio = statistics.median(times["engine"]) / statistics.median(times["numpy, scipy.linalg"])
    print(
        f"start-up of the engine, a tiny seam included, ÷ import numpy, scipy.linalg: {ratio:.2f}   (aim: at "
        "most 3)"
    )


def previews(rounds):
    """What each dialog shows after an option was changed, at the sizes that the plug-in sends: seconds of the
    processor from the request to the picture, and by the clock, the plug-in's rest of 0.15 s included.
    """
    os.environ["TOPOSEAM_PYTHON"] = sys.executable
    found = queue.Queue()
    print("preview               megapixels   processor, s   clock, s   (aim: at most 1)")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, scene, options in scenes(folder):
            request = {"operation": "preview", **scene, "options": options}
            job = EngineJob(folder=folder, request=request, progress=lambda share: None)
            raster = preview(job)["picture"]
            started = time.process_time()
            preview(dataclasses.replace(job, _written=[]))
            worked, times = time.process_time() - started, []
            shown = Rehearsal(found.put, scene["of"])
            for _ in range(rounds + 1):  # the first is what the dialog opens with
                started = time.perf_counter()
                shown.show(scene, options, folder)
                answer = found.get(timeout=120)
                times.append(time.perf_counter() - started + 0.15)
                if isinstance(answer, str):
                    raise SystemExit(answer)
                time.sleep(2)  # the engine that waits for a change starts meanwhile
            shown.close()
            times = times[1:]
            size = raster["width"] * raster["height"] / 1e6
            print(f"{name:20}  {size:10.2f}   {worked:12.2f}   {statistics.median(times):8.2f}", flush=True)


def scenes(folder):
    """What the plug-in asks for when a dialog opens, and after some changes."""
    whole = photograph(400, 620, seed=2)

    def raster(name, pixels, at=(0, 0)):
        if pixels.ndim == 3:
            pixels = np.dstack([pixels, np.full(pixels.shape[:2], 255, np.uint8)])
        (folder / f"{name}.raw").write_bytes(np.ascontiguousarray(pixels).tobytes())
        size = {"width": pixels.shape[1], "height": pixels.shape[0]}
        channels = 1 if pixels.ndim == 2 else pixels.shape[2]
        return {"file": f"{name}.raw", "name": name, "at": at, **size, "channels": channels, "dtype": "uint8"}

    def options(procedure, **changed):
        table = PROCEDURES[f"plug-in-toposeam-{procedure}"].options
        usual = {one.name.replace("-", "_"): one.default for one in table if one.engine}
        return {**usual, **changed}

    pair = [raster("left", whole[:, :380]), raster("right", whole[:, 240:], (240, 0))]
    small = [raster("a", whole[:190, :190]), raster("b", whole[:190, 110:380], (9, 9))]
    stitch = {"of": "stitch", "scale": 0.5, "layers": pair, "selection": None}
    for blend in ("none", "feather", "soft", "multiband", "gradient"):
        yield f"stitch, {blend}", stitch, options("stitch", blend=blend)
    yield "stitch, aligned", stitch, options("stitch", places="near")
    yield "stitch, places found", {**stitch, "layers": small}, options("stitch", places="anywhere")
    hole = np.zeros((179, 179), np.uint8)
    hole[70:130, 80:120] = 255
    y, x = np.ogrid[:400, :620]
    round_ = np.where(np.hypot(y - 200, x - 300) < 120, 255, 0).astype(np.uint8)[80:320, 180:420]
    patch = [raster("below", whole), raster("patch", whole[80:320, 185:425], (180, 80))]
    selected = raster("round", round_, (180, 80))
    yield "patch", {"of": "patch", "scale": 0.5, "layers": patch, "selection": selected}, options("patch")
    layer = {"scale": 0.5, "layer": raster("layer", whole[:179, :179]), "selection": None}
    sample = {"of": "synthesize", **layer, "scale": 1.0, "layer": raster("sample", whole[:224, :224])}
    yield "synthesize", sample, options("synthesize", width=179, height=179)
    yield (
        "tile",
        {"of": "make_tileable", **layer, "layer": raster("tile", whole[:283, :283])},
        options("tile"),
    )
    fill = {"of": "fill", **layer, "selection": raster("hole", hole), "source": None}
    yield "fill", fill, options("fill")
    yield "fill, around", fill, options("fill", **{"from": "around"})
    for rule in ("translate", "p4m", "p6m"):
        yield f"motif, {rule}", {"of": "motif", "scale": 1.0, "layer": None}, options("motif", repeat=rule)
    inks = [raster(f"ink-{index}", whole[:64, :64, index].copy()) for index in range(3)]
    clip = [raster(f"frame-{index}", whole[index : index + 80, index : index + 104]) for index in range(18)]
    yield "loop", {"of": "loop", "scale": 1.0, "layers": clip}, options("loop", level=True)
    colours = {"inks": ["#24376b", "#c4583a", "#d98816"], "paper": "#f6f3ea"}
    pattern = {"of": "repeat", "scale": 1.0, "densities": inks, "repeat": "reflect", **colours}
    yield "repeat", pattern, options("repeat")


def open_pipe():
    """A stdin that stays open after the request's nonce, as the plug-in's does."""
    read, write = os.pipe()
    os.write(write, b"nonce\n")
    return read


class Peak:
    """The most memory that GIMP's children, plug-in and engine, held together, private and shared pages of
    files included, sampled every 50 ms.
    """

    def __init__(self, process):
        self.most, self._process, self._stop = 0, process, threading.Event()

    def __enter__(self):
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join()

    def _watch(self):
        page = os.sysconf("SC_PAGESIZE")
        while not self._stop.wait(0.05):
            total = 0
            for child in descendants(self._process):
                if b"toposeam_gimp.py" in child.command or b"toposeam_engine" in child.command:
                    with suppress(OSError):  # it has just ended
                        total += int(Path(f"/proc/{child.number}/statm").read_text().split()[1]) * page
            self.most = max(self.most, total)


if __name__ == "__main__":
    print(stamp())
    main()
