"""One picture made by one and two processes (``-j``), and by one and two Dask workers, in one run: time by
the clock and of the processors, what is sent, memory per worker; and from these what 1,000 frames cost.

    python benchmarks/workers.py                     12 frames of 16.5 megapixels (about five minutes)
    python benchmarks/workers.py --keep FOLDER       leave the frames there, or take those that are there
    python benchmarks/workers.py --only workers --times 2    the Dask workers, the best of two runs each
    python benchmarks/workers.py --own-cores         the Dask workers, each process with a core of its own
    python benchmarks/workers.py --watched           with workers that watch themselves, as Dask has it
    python benchmarks/workers.py --write             put the tables into docs/distributed.md

The frames are those of ``mosaic.py``: 4 × 3 of 5000 × 3300 px that overlap by 30 %, tones matched, blended by
multiband, written as an uncompressed TIFF of 123 megapixels. Scheduler and workers are started before the
clock and talk without TLS; each worker is a process with one thread. All of them share this machine with the
command itself: on two cores two workers have no core for themselves, so that processor time is told, too.
With ``--own-cores`` the command, the scheduler and each worker have half a core, never more, whoever else has
something to do: two cores are then like four at half the speed.

Costs of more frames go by what the work is about: reading by the pixels of the frames, comparing and dividing
by those of the overlaps, blending and the command's own work by those of the picture.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from cores import cores

FRAMES = 4, 3, 5000, 3300
THOUSAND = 40, 25, 6000, 4000
OVERLAP = 0.30
#: What is done, by the name of its function: what to call it, and what it grows with.
KINDS = {
    "_read": ("decoding", "frames"),
    "_warped": ("decoding", "frames"),
    "_compared": ("comparing tones", "overlaps"),
    "_toned": ("matching tones", "frames"),
    "_tables": ("costs of overlaps", "overlaps"),
    "divided": ("dividing overlaps", "overlaps"),
    "expanded": ("dividing overlaps", "overlaps"),
    "_measured": ("dividing overlaps", "overlaps"),
    "_rendered": ("blending", "picture"),
}
COMMAND = """
import logging, sys
logging.getLogger("toposeam_cli.jobs.crew").setLevel(logging.DEBUG)
logging.getLogger("toposeam_cli.jobs.crew").addHandler(logging.FileHandler(sys.argv.pop(1), "w"))
from toposeam_cli.app.main import main
main()
"""
COUNTED = "TOPOSEAM_COUNTED"
#: How docs/distributed.md has clusters started: nobody looks at what Dask's workers see of themselves.
UNWATCHED = {
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s",
}


def dask_setup(worker: Any) -> None:
    """In a worker that has this file preloaded: count what each kind of work takes."""
    import pickle

    from toposeam_cli.jobs import crew
    from toposeam_cli.jobs.array_files import ArrayFiles
    from toposeam_cli.media.pictures.raw import Stored

    counted: Counter[str] = Counter()
    current = [""]
    read, place, done = Stored.read, ArrayFiles._path, crew.done
    path = Path(os.environ[COUNTED]) / f"{os.getpid()}.json"

    def counted_read(self: Stored, rows: slice, columns: slice) -> Any:
        values = read(self, rows, columns)
        counted[f"bytes read {current[0]}"] += values.nbytes
        return values

    def counted_place(self: ArrayFiles, owner: Any, folder: Path) -> Path:
        before = self.written
        found = place(self, owner, folder)
        counted["bytes of tables"] += self.written - before
        return found

    def counted_done(call: crew.Call) -> bytes:
        begin = time.process_time()
        current[0] = pickle.loads(call[0])[0].__name__  # noqa: S301 - from us
        result = done(call)
        counted[current[0]] += time.process_time() - begin
        path.write_text(json.dumps(counted))
        return result

    Stored.read, ArrayFiles._path, crew.done = counted_read, counted_place, counted_done  # type: ignore


@dataclass
class Ran:
    """The command, once."""

    name: str
    workers: int
    clock: float
    #: Processor seconds of the command, of all workers, and of the scheduler.
    command: float
    helpers: float = 0.0
    scheduler: float = 0.0
    #: MiB: largest resident set of the command; of a worker, and its largest proportional share.
    command_peak: float = 0.0
    resident: float = 0.0
    proportional: float = 0.0
    digest: str = ""
    #: Of workers: processor seconds by function, and bytes read and written beside the output.
    counted: Counter[str] = field(default_factory=Counter)
    #: By function: parts, bytes to workers and back.
    traffic: dict[str, list[int]] = field(default_factory=dict)


@contextlib.contextmanager
def cluster(
    count: int, folder: Path, sees_itself: bool, before: Iterable[list[str]]
) -> Iterator[tuple[str, list[int], int]]:
    """A scheduler and workers of their own: the address, their numbers, and the scheduler's. They watch
    themselves, as Dask has it, where it `sees_itself`; `before` has the words before each one's.
    """
    told = folder / "scheduler.json"
    told.unlink(missing_ok=True)
    counted = folder / "counted"
    counted.mkdir(exist_ok=True)
    for old in counted.iterdir():
        old.unlink()
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", COUNTED: str(counted)}
    environment |= {} if sees_itself else UNWATCHED
    null = subprocess.DEVNULL
    dask = [sys.executable, "-m", "dask"]
    local = ["--scheduler-file", str(told), "--no-dashboard"]
    work = ["--nthreads", "1", "--no-nanny", "--memory-limit", "0", "--preload", __file__]
    started: list[subprocess.Popen[bytes]] = []
    try:
        here = ["--host", "127.0.0.1", "--port", "0"]
        words_of = ["scheduler", *here, *local], *[["worker", *local, *work]] * count
        for first, words in zip(before, words_of, strict=True):
            call = [*first, *dask, *words]
            one = subprocess.Popen(call, stdout=null, stderr=null, env=environment, cwd=folder)
            started.append(one)
            while not told.exists():
                time.sleep(0.1)
        wait = "import sys; from distributed import Client; c = Client(scheduler_file=sys.argv[1]); "
        wait += "c.wait_for_workers(int(sys.argv[2])); print(c.scheduler.address)"
        said = subprocess.run(
            [sys.executable, "-c", wait, str(told), str(count)],
            cwd=folder, env=environment, check=True, capture_output=True, text=True, timeout=120,
        )  # fmt: skip
        yield said.stdout.split()[-1], [one.pid for one in started[1:]], started[0].pid
    finally:
        for ending in (started[1:], started[:1]):  # a worker whose scheduler ends with it may wait for ever
            for one in ending:
                one.terminate()
            for one in ending:
                try:
                    one.wait(10)
                except subprocess.TimeoutExpired:
                    one.kill()


def seconds_of(pid: int) -> float:
    """Processor time of a process so far."""
    after = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(after[11]) + int(after[12])) / os.sysconf("SC_CLK_TCK")


def megabytes_of(pid: int, file: str, name: str) -> float:
    for line in Path(f"/proc/{pid}/{file}").read_text().splitlines():
        if line.startswith(name):
            return int(line.split()[1]) / 1024
    return 0.0


@contextlib.contextmanager
def watched(pids: list[int]) -> Iterator[Callable[[], float]]:
    """The largest proportional share of a process's memory within the block, MiB, looked at every second."""
    peak, ended = [0.0], threading.Event()

    def look() -> None:
        while not ended.wait(1.0):
            peak[0] = max(peak[0], *(megabytes_of(pid, "smaps_rollup", "Pss:") for pid in pids))

    thread = threading.Thread(target=look)
    thread.start()
    try:
        yield lambda: peak[0]
    finally:
        ended.set()
        thread.join()


