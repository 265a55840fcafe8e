"""The poorest model that explains how pictures lie to each other: a plane, or a camera that turns.

1. Features of all pairs are adjusted as homographies to one plane and as turns of one camera
   (:mod:`toposeam.layers.registration.bundle_adjustment`); the camera, which has fewer unknowns, is taken
   unless it leaves clearly more.
2. Pairs that match where they do not belong are left out where others outvote them
   (:mod:`toposeam.layers.registration.consensus`).
3. Patches of each overlap, warped by the model, are laid on each other by phase correlation, and the model
   is adjusted to them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from toposeam.arrays import Floats
from toposeam.heat.threads import one_thread
from toposeam.layers.canvas.transforms import NOWHERE, distorted, undistorted
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.bundle_adjustment import (
    Bundle,
    Family,
    adjust_cameras,
    adjust_plane,
    left_over,
    spanning_tree,
    strengths_of,
)
from toposeam.layers.registration.consensus import ELSEWHERE, divided
from toposeam.layers.registration.features import Look
from toposeam.layers.registration.homography import applied
from toposeam.layers.registration.pair_matching import Match, groups
from toposeam.layers.registration.patches import LaidPatches, find_patches

#: A camera may leave so many times as much as a plane, and so many px more of features and of patches.
_POORER, _SLACK, _EXACT_SLACK = 1.3, 0.15, 0.4
#: One that sees more than so many degrees may leave so many times as much: no lens shows a plane so wide.
_WIDE, _WIDE_POORER = 100.0, 2.0
#: One that leaves so many times as much still knows which way is up.
_LIKE = 3.0
#: Rows and columns of patches; how many a pair needs to be adjusted to these alone; one standard deviation
#: of one, px.
_PATCHES, _ENOUGH, _EXACT = 8, 12, 0.25
#: A pair that is off by more than so many px, and so many times the others' median, does not fit.
_OFF, _TIMES = 6.0, 5.0
#: Shares of a picture's diagonal by which pairs may be off while they are taken up.
_SHARES = (0.25, 0.08, 0.02)


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """What is known of the camera."""

    #: px, and whether it is exactly that.
    focal: float | None = None
    fixed: bool = False
    #: b of the radial distortion; None where it is not known.
    distortion: float | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ModelFit:
    """A model adjusted to all pairs that agree."""

    bundle: Bundle
    #: What the pairs that agree share.
    matches: dict[Pair, Match]
    #: The pairs that the others outvoted, or that do not fit.
    outvoted: tuple[Pair, ...]
    #: Whether these were outvoted by several times their evidence.
    clear: bool
    #: Of a plane: the camera that would leave not much more, if there is one.
    camera: Bundle | None = None


def fit_models(
    looks: Sequence[Look],
    matches: Mapping[Pair, Match],
    families: Collection[Family],
    lens: Lens,
    executor: Executor | None = None,
) -> ModelFit:
    """Adjust the poorest of some models that explains the matches.

    Parameters
    ----------
    looks : sequence of Look
        Of all pictures, which the matches join.
    matches : mapping from pairs to Match
        Features that homographies bring together.
    families : collection of {"plane", "rotation"}
    lens : Lens
    executor : Executor, optional
        Where patches are laid on each other.
    """
    sizes = np.array([look.size for look in looks], float)

    def adjust(family: Family, given: Mapping[Pair, Match], start: Bundle | None = None) -> Bundle:
        if family == "plane":
            return adjust_plane(sizes, given, start)
        return adjust_cameras(
            sizes, given, focal=lens.focal, fixed=lens.fixed, distortion=lens.distortion, start=start
        )

    found = {family: _voted(sizes, matches, partial(adjust, family)) for family in families}
    fit = next(iter(found.values()))
    if len(found) > 1:
        fit = found["rotation"] if _explains(found["rotation"], found["plane"], matches) else found["plane"]
        camera = found["rotation"].bundle
        if left_over(camera, fit.matches) <= _LIKE * left_over(found["plane"].bundle, fit.matches):
            found["plane"] = replace(found["plane"], camera=camera)
            fit = found["plane"] if fit.bundle.family == "plane" else fit
    exact = _with_patches(looks, fit, executor)
    bundle = adjust(fit.bundle.family, exact, fit.bundle)
    plane = found.get("plane", fit)
    if bundle.family == "rotation" and plane is not fit and plane.matches.keys() == exact.keys():
        other = adjust("plane", exact, plane.bundle)
        if left_over(bundle, exact) > _poorer(bundle) * left_over(other, exact) + _EXACT_SLACK:
            fit = replace(plane, bundle=other, matches=exact)
            exact = _with_patches(looks, fit, executor)
            bundle = adjust("plane", exact, other)
    return replace(fit, bundle=bundle, matches=exact)


def _explains(poorer: ModelFit, richer: ModelFit, matches: Mapping[Pair, Match]) -> bool:
    """Whether the poorer model leaves about as little as the richer one, and outvotes no more pairs."""
    shared = [pair for pair in matches if pair in poorer.matches and pair in richer.matches]
    if not shared or len(poorer.outvoted) > len(richer.outvoted):
        return len(poorer.matches) > len(richer.matches)
    if len(poorer.outvoted) < len(richer.outvoted):
        return True
    least = left_over(richer.bundle, matches, shared)
    return left_over(poorer.bundle, matches, shared) <= _poorer(poorer.bundle) * least + _SLACK


def _poorer(camera: Bundle) -> float:
    """How many times as much as a plane a camera may leave."""
    return _WIDE_POORER if camera.field_of_view > _WIDE else _POORER


class _Adjust(Protocol):
    """Adjust a model to pairs, from a start or from nothing."""

    def __call__(self, given: Mapping[Pair, Match], start: Bundle | None = None) -> Bundle: ...


def _voted(sizes: Floats, matches: Mapping[Pair, Match], adjust: _Adjust) -> ModelFit:
    """A model adjusted to the pairs that are not outvoted.

    It begins with the tree of those that say most, and takes up the others that are not too far off, which
    gets less and less: a loop may be open by more at first than what matches elsewhere is later.
    """
    strengths = strengths_of(matches)
    _, order, before = spanning_tree(len(sizes), strengths)
    tree = {(int(min(k, before[k])), int(max(k, before[k]))) for k in order[1:]}
    bundle = adjust({pair: match for pair, match in matches.items() if pair in tree})
    diagonal = float(np.hypot(*sizes.T).min())
    scale = max(float(np.max(match.uncertainty)) for match in matches.values())
    kept = [pair for pair in matches if pair in tree]
    for share in (*_SHARES, 0.0):
        off = bundle.medians(matches)
        usual = _usual(off, kept, diagonal)
        now = [pair for pair in matches if off[pair] <= max(share * diagonal, _OFF * scale, usual)]
        if len(now) == len(kept) == len(matches):
            break
        if now != kept and not groups(len(sizes), now).any():
            kept, bundle = now, adjust({pair: matches[pair] for pair in now}, bundle)
    off = bundle.medians(matches)
    largest = max(_OFF * scale, _usual(off, kept, diagonal))
    right, wrong, clear = divided(len(sizes), strengths, off, largest)
    return ModelFit(
        bundle=bundle,
        matches={pair: matches[pair] for pair in (right if clear else matches)},
        outvoted=tuple(wrong),
        clear=clear,
    )


def _usual(off: Mapping[Pair, float], pairs: Collection[Pair], diagonal: float) -> float:
    """Several times what is left of the pairs that agree, px; what lies elsewhere is more."""
    return min(_TIMES * float(np.median([off[pair] for pair in pairs])), ELSEWHERE * diagonal)


@dataclass(frozen=True, slots=True, eq=False)
class _PairTransform:
    """From the pixels of the second picture of a pair to those of the first, by a bundle."""

    sizes: tuple[tuple[int, int], tuple[int, int]]
    #: (3, 3) from the centred pixels of the first picture to those of the second.
    matrix: Floats
    lens: tuple[float, float, float]

    @classmethod
    def of(cls, bundle: Bundle, i: int, j: int) -> _PairTransform:
        return cls((bundle.size(i), bundle.size(j)), bundle.between(i, j), bundle.lens)

    def to_canvas(self, points: Floats) -> Floats:
        back = np.asarray(np.linalg.inv(self.matrix), float)
        return self._mapped(points, back, self.sizes[1], self.sizes[0], np.nan)

    def to_picture(self, points: Floats) -> Floats:
        return self._mapped(points, self.matrix, *self.sizes, NOWHERE)

    def _mapped(
        self, points: Floats, matrix: Floats, start: tuple[int, int], end: tuple[int, int], missing: float
    ) -> Floats:
        flat = undistorted(points.reshape(-1, 2), start, self.lens)
        depth = flat @ matrix[2, :2] + matrix[2, 2]
        shown = distorted(applied(matrix, flat), end, self.lens)
        shown[~(depth > 0) | ~np.isfinite(shown).all(axis=1)] = missing
        return shown.reshape(points.shape)


def _with_patches(looks: Sequence[Look], fit: ModelFit, executor: Executor | None) -> dict[Pair, Match]:
    """The matches with patches in front of the features; of many patches alone."""
    items = [(looks[i], looks[j], _PairTransform.of(fit.bundle, i, j)) for i, j in fit.matches]
    better = {}
    for (pair, match), laid in zip(fit.matches.items(), results(executor, _laid, items), strict=True):
        if laid is None or not len(laid.first):
            better[pair] = replace(match, correlation=math.nan if laid is None else laid.correlation)
            continue
        first, second, doubts = laid.first, laid.second, np.full(len(laid.first), _EXACT)
        if len(first) < _ENOUGH:
            own = np.full(len(match.first), match.uncertainty)
            first, second = np.concatenate([first, match.first]), np.concatenate([second, match.second])
            doubts = np.concatenate([doubts, own])
        found = replace(match, first=first, second=second, uncertainty=doubts)
        better[pair] = replace(found, correlation=laid.correlation)
    return better


@one_thread()
def _laid(item: tuple[Look, Look, _PairTransform]) -> LaidPatches | None:
    return find_patches(*item, count=_PATCHES)
