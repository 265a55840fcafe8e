"""Choose the poorest model that explains how pictures lie to each other: a plane, or a camera that turns.

1. Features of all pairs are adjusted as homographies to one plane and as turns of one camera
   (:mod:`toposeam.layers.registration.bundle_adjustment`); the camera, which has fewer unknowns, is taken
   unless it leaves clearly larger residuals.
2. Pairs that match where they do not belong are left out where others outvote them
   (:mod:`toposeam.layers.registration.consensus`).
3. Patches of each overlap, warped by the model, are laid on each other by phase correlation, and the model
   is adjusted to them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

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
from toposeam.layers.registration.features import FeatureSet
from toposeam.layers.registration.homography import applied
from toposeam.layers.registration.pair_matching import Match, find_patches, groups

#: Largest residuals of a model ÷ those of one with more unknowns, for the poorer model to be taken.
POORER_RATIO = 1.3
#: Rows and columns of patches of an overlap.
_PATCHES = 8
#: Patches that a pair needs to be adjusted to these alone, and one standard deviation of one, px.
_LEAST_PATCHES, _PATCH_DEVIATION = 12, 0.25
#: A pair does not fit if its median distance exceeds both the first, px of the reduced pictures, and the
#: second times the median of the others.
_LARGEST_DISTANCE, _LARGEST_RATIO = 6.0, 5.0
#: Largest distance of a pair, as a share of a picture's diagonal, in the rounds in which pairs are taken up.
_TAKEN_UP = (0.25, 0.08, 0.02)


@dataclass(frozen=True, slots=True, kw_only=True)
class _CameraTolerance:
    """Largest residuals of a camera beside those of a plane, for the camera to be taken."""

    #: Field of view, degrees, beyond which a camera has a ratio of its own: no lens shows a plane so wide.
    wide: float = 100.0
    wide_ratio: float = 2.0
    #: px that are allowed beside the ratio: of features, and of patches, whose residuals are less.
    features: float = 0.15
    patches: float = 0.4
    #: Largest ratio of a camera that does not explain the pictures but still shows which way is up.
    upright_ratio: float = 3.0

    def allows(self, camera: Bundle, residual: float, least: float, slack: float) -> bool:
        """Test whether a camera's residual is little enough beside the least one, px."""
        ratio = self.wide_ratio if camera.field_of_view > self.wide else POORER_RATIO
        return residual <= ratio * least + slack


_TOLERANCE = _CameraTolerance()


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """The camera, as far as it is known."""

    #: Focal length, px, and whether it is exactly that.
    focal: float | None = None
    fixed: bool = False
    #: b of the radial distortion; None where it is not known.
    distortion: float | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ModelFit:
    """A model adjusted to all pairs that agree."""

    bundle: Bundle
    #: The pairs that agree.
    matches: dict[Pair, Match]
    #: The pairs that the others outvoted, or that do not fit.
    outvoted: tuple[Pair, ...]
    #: Whether these were outvoted by several times their evidence.
    clear: bool
    #: Of a plane: the camera that shows which way is up, if there is one.
    camera: Bundle | None = None


def fit_models(
    features: Sequence[FeatureSet],
    matches: Mapping[Pair, Match],
    families: Collection[Family],
    lens: Lens,
    executor: Executor | None = None,
) -> ModelFit:
    """Adjust the poorest of some models that explains the matches.

    Parameters
    ----------
    features : sequence of FeatureSet
        Of all pictures, which the matches join.
    matches : mapping from pairs to Match
        Features that homographies bring together.
    families : collection of {"plane", "rotation"}
    lens : Lens
    executor : Executor, optional
        Where patches are laid on each other.
    """
    sizes = np.array([one.size for one in features], float)

    def adjust(family: Family, given: Mapping[Pair, Match], start: Bundle | None = None) -> Bundle:
        if family == "plane":
            return adjust_plane(sizes, given, start)
        return adjust_cameras(
            sizes, given, focal=lens.focal, fixed=lens.fixed, distortion=lens.distortion, start=start
        )

    fits = {family: _fit_agreeing(sizes, matches, partial(adjust, family)) for family in families}
    fit = next(iter(fits.values()))
    if len(fits) > 1:
        fit = fits["rotation"] if _explains(fits["rotation"], fits["plane"], matches) else fits["plane"]
        camera = fits["rotation"].bundle
        least = left_over(fits["plane"].bundle, fit.matches)
        if left_over(camera, fit.matches) <= _TOLERANCE.upright_ratio * least:
            fits["plane"] = replace(fits["plane"], camera=camera)
            fit = fits["plane"] if fit.bundle.family == "plane" else fit
    exact = _with_patches(features, fit, executor)
    bundle = adjust(fit.bundle.family, exact, fit.bundle)
    plane = fits.get("plane", fit)
    if bundle.family == "rotation" and plane is not fit and plane.matches.keys() == exact.keys():
        other = adjust("plane", exact, plane.bundle)
        residual, least = left_over(bundle, exact), left_over(other, exact)
        if not _TOLERANCE.allows(bundle, residual, least, _TOLERANCE.patches):
            fit = replace(plane, bundle=other, matches=exact)
            exact = _with_patches(features, fit, executor)
            bundle = adjust("plane", exact, other)
    return replace(fit, bundle=bundle, matches=exact)