def ran(name: str, folder: Path, files: list[str], *words: str, before: Sequence[str] = ()) -> Ran:
    from measured import measured

    log, out = folder / "traffic.txt", folder / "out.tif"
    log.unlink(missing_ok=True)
    stitch = ["stitch", *files, "--force", "--quiet", "--max-megapixels", "4000", "--compression", "none"]
    stitch += ["--match-tones", "--blend", "multiband", "-o", out.name, *words]
    for file in files:  # so that no run waits for the disk more than another
        (folder / file).read_bytes()
    os.sync()
    took = measured([*before, sys.executable, "-c", COMMAND, str(log), *stitch], folder)
    if took.code:
        raise SystemExit(f"{name} ended with {took.code}: {took.said}")
    found = Ran(name, 0, took.clock, took.seconds, command_peak=took.megabytes)
    with out.open("rb") as file:
        found.digest = hashlib.file_digest(file, "sha256").hexdigest()
    for line in log.read_text().splitlines() if log.exists() else ():
        kind, *numbers = line.split()
        if kind in KINDS:
            found.traffic[kind] = [int(number) for number in numbers]
    return found


def with_workers(count: int, folder: Path, files: list[str], sees_itself: bool, own_cores: bool) -> Ran:
    with contextlib.ExitStack() as block:
        first, *others = block.enter_context(cores(count + 2)) if own_cores else [[]] * (count + 2)
        address, pids, scheduler = block.enter_context(cluster(count, folder, sees_itself, others))
        proportional = block.enter_context(watched(pids))
        started = sum(map(seconds_of, pids)), seconds_of(scheduler)
        name = f"{count} worker{'s' if count > 1 else ''}"
        found = ran(name, folder, files, "--dask", address, before=first)
        found.workers = count
        found.helpers = sum(map(seconds_of, pids)) - started[0]
        found.scheduler = seconds_of(scheduler) - started[1]
        found.resident = max(megabytes_of(pid, "status", "VmHWM") for pid in pids)
        found.proportional = proportional()
        for path in (folder / "counted").iterdir():
            found.counted.update(json.loads(path.read_text()))
    return found


