"""Perspective: choose a plane or a camera that turns, and lay its pictures on a canvas.

1. Features of all pairs are adjusted as homographies to one plane and as turns of one camera
   (:mod:`toposeam.layers.registration.bundle_adjustment`); the camera, which has fewer unknowns, is taken
   unless it leaves clearly larger residuals.
2. Pairs that match where they do not belong are left out where others outvote them
   (:mod:`toposeam.layers.registration.consensus`).
3. Patches of each overlap, warped by the model, are laid on each other by phase correlation, and the model
   is adjusted to them.
4. The canvas has the horizon level, the middle of the pictures in its middle, and a projection that suits the
   field of view.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
import scipy

from toposeam.arrays import Floats
from toposeam.heat.threads import one_thread
from toposeam.layers.canvas.canvas import groups
from toposeam.layers.canvas.transforms import (
    NOWHERE,
    CameraTransform,
    PlaneTransform,
    Projection,
    distorted,
    undistorted,
    wrapped,
)
from toposeam.layers.execution.tasks import Executor, results
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.mesh.verticals import MOST_PITCH
from toposeam.layers.registration.bundle_adjustment import (
    Bundle,
    adjust_cameras,
    adjust_plane,
    left_over,
    spanning_tree,
    strengths_of,
)
from toposeam.layers.registration.consensus import divide_pairs, placed_elsewhere
from toposeam.layers.registration.features import FeatureSet
from toposeam.layers.registration.homography import applied, least_squares_homography
from toposeam.layers.registration.pair_matching import ELSEWHERE, GRID, Match, find_patches
from toposeam.layers.registration.placement import POORER_RATIO, Family

#: Patches that a pair needs to be adjusted to these alone, and one standard deviation of one, px.
_LEAST_PATCHES, _PATCH_DEVIATION = 12, 0.25
#: A pair does not fit if its median distance exceeds both the first, px of the reduced pictures, and the
#: second times the median of the others.
_LARGEST_DISTANCE, _LARGEST_RATIO = 6.0, 5.0
#: Largest distance of a pair, as a share of a picture's diagonal, in the rounds in which pairs are taken up.
_TAKEN_UP = (0.25, 0.08, 0.02)
#: Largest field of view of a flat canvas, degrees across and down, and of a cylinder, down.
_LARGEST_FLAT, _LARGEST_CYLINDER = (95.0, 80.0), 100.0
#: Weight of the mean of the cameras' own verticals beside the horizon that their turns share.
_VERTICAL_WEIGHT = 0.002
#: Focal length, mm of film of 24 × 36 mm, beyond which a camera that nobody speaks of shows
#: a plane: nobody turns such a lens by hand, but a map, or a camera that moved, seems to be seen by one.
_LONGEST_MM = 300.0
#: Steps of a circle in which the directions that pictures show are counted.
_CIRCLE_STEPS = 1440
#: Share of the pictures' corners that a camera must see less than 55° off its middle to show a plane.
_LEAST_AHEAD = 0.8


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
    #: Of a plane: the camera that shows which way is up, if there is one, and the focal length, mm of film of
    #: 24 × 36 mm, of the camera that it seems to be seen by, if that is too long for one.
    camera: Bundle | None = None
    seeming_mm: float | None = None


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
            sizes,
            given,
            focal=lens.focal,
            fixed=lens.fixed,
            distortion=lens.distortion,
            start=start,
            alone=len(families) == 1,
        )

    def too_long(camera: Bundle) -> float | None:
        length = math.hypot(24, 36) * camera.focal / float(np.hypot(*sizes[camera.middle]))
        return length if lens.focal is None and length > _LONGEST_MM else None

    fits = {family: _fit_agreeing(sizes, matches, partial(adjust, family)) for family in families}
    fit = next(iter(fits.values()))
    if len(fits) > 1:
        fit = fits["rotation"] if _explains(fits["rotation"], fits["plane"], matches) else fits["plane"]
        camera = fits["rotation"].bundle
        if fit is fits["rotation"] and too_long(camera):
            fit = fits["plane"] = replace(fits["plane"], seeming_mm=too_long(camera))
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
        if too_long(bundle) or not _TOLERANCE.allows(bundle, residual, least, _TOLERANCE.patches):
            fit = replace(plane, bundle=other, matches=exact, seeming_mm=too_long(bundle))
            exact = _with_patches(features, fit, executor)
            bundle = adjust("plane", exact, other)
    return replace(fit, bundle=bundle, matches=exact)


def _explains(camera: ModelFit, plane: ModelFit, matches: Mapping[Pair, Match]) -> bool:
    """Test whether a camera leaves about as little as a plane, and outvotes no more pairs."""
    shared = [pair for pair in matches if pair in camera.matches and pair in plane.matches]
    if not shared or len(camera.outvoted) > len(plane.outvoted):
        return len(camera.matches) > len(plane.matches)
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
    if max(distances.values()) > largest and len(tree) < len(matches):
        # The last pair of a whole turn may be far off where the focal length comes from the others.
        whole = adjust(matches)
        off = whole.medians(matches)
        if max(off.values()) <= max(_LARGEST_DISTANCE * scale, _usual_distance(off, list(off), diagonal)):
            bundle, distances, largest = whole, off, math.inf
    right, wrong, clear = divide_pairs(len(sizes), strengths, distances, largest)
    return ModelFit(
        bundle=bundle,
        matches={pair: matches[pair] for pair in (right if clear else matches)},
        outvoted=tuple(wrong),
        clear=clear,
    )


def is_one_plane(sizes: Floats, matches: Mapping[Pair, Match]) -> bool:
    """Test whether one plane brings all pairs together, so that none of them matches elsewhere."""
    return not _fit_agreeing(sizes, matches, partial(adjust_plane, sizes)).outvoted


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


def match_ends(features: Sequence[FeatureSet], bundle: Bundle, pair: Pair, least: float) -> Match | None:
    """Match two pictures that share few features by patches of the overlap that a bundle gives them.

    Parameters
    ----------
    features : sequence of FeatureSet
        Of all pictures of the bundle.
    bundle : Bundle
    pair : (int, int)
    least : float
        Least correlation of the overlap.

    Returns
    -------
    Match or None
        None where too few patches show the same.
    """
    i, j = pair
    patches = _align_patches((features[i], features[j], _PairTransform.of(bundle, i, j)))
    if patches is None or len(patches.first) < _LEAST_PATCHES or patches.correlation < least:
        return None
    return replace(
        patches,
        features=len(patches.first),
        share=patches.correlation,
        uncertainty=np.full(len(patches.first), _PATCH_DEVIATION),
    )


@one_thread()
def _align_patches(item: tuple[FeatureSet, FeatureSet, _PairTransform]) -> Match | None:
    return find_patches(*item, count=GRID)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class View:
    """The view of a canvas on what a camera saw."""

    #: None for the one that suits the field of view.
    projection: Projection | None = None
    #: Whether the horizon is to be level.
    level: bool = True
    #: The picture that lies in the middle; by default the middle of all.
    centre: int | None = None
    #: Degrees across that it shows at most; None for all.
    fov: float | None = None
    #: Whether the ends of pictures that reach all the way round agree.
    closed: bool = True
    #: (3,) unit direction that points down, in the frame of the cameras, if upright lines agree on one.
    down: Floats | None = None


def plane_transforms(
    bundle: Bundle, camera: Bundle | None = None, view: View | None = None
) -> tuple[PlaneTransform, ...]:
    """Lay all pictures on one plane, in a perspective that suits all of them.

    Where a camera explains the pictures nearly as well, and sees most of them ahead, the plane is viewed as
    that camera shows it, with the horizon level. Otherwise the view is taken in which the scale differs least
    from place to place; on average it leaves the middles of the pictures unchanged.

    Parameters
    ----------
    bundle : Bundle
        Of a plane.
    camera : Bundle, optional
        A camera that explains the pictures nearly as well.
    view : View, optional
    """
    centres = np.tile(np.eye(3), (len(bundle.sizes), 1, 1))
    centres[:, :2, 2] = (bundle.sizes - 1) / 2
    frame = centres[bundle.middle] @ np.linalg.inv(bundle.matrices[bundle.middle])
    matrices = frame @ bundle.matrices @ np.linalg.inv(centres)
    side = float(bundle.sizes.max())
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0.5]])
    spots = np.concatenate([(bundle.sizes - 1)[:, np.newaxis] * corners, np.ones((len(centres), 5, 1))], 2)

    if camera is not None:
        cameras, _ = camera_transforms(camera, replace(view or View(), projection="flat"))
        wanted = np.concatenate([one.to_canvas(own[:, :2]) for one, own in zip(cameras, spots, strict=True)])
        plain = np.concatenate([applied(one, own[:, :2]) for one, own in zip(matrices, spots, strict=True)])
        ahead = np.isfinite(wanted).all(axis=1)
        if ahead.mean() > _LEAST_AHEAD:
            upright = least_squares_homography(wanted[ahead], plain[ahead]) @ matrices
            depths = np.einsum("kj,kj->k", upright[:, 2], spots[:, 4])
            if depths.min() > 0:
                return tuple(
                    PlaneTransform(matrix / depth) for matrix, depth in zip(upright, depths, strict=True)
                )

    def tilted(tilt: Floats) -> Floats:
        """View the plane with another line at infinity."""
        perspective = np.eye(3)
        perspective[2, :2] = tilt / side
        return np.asarray(perspective @ matrices)

    def unevenness(tilt: Floats) -> float:
        views = tilted(tilt)
        depths = np.einsum("kj,kpj->kp", views[:, 2], spots)
        if depths.min() <= 0:
            return math.inf
        return float(np.var(np.log(np.abs(np.linalg.det(views)))[:, np.newaxis] - 3 * np.log(depths)))

    start = np.zeros(2)
    if math.isfinite(unevenness(start)) and unevenness(start) > 1e-12:
        matrices = tilted(scipy.optimize.minimize(unevenness, start, method="Nelder-Mead").x)
    step = np.array([[0, 1, 0], [0, 0, 1], [0, 0, 0]])
    there = applied(matrices, np.swapaxes(spots[:, 4, :2, np.newaxis] + step[:2], 1, 2))
    mean = np.mean(np.swapaxes(there[:, 1:] - there[:, :1], 1, 2), axis=0)
    back = np.eye(3)
    back[:2, :2] = np.linalg.inv(mean)
    matrices = back @ matrices
    # Corners may lie beyond the horizon, the middle does not.
    return tuple(
        PlaneTransform(matrix / abs(matrix[2] @ middle))
        for matrix, middle in zip(matrices, spots[:, 4], strict=True)
    )


def loop_of(bundle: Bundle, matches: Mapping[Pair, Match]) -> tuple[bool, bool, list[Pair]]:
    """Find out whether pictures of a turning camera make a loop.

    Returns
    -------
    reaches : bool
        Whether their fields of view reach all the way round.
    closes : bool
        Whether some loop of the matches leads round, and all of them fit.
    ends : list of (int, int)
        Pairs that are not matched and would lead from one end to the other.
    """
    turns = _upright(bundle, View())
    if not _directions([_rays(bundle, turns, index) for index in range(len(turns))])[1]:
        return False, False, []
    yaws = _unrolled(np.arctan2(turns[:, 0, 2], turns[:, 2, 2]), matches)
    facing = np.einsum("ia,ja->ij", turns[:, :, 2], turns[:, :, 2])
    reach = np.arctan(np.hypot(*bundle.sizes.T) / 2 / bundle.focals)
    near = [
        (i, j)
        for i, j in combinations(range(len(turns)), 2)
        if (i, j) not in matches and math.acos(min(facing[i, j], 1.0)) < reach[i] + reach[j]
    ]
    fits = not placed_elsewhere(bundle.sizes, bundle.medians(matches))
    return True, fits and bool(_closing(yaws, matches)), _closing(yaws, near)


def camera_transforms(bundle: Bundle, view: View) -> tuple[tuple[CameraTransform, ...], int | None]:
    """Lay all pictures of a turning camera on a canvas.

    Parameters
    ----------
    bundle : Bundle
        Of a camera.
    view : View

    Returns
    -------
    transforms : tuple of CameraTransform
    width : int or None
        Of the canvas, px, where it goes all the way round.
    """
    turns = _upright(bundle, view)
    rays = [_rays(bundle, turns, index) for index in range(len(turns))]
    yaws, whole = _directions(rays)
    if view.centre is None and not whole:
        middle = (yaws[0] + yaws[1]) / 2
    else:
        forward = turns[bundle.middle if view.centre is None else view.centre][:, 2]
        middle = math.atan2(forward[0], forward[2])
    turns = _turn_down(middle) @ turns
    across = min(math.degrees(yaws[1] - yaws[0]), 360.0 if view.fov is None else view.fov)
    pitches = np.concatenate([np.arcsin(np.clip(ray[:, 1], -1, 1)) for ray in rays])
    low, high = float(pitches.min()), float(pitches.max())
    projection = view.projection or _suitable(across, math.degrees(high - low), math.degrees(max(-low, high)))
    if projection == "sphere" and view.projection is None and _is_ahead(rays, middle, (low + high) / 2):
        projection = "flat"  # looked up, pictures span more degrees across than they show
    if projection == "flat":
        pitch = (low + high) / 2 if view.centre is None else _pitch(turns[view.centre])
        if view.down is None or abs(pitch) > math.radians(MOST_PITCH):
            turns = _pitched(pitch) @ turns  # else upright lines stay parallel
    round_way = whole and view.closed and projection in ("cylinder", "sphere") and across >= 360
    width = round(2 * math.pi * bundle.focal) if round_way else None
    radius = bundle.focal if width is None else width / (2 * math.pi)
    return (
        tuple(
            CameraTransform(
                size=bundle.size(index),
                rotation=turn,
                focal=float(bundle.focals[index]),
                projection=projection,
                radius=radius,
                lens=bundle.lens,
                fov=None if view.fov is None or view.fov >= 360 else view.fov,
            )
            for index, turn in enumerate(turns)
        ),
        width,
    )


def _is_ahead(rays: Sequence[Floats], yaw: float, pitch: float) -> bool:
    """Test whether no ray of all pictures is farther off a direction than the corners of a flat canvas."""
    ahead = np.array([math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch)])
    corner = math.atan(math.hypot(*(math.tan(math.radians(side) / 2) for side in _LARGEST_FLAT)))
    return min(float((ray @ ahead).min()) for ray in rays) >= math.cos(corner)


def _suitable(across: float, down: float, steepest: float) -> Projection:
    """Choose the projection that suits a field of view and its steepest direction, degrees."""
    if across <= _LARGEST_FLAT[0] and down <= _LARGEST_FLAT[1]:
        return "flat"
    return "cylinder" if 2 * steepest <= _LARGEST_CYLINDER else "sphere"


def _upright(bundle: Bundle, view: View) -> Floats:
    """Return the (N, 3, 3) turns of the cameras in a frame whose y axis points down.

    People turn a camera about the vertical and hold it level across: the horizontal axes of all pictures lie
    in the plane of the horizon (Brown and Lowe 2007, section 5). Where these determine no plane, as of a
    tower from its foot to its top, the pictures' own verticals do.
    """
    turns = bundle.rotations
    if not view.level:
        return np.asarray(turns[bundle.middle if view.centre is None else view.centre].T @ turns)
    down = level_down(bundle) if view.down is None else view.down
    forward = turns[bundle.middle][:, 2]
    forward = forward - down * (down @ forward)
    if np.linalg.norm(forward) < 1e-3:  # straight up or down: nothing is level
        return np.asarray(turns[bundle.middle].T @ turns)
    forward /= np.linalg.norm(forward)
    return np.asarray(np.stack([np.cross(down, forward), down, forward]) @ turns)


def level_down(bundle: Bundle) -> Floats:
    """Return the unit direction that points down by the turns of the cameras."""
    across, own = bundle.rotations[:, :, 0], bundle.rotations[:, :, 1].mean(axis=0)
    own /= np.linalg.norm(own)
    spread = across.T @ across / len(across) - _VERTICAL_WEIGHT * np.outer(own, own)
    down = np.linalg.eigh(spread)[1][:, 0]
    return np.asarray(down * (1 if down @ own >= 0 else -1))


def rays_at(bundle: Bundle, index: int, points: Floats) -> Floats:
    """Return the (M, 3) directions that a picture shows at (M, 2) points, px, in the frame of the cameras."""
    ideal = bundle.ideal(index, points) / bundle.focals[index]
    return np.asarray(np.append(ideal, np.ones((len(ideal), 1)), axis=1) @ bundle.rotations[index].T)


def _rays(bundle: Bundle, turns: Floats, index: int) -> Floats:
    """Compute (M, 3) directions that a picture shows."""
    width, height = bundle.sizes[index]
    x, y = np.linspace(0, width - 1, 33), np.linspace(0, height - 1, 33)
    points = bundle.ideal(index, np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)) / bundle.focals[index]
    rays = np.append(points, np.ones((len(points), 1)), axis=1) @ turns[index].T
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _turn_down(yaw: float) -> Floats:
    """Return the (3, 3) turn that brings a direction about the vertical, rad, to the front."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])


