"""Photographs in any order, from one point or before a plane: how near to the truth they are placed, and how
whole commands compare with OpenCV's Stitcher and with Hugin.

    python benchmarks/photographs.py                        40 rendered sets and 20 mixed ones
    python benchmarks/photographs.py --rendered 5 --seed 7
    python benchmarks/photographs.py --mixed 10
    python benchmarks/photographs.py --photographs FOLDER   real sets, ours and the peers
    python benchmarks/photographs.py --photographs FOLDER --only NAME,NAME --keep seen
    python benchmarks/photographs.py --photographs FOLDER --only NAME,NAME --stages

Rendered sets are views of one sphere or one plane (``rendered_views.py``): rows of pictures, two rows, a
whole turn, a wall seen at a tilt of up to 12°, a scan. Each picture is 500 to 900 px long, exposed up to
±20 % differently, and noisy (1.5 8-bit levels). ``toposeam.find_places`` is told nothing.

*Off* is, at points all over an overlap and along its border, the distance in px between where a point of one
picture lies in the other one and where it was placed there. A set is *placed* when that is nowhere more than
1.5 px, *partly* so when pictures were left out besides, *refused* when the command says so, and *wrong*
otherwise. Mixed sets show two scenes, one scene and a stranger, or unrelated pictures: they are *joined
wrongly* when pictures of different scenes are placed together.

Real sets lie in FOLDER as ``sets/NAME/*`` and ``pairs/NAME_l.jpg``, ``pairs/NAME_r.jpg``. Each program is a
command in a process of its own, with one thread. Seconds are processor time, with that of the processes it
starts. MB is the largest resident set of one of them. Of OpenCV, what PANORAMA mode takes is compared where
that joins the set, and what SCANS mode takes elsewhere. ``--stages`` adds where the time of a set goes
(``stages.py``, in a run of its own). Programs that are not installed are left out:

    pip install opencv-python-headless     (or opencv-python)
    apt install hugin-tools enblend
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import shutil
import sys
import tempfile
import textwrap
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import toposeam as ts
from measured import measured
from rendered_views import PHOTOGRAPHS, Views, make_views
from stages import JOINING, PLACING, stages_of, table
from stamp import stamp
from toposeam.layers.canvas.transforms import Transform

RENDERED, MIXED = 40, 20
#: px; the share of a picture from which on another one overlaps it.
NEAR, LEAST_SHARED = 1.5, 0.02
KINDS = ("row", "wall", "row", "rows", "scan", "row", "turn", "wall", "row", "rows")
#: Of a scene in mixed sets.
MOST_MIXED = 5
#: Points across an overlap, and along a side of a picture.
GRID, SIDE = 13, 49
#: s by the clock.
LIMIT = 300
PICTURES = {".jpg", ".jpeg", ".png", ".tif", ".tiff"}

Floats = np.ndarray


# Rendered sets.


def points_of(size: tuple[int, int]) -> Floats:
    """(N, 2) points: a grid, then the border with the corners."""
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, GRID)] * 2), axis=-1).reshape(-1, 2)
    along = np.linspace(0, 1, SIDE)
    level = [np.stack([along, np.full(SIDE, at)], axis=-1) for at in (0, 1)]
    return np.concatenate([grid, *level, *(side[:, ::-1] for side in level)]) * (np.array(size) - 1.0)


def inside(points: Floats, size: tuple[int, int]) -> Floats:
    """(N,) whether a picture shows them."""
    return ((points >= 0) & (points <= np.array(size) - 1.0)).all(axis=-1)


def offs(truth: list[Transform], found: list[Transform], size: tuple[int, int]) -> Floats:
    """(N,) px at all points of all overlaps; infinite where nothing shows what should be there."""
    result = [np.zeros(0)]
    points = points_of(size)
    on_truth = [transform.to_canvas(points) for transform in truth]
    for i, source in enumerate(truth):
        for j, target in enumerate(truth):
            wanted = target.to_picture(on_truth[i])
            shown = inside(wanted, size)
            if i == j or shown[: GRID**2].mean() < LEAST_SHARED:
                continue
            # The other picture's border, where this one shows it, is that of the overlap, too.
            back = source.to_picture(on_truth[j])
            kept = inside(back, size)
            here = np.concatenate([points[shown], back[kept]])
            there = np.concatenate([wanted[shown], points[kept]])
            distances = np.linalg.norm(found[j].to_picture(found[i].to_canvas(here)) - there, axis=-1)
            result.append(np.where(distances < 1e5, distances, np.inf))
    return np.concatenate(result)


def placed(images: list[np.ndarray]) -> tuple[Any, float, str]:
    """The placement, or None and why it was refused; the seconds that it took."""
    layers = [ts.Layer(image, name=f"picture {number}") for number, image in enumerate(images)]
    placement, reason = None, ""
    started = time.process_time()
    try:
        placement = ts.find_places(layers)
    except ts.TopoSeamError as error:
        reason = textwrap.shorten(str(error), 72, placeholder=" …")
    return placement, time.process_time() - started, reason


def rendered_set(index: int, seed: int) -> Views:
    kind, lens = KINDS[index % len(KINDS)], bool((index + index // len(KINDS)) % 2)
    return make_views(np.random.default_rng([seed, index]), kind, lens=lens)


def rendered(first: int, count: int, seed: int) -> None:
    told = {"placed": 0, "partly": 0, "refused": 0, "wrong": 0}
    medians, worsts, focals, seconds = [], [], [], []
    print(f"{'':>4}{'set':<24}{'frames':>6}  {'true':<11}{'found':<11}", end="")
    print(f"{'off':>7}{'worst':>9}{'focal':>9}{'s':>8}")
    for index in range(first, first + count):
        views = rendered_set(index, seed)
        placement, took, reason = placed(views.images)
        seconds.append(took)
        line = f"{index:>3} {views.name:<24}{len(views.images):>6}  {views.model:<11}"
        if placement is None:
            told["refused"] += 1
            print(f"{line}{'refused':<11}{'':>25}{took:>8.1f}  {reason}", flush=True)
            continue
        truth = [views.transforms[number] for number in placement.numbers]
        off = offs(truth, list(placement.transforms), views.size)
        median, worst = (float(np.median(off)), float(off.max())) if len(off) else (np.inf, np.inf)
        missing = len(views.images) - len(placement.numbers)
        kind = "wrong" if worst > NEAR else "partly" if missing else "placed"
        told[kind] += 1
        focal = ""
        if views.focal and placement.focal:
            focals.append(100 * (placement.focal / views.focal - 1))
            focal = f"{focals[-1]:+.2f} %"
        medians.append(median)
        worsts.append(worst)
        line += f"{placement.model:<11}{median:>7.3f}{worst:>9.3f}{focal:>9}{took:>8.1f}  {kind}"
        print(f"{line}, {missing} left out" if missing else line, flush=True)
    print(", ".join(f"{number} {kind}" for kind, number in told.items()), end=f" of {count}\n")
    if medians:
        print(f"off {np.median(medians):.3f} px in the median of medians", end=", ")
        print(f"worst {np.median(worsts):.3f} in the median, {max(worsts):.3f} at most", end="; ")
    if focals:
        print(f"focal length off {np.median(np.abs(focals)):.2f} % in the median", end="; ")
    print(f"{np.median(seconds):.1f} s of processor time a set in the median\n")


def mixed_set(index: int, seed: int) -> tuple[str, list[np.ndarray], list[int]]:
    """What it is, the pictures, and which scene each one shows; scenes share no photograph."""
    rng = np.random.default_rng([seed, index, 1])
    name = ("two scenes", "a stranger", "unrelated")[index % 3]
    scenes = int(rng.integers(2, 5)) if name == "unrelated" else 2
    photographs = rng.permutation(PHOTOGRAPHS)
    images, owners = [], []
    for scene in range(scenes):
        kind = KINDS[int(rng.integers(len(KINDS)))].replace("turn", "row")
        views = make_views(rng, kind, most=MOST_MIXED, photographs=photographs[scene::scenes].tolist())
        alone = name == "unrelated" or (name == "a stranger" and scene == 1)
        for image in views.images[: 1 if alone else None]:
            images.append(image)
            owners.append(scene)
    order = rng.permutation(len(images))
    return name, [images[k] for k in order], [owners[k] for k in order]


def mixed(first: int, count: int, seed: int) -> None:
    told = {"joined wrongly": 0, "kept apart": 0, "refused": 0}
    print(f"{'':>4}{'set':<16}{'pictures of each scene':<24}{'s':>8}")
    for index in range(first, first + count):
        name, images, owners = mixed_set(index, seed)
        placement, took, remark = placed(images)
        kind = "refused"
        if placement is not None:
            chosen = [owners[number] for number in placement.numbers]
            kind = "joined wrongly" if len(set(chosen)) > 1 else "kept apart"
            remark = f"{len(chosen)} of {owners.count(chosen[0])} placed as {placement.model}"
        told[kind] += 1
        counts = " + ".join(str(owners.count(scene)) for scene in range(max(owners) + 1))
        print(f"{index:>3} {name:<16}{counts:<24}{took:>8.1f}  {kind:<16}{remark}".rstrip(), flush=True)
    print(", ".join(f"{number} {kind}" for kind, number in told.items()), end=f" of {count}\n\n")


# Real sets.

OURS, PANORAMA, SCANS, HUGIN = "TopoSeam", "OpenCV", "OpenCV, scans", "Hugin"

#: Stages of Hugin's programs.
OF_HUGIN = {
    **dict.fromkeys(("pto_gen", "cpfind", "cpclean", "autooptimiser", "pano_modify"), PLACING),
    "hugin_executor": JOINING,
}
#: Mode, output, pictures.
OPENCV = """
import json, sys, time, cv2
spent = [0.0]
def passed():
    spent.append(time.process_time())
    return spent[-1] - spent[-2]
