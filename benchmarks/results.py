"""The tables of docs/results.md, measured at one commit and written there.

    python benchmarks/results.py            all of them, more than an hour
    python benchmarks/results.py -j 2       two at a time, where there are two processors
    python benchmarks/results.py strips     some; the line at the top of results.md is of a run of all

Peers that pip does not install (``apt-get install enblend``) are left out where they are missing. Photographs
with parallax and fresh systems need more than this repository has: docs/results.md names their commands.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from stamp import stamp
from written import DOCS, write_numbers

HERE = Path(__file__).resolve().parent
FIGURE = DOCS / "figures" / "fig-3.27-time.png"

#: name: the words of its command
TABLES: dict[str, tuple[str, ...]] = {
    "strips": ("seams.py", "--all", "--pairs", "4", "--figure", str(FIGURE)),
    "piles": ("seam_costs.py",),
    "stacks": ("stacks.py",),
    "surfaces": ("surfaces.py", "--large", "--loops", "none"),
    "pipeline": ("stitching.py",),
    "moved": ("moved.py",),
    "placing": ("placing.py",),
    "repeating": ("placing.py", "--repeating"),
    "shapes": ("seams.py", "--irregular"),
    "small": ("small_seams.py",),
    "variants": ("quality.py",),
    "cases": ("quality.py", "--cases"),
    "loops": ("surfaces.py", "--quality", "0", "--sizes"),
    "others": ("surfaces.py", "--quality", "0", "--sizes", "--loops", "others"),
    "mosaic": ("mosaic.py",),
    "tones": ("tones.py",),
    "frames": ("seam_costs.py", "--frames"),
}


def numbers(words: tuple[str, ...]) -> str:
    """What a script prints below its stamp."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    ran = subprocess.run(
        [sys.executable, HERE / words[0], *words[1:]],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        env=environment,
    )
    lines = ran.stdout.partition("\n")[2].strip("\n").splitlines()
    return "\n".join(line.rstrip() for line in lines)


def main() -> None:
    """Measure what is named, or everything."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("table", nargs="*", help=f"{', '.join(TABLES)}; all by default")
    parser.add_argument("-j", "--jobs", type=int, default=1)
    given = parser.parse_args()
    wanted = given.table or list(TABLES)
    made = stamp().strip()
    print(stamp())
    with ThreadPoolExecutor(given.jobs) as runs:
        names = {runs.submit(numbers, TABLES[name]): name for name in wanted}
        for run in as_completed(names):
            name, found = names[run], run.result()
            print(f"{name}\n{found}\n", flush=True)
            write_numbers("results.md", f"benchmarks/results.py, {name}", f"```\n{found}\n```")
    if set(wanted) == set(TABLES):
        write_numbers("results.md", "benchmarks/results.py", made)


if __name__ == "__main__":
    main()
