"""Stitch Layers in a real GIMP against the command line on the same pictures: time, memory, start-up of the
engine. ``make bench-gimp``.
"""

import json
import os
import queue
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pyvips

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "gimp"))
from pictures import photograph
from running import Gimp, descendants

import toposeam as ts
from stamp import stamp
from toposeam_gimp.rehearsal import Rehearsal

WIDTH, HEIGHT, OVERLAP = 4000, 3000, 1000


def main():
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    start_up(5)
    previews(5)
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
            times = {"command line": [], "GIMP": []}
            for _ in range(rounds):
                times["command line"].append(command_line(folder, files))
                loaded = gimp.load(
                    files=[str(file) for file in files], offsets=[[0, 0], [WIDTH - OVERLAP, 0]], alpha=False
                )
                with Peak(gimp.process.pid) as peak:
                    started = time.perf_counter()
                    result = gimp.stitch(loaded)
                    times["GIMP"].append(time.perf_counter() - started)
                if result["status"] != "success":
                    raise SystemExit(result["message"])
                gimp.delete(image=loaded["image"])
            for name, values in times.items():
                print(
                    f"  {name:13} {statistics.median(values):6.2f} s   "
                    f"({', '.join(f'{value:.2f}' for value in values)})"
                )
            ratio = statistics.median(
                gimp_ / line for gimp_, line in zip(times["GIMP"], times["command line"], strict=True)
            )
            print(f"  GIMP ÷ command line: {ratio:.2f}   (aim: at most 3)")
            print(
                f"  peak memory of plug-in and engine together: {peak.most / 2**30:.2f} GiB   (aim: at most "
                "2)"
            )
        finally:
            gimp.close()


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
            request = {"protocol": 2, "version": ts.__version__, "operation": "stitch", "layers": layers}
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
    """From asking a warm engine to the picture, two layers of 0.3 megapixels together, against one stitch of
    them in a process that has everything loaded.
    """
    os.environ["TOPOSEAM_PYTHON"] = sys.executable
    base = photograph(300, 800)
    parts = [np.dstack([base[:, x : x + 500], np.full((300, 500), 255, np.uint8)]) for x in (0, 300)]
    layers = [ts.Layer(part[..., :3], at=(x, 0)) for part, x in zip(parts, (0, 300), strict=True)]
    times = {"stitch": [], "preview": []}
    with tempfile.TemporaryDirectory() as scratch:
        rasters = []
        for index, part in enumerate(parts):
            (Path(scratch) / f"{index}.raw").write_bytes(part.tobytes())
            raster = {"file": f"{index}.raw", "width": 500, "height": 300, "channels": 4, "dtype": "uint8"}
            rasters.append({**raster, "name": str(index), "at": [300 * index, 0]})
        found = queue.Queue()
        shown = Rehearsal(found.put)
        ts.stitch(layers)
        for _ in range(rounds):
            shown.warm_up()
            time.sleep(5)
            started = time.perf_counter()
            shown.show({"of": "stitch", "scale": 1.0, "layers": rasters}, {}, Path(scratch))
            found.get(timeout=60)
            times["preview"].append(time.perf_counter() - started)
            started = time.perf_counter()
            ts.stitch(layers)
            times["stitch"].append(time.perf_counter() - started)
        shown.close()
    middle = {name: statistics.median(values) for name, values in times.items()}
    print(
        f"preview: {middle['preview']:.2f} s, {middle['preview'] / middle['stitch']:.2f} × the stitch itself"
    )


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
                try:
                    line = Path(f"/proc/{child}/cmdline").read_bytes()
                    ours = b"toposeam_gimp.py" in line or b"toposeam_engine" in line
                    total += int(Path(f"/proc/{child}/statm").read_text().split()[1]) * page if ours else 0
                except OSError:
                    continue
            self.most = max(self.most, total)


if __name__ == "__main__":
    print(stamp())
    main()