def _explains(camera: ModelFit, plane: ModelFit, matches: Mapping[Pair, Match]) -> bool:
    """Test whether a camera leaves about as little as a plane, and outvotes no more pairs."""
    shared = [pair for pair in matches if pair in camera.matches and pair in plane.matches]
    if not shared or len(camera.outvoted) > len(plane.outvoted):
        return len(camera.matches) > len(plane.matches)
    if len(camera.outvoted) < len(plane.outvoted):
        return True
    least = left_over(plane.bundle, matches, shared)
    residual = left_over(camera.bundle, matches, shared)
    return _TOLERANCE.allows(camera.bundle, residual, least, _TOLERANCE.features)


def _fit_agreeing(sizes: Floats, matches: Mapping[Pair, Match], adjust: Callable[..., Bundle]) -> ModelFit:
    """Adjust a model to the pairs that are not outvoted.

    The first pairs are those of the strongest tree. The others are taken up while they are not too far off;
    the largest distance falls from round to round, as a loop may be open by more at first than a pair that
    matches elsewhere is off later.

    Parameters
    ----------
    sizes : (N, 2) array
        Width and height of each picture, px.
    matches : mapping from (int, int) to Match
    adjust : callable
        Adjusts the model to some of the matches, from a bundle or from nothing.
    """
    strengths = strengths_of(matches)
    _, order, before = spanning_tree(len(sizes), strengths)
    tree = {(int(min(k, before[k])), int(max(k, before[k]))) for k in order[1:]}
    bundle = adjust({pair: match for pair, match in matches.items() if pair in tree})
    diagonal = float(np.hypot(*sizes.T).min())
    scale = max(float(np.max(match.uncertainty)) for match in matches.values())
    kept = [pair for pair in matches if pair in tree]
    for share in (*_TAKEN_UP, 0.0):
        distances = bundle.medians(matches)
        usual = _usual_distance(distances, kept, diagonal)
        largest = max(share * diagonal, _LARGEST_DISTANCE * scale, usual)
        now = [pair for pair in matches if distances[pair] <= largest]
        if len(now) == len(kept) == len(matches):
            break
        if now != kept and not groups(len(sizes), now).any():
            kept, bundle = now, adjust({pair: matches[pair] for pair in now}, bundle)
    distances = bundle.medians(matches)
    largest = max(_LARGEST_DISTANCE * scale, _usual_distance(distances, kept, diagonal))
    right, wrong, clear = divided(len(sizes), strengths, distances, largest)
    return ModelFit(
        bundle=bundle,
        matches={pair: matches[pair] for pair in (right if clear else matches)},
        outvoted=tuple(wrong),
        clear=clear,
    )


def _usual_distance(distances: Mapping[Pair, float], pairs: Collection[Pair], diagonal: float) -> float:
    """Return the largest distance, px, that is usual among pairs that agree; another place is farther."""
    return min(_LARGEST_RATIO * float(np.median([distances[pair] for pair in pairs])), ELSEWHERE * diagonal)


@dataclass(frozen=True, slots=True, eq=False)
class _PairTransform:
    """The transform of a bundle from the pixels of a pair's second picture to those of the first."""

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
        mapped = distorted(applied(matrix, flat), end, self.lens)
        mapped[~(depth > 0) | ~np.isfinite(mapped).all(axis=1)] = missing
        return mapped.reshape(points.shape)


def _with_patches(
    features: Sequence[FeatureSet], fit: ModelFit, executor: Executor | None
) -> dict[Pair, Match]:
    """Put patches in front of the features of each match; many patches take their place."""
    items = [(features[i], features[j], _PairTransform.of(fit.bundle, i, j)) for i, j in fit.matches]
    exact = {}
    for (pair, match), patches in zip(
        fit.matches.items(), results(executor, _align_patches, items), strict=True
    ):
        if patches is None or not len(patches.first):
            exact[pair] = replace(match, correlation=math.nan if patches is None else patches.correlation)
            continue
        first, second = patches.first, patches.second
        uncertainty = np.full(len(first), _PATCH_DEVIATION)
        if len(first) < _LEAST_PATCHES:
            own = np.full(len(match.first), match.uncertainty)
            first, second = np.concatenate([first, match.first]), np.concatenate([second, match.second])
            uncertainty = np.concatenate([uncertainty, own])
        exact[pair] = replace(
            match, first=first, second=second, uncertainty=uncertainty, correlation=patches.correlation
        )
    return exact


@one_thread()
def _align_patches(item: tuple[FeatureSet, FeatureSet, _PairTransform]) -> Match | None:
    return find_patches(*item, count=_PATCHES)
