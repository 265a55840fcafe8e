"""Make approximate positions exact, to the pixel, by comparing overlapping layers.

Each pair of layers that overlap, or would within the search radius, is compared by masked phase correlation
(Padfield 2012, doi:10.1109/TIP.2011.2181402; scikit-image's), on a coarser scale first where the overlap is
large. A shift counts when it lies within the radius and the overlap then correlates. All shifts together give
the positions (:mod:`toposeam.layers.registration.pose_graph`), with the first layer fixed. Pairs that
contradict the others, as those of layers that repeat themselves, are left out where the others outvote them
(:mod:`toposeam.layers.registration.consensus`). Layers are moved by whole pixels and not resampled, turned or
warped.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats, Image, Mask
from toposeam.checks import check_items, check_whole
from toposeam.errors import OverlapError
from toposeam.images import all_of_squares, as_float, reduced
from toposeam.layers.canvas.canvas import groups
from toposeam.layers.canvas.layer import Box, Layer, check_layers, cut
from toposeam.layers.execution.tasks import Executor, check_executor, results
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.consensus import evidence_of, vote
from toposeam.layers.registration.features import CONTENT_BLUR, gray_of
from toposeam.layers.registration.pair_matching import LEAST_CORRELATION, Match
from toposeam.layers.registration.pose_graph import least_squares
from toposeam.layers.registration.refusals import named_pairs

#: Farthest that a layer is searched from its stated position, px in x and in y.
RADIUS = 32
#: Pixels of an overlap that are compared at once, and those from which its correlation is computed.
_COMPARED_PIXELS, _CORRELATED_PIXELS = 400_000, 60_000
#: Least share of the smaller part that two parts have in common, and least number of pixels.
_LEAST_SHARE, _LEAST_PIXELS = 0.3, 64
#: Largest error of phase correlation, px in x and in y, and so of a pair where the others place its layers.
_LARGEST_ERROR = 2
#: Least standard deviation, of full scale, of a part that shows something beside a plain one.
_LEAST_DEVIATION = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Aligned:
    """Layers at the positions that were found.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> scene = np.random.default_rng(0).random((40, 90))
    >>> layers = ts.Layer(scene[:, :60]), ts.Layer(scene[:, 40:], at=(37, 0))
    >>> ts.layers.align(layers, radius=8).layers[1].at
    (40, 0)
    """

    layers: tuple[Layer, ...]
    #: (N, 2) px in x and y by which each was moved.
    shifts: npt.NDArray[np.intp]
    #: Correlation of each pair that was used.
    correlations: dict[Pair, float]

    def __repr__(self) -> str:
        most = int(np.abs(self.shifts).max(initial=0))
        return f"Aligned({len(self.layers)} layers, moved by up to {most} px)"


#: (2,) shift in x and y, px, its correlation, and its evidence.
_Shift: TypeAlias = tuple[Floats, float, float]


def align(layers: Sequence[Layer], *, radius: int = RADIUS, executor: Executor | None = None) -> Aligned:
    """Move layers from about where they belong to where they agree.

    Parameters
    ----------
    layers : sequence of Layer
        At least two.
    radius : int
        How far off, in px in x and in y, a pair may be.
    executor : concurrent.futures.Executor, optional
        Where pairs are compared; the places are the same.

    Returns
    -------
    Aligned

    Raises
    ------
    OverlapError
        When a layer agrees with none of those it overlaps, or pairs contradict each other and none outvotes
        the other.
    OptionError
        For a radius that is no positive number of px, or fewer than two layers.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> scene = np.random.default_rng(0).random((40, 90))
    >>> layers = ts.Layer(scene[:, :60]), ts.Layer(scene[:, 40:], at=(43, 2))
    >>> [layer.at for layer in ts.layers.align(layers, radius=8).layers]
    [(0, 0), (40, 0)]
    """
    radius = check_whole("radius", radius, 1)
    check_executor(executor)
    layers = check_layers(layers)
    found: dict[Pair, _Shift] = {}
    best: dict[int, float] = dict.fromkeys(range(len(layers)), -1.0)
    pairs = [
        (i, j)
        for i, j in combinations(range(len(layers)), 2)
        if all(_place(layers[i]).shared(_place(layers[j]).grown(radius)).shape)
    ]
    items = [(layers[i], layers[j], radius) for i, j in pairs]
    for (i, j), match in zip(pairs, results(executor, _match, items), strict=True):
        if match is None:
            continue
        shift, correlation, evidence = match
        best[i], best[j] = max(best[i], correlation), max(best[j], correlation)
        if correlation >= LEAST_CORRELATION:
            found[i, j] = shift, correlation, evidence
    _check_joined(layers, found, best, radius)
    positions, found = _vote_on_shifts([layer.name for layer in layers], found)
    shifts = np.rint(positions).astype(np.intp)
    moved = [
        dataclasses.replace(layer, at=(int(layer.at[0] + dx), int(layer.at[1] + dy)))
        for layer, (dx, dy) in zip(layers, shifts, strict=True)
    ]
    return Aligned(
        layers=tuple(moved),
        shifts=shifts,
        correlations={pair: correlation for pair, (_, correlation, _) in found.items()},
    )


def correlations(
    layers: Sequence[Layer], *, block: int = 1, executor: Executor | None = None
) -> dict[Pair, float]:
    """Correlate layers where they overlap, without their slow changes.

    Parameters
    ----------
    layers : sequence of Layer
        Placed.
    block : int
        Side of the blocks, px, at most 1000, whose means are compared: of larger ones more of the overlap is,
        and what fits to some px only correlates as well.
    executor : concurrent.futures.Executor, optional
        Where pairs are compared.

    Returns
    -------
    dict of (int, int) to float
        By pair: 1 for the same, about 0 for unrelated layers, 0 where one of the two is plain. Pairs of which
        too little overlaps, or both are plain, are left out.

    Examples
    --------
    >>> whole = np.random.default_rng(0).random((40, 60))
    >>> found = correlations([Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))])
    >>> round(found[0, 1], 3)
    1.0
    """
    layers = check_items("layers", layers, Layer, "a sequence of Layers")
    check_executor(executor)
    check_whole("block", block, 1, 1000)
    pairs = [
        (i, j)
        for i in range(len(layers))
        for j in range(i + 1, len(layers))
        if np.prod(_middle(_place(layers[i]).shared(_place(layers[j])), _CORRELATED_PIXELS).shape)
        >= _LEAST_PIXELS
    ]
    items = [(layers[i], layers[j], block) for i, j in pairs]
    found = zip(pairs, results(executor, _correlation, items), strict=True)
    return {pair: value for pair, value in found if value is not None}


def _correlation(item: tuple[Layer, Layer, int]) -> float | None:
    """Correlate two layers in blocks; None where too little overlaps or both are plain."""
    *layers, block = item
    box = _middle(_place(layers[0]).shared(_place(layers[1])), _CORRELATED_PIXELS * block**2)
    parts = [_content(layer, _place(layer), box, block) for layer in layers]
    both = parts[0][1] & parts[1][1]
    one, other = (part[0][both] for part in parts)
    energy = float((one @ one) * (other @ other))
    if np.count_nonzero(both) < _LEAST_PIXELS:
        return None
    if energy <= 1e-8:  # at least one is plain
        return 0.0 if max(one.std(), other.std()) > _LEAST_DEVIATION else None
    return float(one @ other) / float(np.sqrt(energy))


def _check_joined(
    layers: Sequence[Layer],
    found: dict[Pair, _Shift],
    best: dict[int, float],
    radius: int,
) -> None:
    """Refuse layers that are not joined to the first one by pairs that agree."""
    own = groups(len(layers), found)
    lost = np.flatnonzero(own != own[0])
    if len(lost):
        index = int(lost[0])
        close = (
            f"the best correlation is {best[index]:.2f}" if best[index] > -1 else "it overlaps none of them"
        )
        raise OverlapError(
            "{name} cannot be aligned: within {radius} px of where it was put it agrees with "
            "none of the others ({close}, {least:g} is needed); correct its position, search "
            "farther, or leave out aligning",
            kind="not aligned",
            layers=(index,),
            name=layers[index].name,
            radius=radius,
            close=close,
            least=LEAST_CORRELATION,
        )


def _vote_on_shifts(names: list[str], found: dict[Pair, _Shift]) -> tuple[Floats, dict[Pair, _Shift]]:
    """Find the (N, 2) shifts on which all pairs agree but those that are outvoted, and the pairs that agree.

    Raises
    ------
    OverlapError
        When pairs contradict the others that these do not outvote.
    """
    matches = {
        pair: Match(shift[np.newaxis], np.zeros((1, 2)), correlation, uncertainty=evidence**-0.5)
        for pair, (shift, correlation, evidence) in found.items()
    }
    evidence = {pair: own for pair, (_, _, own) in found.items()}
    solve = partial(least_squares, len(names), freedom="shift")
    result = vote(len(names), matches, evidence, solve, _LARGEST_ERROR, order=np.inf)
    if result.clear:
        return result.places.transforms[:, 2:], {pair: found[pair] for pair in result.kept}
    raise OverlapError(
        "{names} agree where the other layers do not place them, up to {off} px off, and "
        "too little else shows which is right: what repeats itself agrees in several "
        "places; correct their positions and search less far, or leave out aligning",
        kind="ambiguous",
        names=named_pairs(names, result.wrong),
        off=f"{max(result.distances.values()):.0f}",
    )


def _match(item: tuple[Layer, Layer, int]) -> _Shift | None:
    """Find the shift of the second of two layers to where it fits the first, within a radius, px; None if
    they do not overlap there.
    """
    a, b, radius = item
    at_a, at_b = _place(a), _place(b)
    box = at_a.shared(at_b.grown(radius)).grown(radius).shared(_around(at_a, at_b))
    scale = max(1, int(np.ceil(np.sqrt(box.shape[0] * box.shape[1] / _COMPARED_PIXELS))))
    shift = _shift(_content(a, at_a, box, scale), _content(b, at_b, box, scale), radius / scale) * scale
    if scale > 1:
        overlap = _middle(at_a.shared(_moved(at_b, shift)))
        if not all(overlap.shape):
            return None
        shift = shift + _shift(
            _content(a, at_a, overlap), _content(b, _moved(at_b, shift), overlap), 2 * scale
        )
    shift, correlation, count = _refine(a, b, at_a, at_b, shift)
    if np.abs(shift).max() > radius or count < _LEAST_PIXELS:
        return None
    return shift[::-1].astype(float), correlation, evidence_of(correlation, count)


def _refine(
    a: Layer, b: Layer, at_a: Box, at_b: Box, shift: npt.NDArray[np.intp]
) -> tuple[npt.NDArray[np.intp], float, int]:
    """Find the shift of highest correlation within two pixels of a shift, that correlation, and the number
    of pixels that were compared.
    """
    box = _middle(at_a.shared(_moved(at_b, shift)).grown(-_LARGEST_ERROR))
    best = shift, -1.0, 0
    if not all(box.shape):
        return best
    around = box.grown(_LARGEST_ERROR)
    first, second = _content(a, at_a, around), _content(b, _moved(at_b, shift), around)
    inner = box.within(around)
    for y in range(-_LARGEST_ERROR, _LARGEST_ERROR + 1):
        for x in range(-_LARGEST_ERROR, _LARGEST_ERROR + 1):
            there = _moved(box, np.array([-y, -x])).within(around)
            both = first[1][inner] & second[1][there]
            one, other = first[0][inner][both], second[0][there][both]
            energy = float((one @ one) * (other @ other))
            correlation = float(one @ other) / np.sqrt(energy) if energy > 0 else 0.0
            if correlation > best[1]:
                best = shift + np.array([y, x]), correlation, int(np.count_nonzero(both))
    return best


def _shift(a: tuple[Floats, Mask], b: tuple[Floats, Mask], reach: float) -> npt.NDArray[np.intp]:
    """Find the shift, (y, x) px, of the second part to where it fits the first; 0 where it is too far."""
    from skimage.registration import phase_cross_correlation

    if min(np.count_nonzero(a[1]), np.count_nonzero(b[1])) < _LEAST_PIXELS or not (a[0].any() and b[0].any()):
        return np.zeros(2, np.intp)
    register: Any = phase_cross_correlation  # carries no types
    found = register(a[0], b[0], reference_mask=a[1], moving_mask=b[1], overlap_ratio=_LEAST_SHARE)[0]
    shift: npt.NDArray[np.intp] = np.rint(found).astype(np.intp)
    return shift if np.abs(shift).max() <= np.ceil(reach) else np.zeros(2, np.intp)


def _place(layer: Layer) -> Box:
    x, y = layer.at
    return Box(y, x, y + layer.image.shape[0], x + layer.image.shape[1])


def _moved(box: Box, shift: npt.NDArray[np.intp]) -> Box:
    y, x = int(shift[0]), int(shift[1])
    return Box(box.top + y, box.left + x, box.bottom + y, box.right + x)


def _around(a: Box, b: Box) -> Box:
    return Box(min(a.top, b.top), min(a.left, b.left), max(a.bottom, b.bottom), max(a.right, b.right))


def _middle(box: Box, pixels: int = _COMPARED_PIXELS) -> Box:
    """Return the middle of a box, as much of it as is compared at once."""
    side = int(np.sqrt(pixels))
    (height, width), rows, columns = box.shape, box.shape[0], box.shape[1]
    height, width = (
        min(height, max(side, side * side // max(columns, 1))),
        min(width, max(side, side * side // max(rows, 1))),
    )
    top, left = box.top + (rows - height) // 2, box.left + (columns - width) // 2
    return Box(top, left, top + height, left + width)


def _content(layer: Layer, place: Box, box: Box, scale: int = 1) -> tuple[Floats, Mask]:
    """Return the content of a layer in a box without slow changes, in blocks of `scale` px, and a mask."""
    known = cut(layer.covered, place, box)
    image: Image = cut(layer.image, place, box)
    image[~known] = 0
    gray = gray_of(as_float(image, layer.title, layer.data_range), np.float64)
    if scale > 1:
        gray, known = reduced(gray, scale), all_of_squares(known, scale)
    gray[~known] = 0
    weight = scipy.ndimage.gaussian_filter(known.astype(np.float64), CONTENT_BLUR)
    slow = scipy.ndimage.gaussian_filter(gray, CONTENT_BLUR) / np.maximum(weight, 1e-6)
    return np.where(known, gray - slow, 0.0), known
