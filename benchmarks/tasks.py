"""Forty tasks of a stranger, done with what the documents say: ``python benchmarks/tasks.py``.

``--program PATH`` is the command ``toposeam`` of another environment, as of a fresh one with the wheel; with
``--only 3,17`` some are done. Each task names the pages on which its commands are found. It counts as done if
its commands end with code 0 and write what they are to write, and if its pages name the commands and options
that it uses. Printed are seconds of wall time, with Python's start in each command.

What a person needs besides was counted once, by hand (`COUNTED`); ``--write`` puts it into docs/tasks.md.
"""

from __future__ import annotations

import argparse
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from stamp import stamp
from written import write_table

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Task:
    """What somebody wants, the pages that say how, and the commands; the files that they have to write."""

    wish: str
    pages: tuple[str, ...]
    commands: tuple[str, ...]
    made: tuple[str, ...]


def task(wish: str, pages: str, made: str, *commands: str) -> Task:
    return Task(wish, tuple(pages.split()), commands, tuple(made.split()))


A, B = "samples/still_life_left.png", "samples/still_life_right.png"
COFFEE = "samples/coffee_a.jpg samples/coffee_b.jpg samples/coffee_c.jpg"
TASKS = (
    task("two photographs as one", "README.md", "joined.jpg", f"stitch {A} {B} -o joined.jpg"),
    task(
        "see where the seam runs",
        "docs/tutorials/join.md",
        "t.png t_seam.png",
        f"stitch {A} {B} --offset 270,0 -o t.png --overlay t_seam.png",
    ),
    task(
        "layers with masks, for GIMP or Krita",
        "README.md",
        "coffee.ora",
        f"stitch {COFFEE} --match-tones --blend multiband -o coffee.ora",
    ),
    task(
        "no seam through a face, without an editor of masks",
        "docs/tutorials/join.md",
        "f.png",
        f"stitch {A} {B} --offset 270,0 --avoid ellipse:300,100,80,200 -o f.png",
    ),
    task(
        "the person of the second picture",
        "docs/stitching.md",
        "k.jpg",
        "stitch samples/portrait_left.jpg samples/portrait_right.jpg --keep 1=box:40,60,90,120 -o k.jpg",
    ),
    task(
        "a picture that continues to the right",
        "docs/tutorials/join.md",
        "l.png",
        "stitch samples/grass_a.png samples/grass_b.png --overlap 40 -o l.png",
    ),
    task(
        "a picture that continues below",
        "docs/tutorials/join.md",
        "below.png",
        "stitch top.png bottom.png --side bottom --overlap 25% -o below.png",
    ),
    task(
        "tiles in two columns and two rows",
        "docs/stitching.md",
        "grid.png",
        "stitch tile_0.png tile_1.png tile_2.png tile_3.png --grid 2x2 --overlap 25% -o grid.png",
    ),
    task(
        "scans without a changed pixel, or an error",
        "docs/which-tool.md",
        "scans.tif",
        "stitch --as scans --exact tile_0.png tile_1.png -o scans.tif",
    ),
    task(
        "all panoramas of a folder, and one sheet of them",
        "docs/panoramas.md",
        "all.jpg sheet.jpg",
        "stitch holiday/ -o all.jpg --contact sheet.jpg",
    ),
    task(
        "everything kept, on white",
        "docs/files.md",
        "white.jpg",
        f"stitch {A} {B} --crop outside --background white -o white.jpg",
    ),
    task(
        "another projection",
        "docs/panoramas.md",
        "wide.jpg",
        f"stitch {A} {B} -o one.jpg --save-layout pano.toml --model rotation",
        "stitch pano.toml --projection panini -o wide.jpg",
    ),
    task(
        "the same bytes again, next year",
        "docs/stitching.md",
        "first.png again.png",
        f"stitch {A} {B} --offset 270,0 -o first.png --save-layout placed.toml",
        "stitch placed.toml -o again.png",
    ),
    task(
        "go on in Hugin",
        "docs/panoramas.md",
        "two.jpg pano.pto",
        "stitch holiday/portrait_left.jpg holiday/portrait_right.jpg --model rotation -o two.jpg "
        "--save-layout pano.pto",
    ),
    task(
        "bend a seam",
        "docs/tutorials/join.md",
        "table.png table.svg",
        f"stitch {A} {B} --offset 270,0 -o table.png --seam table.svg",
        f"stitch {A} {B} --offset 270,0 -o table.png --use-seam table.svg --force",
    ),
    task(
        "exposures that differ",
        "docs/tutorials/join.md",
        "c.png",
        "stitch samples/coffee.toml --align --match-tones --blend multiband -o c.png",
    ),
    task("figures for a script", "docs/stitching.md", "j.png", f"stitch {A} {B} --json -o j.png"),
    task(
        "a report for a client",
        "docs/stitching.md",
        "seams.html",
        f"stitch {A} {B} --offset 270,0 -o r.png --report seams.html",
    ),
    task(
        "zoom into it in a browser",
        "docs/large.md docs/stitching.md",
        "zoom.dzi",
        f"stitch {A} {B} --offset 270,0 -o zoom.dzi",
    ),
    task(
        "methods beside each other",
        "docs/method.md",
        "",
        "compare samples/grass_a.png samples/grass_b.png --overlap 25%",
    ),
    task(
        "better seams for Hugin's panorama",
        "docs/large.md",
        "pano.tif",
        "enblend --compression=LZW -o pano.tif -- view0.tif view1.tif",
    ),
    task(
        "a folder of pairs",
        "docs/batch.md",
        "out/007.png out/008.png",
        "batch 'left_*.png' 'right_*.png' --overlap 25% -o 'out/{name}.png' -j 2",
    ),
    task(
        "a large texture of a small one",
        "docs/tutorials/grow.md",
        "gravel.png",
        "synth samples/gravel.png --size 512x384 -o gravel.png",
    ),
    task(
        "a texture that tiles, with its normal map",
        "README.md",
        "cobbles.png",
        "synth samples/cobbles.png --normal samples/cobbles_normal.png --size 512x256 --tileable both "
        "-o cobbles.png",
    ),
    task(
        "a picture that tiles",
        "docs/tutorials/grow.md",
        "g.png g3.png",
        "tile samples/gravel.png -o g.png --preview g3.png",
    ),
    task(
        "something in the way, marked by a mask",
        "docs/tutorials/grow.md",
        "clean.png",
        "fill samples/gravel.png --mask samples/gravel_mask.png -o clean.png",
    ),
    task(
        "something in the way, without an editor",
        "docs/tutorials/grow.md",
        "meadow.png",
        "fill samples/gravel.png --box 40,30,40,30 -o meadow.png",
    ),
    task(
        "tiles for a game",
        "docs/texture.md",
        "meadow",
        "tileset samples/gravel.png samples/cobbles.png -o meadow",
    ),
    task("a pattern", "docs/patterns.md", "motif.png", "motif -o motif.png --size 96"),
    task(
        "a sheet of it",
        "docs/tutorials/invent.md",
        "m.png s.png",
        "motif -o m.png --repeat p4m --palette fall --seed 7 --size 96",
        "repeat m.png 4x4 -o s.png",
    ),
    task(
        "curves for print, 8 cm wide",
        "docs/tutorials/invent.md",
        "m.svg",
        "motif -o m.png --seed 7 --size 96",
        "motif -o m.svg --like m.png --motif-width 80mm --sheet 4x4",
    ),
    task(
        "a page of patterns to choose from",
        "docs/patterns.md",
        "sheet.html next.html",
        "motif --explore 3x2 --palette sea --repeat cmm --size 64 -o sheet.html",
        "motif --from sheet.html --number 3 --explore 3x2 --vary 0.3 -o next.html",
    ),
    task(
        "a book of patterns from a sign",
        "docs/tutorials/invent.md",
        "leaf_book",
        "book samples/leaf.png -n 6 -o leaf_book -j 2",
    ),
    task(
        "a scarf",
        "docs/tutorials/invent.md",
        "scarf.png",
        "motif -o m.png --seed 7 --size 96",
        "mockup m.png -o scarf.png --on scarf --motif-width 60mm",
    ),
    task(
        "a kaleidoscope of a photograph",
        "docs/patterns.md",
        "kaleidoscope.jpg",
        "repeat samples/coffee_a.jpg 4x4 --repeat p6m --cell 100 --at 120,100 -o kaleidoscope.jpg",
    ),
    task(
        "a clip that loops",
        "docs/loops.md",
        "loop.gif",
        "loop clip.gif -o loop.gif --length 12-20",
    ),
    task(
        "two stacks as one, and the surface",
        "docs/volumes.md",
        "both.npy surface.ply",
        "volume stack_a.npy stack_b.npy --offset 0,0,24 -o both.npy --mesh surface.ply",
    ),
    task(
        "a way for a robot",
        "docs/paths.md",
        "way.svg",
        "path map.png --from 4,80 --to 130,80 -o way.svg",
    ),
    task("what is missing on this machine", "docs/install.md", "", "doctor"),
    task("completion in the shell", "docs/install.md", "", "completion bash"),
)
#: Of each task: commands until the result was right, dead ends met, and minutes of reading, about.
COUNTED = (
    *(
        (1, 0, 1),
        (1, 0, 2),
        (1, 0, 1),
        (1, 1, 4),
        (1, 0, 3),
        (1, 0, 1),
        (1, 1, 2),
        (2, 1, 4),
        (1, 0, 2),
        (1, 0, 3),
    ),
    *(
        (1, 0, 2),
        (4, 1, 4),
        (2, 0, 2),
        (1, 0, 3),
        (2, 0, 2),
        (1, 1, 3),
        (1, 0, 2),
        (1, 0, 3),
        (1, 1, 2),
        (1, 0, 2),
    ),
    *(
        (1, 0, 2),
        (1, 0, 3),
        (1, 0, 1),
        (1, 0, 1),
        (1, 0, 1),
        (1, 0, 1),
        (1, 0, 1),
        (1, 0, 2),
        (1, 0, 1),
        (2, 0, 1),
    ),
    *(
        (2, 0, 1),
        (2, 0, 3),
        (1, 0, 1),
        (2, 0, 1),
        (1, 0, 2),
        (1, 0, 3),
        (1, 0, 3),
        (1, 0, 2),
        (1, 0, 1),
        (1, 1, 2),
    ),
)


