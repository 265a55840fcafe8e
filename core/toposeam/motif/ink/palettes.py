"""Palettes: a paper and the inks for it, by name or from a picture."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.checks import check_whole
from toposeam.colours import LUMA, parse_colour, to_hex
from toposeam.errors import OptionError, Term
from toposeam.heat.threads import one_thread
from toposeam.images import as_float

#: Paper, then inks, the leading one first.
PALETTES: dict[str, tuple[str, ...]] = {
    "spring": ("#fdf8ee", "#e58a9a", "#8fb86a", "#f2c14e", "#7fb3c8", "#c79bc7", "#5d8a66"),
    "summer": ("#fbfaf3", "#1f8a9e", "#f26d5b", "#f4b73f", "#3b6fb6", "#79b791", "#d94f70"),
    "fall": ("#f8f0e1", "#b5532a", "#d99a2b", "#6f7a3a", "#7d2e3a", "#3f4a4f", "#c77b58"),
    "winter": ("#f4f6f8", "#23426b", "#7fa6c4", "#8c2f45", "#9aa7b4", "#3e6b6f", "#5b4b7a"),
    "indigo": ("#f6f3ea", "#24376b", "#5f86b5", "#9dbad0", "#16233f", "#7d7fa8", "#c0894f"),
    "sumi": ("#f5f1e8", "#2b2b2e", "#7b7a78", "#b0342c", "#55585c", "#a79f91", "#3d3a38"),
    "terracotta": ("#faf1e6", "#c4583a", "#2f5d62", "#e0a458", "#8a3b2e", "#88a096", "#5a3d2b"),
    "botanic": ("#f7f5e9", "#2f6b4f", "#a3b86c", "#d98c5f", "#1f4037", "#d6b656", "#7c9f8a"),
    "sea": ("#f3f8f6", "#12637a", "#52a7a5", "#f0a48b", "#0f3d57", "#a3d1c6", "#dcae5b"),
    "plum": ("#faf3f1", "#6d2e58", "#d1728f", "#e7a977", "#40294d", "#a486b4", "#7e8f5f"),
    "saffron": ("#fdf6e3", "#d98816", "#a63a2f", "#2f6f73", "#e8b84a", "#5b3a5e", "#7a8c45"),
    "night": ("#efe9dc", "#1b2a41", "#b0413e", "#d8a25e", "#3e5c76", "#748cab", "#5c4b51"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Palette:
    """A paper and its inks, sRGB in [0, 1].

    Examples
    --------
    >>> import toposeam as ts
    >>> ts.motif.palette("indigo", 3).inks.shape
    (3, 3)
    """

    #: (3,)
    paper: Floats
    #: (n, 3)
    inks: Floats

    def __repr__(self) -> str:
        return f"Palette({', '.join(map(to_hex, self.inks))} on {to_hex(self.paper)})"

    def check_layers(self, layers: int) -> None:
        """Refuse more layers than there are inks.

        Raises
        ------
        OptionError
        """
        if len(self.inks) < layers:
            raise OptionError(
                "the palette has {count} inks for {wanted} layers; use fewer layers or more inks",
                kind="count",
                parameter=Term("palette"),
                value=self,
                count=len(self.inks),
                wanted=layers,
            )


def palette(source: str | npt.ArrayLike, n: int) -> Palette:
    """Return a paper and `n` inks.

    Parameters
    ----------
    source : str or (H, W, 3) array_like
        A name from `PALETTES`, or a picture. If a named palette has too few inks, mixtures of them are added.
        The lightest main colour of a picture becomes the paper; inks are chosen that print the others on it.
    n : int
        Number of inks.

    Raises
    ------
    OptionError
        For an unknown name, or more inks than the palette or the picture has.

    Examples
    --------
    >>> import toposeam as ts
    >>> ts.motif.palette("sumi", 2).inks.round(2).tolist()
    [[0.17, 0.17, 0.18], [0.48, 0.48, 0.47]]
    """
    n = check_whole("n", n, 1)
    if isinstance(source, str):
        if source not in PALETTES:
            raise OptionError(
                "{parameter} {given} is not known; choose one of {allowed}",
                kind="choice",
                parameter=Term("palette"),
                value=source,
                given=repr(source),
                allowed=tuple(PALETTES),
            )
        paper, *inks = [np.array(parse_colour(text)) for text in PALETTES[source]]
        if n > len(inks):
            inks += _mixed(paper, inks, n - len(inks))
        if n > len(inks):
            raise OptionError(
                "{parameter} {value} has {count} inks with their mixtures, {wanted} were asked for; use "
                "fewer layers or give the inks",
                kind="count",
                parameter=Term("palette"),
                value=source,
                count=len(inks),
                wanted=n,
            )
        return Palette(paper=paper, inks=np.array(inks[:n]))
    return _from_picture(source, n)


def _mixed(paper: Floats, inks: list[Floats], count: int) -> list[Floats]:
    """Mix up to `count` further inks, each of two in equal parts.

    In each step the mixture is added that differs most from the paper and from all inks so far.
    """
    mixtures = [(one + other) / 2 for one, other in combinations(inks, 2)]
    chosen: list[Floats] = []
    while mixtures and len(chosen) < count:
        there = np.array([paper, *inks, *chosen])
        apart = [np.square(there - mixture).sum(axis=1).min() for mixture in mixtures]
        chosen.append(mixtures.pop(int(np.argmax(apart))))
    return chosen


def _from_picture(source: npt.ArrayLike, n: int) -> Palette:
    image = as_float(source, "the palette's picture")
    pixels = image[..., :3].reshape(-1, image.shape[2] if image.shape[2] < 3 else 3).astype(np.float64)
    if pixels.shape[1] < 3:
        pixels = np.repeat(pixels[:, :1], 3, axis=1)
    pixels = np.clip(pixels[:: max(1, len(pixels) // 20_000)], 0.0, 1.0)
    distinct = np.unique(np.round(pixels * 31), axis=0)
    if len(distinct) < n + 1:
        raise OptionError(
            "the palette's picture has {count} colours, {least} are needed (paper and {wanted} inks); use "
            "fewer layers",
            kind="count",
            parameter=Term("palette"),
            count=len(distinct),
            least=n + 1,
            wanted=n,
        )
    centres, sizes = _cluster(pixels, n + 1)
    lightest = int(np.argmax(centres @ LUMA))
    paper = centres[lightest]
    rest = np.delete(np.arange(n + 1), lightest)
    rest = rest[np.argsort(-sizes[rest], kind="stable")]
    return Palette(paper=paper, inks=np.clip(centres[rest] / np.maximum(paper, 1e-3), 0.0, 1.0))


def _cluster(pixels: Floats, n: int) -> tuple[Floats, Floats]:
    """Find the main colours and their numbers of pixels by k-means on a perceptual scale.

    The start is deterministic: each centre is the pixel farthest from those before.
    """
    from scipy.cluster.vq import kmeans2

    points = np.cbrt(pixels) @ np.array([[0.3, 0.6, 0.3], [0.6, -0.9, 0.5], [0.1, 0.3, -0.8]])
    chosen = [int(np.argmax(points[:, 0]))]
    nearest = np.full(len(points), np.inf)
    for _ in range(n - 1):
        nearest = np.minimum(nearest, np.square(points - points[chosen[-1]]).sum(1))
        chosen.append(int(np.argmax(nearest)))
    with one_thread(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an empty cluster keeps its first pixel
        _, label = kmeans2(points, points[chosen], 25, minit="matrix", missing="warn")
    counts = np.bincount(label, minlength=n).astype(np.float64)
    means = np.stack([pixels[label == c].mean(0) if counts[c] else pixels[chosen[c]] for c in range(n)])
    return means, counts