cv2.setNumThreads(1)
stages = {"start, imports": passed()}
stitcher = cv2.Stitcher_create(getattr(cv2, "Stitcher_" + sys.argv[1]))
stitcher.setCompositingResol(-1)
images = [cv2.imread(name) for name in sys.argv[3:]]
stages["read"] = passed()
status = stitcher.estimateTransform(images)
stages["features to placing"] = passed()
if status == cv2.Stitcher_OK:
    status, joined = stitcher.composePanorama()
if status != cv2.Stitcher_OK:
    sys.exit(f"status {status}")
stages["warp to blend"] = passed()
cv2.imwrite(sys.argv[2], joined)
stages["crop, write"] = passed()
print(json.dumps({"used": len(stitcher.component()), "stages": stages}))
"""


@dataclass(frozen=True)
class Outcome:
    """What a program did with a set."""

    #: "joined", "refused" or "late".
    kind: str
    seconds: float
    megabytes: float
    #: Pictures it used, where that is known.
    used: int | None = None
    said: str = ""
    #: Seconds by stage, as far as the program tells them.
    stages: dict[str, float] = field(default_factory=dict)


def programs(files: list[str]) -> dict[str, tuple[str, list[list[str]]]]:
    """The file that each program writes, and its commands."""
    python, project = sys.executable, "set.pto"
    found = {OURS: ("out.jpg", [[python, "-m", "toposeam_cli", "stitch", *files, "-o", "out.jpg", "--json"]])}
    if importlib.util.find_spec("cv2"):
        for name, mode in ((PANORAMA, "PANORAMA"), (SCANS, "SCANS")):
            found[name] = ("out.jpg", [[python, "-c", OPENCV, mode, "out.jpg", *files]])
    if all(shutil.which(name) for name in ("pto_gen", "cpfind", "hugin_executor", "enblend")):
        same = ["-o", project, project]
        found[HUGIN] = ("out.tif", [
            ["pto_gen", "-o", project, *files],
            ["cpfind", "--multirow", *same],
            ["cpclean", *same],
            ["autooptimiser", "-a", "-m", "-l", "-s", *same],
            ["pano_modify", "--canvas=AUTO", "--crop=AUTO", *same],
            ["hugin_executor", "--stitching", "--prefix=out", project],
        ])  # fmt: skip
    return found


def outcome(commands: list[list[str]], written: Path) -> Outcome:
    """Run the commands one after the other in the folder of what they write."""
    seconds, megabytes, left = 0.0, 0.0, float(LIMIT)
    said, stages = "", Counter[str]()
    for command in commands:
        ran = measured(["timeout", "-k", "5", f"{max(left, 1):.0f}", *command], written.parent)
        seconds, megabytes, left = seconds + ran.seconds, max(megabytes, ran.megabytes), left - ran.clock
        said = ran.said
        stages[OF_HUGIN.get(command[0], "")] += ran.seconds
        if ran.code:
            return Outcome("late" if ran.code in (124, 137) else "refused", seconds, megabytes, said=said)
    if not written.exists():
        return Outcome("refused", seconds, megabytes, said=said)
    project = written.parent / "set.pto"
    used = connected(project.read_text(encoding="utf-8")) if project.exists() else None
    told = dict(stages) if "" not in stages else answer(said).get("stages", {})
    return Outcome("joined", seconds, megabytes, used, said, told)


def connected(project: str) -> int:
    """How many pictures of a project of Hugin hang together by control points."""
    lines = [line.split() for line in project.splitlines()]
    group = list(range(sum(words[:1] == ["i"] for words in lines)))
    for words in lines:
        if words[:1] == ["c"]:
            a, b = (next(int(word[1:]) for word in words if word[0] == key) for key in "nN")
            group = [group[a] if of == group[b] else of for of in group]
    return max(map(group.count, group), default=0)


def answer(said: str) -> dict[str, Any]:
    """The JSON that a command printed last."""
    lines = said.splitlines()
    for start in (number for number, line in enumerate(lines) if line.startswith("{")):
        try:
            return dict(json.loads("\n".join(lines[start:])))
        except ValueError:
            continue
    return {}


def values_of(key: str, within: Any) -> Iterator[Any]:
    """Whatever has that name, however deep."""
    if isinstance(within, dict):
        for name, value in within.items():
            yield from [value] if name == key else values_of(key, value)
    elif isinstance(within, list):
        for value in within:
            yield from values_of(key, value)


def used(found: Outcome, pictures: int) -> int | None:
    if found.used is not None:
        return found.used
    said = answer(found.said)
    left_out = next(values_of("left_out", said), None)
    return pictures - len(left_out) if left_out is not None else next(values_of("used", said), None)


def cell(found: Outcome | None, pictures: int) -> str:
    if found is None:
        return ""
    number = used(found, pictures)
    kind = f"{'–' if number is None else number}/{pictures}" if found.kind == "joined" else found.kind
    return f"{kind:>8}{found.seconds:>8.1f}{found.megabytes:>7.0f}"


def real_sets(folder: Path) -> dict[str, list[Path]]:
    found = {
        path.name: sorted(file for file in path.iterdir() if file.suffix.lower() in PICTURES)
        for path in sorted(folder.glob("sets/*/"))
    }
    for left in sorted(folder.glob("pairs/*_l.*")):
        name = left.stem.removesuffix("_l")
        found[name] = [left, left.with_name(f"{name}_r{left.suffix}")]
    return found


def photographs(folder: Path, only: list[str], keep: Path | None, staged: bool) -> None:
    sets = {name: files for name, files in real_sets(folder).items() if not only or name in only}
    if missing := set(only) - set(sets):
        raise SystemExit(f"no such sets in {folder}: {', '.join(sorted(missing))}")
    # Commands run elsewhere: what is measured is the code that was asked for.
    paths = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    os.environ["PYTHONPATH"] = os.pathsep.join(str(Path(path).resolve()) for path in paths if path)
    names = list(programs([]))
    print(f"{'':<14}{'':>8}" + "".join(f"{name:>23}" for name in names))
    print(f"{'set':<14}{'pictures':>8}" + f"{'joined':>8}{'s':>8}{'MB':>7}" * len(names))
    all_found: list[dict[str, Outcome]] = []
    for name, files in sets.items():
        found: dict[str, Outcome] = {}
        for program, (output, commands) in programs([str(file.resolve()) for file in files]).items():
            with tempfile.TemporaryDirectory(prefix="photographs-") as own:
                written = Path(own) / output
                if program == OURS and not all_found:
                    outcome(commands, written)  # not counted: modules never imported are compiled
                    written.unlink(missing_ok=True)
                found[program] = outcome(commands, written)
                if keep is not None and found[program].kind == "joined":
                    keep.mkdir(parents=True, exist_ok=True)
                    label = program.lower().replace(", ", "-")
                    shutil.copy(written, keep / f"{name}-{label}{written.suffix}")
        all_found.append(found)
        print(f"{name:<14}{len(files):>8}" + "".join(cell(found[p], len(files)) for p in names), flush=True)
        if staged:
            words = ["stitch", *(str(file.resolve()) for file in files), "-o", "out.jpg", "--json"]
            with tempfile.TemporaryDirectory(prefix="photographs-") as own:
                columns = {OURS: stages_of(words, Path(own))}
            columns |= {p: found[p].stages for p in names if p != OURS}
            print(textwrap.indent(table(columns), "  "), flush=True)
    joined = {p: sum(found[p].kind == "joined" for found in all_found) for p in names}
    print("joined " + ", ".join(f"{number} by {program}" for program, number in joined.items()), end="")
    print(f", of {len(sets)}")
    for label, peers in (("OpenCV", (PANORAMA, SCANS)), ("Hugin", (HUGIN,))):
        print(ratios(all_found, label, peers))


def ratios(all_found: list[dict[str, Outcome]], label: str, peers: tuple[str, ...]) -> str:
    """Ours ÷ a peer's, over the sets that both joined."""
    logs = []
    for found in all_found:
        theirs = [found[p] for p in peers if p in found and found[p].kind == "joined"]
        if theirs and found[OURS].kind == "joined":
            ours, peer = found[OURS], theirs[0]
            logs.append(np.log([ours.seconds / peer.seconds, ours.megabytes / peer.megabytes]))
    if not logs:
        return f"{OURS} ÷ {label}: no set that both joined"
    seconds, megabytes = np.exp(np.mean(logs, axis=0))
    return f"{OURS} ÷ {label}: time {seconds:.2f}, memory {megabytes:.2f} in the mean of {len(logs)} sets"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rendered", type=int, nargs="?", const=RENDERED, metavar="N", help="so many sets")
    parser.add_argument("--mixed", type=int, nargs="?", const=MIXED, metavar="M", help="so many mixed sets")
    parser.add_argument("--first", type=int, default=0, help="number of the first set")
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--photographs", type=Path, metavar="FOLDER", help="real sets, with the peers")
    parser.add_argument("--only", default="", metavar="NAME,NAME", help="of the real sets")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="leave the joined pictures there")
    parser.add_argument("--stages", action="store_true", help="and where the time of each real set goes")
    options = parser.parse_args()
    if options.rendered is options.mixed is options.photographs is None:
        options.rendered, options.mixed = RENDERED, MIXED
    if options.rendered:
        rendered(options.first, options.rendered, options.seed)
    if options.mixed:
        mixed(options.first, options.mixed, options.seed)
    if options.photographs is not None:
        only = [name for name in options.only.split(",") if name]
        photographs(options.photographs, only, options.keep, options.stages)


if __name__ == "__main__":
    print(stamp())
    main()