def sizes(columns: int, rows: int, width: int, height: int) -> dict[str, float]:
    """Megapixels of the frames, their overlaps, and the picture."""
    x, y = round(width * OVERLAP), round(height * OVERLAP)
    straight = (columns - 1) * rows * x * height + columns * (rows - 1) * width * y
    across = 2 * (columns - 1) * (rows - 1) * x * y
    picture = ((width - x) * (columns - 1) + width) * ((height - y) * (rows - 1) + height)
    pixels = {"frames": columns * rows * width * height, "overlaps": straight + across, "picture": picture}
    return {name: number / 1e6 for name, number in pixels.items()}


def growth() -> dict[str, float]:
    small, large = sizes(*FRAMES), sizes(*THOUSAND)
    return {name: large[name] / small[name] for name in small}


def process_rows(*runs: Ran) -> list[list[str]]:
    from stamp import commit

    rows = [[f"at commit {commit()}", "clock, s", "÷", "processors, s"]]
    for run in runs:
        ratio = f"{runs[0].clock / run.clock:.2f}" if run is not runs[0] else ""
        rows.append([run.name, f"{run.clock:.1f}", ratio, f"{run.command:.1f}"])
    return rows


def measured_rows(*runs: Ran) -> list[list[str]]:
    from stamp import commit

    names = ["clock, s", "÷", "command, s", "workers, s", "scheduler, s", "peak, MiB", "share, MiB"]
    rows = [[f"at commit {commit()}", *names]]
    for run in runs:
        ratio = f"{runs[0].clock / run.clock:.2f}" if run is not runs[0] else ""
        line = [run.name, f"{run.clock:.1f}", ratio, f"{run.command:.1f}", f"{run.helpers:.1f}"]
        rows.append([*line, f"{run.scheduler:.1f}", f"{run.resident:.0f}", f"{run.proportional:.0f}"])
    return rows


def kind_rows(run: Ran) -> list[list[str]]:
    rows = [["work", "parts", "workers, s", "sent, MB", "back, MB"]]
    names = dict.fromkeys(name for name, _ in KINDS.values())
    for name in names:
        own = [kind for kind, (called, _) in KINDS.items() if called == name]
        parts, sent, back = (sum(run.traffic.get(kind, [0, 0, 0])[k] for kind in own) for k in range(3))
        seconds = sum(run.counted[kind] for kind in own)
        rows.append([name, str(parts), f"{seconds:.1f}", f"{sent / 1e6:.2f}", f"{back / 1e6:.2f}"])
    return rows


