"""Pictures of docs/method.md, docs/heat.md and docs/tutorials/python.md: ``python docs/method_figures.py``
(needs ``pip install opencv-python-headless``).
"""

from __future__ import annotations

import contextlib
import io
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import skimage.data
from PIL import Image, ImageDraw

import toposeam as ts
from compared_figures import sheet
from toposeam.seam.problem.match_cost import MatchCost, match_cost
from toposeam.seam.result.drawing import draw_seams

DOCS = Path(__file__).resolve().parent
FIGURES, SAMPLES = DOCS / "figures", DOCS.parent / "samples"
#: The part of the portraits' overlap that is shown: x and y on the canvas, width and height, px.
PERSON = (340, 60, 460, 340)
LAWS = ("natural", "gradient", "colour")

Pixels = np.ndarray


def main() -> None:
    laws()
    verdicts()
    topologies()
    tutorial()


def picture(values: Pixels, scale: int = 1) -> Image.Image:
    """A picture of 8-bit pixels, each enlarged to a square."""
    shown = Image.fromarray(np.ascontiguousarray(values))
    return shown.resize((shown.width * scale, shown.height * scale), Image.Resampling.NEAREST)


def glowing(values: Pixels) -> Pixels:
    """Values in [0, 1] in the colours of heat."""
    return np.asarray(mpl.colormaps["inferno"](np.clip(values, 0, 1))[..., :3] * 255, np.uint8)


def portraits() -> list[ts.Layer]:
    """The two views of a person, placed, with their tones matched."""
    views = [Image.open(SAMPLES / f"portrait_{side}.jpg").convert("RGB") for side in ("left", "right")]
    found = ts.find_places([ts.Layer(np.asarray(view), name=str(n)) for n, view in enumerate(views)])
    return list(ts.layers.match_tones(found.layers))


def laws() -> None:
    """What a cut costs by each law, between two pictures of a person who moved, and the seams."""
    placed = portraits()
    left, top = np.min([layer.at for layer in placed], axis=0)
    shown = []
    for layer in placed:
        x, y = PERSON[0] - (layer.at[0] - left), PERSON[1] - (layer.at[1] - top)
        shown.append(np.asarray(layer.image)[y : y + PERSON[3], x : x + PERSON[2]])
    planes = [np.asarray(one, np.float32) / 255 for one in shown]
    costs, joined = [], []
    for law in LAWS:
        right, down = match_cost(*planes, None, None, None, MatchCost(law=law))
        total = np.log10(right[:-1] + down[:, :-1] + 1e-4)
        low, high = np.percentile(total, (5, 99.5))
        costs.append((picture(glowing((total - low) / (high - low)), 2), f"what a cut costs: {law}"))
        seam = ts.find_seam(*shown, cost=MatchCost(law=law))
        mixed = np.where(seam.labels[..., np.newaxis], shown[1], shown[0])
        joined.append((picture(draw_seams(mixed, [seam]), 2), f"the seam: {law}"))
    pair = [(picture(one, 2), words) for one, words in zip(shown, ("A", "B"), strict=True)]
    between = picture(np.asarray(np.abs(planes[0] - planes[1]).mean(axis=2) * 255, np.uint8), 2)
    sheet(FIGURES / "method-laws.jpg", [[*pair, (between, "how much A and B differ")], costs, joined])


