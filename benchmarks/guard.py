"""Whether a change made any result worse or slower: costs ÷ the best known, and processor time.

    python benchmarks/guard.py                       every case against guard.json
    python benchmarks/guard.py --quick               one case in thirteen, about a minute
    python benchmarks/guard.py --only seams holes    some rooms
    python benchmarks/guard.py --against ../other    every case with this core and with another checkout's
    python benchmarks/guard.py --write               and keep what was better, and the times

The cases are 200 seams, 100 small and 12 large piles, 30 frames that overlap by 60 %, 20 textures, 12 holes,
40 volumes, 20 motifs and 2 stitches of photographs, from finding their places to pixels (guard_cases.py).
Each has one or two figures, of which less is better:

cost         Σ M of the seam, or of all seams of a pile, or of the surface; infinite where pixels show that
             are not there. For the laws "gradient" and "colour" it is computed by the guard from the labels,
             for "natural" it is the one that the result states
steps        of textures and holes: by how much steps between copies differ from those that the sample has
             there, 8-bit levels per pixel of the texture or the hole
repeats      of textures: how often the source of a pixel shows, mean over the pixels
compliance   of motifs: that of the last design whose compliance is known, for unit heat, times its mass ÷ the
             mass of the recipe where that is exceeded; sum over the layers

A room passes where figure ÷ best known is at most 1.005 in the mean and 1.05 at worst, and the processor
time at most 1.1 times the recorded one; a room that takes longer is timed again, twice at most, and the least
time of each case counts. Figures below 0.95 are listed, too: such a result may solve another problem.
Recorded times are counted in a fixed workload (``yardstick``) that is timed in the same process every few
seconds; with ``--against``, both cores run each case one after the other, in turns, and their seconds are
compared. The exit code is 1 where a room fails.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse.linalg import spsolve

from guard_cases import ROOMS, Case
from stamp import commit, stamp

HERE = Path(__file__).resolve().parent
STORED = HERE / "guard.json"
MEAN, WORST, TIME = 1.005, 1.05, 1.1
#: Figures differ by no more than this where results are equal: sums are rounded.
EQUAL = 1e-6
#: Below this share of the best known a result is looked at.
SUSPICIOUS = 0.95
#: One case in so many is quick; not a multiple of what cases alternate by.
QUICK = 13
#: Cases that take less, s, run so often.
SHORT, TIMES = 0.3, 3
#: A yardstick is good for so many seconds.
FRESH = 5.0

#: Of each room and case its figures, "seconds" and "time", or "error".
NOT_FIGURES = ("seconds", "time", "error")
Measured = dict[str, dict[str, dict[str, Any]]]


def yardstick() -> float:
    """Processor seconds of a fixed workload, about 0.2."""
    rng = np.random.default_rng(0)
    values, side = rng.random((512, 512)), 120
    line = sparse.diags([-1.0, 2.1, -1.0], [-1, 0, 1], (side, side))  # type: ignore[list-item]
    plane = sparse.kronsum(line, line).tocsc()
    started = time.process_time()
    for _ in range(3):
        ndimage.gaussian_filter(values, 3)
        np.sort(values.ravel())
        np.fft.irfft2(np.fft.rfft2(values))
    spsolve(plane, np.ones(side * side))
    sum(divmod(number, 7)[0] for number in range(200_000))
    return time.process_time() - started


# One process per core.


def serve(core: Path) -> None:
    """Run the cases that are asked for on standard input, and answer on standard output."""
    import toposeam

    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever a core prints is no answer
    if core not in Path(str(toposeam.__file__)).resolve().parents:
        raise SystemExit(f"toposeam comes from {toposeam.__file__}, not from {core}")
    unit, since, now = yardstick(), time.monotonic(), ("", -1)
    cases: dict[str, list[Case]] = {}
    prepared: Any = None
    for request in sys.stdin:
        room, index = json.loads(request)
        answer: dict[str, Any]
        try:
            if now != (room, index):
                if room not in cases:
                    cases[room] = list(ROOMS[room]())
                prepared, now = cases[room][index].prepare(), (room, index)
            if time.monotonic() - since > FRESH:
                unit, since = yardstick(), time.monotonic()
            run, judge = prepared
            started = processor_time()
            result = run()
            seconds = processor_time() - started
            answer = {**judge(result), "seconds": seconds, "time": seconds / unit}
        except Exception as error:  # whatever a core raises is its result
            answer, now = {"error": f"{type(error).__name__}: {error}"}, ("", -1)
        print(json.dumps(answer), file=answers, flush=True)


def processor_time() -> float:
    """Seconds of this process and of those that it has waited for."""
    return time.process_time() + sum(os.times()[2:4])


class Core:
    """A process that runs cases with one checkout's core."""

    def __init__(self, checkout: Path) -> None:
        core = (checkout / "core").resolve()
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
        environment = {**os.environ, **threads, "PYTHONPATH": os.pathsep.join([str(core), str(HERE)])}
        self._process: Any = subprocess.Popen(
            [sys.executable, str(HERE / "guard.py"), "--serve", str(core)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            env=environment,
        )

    def run(self, room: str, index: int) -> dict[str, Any]:
        """The figures of a case, its seconds and its time, or an error."""
        try:
            print(json.dumps([room, index]), file=self._process.stdin, flush=True)
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            return {"error": "the process has ended"}
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        """Let it end."""
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


def measure(
    checkouts: Sequence[Path], rooms: Sequence[str], quick: bool = False, jobs: int = 1
) -> list[Measured]:
    """Run cases with each checkout's core, in turns.

    Parameters
    ----------
    checkouts : sequence of Path
    rooms : sequence of str
        Names in `ROOMS`.
    quick : bool
        Whether to run one case in thirteen.
    jobs : int
        How many cases run side by side.

    Returns
    -------
    list of Measured
        One for each checkout. With one checkout times are in yardsticks, with several in seconds.
    """
    found: list[Measured] = [{room: {} for room in rooms} for _ in checkouts]
    local, everyone = threading.local(), []

    def one(number: int, room: str, index: int, name: str) -> None:
        if not hasattr(local, "cores"):
            local.cores = [Core(checkout) for checkout in checkouts]
            everyone.extend(local.cores)
        answers: list[dict[str, Any]] = [{} for _ in checkouts]
        for again in range(TIMES):
            for k in range(len(checkouts)) if (number + again) % 2 else reversed(range(len(checkouts))):
                answer = local.cores[k].run(room, index)
                if "error" in answer or not answers[k] or answer["time"] < answers[k]["time"]:
                    answers[k] = answer
            if any("error" in answer or answer["seconds"] > SHORT for answer in answers):
                break
        for measured, answer in zip(found, answers, strict=True):
            if len(checkouts) > 1 and "error" not in answer:
                answer["time"] = answer["seconds"]
            measured[room][name] = answer
        if sys.stderr.isatty():
            print(f"\r{room}: {name:<60}", end="", file=sys.stderr, flush=True)

    tasks = [
        (room, index, case.name)
        for room in rooms
        for index, case in enumerate(ROOMS[room]())
        if not quick or index % QUICK == 0
    ]
    try:
        with ThreadPoolExecutor(jobs) as pool:
            list(pool.map(one, range(len(tasks)), *zip(*tasks, strict=True)))
    finally:
        for core in everyone:
            core.close()
    return found


def faster(measured: Measured, again: Measured) -> None:
    """Keep the shorter time of each case, in place."""
    for room, cases in again.items():
        for name, answer in cases.items():
            before = measured.setdefault(room, {}).setdefault(name, answer)
            if answer.get("time", math.inf) < before.get("time", math.inf):
                before |= {"seconds": answer["seconds"], "time": answer["time"]}


# What is made of it.


@dataclass(frozen=True)
class Row:
    """One figure of one room, compared."""

    room: str
    figure: str
    #: By case: figure ÷ the other's; NaN where there is nothing to compare with.
    ratios: dict[str, float]
    #: Processor seconds, and time ÷ the other's of the cases that both have; NaN where there are none.
    seconds: float
    time: float

    @property
    def mean(self) -> float:
        """Of the ratios."""
        return float(np.mean(list(self.ratios.values())))

    @property
    def worst(self) -> float:
        """Of the ratios."""
        return float(np.max(list(self.ratios.values())))

    @property
    def passes(self) -> bool:
        """False also where something is not known."""
        return self.mean <= MEAN and self.worst <= WORST and self.time <= TIME

    @property
    def cells(self) -> list[str]:
        """Of the table."""
        equal = sum(abs(ratio - 1) <= EQUAL for ratio in self.ratios.values())
        found = [f"{self.mean:.4f}", f"{self.worst:.4f}", f"{self.seconds:.1f}", f"{self.time:.2f}"]
        verdict = "passes" if self.passes else "FAILS"
        return [self.room, self.figure, f"{len(self.ratios)}", f"{equal}", *found, verdict]


def quotient(one: float, other: float) -> float:
    return 1.0 if one == other else one / other if other else math.inf


def compared(measured: Measured, known: Measured) -> Iterator[Row]:
    """Each room's figures against those that are known of the same cases."""
    for room, cases in measured.items():
        if not cases:
            continue
        before = known.get(room, {})
        both = [name for name in cases if "time" in cases[name] and "time" in before.get(name, {})]
        taken, allowed = (sum(side[name]["time"] for name in both) for side in (cases, before))
        seconds = sum(answer.get("seconds", 0.0) for answer in cases.values())
        names = {name: None for answer in cases.values() for name in answer if name not in NOT_FIGURES}
        for figure in names or {"none": None}:
            ratios = {}
            for name, answer in cases.items():
                told = before.get(name, {}).get(figure, math.nan)
                ratios[name] = quotient(answer[figure], told) if figure in answer else math.inf
            yield Row(room, figure, ratios, seconds, taken / allowed if allowed else math.nan)


def report(rows: Sequence[Row], measured: Measured, beside: str) -> str:
    """The table in Markdown, and the cases to look at."""
    head = f"room|figure|cases|equal|mean ÷ {beside}|worst|seconds|time ÷ {beside}|".split("|")
    lines = ["| " + " | ".join(cells) + " |" for cells in (head, *(row.cells for row in rows))]
    lines.insert(1, "|---" * len(head) + "|")
    notes = []
    for row in rows:
        for name, ratio in sorted(row.ratios.items(), key=lambda item: -item[1]):
            error = measured[row.room][name].get("error")
            if error is None and (math.isnan(ratio) or SUSPICIOUS <= ratio <= WORST):
                continue
            what = error or f"{row.figure} ÷ {beside} is {ratio:.4f}"
            what += "; does it solve the same problem?" * (ratio < SUSPICIOUS)
            notes.append(f"- {row.room}, {name}: {what}")
        unknown = sum(map(math.isnan, row.ratios.values()))
        if unknown:
            notes.append(
                f"- {row.room}: {unknown} of {len(row.ratios)} cases have no {row.figure} to compare with"
            )
    return "\n".join([*lines, *([""] if notes else []), *notes])


def kept(measured: Measured, known: Measured, reset: bool) -> Measured:
    """What is best known from now on: lower figures, or with `reset` all, and the times of this run."""
    best = {room: dict(cases) for room, cases in known.items()}
    for room, cases in measured.items():
        for name, answer in cases.items():
            if "error" in answer:
                continue
            before = {} if reset else best.get(room, {}).get(name, {})
            figures = {
                figure: float(f"{min(value, before.get(figure, value)) if figure != 'time' else value:.8g}")
                for figure, value in answer.items()
                if figure != "seconds"
            }
            best.setdefault(room, {})[name] = figures
    return best


def read() -> Measured:
    """What is best known."""
    found: Measured = json.loads(STORED.read_text(encoding="utf-8"))["rooms"] if STORED.exists() else {}
    return found


def write(best: Measured) -> None:
    """Store it, one line for each case."""
    rooms = []
    for room, cases in best.items():
        lines = ",\n".join(f"   {json.dumps(name)}: {json.dumps(answer)}" for name, answer in cases.items())
        rooms.append(f"  {json.dumps(room)}: {{\n{lines}\n  }}")
    head = f' "written": {json.dumps(stamp().strip(), ensure_ascii=False)},\n "rooms": {{\n'
    STORED.write_text("{\n" + head + ",\n".join(rooms) + "\n }\n}\n", encoding="utf-8")


def main(words: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", metavar="ROOM", choices=ROOMS, default=list(ROOMS))
    parser.add_argument("--quick", action="store_true", help="one case in thirteen")
    parser.add_argument("-j", type=int, default=1, metavar="N", help="how many cases run side by side")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="a checkout to compare with")
    parser.add_argument("--write", action="store_true", help="keep lower figures, and the times")
    parser.add_argument("--reset", action="store_true", help="with --write: keep higher figures, too")
    parser.add_argument("--serve", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args(words)
    if options.serve is not None:
        serve(options.serve)
        return 0
    if options.j < 1:
        parser.error(f"-j is {options.j}; give 1 or more")
    if options.reset and not options.write:
        parser.error("--reset needs --write")
    print(stamp())
    ours, other = HERE.parent, options.against
    known: Measured = {}
    if other is not None:
        if options.write:
            parser.error("--against compares two checkouts; leave --write out")
        if not (other / "core" / "toposeam").is_dir():
            parser.error(f"{other} has no core/toposeam; give the folder of a checkout")
    else:
        known = read()
    measured, rows = {}, []
    rooms = options.only
    for _ in range(TIMES):
        again = measure([ours, other] if other else [ours], rooms, options.quick, options.j)
        faster(measured, again[0])
        if other is not None:
            faster(known, again[1])
        rows = list(compared(measured, known))
        rooms = list(dict.fromkeys(row.room for row in rows if row.time > TIME))
        if not rooms:
            break
    print(report(rows, measured, "best known" if other is None else commit(other)))
    if options.write:
        write(kept(measured, known, options.reset))
    return 0 if all(row.passes for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
