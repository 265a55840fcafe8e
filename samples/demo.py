"""Join the sample pictures on the command line and say where to look: ``python samples/demo.py FOLDER`` (``make demo`` runs it)."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def main(folder: Path) -> int:
    """Run the commands, each shown before it runs; the exit code of the first that fails."""
    folder.mkdir(parents=True, exist_ok=True)
    left, right, sky, patch = (
        str(HERE / name) for name in ("motorcycle_left.png", "motorcycle_right.png", "sky_a.png", "sky_b.png")
    )  # fmt: skip
    joined, seen, history, seam = (str(folder / name) for name in ("joined.png", "joined_seam.png", "how_heat_found_it.png", "seam.svg"))
    steps = (
        (
            "Two photographs of one motorcycle, from two cameras:",
            ["stitch", left, right, "--offset", "270,0", "-o", joined, "--overlay", seen, "--history", history, "--seam", seam, "--force"],
        ),
        (
            "A piece of sky with a corner missing, and another that fills it:",
            [
                "stitch",
                sky,
                patch,
                "--offset",
                "120,120",
                "-o",
                str(folder / "sky.png"),
                "--overlay",
                str(folder / "sky_seam.png"),
                "--force",
            ],
        ),
        ("Every method on the motorcycle:", ["compare", left, right, "--offset", "270,0"]),
    )
    for title, arguments in steps:
        print(f"{title}\n  $ toposeam {shlex.join(map(_short, arguments))}", flush=True)
        done = subprocess.run([sys.executable, "-m", "toposeam_cli.main", *arguments], check=False)  # noqa: S603 - our own command
        if done.returncode:
            return done.returncode
        print(flush=True)
    print(
        f"Look into {folder.resolve()}\n"
        "  joined.png             the two photographs as one; try to find the seam, then open\n"
        "  joined_seam.png        where it runs\n"
        "  how_heat_found_it.png  the heat gathering on it, iteration by iteration\n"
        "  seam.svg               the seam as a path: bend it in GIMP or Inkscape and give it back with --use-seam\n"
        "  sky.png, sky_seam.png  the same round a corner"
    )
    return 0


def _short(argument: str) -> str:
    """A path as it would be typed from the current folder."""
    path = Path(argument)
    return str(path.relative_to(Path.cwd())) if path.is_absolute() and path.is_relative_to(Path.cwd()) else argument


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python samples/demo.py FOLDER")
    sys.exit(main(Path(sys.argv[1])))