def prepare(folder: Path) -> None:
    """What a stranger has: the samples, tiles, views, a clip, stacks, a map."""
    shutil.copytree(ROOT / "samples", folder / "samples")
    whole = np.asarray(Image.open(folder / A).convert("RGB"))
    Image.fromarray(whole[:300]).save(folder / "top.png")
    Image.fromarray(whole[225:]).save(folder / "bottom.png")
    crops = ((0, 0), (0, 180), (210, 0), (210, 180))
    for number, (top, left) in enumerate(crops):
        Image.fromarray(whole[top : top + 280, left : left + 240]).save(folder / f"tile_{number}.png")
    for number in (7, 8):
        top = 30 * number
        Image.fromarray(whole[top : top + 200, :240]).save(folder / f"left_00{number}.png")
        Image.fromarray(whole[top : top + 200, 180:420]).save(folder / f"right_00{number}.png")
    for number, left in enumerate((0, 160)):
        view = np.zeros((500, 440, 4), np.uint8)
        view[:, left : left + 280, :3], view[:, left : left + 280, 3] = whole[:, left : left + 280], 255
        Image.fromarray(view).save(folder / f"view{number}.tif")
    (folder / "holiday").mkdir()
    for side in ("left", "right"):
        shutil.copy(folder / f"samples/portrait_{side}.jpg", folder / "holiday")
    rng = np.random.default_rng(0)
    height, width, count = 60, 80, 40
    y, x = np.mgrid[:height, :width]
    frames = []
    for number in range(count):
        wave = np.sin(x / 7 + number / 3) + np.sin(y / 5 - number / 4 + x / 20)
        frames.append(Image.fromarray(np.uint8(np.clip(120 + 40 * wave + rng.normal(0, 4, x.shape), 0, 255))))
    frames[0].save(folder / "clip.gif", save_all=True, append_images=frames[1:], duration=40)
    stack = rng.random((12, 32, 56))
    np.save(folder / "stack_a.npy", (stack[..., :32] * 200).astype(np.uint8))
    np.save(folder / "stack_b.npy", (stack[..., 24:] * 200).astype(np.uint8))
    ground = np.full((96, 140), 220, np.uint8)
    ground[30:, 70:74] = 0
    Image.fromarray(ground).save(folder / "map.png")


