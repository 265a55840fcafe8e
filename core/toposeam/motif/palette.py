"""Colours to print with: a paper and the inks that go on it, by name or taken from a picture.

Inks are mixed subtractively (thesis 4.2): where two lie on each other, and on the paper, their colours are multiplied. So the inks here are
light enough for their mixtures to stay clear.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from toposeam.errors import OptionError
from toposeam.images import as_float

Floats = npt.NDArray[np.float64]

#: Paper first, then the inks, the most important first.
_NAMED = {
    "spring": "fffaf0 f27ea9 8cc63f ffcf3d 6cc3e0 b98ae0 f79a68",
    "summer": "fdfdf4 1295d8 ffbe1a ff6552 1fbfa5 6cc04a f2549b",
    "fall": "fbf3e3 c4502f e09f2c 76834a 8c3348 d98545 4f6b66",
    "winter": "f5f9fc 2d5f91 86b6da 8e9db0 5a4a8f b5384a 2f7a78",
    "ink": "f7f4ec 3c3c3f 77767a a5a29c b5452f 565b66 8c8172",
    "indigo": "f4f1e8 27408b 5f7fbf 9fb6d9 1d6a83 7568a8 c8a24a",
    "meadow": "fbfaee 5f9e3f c5d246 2f7f6d e6b422 d96c8a 7fb4c9",
    "dusk": "fcefe9 6a4c93 e56b6f f0a868 355070 b56576 7f95c4",
    "terracotta": "faf1e8 c1583c dfa27a 5d7275 e3b04b 93503f 9fae8e",
    "riso": "fdfbf5 ff48b0 0078bf ffe100 00a95c ff6c2f 765ba7",
    "cmy": "ffffff 00aeef ec008c fff200 00a99d f7941d 8560a8",
    "sea": "f3faf8 0b7a99 52bcc4 a5d8c6 1d4e89 f2b880 e4745b",
}

#: The names :func:`palette` knows.
PALETTES = tuple(_NAMED)

#: The four that divide a pattern book.
SEASONS = ("spring", "summer", "fall", "winter")

#: Most pixels of a picture that are looked at.
_SAMPLE = 20_000
_CLUSTERING_ROUNDS = 30


@dataclass(frozen=True, slots=True, eq=False)
class Palette:
    """A paper (3,) and inks (n, 3), sRGB in [0, 1]."""

    paper: Floats
    inks: Floats

    def __post_init__(self) -> None:
        for values in (self.paper, self.inks):
            values.setflags(write=False)


def palette(source: str | npt.ArrayLike, n: int = 3, *, seed: int = 0) -> Palette:
    """The paper and the first n inks of a palette.

    Parameters
    ----------
    source : str or (H, W[, 3]) array_like
        One of `PALETTES`; or colours like ``"#fffaf0 #c4502f #e09f2c"``, paper first; or a picture, whose colours are clustered (k-means in
        the perceptually even OKLab, Ottosson 2020): the lightest becomes the paper, the others inks that print as themselves on it, the
        most saturated and frequent first.
    n : int
        Number of inks, 1 or more.
    seed : int
        For the clustering.

    Raises
    ------
    OptionError
        For a name that does not exist, text that is no colour, or fewer than n inks.
    ImageError
        For a picture that cannot be used.
    """
    if n < 1:
        raise OptionError(f"a palette of {n} inks was asked for; ask for 1 or more")
    if not isinstance(source, str):
        return _from_picture(as_float(source, "the palette's picture"), n, seed)
    colours = _named(source) if "#" not in source else _written(source)
    if len(colours) - 1 < n:
        raise OptionError(
            f"the palette '{source}' has {len(colours) - 1} inks, but {n} layers need {n}; use fewer layers or another palette"
        )
    return Palette(colours[0], colours[1 : n + 1])


def _named(name: str) -> Floats:
    if name not in _NAMED:
        raise OptionError(f"there is no palette '{name}'; use one of {', '.join(PALETTES)}, or colours like '#fffaf0 #c4502f', paper first")
    return _written(" ".join(f"#{colour}" for colour in _NAMED[name].split()))


def _written(text: str) -> Floats:
    """Colours in hexadecimal."""
    colours = re.split(r"[\s,]+", text.strip())
    for colour in colours:
        if not re.fullmatch(r"#[0-9a-fA-F]{6}", colour):
            raise OptionError(f"'{colour}' is not a colour; write six hexadecimal digits after '#', like #c4502f")
    return np.array([[int(colour[at : at + 2], 16) for at in (1, 3, 5)] for colour in colours]) / 255.0


def _from_picture(image: npt.NDArray[np.float32], n: int, seed: int) -> Palette:
    pixels = np.clip(image.reshape(-1, image.shape[2])[:, :3], 0, 1).astype(np.float64)
    if pixels.shape[1] != 3:
        pixels = np.repeat(pixels[:, :1], 3, axis=1)
    rng = np.random.default_rng(seed)
    if len(pixels) > _SAMPLE:
        pixels = pixels[rng.choice(len(pixels), _SAMPLE, replace=False)]
    distinct = len(np.unique(np.rint(pixels * 255), axis=0))
    if distinct <= n:
        raise OptionError(
            f"the palette's picture has {distinct} colours, but a paper and {n} inks need {n + 1}; use fewer layers or another picture"
        )
    lab = _to_oklab(pixels)
    centres = _spread(lab, n + 1, rng)
    for _ in range(_CLUSTERING_ROUNDS):  # k-means (Lloyd 1982)
        nearest = ((lab[:, None] - centres) ** 2).sum(axis=2).argmin(axis=1)
        share = np.bincount(nearest, minlength=n + 1) / len(lab)
        sums = np.column_stack([np.bincount(nearest, channel, n + 1) for channel in lab.T])
        centres = np.where(share[:, None] > 0, sums / np.maximum(share * len(lab), 1)[:, None], centres)
    colours = _from_oklab(centres)
    lightest = int(centres[:, 0].argmax())
    others = np.delete(np.arange(n + 1), lightest)
    weight = np.sqrt(share[others]) * (0.05 + np.hypot(*centres[others, 1:].T))
    paper = colours[lightest]
    inks = np.clip(colours[others[np.argsort(-weight)]] / np.maximum(paper, 1e-3), 0, 1)
    return Palette(paper, inks)


def _spread(points: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Points far from one another, to begin the clustering with (k-means++; Arthur and Vassilvitskii 2007)."""
    chosen = [points[int(rng.integers(len(points)))]]
    distance = np.full(len(points), np.inf)
    for _ in range(count - 1):
        distance = np.minimum(distance, ((points - chosen[-1]) ** 2).sum(axis=1))
        chosen.append(points[int(rng.choice(len(points), p=distance / distance.sum()))])
    return np.array(chosen)


_TO_CONES = np.array([
    [0.4122214708, 0.5363325363, 0.0514459929],
    [0.2119034982, 0.6806995451, 0.1073969566],
    [0.0883024619, 0.2817188376, 0.6299787005],
])  # fmt: skip
_TO_LAB = np.array([
    [0.2104542553, 0.7936177850, -0.0040720468],
    [1.9779984951, -2.4285922050, 0.4505937099],
    [0.0259040371, 0.7827717662, -0.8086757660],
])  # fmt: skip


def _to_oklab(rgb: Floats) -> Floats:
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    lab: Floats = np.cbrt(linear @ _TO_CONES.T) @ _TO_LAB.T
    return lab


def _from_oklab(lab: Floats) -> Floats:
    linear = np.clip((lab @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_CONES).T, 0, 1)
    rgb: Floats = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
    return rgb
