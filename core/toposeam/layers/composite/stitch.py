"""Layers in, one picture out, with its seams."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from toposeam.display import to_png
from toposeam.images import Image, Mask, full_scale
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.painting import LabelMap
from toposeam.layers.composite.compose import compose
from toposeam.layers.composite.composition import Composition, Outline
from toposeam.layers.composite.options import StitchKeywords
from toposeam.layers.labelling.problem import Pair
from toposeam.picture_files import PictureResult
from toposeam.saving import save
from toposeam.seam.result.drawing import draw_seams
from toposeam.seam.result.seam import Seam
from toposeam.seam.result.verdict import Verdict, worst_of
from toposeam.sentence import counted
from toposeam.vector.svg import write_svg


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Stitched(PictureResult):
    """The composite of placed layers.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> a, b = np.random.default_rng(0).random((2, 30, 40))
    >>> stitched = ts.stitch(ts.layers.overlapping(a, b, overlap=10))
    >>> stitched.image.shape, len(stitched.masks), stitched.pairs
    ((30, 70), 2, ((0, 1),))
    """

    #: (H, W) or (H, W, C), dtype of the layers; 0 where no layer has pixels.
    image: Image
    #: (H, W) opacity in the layers' dtype, or None where every pixel is opaque.
    alpha: npt.NDArray[Any] | None
    #: (H, W) int16, the number of the layer that shows at each pixel; -1 where none has pixels.
    label_map: LabelMap
    #: The seams, or what makes them.
    _seams: tuple[Seam, ...] | Callable[[], tuple[Seam, ...]]
    #: Which two layers each seam divides, by number; ``b`` of the seam is the second one.
    pairs: tuple[Pair, ...]
    #: The layers' names.
    names: tuple[str, ...]
    #: Rounds of expansions that were made, 0 for two layers.
    rounds: int
    #: (x, y) of the canvas's upper left pixel in the layers' coordinates.
    origin: tuple[int, int]
    #: The farthest by which layers were bent to meet at the seams, px.
    bent: float = 0.0

    @property
    def seams(self) -> tuple[Seam, ...]:
        """One seam per pair of layers that adjoin where both have pixels; those of more than two layers are
        made when somebody asks for them.
        """
        return self._seams() if callable(self._seams) else self._seams

    @property
    def masks(self) -> tuple[Mask, ...]:
        """One (H, W) bool mask per layer: where it shows. They never overlap and together cover what any
        layer covers.
        """
        return tuple(self.label_map == index for index in range(len(self.names)))

    @property
    def hidden(self) -> tuple[int, ...]:
        """The numbers of the layers that show nowhere, since others cover them and seams cost less so."""
        return tuple(index for index, mask in enumerate(self.masks) if not mask.any())

    @property
    def cost(self) -> float:
        """Σ M over all seams."""
        return sum(seam.cost for seam in self.seams)

    @property
    def verdict(self) -> Verdict | None:
        """That of the seam most likely to be seen; None unless the law of the match cost is "natural"."""
        return worst_of(seam.verdict for seam in self.seams)

    def __repr__(self) -> str:
        height, width = self.label_map.shape
        return (
            f"Stitched({len(self.names)} layers, {width} × {height} px, {counted(len(self.seams), 'seam')} "
            f"of cost {self.cost:.4g})"
        )

    def _repr_png_(self) -> bytes:
        return to_png(draw_seams(self.image, self.seams), self.alpha)

    def to_svg(self, path: str | Path | None = None) -> str:
        """All seams as one SVG document; the paths of a seam are named after its layers, as ``"first.png :
        second.png"``.

        Parameters
        ----------
        path : str or Path, optional
            Also write the document there (an existing file is replaced).
        """
        shape = self.label_map.shape
        between = list(zip(self.pairs, self.seams, strict=True))
        text = seams_svg(between, self.names, (shape[0], shape[1]), self.rounds)
        if path is not None:
            save(path, text)
        return text


def seams_svg(
    seams: Sequence[tuple[Pair, Seam | Outline]],
    names: Sequence[str],
    shape: tuple[int, int],
    rounds: int,
) -> str:
    """The seams between layers, by their numbers, as one SVG document of the canvas's height and width."""
    lines = [(line, pair_name(names[i], names[j])) for (i, j), seam in seams for line in seam.paths]
    settings: dict[str, Any] = {
        "layers": tuple(names),
        "cost": sum(seam.cost for _, seam in seams),
        "rounds": rounds,
        "seams": [
            {**seam.settings, "pair": pair, "method": seam.method, "cost": seam.cost} for pair, seam in seams
        ],
    }
    height, width = shape
    return write_svg([line for line, _ in lines], width, height, settings, [name for _, name in lines])