def undocumented(one: Task) -> list[str]:
    """Commands and options that the pages of a task do not name."""
    text = "\n".join((ROOT / page).read_text(encoding="utf-8") for page in one.pages)
    words = [word for command in one.commands for word in shlex.split(command)]
    options = {word.partition("=")[0] for word in words if re.match(r"--\w|-[a-z]$", word)}
    named = {option for option in options if re.search(rf"(?<![\w-]){re.escape(option)}\b", text)}
    commands = {command.split()[0] for command in one.commands}
    return sorted(options - named - {"--force"}) + sorted(
        command for command in commands if not re.search(rf"\b{command}\b", text)
    )


def table() -> list[list[str]]:
    """What docs/tasks.md shows of each task: its page, its commands, what was counted."""
    rows = [["", "task", "page", "command", "commands", "dead ends met", "minutes"]]
    for number, (one, counted) in enumerate(zip(TASKS, COUNTED, strict=True), 1):
        pages = ", ".join(
            f"[{Path(page).stem}]({page.removeprefix('docs/') if page.startswith('docs/') else f'../{page}'})"
            for page in one.pages
        )
        commands = "<br>".join(f"`toposeam {command}`" for command in one.commands)
        rows.append([str(number), one.wish, pages, commands, *map(str, counted)])
    commands, met, minutes = (sum(column) for column in zip(*COUNTED, strict=True))
    return [*rows, ["", "all", "", "", str(commands), str(met), str(minutes)]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--program", help="the command toposeam; by default this Python's")
    parser.add_argument("--only", help="numbers of tasks, counted from 1")
    parser.add_argument(
        "--write", action="store_true", help="write the table of docs/tasks.md, and do nothing"
    )
    given = parser.parse_args()
    if given.write:
        write_table("tasks.md", "benchmarks/tasks.py", table())
        return
    program = [given.program] if given.program else [sys.executable, "-m", "toposeam_cli"]
    chosen = {int(one) for one in given.only.split(",")} if given.only else set(range(1, len(TASKS) + 1))
    print(stamp())
    done = 0
    for number, one in enumerate(TASKS, 1):
        if number not in chosen:
            continue
        missing, said, started = undocumented(one), "", time.perf_counter()
        with tempfile.TemporaryDirectory() as scratch:
            prepare(Path(scratch))
            started = time.perf_counter()
            for command in one.commands:
                ran = subprocess.run(
                    [*program, *shlex.split(command)],
                    cwd=scratch,
                    capture_output=True,
                    text=True,
                    check=False,
                )
                if ran.returncode:
                    said = f"{command}: {(ran.stderr.strip().splitlines() or [ran.returncode])[-1]}"
                    break
            seconds = time.perf_counter() - started
            absent = [name for name in one.made if not (Path(scratch) / name).exists()]
        problems = [said] if said else []
        problems += [f"nothing wrote {name}" for name in absent] if not said else []
        problems += [f"{', '.join(one.pages)} does not name {name}" for name in missing]
        done += not problems
        print(f"{number:>3} {seconds:>6.1f} s  {one.wish} ({', '.join(one.pages)})", flush=True)
        for problem in problems:
            print(f"       {problem}", flush=True)
    print(f"{done} of {len(chosen)} tasks done")


if __name__ == "__main__":
    main()
