"""Large textures from small samples (thesis 3.5, after Efros and Freeman 2001, doi:10.1145/383259.383296)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from toposeam.errors import ImageError, OptionError
from toposeam.images import as_float, full_scale
from toposeam.layers.composite import MAX_PIXELS
from toposeam.texture.atlas import Atlas
from toposeam.texture.canvas import Canvas
from toposeam.texture.closing import closing_guide, order_axis
from toposeam.texture.lay import Guide, Layer, LayOptions
from toposeam.texture.mend import mend
from toposeam.texture.raster import lay_all, patches_along
from toposeam.texture.rendering import render
from toposeam.texture.scale import natural_patch
from toposeam.texture.sources import Images, Sources, as_list, check_varied, read_sources
from toposeam.texture.synthesis import Synthesis

Tileable = bool | Literal["x", "y"]
#: Sides of a patch are at least this many px.
SMALLEST_PATCH = 4


def synthesize(
    source: Images,
    size: int | tuple[int, int],
    patch: int | None = 40,
    overlap: int | None = None,
    seed: int = 0,
    tileable: Tileable = False,
    *,
    alpha: Images | None = None,
    mask: Images | None = None,
    maps: Sequence[Images] = (),
    weights: Sequence[float] | None = None,
    guide: npt.ArrayLike | None = None,
    guide_source: Images | None = None,
    guide_weight: float = 0.5,
    smooth: int = 1,
    max_pixels: int = MAX_PIXELS,
    progress: Callable[[float], None] | None = None,
    **options: Any,
) -> Synthesis:
    """Grow a texture of any size from one or more samples.

    Patches are laid in raster order, each where it fits best to what is there, and cut along heat seams.

    Parameters
    ----------
    source : (H, W[, C]) array_like, or a list of such
        The exemplars, gray or RGB, of one dtype.
    size : int or (int, int)
        Height and width of the texture, px.
    patch : int, optional
        Side of a patch, px; None chooses by the size of the texture's elements. Cut to the texture where that is smaller.
    overlap : int, optional
        How far neighbouring patches overlap, px; by default a quarter of the patch.
    seed : int
        The same seed gives the same bytes.
    tileable : bool or {"x", "y"}
        Whether the texture continues at the opposite border, on both axes or one.
    alpha, mask : (H, W) array_like, or a list with one per exemplar
        Opacity, which is laid with the patches, and where to sample; by default wherever the opacity is above 0.
    maps : sequence
        Further maps of the same exemplars (normals, roughness …), each an array or a list with one per exemplar.
    weights : sequence of float, optional
        How much the picture and each map count in the search and in the seams; 1 each by default.
    guide, guide_source : array_like
        What is wanted, on the texture's canvas, and what the exemplars' pixels stand for, in the same terms: (H, W) or (H, W, G) each. Each
        patch is then also chosen for how well its piece of `guide_source` agrees with `guide` there.
    guide_weight : float
        Share of the guide in that choice, in [0, 1].
    smooth : int
        px to either side of a seam in which neighbouring patches are mixed; 0 for hard cuts.
    max_pixels : int
        Refuse a larger texture.
    progress : callable, optional
        Called with the share of the patches laid.
    **options
        Fields of :class:`LayOptions`.

    Returns
    -------
    Synthesis

    Raises
    ------
    ImageError
        For exemplars, masks or maps that cannot be used.
    OptionError
        For sizes and options out of range.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> sample = np.random.default_rng(0).integers(0, 256, (48, 48), np.uint8)
    >>> ts.synthesize(sample, (60, 80), patch=24, tileable="x").image.shape
    (60, 80)
    """
    height, width = _size(size, max_pixels)
    if tileable not in (False, True, "x", "y"):
        raise OptionError(f"tileable is {tileable!r}; choose False, True, 'x' or 'y'")
    if not 0 <= smooth <= 8:
        raise OptionError(f"smooth is {smooth}; choose 0 to 8 px")
    wraps = (tileable in (True, "y"), tileable in (True, "x"))
    sources = read_sources(source, alpha=alpha, mask=mask, maps=maps, weights=weights)
    check_varied(sources)
    chosen = lay_options(options)
    side = natural_patch(sources.features, sources.usable, sources.shapes) if patch is None else patch
    side, overlap = check_patch(sources, side, overlap)
    atlas = Atlas.of(sources.present, chosen.context, sources.usable)
    features = atlas.spread(sources.features)
    given = _guide(guide, guide_source, guide_weight, atlas, sources, (height, width))
    rows, columns = patches_along(height, side, overlap, wraps[0]), patches_along(width, side, overlap, wraps[1])
    report = _Stages(progress)
    axis = None
    if given is None and chosen.close and any(wraps) and min(height, width) >= 4 * side:
        axis = order_axis(sources.features[0], sources.usable[0])
    if axis is not None and wraps[axis]:
        given = closing_guide(sources, atlas, chosen, (height, width), wraps, axis, side, overlap, seed, report.stage(0.0, 0.3))
    canvas = Canvas((height, width), wraps, atlas.usable.size)
    layer = Layer(atlas, features, canvas, chosen, np.random.default_rng(seed), height * width, given)
    shape = rows[0], columns[0]
    if not layer.search.room(shape).any():
        raise ImageError(f"no place in the mask has room for a patch of {shape[1]} × {shape[0]} px; use smaller patches or a larger mask")
    lay_all(layer, side, overlap, 0, report.stage(report.done, 0.9))
    mend(layer, shape, round(chosen.mend * len(rows[1]) * len(columns[1])), report.stage(0.9, 1.0))
    report.finish()
    settings = {"patch": side, "overlap": overlap, "seed": seed, "tileable": tileable, "smooth": smooth, **settings_of(chosen)}
    return finish(sources, atlas, canvas, shape, settings, smooth)


class _Stages:
    """Progress through several stages."""

    def __init__(self, progress: Callable[[float], None] | None) -> None:
        self._progress, self.done = progress, 0.0

    def stage(self, first: float, last: float) -> Callable[[float], None] | None:
        """What reports the share done of a stage that takes from one share of the whole to another."""

        def report(share: float) -> None:
            self.done = first + (last - first) * share
            if self._progress is not None:
                self._progress(self.done)

        return report

    def finish(self) -> None:
        """All is done."""
        if self._progress is not None:
            self._progress(1.0)


def finish(
    sources: Sources, atlas: Atlas, canvas: Canvas, patch: tuple[int, int], settings: dict[str, Any], smooth: int,
    changed: npt.NDArray[np.bool_] | None = None,
) -> Synthesis:  # fmt: skip
    """Every map, made of what the canvas shows."""
    made = []
    for images, gray in zip(sources.planes, sources.gray, strict=True):
        picture = render(canvas.index, atlas.spread(images), atlas.usable, canvas.wrap, smooth)
        if changed is not None:
            np.copyto(picture, images[0], where=~changed[..., np.newaxis])
        made.append(picture[..., 0] if gray else picture)
    alpha = made.pop() if sources.has_alpha else None
    if alpha is None and canvas.ground is not None:
        alpha = canvas.ground * full_scale(made[0].dtype)
    exemplar, place = atlas.locate(canvas.index)
    return Synthesis(
        image=made[0], alpha=alpha, maps=tuple(made[1:]), labels=canvas.labels, source=place, exemplar=exemplar, wraps=canvas.wrap,
        patch=patch, settings=settings, smooth=smooth, changed=changed, atlas=atlas,
    )  # fmt: skip


def lay_options(options: dict[str, Any]) -> LayOptions:
    """The options of laying, by name.

    Raises
    ------
    OptionError
        For a name that is none, or a value out of range.
    """
    known = LayOptions.__dataclass_fields__
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise OptionError(f"{', '.join(unknown)} is not an option; there are {', '.join(known)}")
    return LayOptions(**options)


def settings_of(options: LayOptions) -> dict[str, Any]:
    """The options as numbers and texts."""
    return {name: getattr(options, name) for name in LayOptions.__dataclass_fields__ if name != "cost"}


def check_patch(sources: Sources, patch: int, overlap: int | None) -> tuple[int, int]:
    """Patch and overlap in px, with the default resolved.

    Raises
    ------
    ImageError
        When an exemplar is smaller than the patch.
    OptionError
        When the two do not fit each other.
    """
    height, width = max(sources.shapes, key=min)
    if min(height, width) < SMALLEST_PATCH:
        raise ImageError(f"the source is {width} × {height} px; to copy patches from it needs at least {SMALLEST_PATCH} px a side")
    if int(patch) != patch or patch < SMALLEST_PATCH:
        raise OptionError(f"patch is {patch}; give a whole number of px, at least {SMALLEST_PATCH}")
    overlap = max(2, patch // 4) if overlap is None else overlap
    if int(overlap) != overlap or not 2 <= overlap < patch:
        raise OptionError(
            f"overlap is {overlap} with patches of {patch} px; give a whole number from 2 to {patch - 1} px, usually a quarter"
        )
    if patch > min(height, width):
        raise ImageError(
            f"the source is {width} × {height} px, smaller than a patch of {patch} px; use a patch of {min(height, width)} px or less"
        )
    return int(patch), int(overlap)


def _size(size: int | tuple[int, int], max_pixels: int) -> tuple[int, int]:
    given = tuple(size) if isinstance(size, tuple | list) else (size, size)
    if len(given) != 2 or not all(isinstance(length, int | np.integer) and length >= 1 for length in given):
        raise OptionError(f"size is {size}; give height and width as whole numbers of px, 1 or more")
    height, width = int(given[0]), int(given[1])
    if height * width > max_pixels:
        raise OptionError(
            f"a texture of {width} × {height} px has more than {max_pixels} pixels; make a smaller one that repeats, and repeat it"
        )
    return height, width


def _guide(
    guide: npt.ArrayLike | None, guide_source: Images | None, weight: float, atlas: Atlas, sources: Sources, size: tuple[int, int]
) -> Guide | None:
    if guide is None and guide_source is None:
        return None
    if guide is None or guide_source is None:
        raise OptionError("guide and guide_source belong together: what is wanted, and what the source's pixels stand for; give both")
    if not 0 <= weight <= 1:
        raise OptionError(f"guide_weight is {weight}; choose a share from 0 to 1")
    target = as_float(guide, "guide")
    if target.shape[:2] != size:
        raise ImageError(f"guide is {target.shape[1]} × {target.shape[0]} px, but the texture {size[1]} × {size[0]} px; make them one size")
    stands = []
    for image, (height, width) in zip(as_list(guide_source, len(sources.shapes), "guide_source"), sources.shapes, strict=True):
        values = as_float(np.asarray(image), "guide_source")
        if values.shape[:2] != (height, width):
            raise ImageError(
                f"guide_source is {values.shape[1]} × {values.shape[0]} px, but its source {width} × {height} px; make them one size"
            )
        if values.shape[2] != target.shape[2]:
            raise ImageError(
                f"guide has {target.shape[2]} channels and guide_source {values.shape[2]}; convert both to gray, or both to RGB"
            )
        stands.append(values)
    plane = atlas.spread(stands)
    plane[~atlas.usable] = 0
    return Guide(source=plane, target=target, weight=weight)