def pair_name(first: str, second: str) -> str:
    """What the paths between two layers are called in SVG.

    Examples
    --------
    >>> import toposeam as ts
    >>> ts.layers.pair_name("a", "b")
    'a : b'
    """
    return " ".join(f"{first} : {second}".split())


def stitch(
    layers: Sequence[Layer] | Sequence[npt.NDArray[Any]], **options: Unpack[StitchKeywords]
) -> Stitched:
    """Join placed layers.

    Two are joined along one seam. More are laid on top of each other in several orders of their places; from
    each of these starts, moves let one layer after another show more of itself, until the total cost falls no
    longer, and the best of each end is taken (:mod:`toposeam.layers.search.local_search`).
    What shows where, and at what cost, is defined in :mod:`toposeam.layers.labelling.problem`.

    Parameters
    ----------
    layers : sequence of Layer, or list of (H, W) or (H, W, C) arrays
        At least two, of one dtype; gray layers are widened to the others' channels. Of arrays the places are
        found first, by :func:`toposeam.find_places`; those that fit none of the others are left out with a
        warning.
    **options
        Fields of :class:`toposeam.layers.StitchOptions`, which says what each means, and of
        :class:`toposeam.seam.HeatOptions` or :class:`toposeam.seam.ThesisOptions`: `blend`, `blend_width`,
        `match_tones`, `match_shading` and `give` for how the picture looks; `method`, `options`, `cost`,
        `gradient`, `effort` and `max_rounds` for how seams are searched; `weight`, `avoid`, `core`, `speck`
        and `use_path` for where they run; `wrap` and `max_megapixels` for the canvas; `record_frames`,
        `progress` and `executor`.

    Returns
    -------
    Stitched

    Raises
    ------
    OverlapError
        When a layer shares no pixel with the others.
    ImageError, OptionError, PathError

    Examples
    --------
    >>> import numpy as np
    >>> from toposeam.layers.canvas.layer import Layer
    >>> whole = np.random.default_rng(0).random((30, 60))
    >>> stitch([Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))])
    Stitched(2 layers, 60 × 30 px, 1 seam of cost 0.03)
    >>> from skimage import data
    >>> whole = data.camera()[100:260, :300]
    >>> stitch([whole[:, :180], whole[:, 120:]], blend="feather").image.shape
    (160, 300)
    """
    whole = stitched(compose(layers, **options))
    if (progress := options.get("progress")) is not None:
        progress(1.0)
    return whole


def stitched(composed: Composition, labels: bool = True) -> Stitched:
    """All of a composition at once; without its label map no layer is said to show anywhere."""
    everything = slice(None), slice(None)
    image, alpha = composed.window(*everything)

    @cache
    def made() -> tuple[Seam, ...]:
        return tuple(seam for _, seam in composed.seams())

    return Stitched(
        image=image,
        alpha=None if alpha.min() == full_scale(image.dtype) else alpha,
        label_map=composed.labels(*everything) if labels else np.broadcast_to(np.int16(-1), composed.shape),
        _seams=made() if len(composed.layers) == 2 else made,
        pairs=composed.pairs,
        names=composed.names,
        rounds=composed.rounds,
        origin=composed.origin,
        bent=composed.bent,
    )
