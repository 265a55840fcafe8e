"""Figures 3.24 to 3.26 of the thesis in kind, and the pictures of docs/texture.md; ``make figures``
runs it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import skimage.data
from PIL import Image, ImageDraw

import toposeam as ts

DOCS = Path(__file__).resolve().parent
FIGURES = DOCS / "figures"
SAMPLES = DOCS.parent / "samples"
_GAP = 12

Pixels = npt.NDArray[np.uint8]


def main() -> None:
    """Draw every picture."""
    FIGURES.mkdir(exist_ok=True)
    figure_24()
    figure_25()
    figure_26()
    uses()


def figure_24() -> None:
    """Patches of 40 to 80 px, 5 × 5 to 10 × 10 of them."""
    cases = (
        (grayscale("gravel"), 40, 10),
        (sample("cobbles"), 60, 7),
        (grayscale("grass"), 80, 5),
        (grayscale("brick"), 60, 7),
    )
    save("fig-3.24-textures.jpg", [grown(source, patch, count) for source, patch, count in cases])


def figure_25() -> None:
    """10 × 10 patches of 40 px."""
    cells = skimage.data.immunohistochemistry()[40:168, 20:148]
    save(
        "fig-3.25-textures.jpg",
        [grown(source, 40, 10) for source in (sample("stars"), sample("cloth"), cells)],
    )


def figure_26() -> None:
    """14 × 14 patches of 40 px, from motifs of the variational art algorithm that form a regular pattern when
    they are connected.
    """
    motifs = [ts.motif(112, repeat="translate", seed=seed).image() for seed in (3, 5, 8)]
    sources = [np.rint(255 * np.tile(motif, (2, 2, 1))[:168, :168]).astype(np.uint8) for motif in motifs]
    save("fig-3.26-textures.jpg", [grown(source, 40, 14) for source in sources], 340)


def uses() -> None:
    """What else patches are good for, a row each."""
    gravel, wall = skimage.data.gravel(), sample("cobbles")
    hole = np.zeros(gravel.shape, bool)
    y, x = np.indices(gravel.shape)
    hole[np.hypot(y - 250, x - 260) < 90] = True
    filled = ts.fill(gravel, hole)
    shown = np.where(hole, 255, gravel).astype(np.uint8)
    save("texture-fill.jpg", [(None, shown), (None, filled.image), (None, seams_over(filled))], 380)

    closed = ts.make_tileable(wall, band=32)
    save("texture-tile.jpg", [(None, np.tile(image, (2, 2, 1))) for image in (wall, closed.image)], 384)

    made = ts.synthesize(wall, 400, patch=40, normal=sample("cobbles_normal"), tileable=True)
    save(
        "texture-maps.jpg",
        [(wall, made.image), (sample("cobbles_normal"), made.normal), (None, seams_over(made))],
        380,
    )

    grass = grayscale("grass")[..., np.newaxis] * np.array([0.75, 1.0, 0.45])
    tiles = ts.texture.tile_set([grass.astype(np.uint8), wall], 64)
    sheet = tiles.laid(np.arange(16).reshape(4, 4))
    save("texture-tiles.jpg", [(None, sheet), (None, tiles.field(8, 8, 1))], 512)

    face = np.asarray(
        Image.fromarray(skimage.data.astronaut()[0:220, 110:330])
        .convert("L")
        .resize((440, 440), Image.Resampling.LANCZOS)
    )
    cloth = Image.fromarray(skimage.data.gravel()[:256, :256])
    source = np.asarray(cloth)
    soft = np.asarray(
        cloth.resize((128, 128), Image.Resampling.BOX).resize((256, 256), Image.Resampling.BICUBIC)
    )
    ranked = np.interp(face, np.percentile(face, range(101)), np.percentile(soft, range(101))).astype(
        np.uint8
    )
    drawn = ts.synthesize(source, face.shape, patch=16, guide=ranked, guide_source=soft, guide_weight=0.85)
    save("texture-guide.jpg", [(source, face), (None, drawn.image)], 440)


def grown(source: Pixels, patch: int, count: int) -> tuple[Pixels, Pixels]:
    """A sample and a texture of count × count patches, each overlapping the next by a quarter."""
    side = patch + (count - 1) * (patch - patch // 4)
    return source, ts.synthesize(source, side, patch=patch, seed=1).image


def seams_over(made: ts.texture.Synthesis) -> Pixels:
    """The picture, pale, with its seams in red."""
    gray = made.image if made.image.ndim == 2 else made.image.mean(axis=2).astype(np.uint8)
    pale = Image.fromarray((160 + gray // 3).astype(np.uint8)).convert("RGB")
    draw = ImageDraw.Draw(pale)
    for line in made.paths:
        draw.line([tuple(point) for point in line.outline], fill=(200, 20, 50), width=1)
    return np.asarray(pale)


def grayscale(name: str) -> Pixels:
    """The upper left 192 × 192 px of one of scikit-image's gray textures."""
    picture: Pixels = getattr(skimage.data, name)()[:192, :192]
    return picture


def sample(name: str) -> Pixels:
    """One of the sample pictures."""
    with Image.open(SAMPLES / f"{name}.png") as image:
        return np.asarray(image.convert("RGB"))


def save(name: str, pairs: list[tuple[Pixels | None, Pixels]], side: int = 310) -> None:
    """Write a row of results, each with its sample, at the same scale, beside its upper left corner."""
    panels = []
    for source, image in pairs:
        scale = side / max(image.shape[:2])
        large = _scaled(image, scale)
        small = None if source is None else _scaled(source, scale)
        width = large.width + (0 if small is None else small.width + _GAP // 2)
        panel = Image.new("RGB", (width, large.height), "white")
        if small is not None:
            panel.paste(small, (0, 0))
        panel.paste(large, (width - large.width, 0))
        panels.append(panel)
    sheet = Image.new(
        "RGB",
        (
            sum(panel.width for panel in panels) + _GAP * (len(panels) - 1),
            max(panel.height for panel in panels),
        ),
        "white",
    )
    left = 0
    for panel in panels:
        sheet.paste(panel, (left, 0))
        left += panel.width + _GAP
    sheet.save(FIGURES / name, quality=80, optimize=True)


def _scaled(image: Pixels, scale: float) -> Image.Image:
    picture = Image.fromarray(np.ascontiguousarray(image)).convert("RGB")
    return picture.resize(
        (round(picture.width * scale), round(picture.height * scale)), Image.Resampling.LANCZOS
    )


if __name__ == "__main__":
    main()
