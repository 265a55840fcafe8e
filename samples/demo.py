"""The main jobs on the sample pictures, and a page of what they made.

``python samples/demo.py FOLDER``; ``make demo`` runs it.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent

#: What is shown, and the command: {s} is the folder of the samples, {o} that of the results.
STEPS = (
    (
        "One still life from two cameras that stood side by side:",
        "stitch {s}/still_life_left.png {s}/still_life_right.png --offset 270,0 -o {o}/joined.png --overlay "
        "{o}/joined_seam.png --history {o}/how_heat_found_it.gif --seam {o}/seam.svg --force",
    ),
    (
        "Three exposures of one table, placed roughly:",
        "stitch {s}/coffee.toml --align --match-tones --blend multiband -o {o}/coffee.png --overlay "
        "{o}/coffee_seams.png --force",
    ),
    (
        "A piece of sky with a corner missing, and another that fills it:",
        "stitch {s}/sky_a.png {s}/sky_b.png --offset 120,120 -o {o}/sky.png --overlay {o}/sky_seam.png "
        "--force",
    ),
    (
        "A wall that repeats, grown from a sample, with its normal map:",
        "synth {s}/cobbles.png --normal {s}/cobbles_normal.png --size 640x640 --tileable both --seed 3 -o "
        "{o}/wall.png --force",
    ),
    (
        "A pattern invented by heat:",
        "motif --repeat p4m --palette fall --seed 7 --size 256 --sheet 3x3 -o {o}/pattern.png --force",
    ),
)

#: The pictures to look at, and what they are.
LOOK = {
    "joined.png": "the two pictures as one; try to find the seam, then open",
    "joined_seam.png": "where it runs",
    "how_heat_found_it.gif": "watch the heat gather on it, iteration by iteration",
    "coffee.png": "three pictures aligned, matched in tone, blended",
    "coffee_seams.png": "where they meet",
    "sky.png": "a corner that another picture filled",
    "sky_seam.png": "its seam, round the corner",
    "wall.png": "a texture that repeats",
    "wall_cobbles_normal.png": "its normal map, cut alike",
    "pattern.png": "a pattern, three by three; every seed is another one",
}
STYLE = "body{font:16px sans-serif;max-width:60em;margin:2em auto}img{max-width:100%}figure{margin:2em 0}"
PATH = "seam.svg is the first seam as a path: bend it in GIMP or Inkscape, and give it back with --use-seam"


def main(folder: Path) -> int:
    """Run the commands, each shown before it runs; the exit code of the first that fails."""
    folder.mkdir(parents=True, exist_ok=True)
    for title, line in STEPS:
        arguments = [word.format(s=HERE, o=folder) for word in line.split()]
        print(f"{title}\n  $ toposeam {shlex.join(map(_short, arguments))}", flush=True)
        done = subprocess.run([sys.executable, "-m", "toposeam_cli", *arguments], check=False)  # noqa: S603 - our own command
        if done.returncode:
            return done.returncode
        print(flush=True)
    shown = "".join(
        f'<figure><img src="{name}" alt="{words}"><figcaption>{name}: {words}</figcaption></figure>\n'
        for name, words in LOOK.items()
    )
    head = f'<!doctype html><meta charset="utf-8"><title>TopoSeam</title><style>{STYLE}</style>\n'
    (folder / "index.html").write_text(f"{head}{shown}<p>{PATH}</p>\n", encoding="utf-8")
    print(f"All pictures on one page: {(folder / 'index.html').resolve().as_uri()}")
    return 0


def _short(argument: str) -> str:
    """A path as it would be typed from the current folder."""
    path = Path(argument)
    return (
        str(path.relative_to(Path.cwd()))
        if path.is_absolute() and path.is_relative_to(Path.cwd())
        else argument
    )


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python samples/demo.py FOLDER")
    sys.exit(main(Path(sys.argv[1])))