def thousand_rows(run: Ran) -> list[list[str]]:
    """What 1,000 frames cost, from one run."""
    grows = growth()
    work = sum(run.counted[kind] * grows[of] for kind, (_, of) in KINDS.items())
    # What a worker's process takes besides, as for messages.
    work *= run.helpers / sum(run.counted[kind] for kind in KINDS)
    command = (run.command + run.scheduler) * grows["picture"]
    traffic = sum(sum(run.traffic.get(kind, [0, 0, 0])[1:]) * grows[of] for kind, (_, of) in KINDS.items())
    read = sum(run.counted[f"bytes read {kind}"] * grows[of] for kind, (_, of) in KINDS.items())
    tables = run.counted["bytes of tables"] * grows["overlaps"]
    large = sizes(*THOUSAND)
    rows = [["1,000 frames of 24 megapixels", ""]]
    rows.append(["picture", f"{large['picture'] / 1e3:.1f} gigapixels"])
    hours = {count: (command + work / count) / 3600 for count in (1, 2, 8, 32)}
    rows += [[f"time with {count} worker{'s' * (count > 1)}", f"{hours[count]:.1f} h"] for count in hours]
    rows.append(["of that the command's and the scheduler's own", f"{command / 3600:.1f} h"])
    rows.append(["through the scheduler", f"{traffic / 1e9:.1f} GB"])
    rows.append(["read from shared storage, most of it windows of pixels", f"{read / 1e12:.1f} TB"])
    rows.append(["tables kept there", f"{tables / 1e9:.0f} GB"])
    kept = (large["frames"] + large["picture"]) * 4 / 1e3
    rows.append(["pixels kept there (frames, picture with opacity)", f"{kept:.0f} GB"])
    rows.append(["memory per worker", f"{run.resident / 1024:.1f} GiB"])
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--keep", type=Path, help="leave the frames in this folder, or take those there")
    parser.add_argument("--only", choices=["processes", "workers"])
    parser.add_argument("--times", type=int, default=1, help="runs of each, of which the quickest counts")
    parser.add_argument("--own-cores", action="store_true", help="only the Dask workers, on half cores")
    parser.add_argument("--watched", action="store_true", help="let Dask's workers watch themselves")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/distributed.md")
    options = parser.parse_args()
    from mosaic import make_large
    from written import write_table

    columns, rows, width, height = FRAMES
    files = [f"frame{index:02d}.tif" for index in range(columns * rows)]
    tables: dict[str, list[list[str]]] = {}
    made: set[str] = set()
    with tempfile.TemporaryDirectory(prefix="workers-") as name:
        folder = (options.keep or Path(name)).resolve()
        folder.mkdir(exist_ok=True)
        if not all((folder / file).exists() for file in files):
            make_large(folder, columns, rows, width, height, 5)
        if options.only != "workers" and not options.own_cores:
            one, two = best(
                options.times,
                lambda: ran("1 process (-j 1)", folder, files, "-j", "1"),
                lambda: ran("2 processes (-j 2)", folder, files, "-j", "2"),
            )
            tables["processes"] = process_rows(one, two)
            made.add(one.digest)
        if options.only != "processes":
            told = options.watched, options.own_cores
            made_by = [partial(with_workers, count, folder, files, *told) for count in (1, 2)]
            one, two = best(options.times, *made_by)
            tables["cores" if options.own_cores else "measured"] = measured_rows(one, two)
            if not options.own_cores:
                tables |= {"parts": kind_rows(two), "thousand": thousand_rows(one)}
            made.add(one.digest)
    if len(made) != 1:
        raise SystemExit("the pictures differ")
    for named, table in tables.items():
        for row in table:
            print(f"{row[0]:<56}" + "".join(f"{cell:>14}" for cell in row[1:]))
        print(flush=True)
        if options.write:
            write_table("distributed.md", f"benchmarks/workers.py, {named}", table)


def best(times: int, *does: Callable[[], Ran]) -> list[Ran]:
    """Of each, the run that took least by the clock; they take turns, and all make the same picture."""
    runs = [[one() for one in does] for _ in range(times)]
    if len({run.digest for turn in runs for run in turn}) != 1:
        raise SystemExit("the pictures differ")
    for turn in runs:
        print(", ".join(f"{run.name}: {run.clock:.1f} s" for run in turn), flush=True)
    return [min(turns, key=lambda run: run.clock) for turns in zip(*runs, strict=True)]


if __name__ == "__main__":
    from stamp import stamp

    print(stamp())
    main()
