"""Where the processor time of a command goes: each moment counts for one stage.

    python benchmarks/stages.py stitch a.jpg b.jpg -o joined.jpg

A timer of processor time interrupts the command every few milliseconds, and what has passed since counts for
the innermost function on the stack that belongs to a stage. So the stages add up to the whole, a stage that
calls another one is not charged for it, and the command takes no longer for it. Calls of libraries belong to
the function of ours that makes them.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

from measured import measured

#: Stages, by the module or the folder of modules whose functions they are; the first that fits counts.
STAGES = {
    "<frozen importlib._bootstrap": "start, imports",
    "layers/registration/features.py": "features",
    "layers/registration/pair_matching.py": "matching",
    "layers/registration/homography.py": "matching",
    "layers/registration/planes.py": "matching",
    "layers/registration/": "placing",
    "layers/mesh/": "mesh",
    "stitching/resample.py": "warp",
    "layers/canvas/warping.py": "warp",
    "layers/exposure/": "tones",
    "toposeam/seam/problem/natural.py": "seam: costs",
    "toposeam/seam/problem/match_cost.py": "seam: costs",
    "toposeam/seam/problem/blend_reach.py": "seam: costs",
    "layers/labelling/": "seam: costs",
    "layers/search/cost_coarsening.py": "seam: costs",
    "toposeam/seam/result/": "seam: verdict",
    "toposeam/seam/": "seam: search",
    "layers/search/": "seam: search",
    "layers/composite/two_layers.py": "seam: search",
    "layers/composite/many_layers.py": "seam: search",
    "layers/blending/": "blend",
    "layers/composite/painter.py": "blend",
    "layers/composite/": "composition",
    "stitching/outputs.py": "crop, write",
    "stitching/rendering.py": "crop, write",
    "layers/canvas/largest_rectangle.py": "crop, write",
    "files/writing.py": "crop, write",
    "media/pictures/lens.py": "read",
    "media/pictures/decode.py": "read",
    "stitching/inputs.py": "read",
    "stitching/report.py": "report",
}
OTHER = "other"
#: What peers only tell together.
PLACING, JOINING = "features to placing", "warp to blend"
#: Of a set's table, in this order.
ORDER = (
    *("start, imports", "read", "features", "matching", "placing", "mesh", PLACING),
    *("warp", "tones", "seam: costs", "seam: search", "seam: verdict", "blend", "composition", JOINING),
    *("crop, write", "report", OTHER),
)
#: s between two looks, of processor time.
EVERY = 0.004


class Stages:
    """Processor time by stage, s, from the start of the process."""

    def __init__(self) -> None:
        self.seconds = Counter({STAGES["<frozen importlib._bootstrap"]: time.process_time()})
        self._last = time.process_time()
        self._known: dict[str, str | None] = {}
        signal.signal(signal.SIGPROF, self._look)
        signal.setitimer(signal.ITIMER_PROF, EVERY, EVERY)

    def stop(self) -> dict[str, float]:
        """Count no longer; return the stages' seconds."""
        signal.setitimer(signal.ITIMER_PROF, 0)
        self._charge(OTHER)
        return dict(self.seconds)

    def _look(self, _: int, frame: FrameType | None) -> None:
        while frame is not None:
            stage = self._stage(frame.f_code.co_filename)
            if stage is not None:
                return self._charge(stage)
            frame = frame.f_back
        return self._charge(OTHER)

    def _charge(self, stage: str) -> None:
        now = time.process_time()
        self.seconds[stage] += now - self._last
        self._last = now

    def _stage(self, file: str) -> str | None:
        if file not in self._known:
            self._known[file] = next((stage for part, stage in STAGES.items() if part in file), None)
        return self._known[file]


def stages_of(words: Sequence[str], folder: Path) -> dict[str, float]:
    """Seconds by stage of a command, run in a folder in a process of its own; empty where it fails."""
    target = folder / "stages.json"
    ran = measured([sys.executable, __file__, "--into", str(target), *words], folder)
    return {} if ran.code else dict(json.loads(target.read_text(encoding="utf-8")))


def table(columns: dict[str, dict[str, float]]) -> str:
    """Lines of stages with the seconds of each command and their shares."""
    used = [stage for stage in ORDER if any(stage in found for found in columns.values())]
    width = max(map(len, used), default=0)
    lines = [" " * width + "".join(f"{name:>18}" for name in columns if columns[name])]
    columns = {name: found for name, found in columns.items() if found}
    for stage in [*used, "all"]:
        cells = []
        for found in columns.values():
            total = sum(found.values())
            own = total if stage == "all" else found.get(stage)
            cells.append(" " * 18 if own is None else f"{own:>11.2f}{own / max(total, 1e-9):>7.0%}")
        lines.append(f"{stage:<{width}}{''.join(cells)}".rstrip())
    return "\n".join(lines)


def run(words: Sequence[str], target: Path | None) -> None:
    """Run a command, and print or write its stages."""
    stages = Stages()
    from toposeam_cli.app.main import main

    try:
        main(list(words), prog_name="toposeam", standalone_mode=True)
    except SystemExit as end:
        found = stages.stop()
        if end.code:
            raise
    if target is None:
        from stamp import stamp

        print(table({"s, share": found}))
        print(stamp())
    else:
        target.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    given = sys.argv[1:]
    into = Path(given[1]) if given[:1] == ["--into"] else None
    run(given[2:] if into else given, into)