def verdicts() -> None:
    """A seam that is judged to be invisible, and one that is not, with the place to look at."""
    first, second = portraits()
    cases = {
        "": (first, second),
        "B 14 levels brighter: ": (
            first,
            replace(second, image=np.clip(second.image.astype(int) + 14, 0, 255).astype(np.uint8)),
        ),
    }
    shown = []
    for words, layers in cases.items():
        joined = ts.stitch(layers)
        drawn = Image.fromarray(np.asarray(joined.image)[..., :3])
        verdict, size = joined.verdict, 0.03 * drawn.width
        if not verdict.unseen:
            x, y = verdict.where
            ImageDraw.Draw(drawn).ellipse(
                (x - size, y - size, x + size, y + size),
                outline=(220, 20, 30),
                width=max(drawn.width // 200, 2),
            )
        shown.append((drawn, words + str(verdict).split(" (")[0]))
    sheet(FIGURES / "method-verdict.jpg", [shown])


def topologies() -> None:
    """Heat that gathers on one line, on a ring, and on several of them at once."""
    shape, rows = (120, 170), []
    gravel = skimage.data.gravel()
    a, b = gravel[:120, :170], gravel[200:320, 200:370]
    y, x = np.mgrid[: shape[0], : shape[1]]
    disc = np.hypot(x - 85, y - 60)
    islands = np.minimum(np.hypot(x - 45, y - 60), np.hypot(x - 125, y - 60))
    cases = {
        "a strip": (x < 110, x >= 60),
        "a picture within another": (disc > -1, disc < 52),
        "two pictures within another": (islands > -1, islands < 36),
    }
    for words, (mask_a, mask_b) in cases.items():
        seam = ts.find_seam(a, b, mask_a=mask_a, mask_b=mask_b, method="heat", record_frames=True)
        frames = seam.frames
        chosen = [frames[1], frames[len(frames) // 2]]
        row = []
        for frame in chosen:
            heat, overlap = np.zeros(shape), seam.problem.overlap
            window = np.pad(frame.right, ((0, 0), (0, 1))) + np.pad(frame.down, ((0, 1), (0, 0)))
            canvas, inside = overlap.inside
            heat[canvas] = window[inside]
            row.append((picture(glowing(heat), 3), f"{words}: iteration {frame.iteration}"))
        mixed = np.where(seam.labels, b, a)
        row.append((picture(draw_seams(mixed, [seam]), 3), f"iteration {frames[-1].iteration}: the seam"))
        rows.append(row)
    sheet(FIGURES / "heat-topologies.jpg", rows)


def tutorial() -> None:
    """What the code of docs/tutorials/python.md makes."""
    text = (DOCS / "tutorials/python.md").read_text(encoding="utf-8")
    made: dict[str, Any] = {}
    with contextlib.chdir(DOCS.parent), contextlib.redirect_stdout(io.StringIO()):
        for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
            exec(code, made)  # noqa: S102 - our own page
    for name in ("lawns.png", "paper.png"):
        (DOCS.parent / name).unlink()
    a, b, seam, joined = made["a"][:, -40:], made["b"][:, :40], made["seam"], made["joined"]
    soft = np.asarray(np.nan_to_num(seam.soft) * 255, np.uint8)
    sheet(
        FIGURES / "tutorial-seam.jpg",
        [
            [
                (picture(a[:90], 4), "a[:, -40:], its top"),
                (picture(b[:90], 4), "b[:, :40]"),
                (picture(soft[:90], 4), "seam.soft"),
                (picture(draw_seams(joined, [seam])[:90], 4), "joined, and seam.paths"),
            ]
        ],
    )
    stitched = made["stitched"]
    image = np.asarray(stitched)
    sheet(
        FIGURES / "tutorial-lawns.jpg",
        [
            [
                (picture(draw_seams(image, stitched.seams), 2), "stitched.seams"),
                (picture(image, 2), "lawns.png"),
            ]
        ],
    )
    paper = ts.to_pil(made["paper"])
    sheet(
        FIGURES / "tutorial-invented.jpg",
        [
            [
                (picture(made["a"], 2), "a, the sample"),
                (picture(np.asarray(made["wall"]), 2), "wall: grown from a"),
                (ts.to_pil(made["motif"]).resize((384, 384), Image.Resampling.NEAREST), "motif"),
                (paper.resize((paper.width * 3, paper.height * 3)), "paper.png"),
            ]
        ],
    )


if __name__ == "__main__":
    main()
