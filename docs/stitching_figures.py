"""Figures of docs/stitching.md, from the sample pictures: ``python docs/stitching_figures.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import toposeam as ts
from toposeam.seam.result.drawing import draw_seams

HERE = Path(__file__).resolve().parent
PAPER = (243, 242, 238)


def main() -> None:
    """Write both figures."""
    layers = coffee()
    stitched = ts.stitch(layers, match_tones=True, blend="multiband")
    piled = ts.stitch(layers, max_rounds=0)
    scene = np.concatenate(
        [on_paper(draw_seams(piled.image, stitched.seams), piled), on_paper(stitched.image, stitched)], axis=1
    )
    Image.fromarray(scene).save(HERE / "figures" / "stitching-coffee.jpg", quality=88)
    kinds = {
        "none": {},
        "feather": {"blend": "feather"},
        "multiband": {"blend": "multiband"},
        "gradient": {"blend": "gradient"},
        "match-tones": {"match_tones": True},
        "match-tones, multiband": {"match_tones": True, "blend": "multiband"},
    }
    # A seam drawn by hand right through saucer and table, where it cannot hide.
    path = ts.vector.read_svg(
        '<svg xmlns="http://www.w3.org/2000/svg" width="470" height="250"><path d="M255 0 V250"/></svg>'
    )
    tiles = []
    for name, options in kinds.items():
        image = ts.stitch(layers[:2], use_path=path, **options).image[60:200, 185:355]
        tile = Image.fromarray(image).resize((340, 280), Image.Resampling.NEAREST)
        drawing = ImageDraw.Draw(tile)
        drawing.rectangle((0, 0, 12 + 6.2 * len(name), 17), fill=PAPER)
        drawing.text((6, 3), name, fill=(20, 20, 20))
        tiles.append(np.asarray(tile))
    rows = [np.concatenate(tiles[start : start + 3], axis=1) for start in (0, 3)]
    Image.fromarray(np.concatenate(rows)).save(HERE / "figures" / "stitching-blends.jpg", quality=88)


def coffee() -> list[ts.Layer]:
    """The three sample photographs at their places."""
    places = {"a": (0, 0), "b": (190, 30), "c": (90, 170)}
    samples = HERE.parent / "samples"
    return [
        ts.Layer(
            image=np.asarray(Image.open(samples / f"coffee_{name}.jpg")), at=at, name=f"coffee_{name}.jpg"
        )
        for name, at in places.items()
    ]


def on_paper(image: np.ndarray, stitched: ts.layers.Composition) -> np.ndarray:
    """The picture with paper where no layer is, and a margin."""
    shown = np.any(stitched.masks, axis=0)
    return np.pad(
        np.where(shown[..., None], image, np.uint8(PAPER)), ((8, 8), (8, 8), (0, 0)), constant_values=243
    )


if __name__ == "__main__":
    main()
