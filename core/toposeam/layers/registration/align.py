"""Approximate positions made exact, to the pixel, by what overlapping layers show.

Each pair of layers that overlap, or would within the search radius, is compared by masked phase correlation
(Padfield 2012, doi:10.1109/TIP.2011.2181402; scikit-image's), on a coarser scale first where the overlap is
large. A shift counts when it lies within the radius and the overlap then correlates. All shifts together give
the positions (:mod:`toposeam.layers.registration.pose_graph`), the first layer staying where it is; pairs
that contradict the others, as what repeats itself does, are left out where those outvote them
(:mod:`toposeam.layers.registration.consensus`). Layers are moved by whole pixels and not resampled, turned or
warped.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from toposeam.arrays import Floats, Image, Mask
from toposeam.checks import check_items, check_whole
from toposeam.errors import OverlapError
from toposeam.images import as_float
from toposeam.layers.canvas.layer import Box, Layer, check_layers, cut
from toposeam.layers.execution.tasks import Executor, check_executor, results
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.consensus import evidence_of, named_pairs, voted
from toposeam.layers.registration.features import gray_of, reduced
from toposeam.layers.registration.pair_matching import Match, groups
from toposeam.layers.registration.pose_graph import least_squares

#: Farthest a layer is searched from where it was said to be, px in x and in y.
RADIUS = 32
#: Least correlation of two overlaps that are taken to show the same.
LEAST_CORRELATION = 0.5

_COARSE_PIXELS = 400_000  # compared at once
_LOOKED_AT = 60_000  # to tell whether two layers show the same
_LEAST_SHARE = 0.3  # of the smaller part, that two parts have to share
_LEAST_PIXELS = 64
_AGREE = 2.0  # px in x and in y that a pair may be off where the others place its layers
_NEAR = 2  # px that phase correlation may be off
_PLAIN = 0.01  # of full scale: what varies less shows nothing beside something plain
_BLUR = 8.0  # px; slower changes are exposure, not content


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
    found: dict[Pair, tuple[Floats, float, float]] = {}
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
        shift, correlation, told = match
        best[i], best[j] = max(best[i], correlation), max(best[j], correlation)
        if correlation >= LEAST_CORRELATION:
            found[i, j] = shift, correlation, told
    _check_joined(layers, found, best, radius)
    positions, found = _agreed([layer.name for layer in layers], found)
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


def correlations(layers: Sequence[Layer], *, executor: Executor | None = None) -> dict[Pair, float]:
    """How alike two layers are where they overlap, without their slow changes: 1 for the same, about 0 for
    strangers.

    Parameters
    ----------
    layers : sequence of Layer
        Placed.
    executor : concurrent.futures.Executor, optional
        Where pairs are compared.

    Returns
    -------
    dict of (int, int) to float
        By pair; 0 where only one of the two shows something, as beside a white picture. Pairs of which too
        little overlaps, or neither shows anything, are left out.

    Examples
    --------
    >>> whole = np.random.default_rng(0).random((40, 60))
    >>> found = correlations([Layer(whole[:, :40]), Layer(whole[:, 20:], at=(20, 0))])
    >>> round(found[0, 1], 3)
    1.0
    """
    layers = check_items("layers", layers, Layer, "a sequence of Layers")
    check_executor(executor)
    pairs = [
        (i, j)
        for i in range(len(layers))
        for j in range(i + 1, len(layers))
        if np.prod(_middle(_place(layers[i]).shared(_place(layers[j])), _LOOKED_AT).shape) >= _LEAST_PIXELS
    ]
    items = [(layers[i], layers[j]) for i, j in pairs]
    found = zip(pairs, results(executor, _correlation, items), strict=True)
    return {pair: value for pair, value in found if value is not None}


def _correlation(layers: tuple[Layer, Layer]) -> float | None:
    box = _middle(_place(layers[0]).shared(_place(layers[1])), _LOOKED_AT)
    parts = [_content(layer, _place(layer), box) for layer in layers]
    both = parts[0][1] & parts[1][1]
    one, other = (part[0][both] for part in parts)
    energy = float((one @ one) * (other @ other))
    if np.count_nonzero(both) < _LEAST_PIXELS:
        return None
    if energy <= 1e-8:  # at least one is plain
        return 0.0 if max(one.std(), other.std()) > _PLAIN else None
    return float(one @ other) / float(np.sqrt(energy))


def _check_joined(
    layers: Sequence[Layer],
    found: dict[Pair, tuple[Floats, float, float]],
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


def _agreed(
    names: list[str], found: dict[Pair, tuple[Floats, float, float]]
) -> tuple[Floats, dict[Pair, tuple[Floats, float, float]]]:
    """(N, 2) shifts that all pairs but those that are outvoted agree to, and the pairs that agree.

    Raises
    ------
    OverlapError
        When more than these contradict each other.
    """
    matches = {
        pair: Match(shift[np.newaxis], np.zeros((1, 2)), correlation, uncertainty=told**-0.5)
        for pair, (shift, correlation, told) in found.items()
    }
    evidence = {pair: told for pair, (_, _, told) in found.items()}
    solved = partial(least_squares, len(names), freedom="shift")
    vote = voted(len(names), matches, evidence, solved, _AGREE, order=np.inf)
    if vote.clear:
        return vote.places.transforms[:, 2:], {pair: found[pair] for pair in vote.kept}
    raise OverlapError(
        "{names} agree where the other layers do not place them, up to {off} px off, and "
        "too little else shows which is right: what repeats itself agrees in several "
        "places; correct their positions and search less far, or leave out aligning",
        kind="ambiguous",
        names=named_pairs(names, vote.wrong),
        off=f"{max(vote.off.values()):.0f}",
    )


def _match(item: tuple[Layer, Layer, int]) -> tuple[Floats, float, float] | None:
    """By how much (x, y) the second of two layers that may overlap has to move to fit the first, at most so
    many px, how well they then correlate, and how much that tells; None if they are apart.
    """
    a, b, radius = item
    at_a, at_b = _place(a), _place(b)
    box = at_a.shared(at_b.grown(radius)).grown(radius).shared(_around(at_a, at_b))
    scale = max(1, int(np.ceil(np.sqrt(box.shape[0] * box.shape[1] / _COARSE_PIXELS))))
    shift = _shift(_content(a, at_a, box, scale), _content(b, at_b, box, scale), radius / scale) * scale
    if scale > 1:
        overlap = _middle(at_a.shared(_moved(at_b, shift)))
        if not all(overlap.shape):
            return None
        shift = shift + _shift(
            _content(a, at_a, overlap), _content(b, _moved(at_b, shift), overlap), 2 * scale
        )
    shift, correlation, count = _refined(a, b, at_a, at_b, shift)
    if np.abs(shift).max() > radius or count < _LEAST_PIXELS:
        return None
    return shift[::-1].astype(float), correlation, evidence_of(correlation, count)


def _refined(
    a: Layer, b: Layer, at_a: Box, at_b: Box, shift: npt.NDArray[np.intp]
) -> tuple[npt.NDArray[np.intp], float, int]:
    """The shift of highest correlation within two pixels of one, that correlation, and the number of pixels
    it is of.
    """
    box = _middle(at_a.shared(_moved(at_b, shift)).grown(-_NEAR))
    best = shift, -1.0, 0
    if not all(box.shape):
        return best
    around = box.grown(_NEAR)
    first, second = _content(a, at_a, around), _content(b, _moved(at_b, shift), around)
    inner = box.within(around)
    for y in range(-_NEAR, _NEAR + 1):
        for x in range(-_NEAR, _NEAR + 1):
            there = _moved(box, np.array([-y, -x])).within(around)
            both = first[1][inner] & second[1][there]
            one, other = first[0][inner][both], second[0][there][both]
            energy = float((one @ one) * (other @ other))
            correlation = float(one @ other) / np.sqrt(energy) if energy > 0 else 0.0
            if correlation > best[1]:
                best = shift + np.array([y, x]), correlation, int(np.count_nonzero(both))
    return best


def _shift(a: tuple[Floats, Mask], b: tuple[Floats, Mask], reach: float) -> npt.NDArray[np.intp]:
    """By how many pixels (y, x) the second part has to move to fit the first; 0 where that is farther than it
    may be.
    """
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


def _middle(box: Box, pixels: int = _COARSE_PIXELS) -> Box:
    """As much of the middle of a box as is compared at once."""
    side = int(np.sqrt(pixels))
    (height, width), rows, columns = box.shape, box.shape[0], box.shape[1]
    height, width = (
        min(height, max(side, side * side // max(columns, 1))),
        min(width, max(side, side * side // max(rows, 1))),
    )
    top, left = box.top + (rows - height) // 2, box.left + (columns - width) // 2
    return Box(top, left, top + height, left + width)


def _content(layer: Layer, place: Box, box: Box, scale: int = 1) -> tuple[Floats, Mask]:
    """What a layer shows in a box without its slow changes, in blocks of `scale` px, and where."""
    known = cut(layer.covered, place, box)
    image: Image = cut(layer.image, place, box)
    image[~known] = 0
    gray = gray_of(as_float(image, layer.title, layer.data_range), np.float64)
    if scale > 1:
        gray, known = reduced(gray, scale), reduced(known.astype(np.float32), scale) == 1
    gray[~known] = 0
    weight = scipy.ndimage.gaussian_filter(known.astype(np.float64), _BLUR)
    slow = scipy.ndimage.gaussian_filter(gray, _BLUR) / np.maximum(weight, 1e-6)
    return np.where(known, gray - slow, 0.0), known
