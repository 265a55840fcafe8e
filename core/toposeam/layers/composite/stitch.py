"""Layers in, one picture out, with its seams."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Image, Labels, Mask
from toposeam.display import to_png
from toposeam.images import full_scale
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.composite.compose import compose
from toposeam.layers.composite.composition import Composition, Outline
from toposeam.layers.composite.options import StitchKeywords, with_signature
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
    label_map: Labels
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


@with_signature
def stitch(
    layers: Sequence[Layer] | Sequence[npt.NDArray[Any]], **keywords: Unpack[StitchKeywords]
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
    method, gradient, cost, options, **keywords
        As for :func:`toposeam.find_seam`; without `cost`, the blends "soft" and "multiband" set its `reach`
        to how far they reach. Of two layers the blend "soft" makes `auto` choose `heat`. Regions between more
        than two layers are no strips: `thesis` and `dp` leave them to `auto`.
    weight : (H, W) array_like on the canvas, optional
        A positive factor on the cost of each pixel's interfaces.
    avoid : (H, W) array_like on the canvas, optional
        Pixels no seam may touch.
    core : float in (0, 1], optional
        What must show of a layer that others cover wholly: this share of its depth, from its middle outwards;
        1 is all of it but its border, where the seam must run. By default a layer that lies inside one other
        layer shows the half of its depth, and one that several others together cover shows only where that
        makes the seams cheaper, which may be nowhere (:attr:`Stitched.hidden`).
    speck : float, optional
        A piece of a layer that others cover wholly need not show if it cannot show so many connected pixels,
        unless the layer has hardly anything else; by default 64, or 0.05 % of the layer's own if that is
        more. 0 lets every piece show.
    blend : {"none", "feather", "soft", "multiband", "gradient"}
        What happens across the seams (:mod:`toposeam.layers.blending.blend`). The masks stay hard.
    blend_width : float, optional
        Of `feather`, `multiband` and `gradient`, in px.
    match_tones : bool
        First give each layer a gain per channel so that overlaps agree
        (:mod:`toposeam.layers.exposure.gains`).
    match_shading : bool
        The same, and a smooth field of gain, since lenses darken towards the corners
        (:mod:`toposeam.layers.exposure.gains`).
    give : int
        Bend the layers by up to so many px until what crosses a seam goes on behind it, and search the seams
        again (:mod:`toposeam.layers.composite.local_warp`), where that makes them clearly cheaper. All layers
        have to fit into memory.
    use_path : SvgSeam, or mapping of (int, int) to SvgSeam, optional
        Seams that were read from files, on the canvas: of the only two layers, or of pairs of layers by
        number.
    max_rounds : int
        Rounds of expansions at most; 0 leaves the seams as they were found one after another.
    effort : {"fast", "best"}, optional
        How thoroughly the seams of more than two layers are searched. By default "fast" up to 12 layers and
        "best" from 13 on. "best" searches canvases of up to 4 megapixels twice, on costs reduced in two ways,
        and once more at full size where three layers meet; it takes two to four times as long, and its seams
        cost the same or less by up to some per cent.
    max_megapixels : float
        Refuse a larger canvas.
    wrap : int, optional
        The canvas goes round, as a panorama of 360° does, and is so many px wide: what reaches over the right
        edge lies at the left one, and seams and blending know it.
    record_frames : bool
        For two layers: keep the densities of every iteration in ``Seam.frames``.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].
    executor : concurrent.futures.Executor, optional
        Where what does not depend on each other is done; the result is the same. Layers are handed to it:
        let their images be Windows that are small when pickled, such as those that know a file's name.

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
    whole = stitched(compose(layers, **keywords))
    if (progress := keywords.get("progress")) is not None:
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
