"""The summary of docs/results.md: a table and two plots, drawn from the tables of that page and of
docs/panoramas.md, so that no number stands there twice by hand; and a plot of a table of docs/heat.md.

``python docs/results_figures.py``; ``make results`` runs it (needs ``pip install '.[plot]'``).
"""

from __future__ import annotations

import re
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "results.md"
MARK = "<!-- numbers: written by docs/results_figures.py -->"
#: The overlap of the first plot: the largest one on which every method is measured.
SIZE = "640 × 160"
OURS, THEIRS = "#c8553d", "#44546a"


def main() -> None:
    text, photographs = PAGE.read_text(encoding="utf-8"), (DOCS / "panoramas.md").read_text(encoding="utf-8")
    methods = strips(text)
    jobs = compared(text, photographs)
    draw_methods(methods, DOCS / "figures/results-methods.png")
    draw_jobs(jobs, DOCS / "figures/results-peers.png")
    draw_rings(rings((DOCS / "heat.md").read_text(encoding="utf-8")), DOCS / "figures/results-rings.png")
    lines = [
        "| job | peer | error, or what shows: TopoSeam's ÷ the peer's "
        "| processor time: TopoSeam's ÷ the peer's |",
        "|---|---|---:|---:|",
        *(f"| {job} | {peer} | {error or '–'} | {time:g} |" for job, peer, error, time in jobs),
    ]
    head, _, rest = text.partition(MARK)
    PAGE.write_text(
        f"{head}{MARK}\n" + "\n".join(lines) + f"\n{MARK}" + rest.partition(MARK)[2], encoding="utf-8"
    )


def strips(text: str) -> dict[str, tuple[float, float, float | None]]:
    """Of each method on the chosen overlap: ms, 1-SSIM, and cost ÷ best where it minimises the same cost."""
    table = re.search(rf"^{SIZE} px, .*?\n\n", text, re.MULTILINE | re.DOTALL)
    if table is None:
        raise ValueError(f"docs/results.md has no table of {SIZE} px")
    found = {}
    for line in table[0].splitlines()[2:]:
        match = re.match(r" *(\S.*?) {2,}([\d.]+) +\S+ +\S+ +([\d.]+|–)(?: +([\d.]+))? +([\d.]+)", line)
        if match and match[1] != "Dijkstra alone":
            found[match[1]] = (float(match[2]), float(match[5]), None if match[3] == "–" else float(match[3]))
    return found


def compared(text: str, photographs: str) -> list[tuple[str, str, float | None, float]]:
    """Of each job: its name, the peer, error ÷ error, time ÷ time."""
    pile = re.search(
        r"toposeam, --match-tones --blend multiband ÷ OpenCV, gains.*: error ([\d.]+), .*?s ([\d.]+);", text
    )
    mosaic = re.search(r"toposeam, tones \+ multiband ÷ enblend: time ([\d.]+)", text)
    section = text.partition("## Mosaics against enblend")[2].partition("\n## ")[0]
    errors = [
        re.search(rf"^{name}(?: +[\d.]+){{5}} +([\d.]+)", section, re.MULTILINE)
        for name in (r"toposeam, tones \+ multiband", "enblend")
    ]
    parallax = re.search(r"\| natural \(default\) \| \**([\d.]+)\**.*\| ([\d.]+) \|$", text, re.MULTILINE)
    whole = re.search(r"processor time, TopoSeam's ÷ theirs.*?\| \| ([\d.]+) \| \| ([\d.]+) \|", photographs)
    if not (pile and mosaic and all(errors) and parallax and whole):
        raise ValueError("a table of docs/results.md or docs/panoramas.md has another form; see this script")
    ours, theirs = (float(error[1]) for error in errors if error)
    return [
        (
            "the seam of two photographs with parallax",
            "OpenCV GraphCut",
            float(parallax[1]),
            float(parallax[2]),
        ),
        ("a pile of crops, exposed differently", "OpenCV's pipeline", float(pile[1]), float(pile[2])),
        ("a mosaic of 17 megapixels", "enblend", round(ours / theirs, 2), float(mosaic[1])),
        ("photographs, from files to the joined picture", "OpenCV's Stitcher", None, float(whole[1])),
        ("the same", "Hugin's command line", None, float(whole[2])),
    ]


def rings(text: str) -> dict[str, list[tuple[float, float]]]:
    """Of each engine: numbers of free pixels and ms, from the table of closed seams of docs/heat.md."""
    table = text.partition("engines.py, rings -->")[2].partition("<!--")[0].strip().splitlines()
    names = [cell.strip().removesuffix(", ms") for cell in table[0].strip("|").split("|")[1:-1]]
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
    for line in table[2:]:
        pixels, *times = [float(cell.replace(",", "")) for cell in line.strip("|").split("|")[:-1]]
        for name, ms in zip(names, times, strict=True):
            found[name].append((pixels, ms))
    return found


def draw_rings(engines: dict[str, list[tuple[float, float]]], target: Path) -> None:
    figure, axes = plt.subplots(figsize=(8, 3.6), layout="constrained")
    for (name, points), style in zip(engines.items(), ("-o", "-s", "--s", "--D"), strict=True):
        ours = name in ("heat", "kernel's flow")
        axes.plot(*zip(*points, strict=True), style, color=OURS if ours else THEIRS, label=name, markersize=4)
    axes.set(xscale="log", yscale="log", xlabel="free pixels of a closed seam", ylabel="processor time, ms")
    axes.legend(frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(target, dpi=130)


def draw_methods(methods: dict[str, tuple[float, float, float | None]], target: Path) -> None:
    figure, axes = plt.subplots(figsize=(8, 4.2), layout="constrained")
    for number, (name, (ms, shows, _cost)) in enumerate(sorted(methods.items(), key=lambda one: one[1][0])):
        ours = name in ("heat", "thesis", "shortest-path", "dp") or name.startswith("find_seam")
        axes.plot(ms, shows, "o", color=OURS if ours else THEIRS)
        place, colour = (5, 6 if number % 4 in (1, 2) else -12), OURS if ours else THEIRS
        axes.annotate(name, (ms, shows), place, textcoords="offset points", fontsize=8, color=colour)
    axes.set_xscale("log")
    axes.margins(x=0.18, y=0.15)
    axes.set(
        xlabel=f"processor time of one seam, ms ({SIZE} px)",
        ylabel="1 - SSIM along the seam\n÷ that of the least (2.4)",
    )
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(target, dpi=130)


def draw_jobs(jobs: list[tuple[str, str, float | None, float]], target: Path) -> None:
    figure, axes = plt.subplots(figsize=(8, 3.4), layout="constrained")
    for row, (_job, _peer, error, time) in enumerate(jobs):
        axes.plot([1, time], [row, row], color=THEIRS, linewidth=1)
        axes.plot(time, row, "s", color=THEIRS, label="processor time" if row == 0 else None)
        if error is not None:
            axes.plot(error, row, "o", color=OURS, label="error, or what shows" if row == 0 else None)
    axes.axvline(1, color="black", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_xticks([0.1, 0.25, 0.5, 1, 2, 5], ["0.1", "0.25", "0.5", "1", "2", "5"])
    axes.minorticks_off()
    axes.set_yticks(range(len(jobs)), [f"{job}\nbeside {peer}" for job, peer, *_ in jobs], fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel("TopoSeam's ÷ the peer's: left of 1 TopoSeam is better")
    axes.legend(frameon=False, loc="lower right", fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(target, dpi=130)


if __name__ == "__main__":
    main()