def _pitched(pitch: float) -> Floats:
    """Return the (3, 3) turn that brings a direction below the horizon, rad, to the front."""
    cosine, sine = math.cos(pitch), math.sin(pitch)
    return np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])


def _pitch(turn: Floats) -> float:
    return math.asin(max(-1.0, min(1.0, float(turn[1, 2]))))


def _directions(rays: Sequence[Floats]) -> tuple[tuple[float, float], bool]:
    """Find the angles about the vertical, rad, between which pictures show something, and whether they reach
    all the way round.

    Parameters
    ----------
    rays : sequence of (M, 3) arrays
        What each picture shows: right, down, forward.
    """
    shown = np.zeros(_CIRCLE_STEPS, bool)
    for ray in rays:
        yaw = np.arctan2(ray[:, 0], ray[:, 2])
        centre = math.atan2(ray[:, 0].mean(), ray[:, 2].mean())
        angles = wrapped(yaw - centre)
        low, high = (
            (centre + angle) / (2 * math.pi) * _CIRCLE_STEPS for angle in (angles.min(), angles.max())
        )
        shown[np.arange(math.floor(low), math.ceil(high)) % _CIRCLE_STEPS] = True
    if shown.all():
        return (-math.pi, math.pi), True
    # The largest gap is behind.
    hidden = np.flatnonzero(~shown)
    runs = np.split(hidden, np.flatnonzero(np.diff(hidden) > 1) + 1)
    if len(runs) > 1 and runs[0][0] == 0 and runs[-1][-1] == _CIRCLE_STEPS - 1:
        runs = [np.concatenate([runs[-1] - _CIRCLE_STEPS, runs[0]]), *runs[1:-1]]
    gap = max(runs, key=len)
    first, last = gap[-1] + 1, gap[0] + _CIRCLE_STEPS
    low, high = (value / _CIRCLE_STEPS * 2 * math.pi for value in (first, last))
    return (low, high), False


def _unrolled(yaws: Floats, pairs: Collection[Pair]) -> Floats:
    """Add whole turns to the directions of pictures, (N,) rad, so that they go on from pair to pair, those of
    nearest directions first.
    """
    yaws = np.array(yaws, float)
    group = np.arange(len(yaws))
    for i, j in sorted(pairs, key=lambda pair: abs(_yaw_step(yaws, pair))):
        if group[i] != group[j]:
            moved = group == group[j]
            yaws[moved] += yaws[i] + _yaw_step(yaws, (i, j)) - yaws[j]
            group[moved] = group[i]
    return yaws


def _closing(yaws: Floats, pairs: Collection[Pair]) -> list[Pair]:
    """List the pairs that lead from one end of an unrolled row (:func:`_unrolled`) to the other."""
    return [(i, j) for i, j in pairs if abs(yaws[j] - yaws[i] - _yaw_step(yaws, (i, j))) > math.pi]


def _yaw_step(yaws: Floats, pair: Pair) -> float:
    """Return the angle from the first picture of a pair to the second, the shorter way."""
    return float(wrapped(yaws[pair[1]] - yaws[pair[0]]))
