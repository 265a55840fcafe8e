"""Places of pictures of which nobody says where they belong.

1. Each picture, reduced, is described by its SIFT features (Lowe 2004,
   doi:10.1023/B:VISI.0000029664.99615.94), and pairs of pictures by those that match.
2. The poorest model that explains the pictures is taken, and adjusted to all pairs at once, so that loops
   close. *Shift* and *similarity* (a turn and a scale) come first: patches of each overlap, laid exactly on
   each other by phase correlation, give them by linear least squares
   (:mod:`toposeam.layers.registration.pose_graph`). Then come a camera that *rotates* and homographies of one
   *plane* (:mod:`toposeam.layers.registration.models`).
3. Pairs that match where they do not belong, as what repeats itself does, are left out where others outvote
   them (:mod:`toposeam.layers.registration.consensus`).
4. Pictures that are only moved come to lie on whole pixels; others are warped once, by cubic splines.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.checks import check_choice, check_function, check_items, check_range, check_whole
from toposeam.errors import OptionError, OverlapError, Term
from toposeam.layers.canvas.layer import Layer, as_layers
from toposeam.layers.canvas.transforms import (
    PROJECTIONS,
    CameraTransform,
    PlaneTransform,
    Projection,
    Transform,
    reach,
)
from toposeam.layers.canvas.warping import on_canvas
from toposeam.layers.execution.tasks import Executor, check_executor
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.bundle_adjustment import Family
from toposeam.layers.registration.consensus import (
    ELSEWHERE,
    LARGEST_MISFIT,
    ambiguous,
    placed_elsewhere,
    without_contradictions,
)
from toposeam.layers.registration.given_points import matches_of
from toposeam.layers.registration.homography import applied
from toposeam.layers.registration.models import Lens, ModelFit, fit_models
from toposeam.layers.registration.pair_matching import Kind, Match, Sightings, groups
from toposeam.layers.registration.panorama import View, camera_transforms, plane_transforms
from toposeam.layers.registration.placement import MODELS, Model, Placement, Residual
from toposeam.layers.registration.pose_graph import FREEDOMS, open_corners, residuals
from toposeam.layers.registration.refusals import check_exact, check_joined, is_plain, named, strangers

#: Least correlation of two overlaps that are taken to show the same.
LEAST_CORRELATION = 0.5
#: Greatest focal length, px.
_LONGEST_FOCAL = 1e9
#: Similarities that leave no more px at a twentieth of the points of any pair are not compared with other
#: models.
_EXPLAINED = 1.2
#: So many of the strongest pairs tell whether similarities may do: not where they leave so many times as much
#: of the features as homographies do, and so many px of the reduced pictures more.
_ASKED, _TIMES, _MORE = 6, 1.3, 0.5

_Value = TypeVar("_Value")


def find_places(
    pictures: Sequence[Layer] | Sequence[npt.NDArray[Any]],
    *,
    model: Model | str = "auto",
    exact: bool = False,
    focal: float | None = None,
    lens: float | None = None,
    projection: Projection | str = "auto",
    level: bool = True,
    centre: int | None = None,
    fov: float | None = None,
    points: Mapping[Pair, npt.ArrayLike] | None = None,
    least_correlation: float = LEAST_CORRELATION,
    progress: Callable[[float], None] | None = None,
    executor: Executor | None = None,
) -> Placement:
    """Find out which pictures belong together, and where.

    Parameters
    ----------
    pictures : sequence of Layer, or of (H, W) or (H, W, C) arrays
        At least two, in any order and exposed differently; where they lie is ignored.
    model : {"auto", "shift", "similarity", "plane", "rotation"}
        What may bring pictures together: moves; turns by up to 3° and scales by up to 3 %, too; homographies
        of one plane; a camera that turns about one point. By default the poorest that explains them.
    exact : bool
        Refuse pictures that moves, turns and scales do not place exactly, and those that fit none of the
        others, which are left out otherwise.
    focal : float in [1, 1e9], optional
        Focal length of the camera, px of the pictures; by default estimated. It, `lens`, `projection` and
        `fov` make the model "auto" a camera that rotates.
    lens : float, optional
        Its radial distortion, b of Hugin (:mod:`toposeam.layers.canvas.transforms`); by default estimated
        from three pictures on.
    projection : {"auto", "flat", "cylinder", "sphere", "panini"}
        How the canvas shows what a camera saw; by default as the field of view asks for.
    level : bool
        Whether the horizon is laid level; else the picture in the middle lies upright.
    centre : int, optional
        The picture that lies in the middle of the canvas, where a camera turned.
    fov : float in (0, 360], optional
        Degrees across that the canvas shows at most, of what a camera saw; pictures beyond are left out.
    points : mapping from (int, int) to (M, 4) array_like, optional
        Points that two pictures share, at least four, in place of the features found in them: x and y in the
        one, px from the middle of its upper left pixel, and in the other.
    least_correlation : float in (0, 1]
        Of the overlap of two pictures that similarities bring together.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].
    executor : concurrent.futures.Executor, optional
        Where pictures and pairs are looked at; the places are the same.

    Returns
    -------
    Placement

    Raises
    ------
    OverlapError
        When no two pictures show the same, or pairs contradict each other and none outvotes the other; the
        text names them.
    OptionError

    Examples
    --------
    >>> from skimage import data
    >>> whole = data.camera()[100:260, :300]
    >>> pictures = [Layer(whole[:, :180], name="left"), Layer(whole[:, 120:], name="right")]
    >>> [layer.at for layer in find_places(pictures).layers]
    [(0, 0), (120, 0)]
    """
    options = PlaceOptions(
        model=model,
        exact=exact,
        focal=focal,
        lens=lens,
        projection=projection,
        level=level,
        centre=centre,
        fov=fov,
        points={} if points is None else points,
        least_correlation=least_correlation,
    )
    check_executor(executor)
    return found_places(as_layers(pictures), options, progress, executor, _placed_here)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceOptions:
    """Options of :func:`find_places`."""

    model: Model | str = "auto"
    exact: bool = False
    focal: float | None = None
    #: Whether the focal length is a first guess only, as of EXIF.
    about: bool = False
    lens: float | None = None
    projection: Projection | str = "auto"
    level: bool = True
    centre: int | None = None
    fov: float | None = None
    points: Mapping[Pair, npt.ArrayLike] = field(default_factory=dict)
    least_correlation: float = LEAST_CORRELATION

    @property
    def families(self) -> tuple[Family, ...]:
        """The models that are tried beyond similarities: of what only a camera has, that one."""
        if self.model in ("plane", "rotation"):
            return ("plane",) if self.model == "plane" else ("rotation",)
        known = self.lens is not None or (self.focal is not None and not self.about)
        known = known or self.projection != "auto" or self.fov is not None
        return ("rotation",) if known else ("plane", "rotation")

    def check(self, count: int) -> None:
        """Refuse options that mean nothing for so many pictures."""
        check_choice("model", self.model, ("auto", *MODELS))
        check_choice("projection", self.projection, ("auto", *PROJECTIONS))
        check_choice("level", self.level, (True, False))
        check_choice("exact", self.exact, (True, False))
        check_range(0, 1, above=True, least_correlation=self.least_correlation)
        if self.focal is not None:
            check_range(1, _LONGEST_FOCAL, focal=self.focal)
        if self.lens is not None:
            check_range(-0.5, 0.5, lens=self.lens)
        if self.fov is not None:
            check_range(0, 360, above=True, fov=self.fov)
        if self.exact and self.model in ("plane", "rotation"):
            raise OptionError(
                "exact is for moves, turns and scales, not for the model {model}; leave one of them out",
                kind="conflict",
                model=self.model,
            )
        if self.centre is not None:
            check_whole("centre", self.centre, 0, count - 1)


#: Pictures laid on the canvas by transforms.
Places = Callable[[Sequence[Layer], Sequence[Transform]], Sequence[Layer]]


def _placed_here(pictures: Sequence[Layer], transforms: Sequence[Transform]) -> Sequence[Layer]:
    return [on_canvas(picture, transform) for picture, transform in zip(pictures, transforms, strict=True)]


@dataclass(frozen=True, slots=True, eq=False)
class _Set:
    """Pictures, what they show, and what is wanted of them."""

    pictures: Sequence[Layer]
    sightings: Sightings
    options: PlaceOptions
    executor: Executor | None

    @property
    def sizes(self) -> Floats:
        """(N, 2) heights and widths."""
        return np.array([picture.image.shape[:2] for picture in self.pictures], float)

    @property
    def most_shared(self) -> npt.NDArray[np.intp]:
        """(N,) features that each picture shares with the one that it shares most with."""
        most = np.zeros(len(self.pictures), np.intp)
        for pair in self.sightings.pairs:
            most[list(pair)] = np.maximum(most[list(pair)], len(self.sightings.shared(pair)))
        return most

    @property
    def names(self) -> list[str]:
        return [picture.name for picture in self.pictures]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _Found:
    """Transforms of the pictures that belong together, and the pairs that say so."""

    model: Model
    #: Which pictures these are; pairs are counted among them.
    numbers: Sequence[int]
    transforms: Sequence[Transform]
    matches: Mapping[Pair, Match]
    #: (M,) px each, by pair.
    off: Mapping[Pair, Floats]
    outvoted: tuple[Pair, ...] = ()
    focal: float | None = None
    distortion: float = 0.0
    projection: Projection | None = None
    wrap: int | None = None
    #: (N,) which group each of all pictures is in.
    groups: npt.NDArray[np.intp]
    #: Pictures of which the canvas shows nothing.
    beyond: tuple[int, ...] = ()

    @property
    def misfit(self) -> float:
        return max(float(np.median(off)) for off in self.off.values())

    @property
    def farthest(self) -> float:
        """The largest twentieth of a pair, px."""
        return max(float(np.percentile(off, 95)) for off in self.off.values())


def found_places(
    pictures: Sequence[Layer],
    options: PlaceOptions,
    progress: Callable[[float], None] | None,
    executor: Executor | None,
    place: Places,
) -> Placement:
    """As :func:`find_places`, for whoever places pictures in a way of their own, as into files."""
    pictures = check_items("pictures", pictures, Layer, "a sequence of Layers")
    if len(pictures) < 2:
        raise OptionError(
            "{count} picture was given; pass at least two",
            kind="few layers",
            parameter=Term("pictures"),
            count=len(pictures),
        )
    options.check(len(pictures))
    check_function("progress", progress)
    report: Callable[[float], None] = progress or (lambda _: None)
    sizes = [(picture.image.shape[1], picture.image.shape[0]) for picture in pictures]
    marked = matches_of(options.points, sizes)
    given = _Set(pictures, Sightings(pictures, report, executor, marked), options, executor)
    found = _found(given)
    numbers = list(found.numbers)
    if options.centre is not None and options.centre not in numbers:
        raise OverlapError(
            "{centre} is to lie in the middle, but {why}; name another picture",
            kind="centre",
            layers=(options.centre,),
            centre=given.names[options.centre],
            why=_reason(given, found, options.centre),
        )
    transforms = tuple(found.transforms)
    layers = tuple(place([pictures[number] for number in numbers], transforms))
    report(1.0)
    left_out = {
        number: _reason(given, found, number) for number in range(len(pictures)) if number not in numbers
    }
    return Placement(
        layers=layers,
        model=found.model,
        sizes=tuple((int(width), int(height)) for height, width in given.sizes[numbers]),
        transforms=transforms,
        numbers=tuple(numbers),
        left_out=left_out,
        correlations={pair: match.correlation for pair, match in found.matches.items()},
        residuals={
            pair: _residual(transforms[pair[0]], match, found.off[pair])
            for pair, match in found.matches.items()
        },
        misfit=found.misfit,
        outvoted=found.outvoted,
        focal=found.focal,
        distortion=found.distortion,
        projection=found.projection,
        wrap=found.wrap,
        other_groups=_other_groups(found),
    )


def _residual(transform: Transform, match: Match, off: Floats) -> Residual:
    """What is left of a pair where the canvas shows it."""
    at = transform.to_canvas(match.first)
    features = match.features or len(off)
    if isinstance(transform, CameraTransform):
        shown = np.abs(at[:, 0]) <= transform.edge
        at, off = at[shown], off[shown]
    return Residual.of(off, at, features)


def _other_groups(found: _Found) -> tuple[tuple[int, ...], ...]:
    """The numbers of pictures that belong together, but not to those that were placed."""
    several = [np.flatnonzero(found.groups == group) for group in dict.fromkeys(found.groups.tolist())]
    return tuple(
        tuple(int(number) for number in members)
        for members in several
        if len(members) > 1 and members[0] not in found.numbers
    )


def _found(given: _Set) -> _Found:
    """The poorest model that explains the pictures."""
    model = given.options.model
    freedoms: Sequence[str] = FREEDOMS[:1] if model == "shift" else FREEDOMS
    if given.options.exact or model in ("shift", "similarity"):
        return _by_similarity(given, freedoms, LARGEST_MISFIT if given.options.exact else None)
    if len(given.options.families) == 1:
        return _by_perspective(given)
    similar: _Found | None = None
    refused: OverlapError | None = None
    if not _is_perspective(given):
        try:
            similar = _by_similarity(given, freedoms, LARGEST_MISFIT)
        except OverlapError as error:
            refused = error
    if similar is not None and similar.farthest <= _EXPLAINED:
        left_out = len(similar.numbers) < len(given.pictures)
        if not left_out or _most_joined(given) <= len(similar.numbers):
            return similar
    try:
        other = _by_perspective(given)
    except OverlapError as error:
        if similar is None:
            raise (refused or error) from None
        return similar
    if refused is not None and refused.kind == "ambiguous" and other.outvoted:
        raise refused
    if similar is None or len(other.numbers) > len(similar.numbers):
        return other
    return similar if similar.farthest <= max(_EXPLAINED, _TIMES * other.farthest) else other


def _most_joined(given: _Set) -> int:
    """How many pictures homographies join."""
    matches, _ = given.sightings.matches("homography", given.options.least_correlation)
    return int(np.bincount(groups(len(given.pictures), matches)).max())


def _is_perspective(given: _Set) -> bool:
    """Whether most of the strongest pairs say that no similarity brings them together."""
    votes = []
    asked = given.sightings.pairs[:_ASKED]
    for pair, match in zip(asked, given.sightings.homographies(asked), strict=True):
        if match is None:
            continue
        first, second = match.first @ [1, 1j], match.second @ [1, 1j]
        own, other = first - first.mean(), second - second.mean()
        left = np.abs(own - np.vdot(other, own) / np.vdot(other, other) * other)
        least = np.abs(first - applied(match.matrix, match.second) @ [1, 1j])
        votes.append(_rms(left) > _TIMES * _rms(least) + _MORE * given.sightings.looks[pair[0]].scale)
    return bool(votes) and sum(votes) > len(votes) / 2


def _rms(values: npt.NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Most of the pictures that pairs join."""

    numbers: list[int]
    names: list[str]
    #: By pairs that are counted among these pictures.
    matches: dict[Pair, Match]
    #: (N,) which group each of all pictures is in.
    groups: npt.NDArray[np.intp]

    @classmethod
    def of(cls, given: _Set, kind: Kind) -> _Group:
        """By pairs of a kind; none may be lost where places are to be exact."""
        least = given.options.least_correlation
        matches, best = given.sightings.matches(kind, least)
        own = groups(len(given.pictures), matches)
        sizes = np.bincount(own)
        if given.options.exact or sizes.max() < 2:
            if len(given.pictures) == 2 and not matches:
                raise strangers(given.pictures, given.sightings, float(best.max()), least)
            check_joined(given.pictures, matches, best, least, given.most_shared)
        numbers = np.flatnonzero(own == sizes.argmax()).tolist()
        names = [given.pictures[number].name for number in numbers]
        return cls(numbers, names, among(numbers, matches), own)


def among(numbers: Sequence[int], pairs: Mapping[Pair, _Value]) -> dict[Pair, _Value]:
    """Keep the pairs of some pictures, counted among these."""
    order = {number: index for index, number in enumerate(numbers)}
    return {(order[i], order[j]): value for (i, j), value in pairs.items() if i in order and j in order}


def _by_similarity(given: _Set, freedoms: Sequence[str], largest: float | None) -> _Found:
    """Moves, turns and scales of most pictures, of which no pair is off by more than so many px; by default
    any that is not elsewhere.
    """
    group = _Group.of(given, "similarity")
    sizes = given.sizes[group.numbers]
    if largest is None:
        largest = ELSEWHERE * float(np.hypot(*sizes.T).min())
    solution, used = without_contradictions(group.names, sizes, group.matches, freedoms, largest)
    if given.options.exact:
        check_exact([given.pictures[number] for number in group.numbers], open_corners(sizes, solution))
    transforms = [
        PlaneTransform(np.array([[a, -b, u], [b, a, v], [0.0, 0.0, 1.0]]))
        for a, b, u, v in solution.transforms
    ]
    turned = any(not np.array_equal(one.matrix[:2, :2], np.eye(2)) for one in transforms)
    return _Found(
        model="similarity" if turned else "shift",
        numbers=group.numbers,
        transforms=transforms,
        matches=used,
        off={pair: residuals(solution.transforms, *pair, match) for pair, match in used.items()},
        outvoted=tuple(pair for pair in group.matches if pair not in used),
        groups=group.groups,
    )


def _by_perspective(given: _Set) -> _Found:
    """A plane, or a camera that turns."""
    options, group = given.options, _Group.of(given, "homography")
    fit = fit_models(
        [given.sightings.looks[number] for number in group.numbers],
        group.matches,
        options.families,
        Lens(
            focal=options.focal,
            fixed=options.focal is not None and not options.about,
            distortion=options.lens,
        ),
        given.executor,
    )
    _check_contradictions(group.names, fit)
    bundle = fit.bundle
    transforms: Sequence[Transform]
    width = projection = None
    if bundle.family == "plane":
        transforms = plane_transforms(bundle, fit.camera, View(level=options.level))
    else:
        asked = None if options.projection == "auto" else options.projection
        centre = group.numbers.index(options.centre) if options.centre in group.numbers else None
        view = View(projection=asked, level=options.level, centre=centre, fov=options.fov)  # type: ignore[arg-type]
        cameras, width = camera_transforms(bundle, view)
        transforms, projection = cameras, cameras[0].projection
    found = _Found(
        model=bundle.family,
        numbers=group.numbers,
        transforms=transforms,
        matches=fit.matches,
        off={pair: bundle.off(pair, match) for pair, match in fit.matches.items()},
        outvoted=fit.outvoted,
        focal=bundle.focal if bundle.family == "rotation" else None,
        distortion=bundle.distortion,
        projection=projection,
        wrap=width,
        groups=group.groups,
    )
    return found if options.fov is None else _in_view(given, found, options.fov)


def _in_view(given: _Set, found: _Found, fov: float) -> _Found:
    """Those of the pictures that a canvas of so many degrees across shows."""
    sizes = [(int(width), int(height)) for height, width in given.sizes[list(found.numbers)]]
    shown = [k for k, size in enumerate(sizes) if reach(found.transforms[k], size) is not None]
    if len(shown) == len(sizes):
        return found
    if len(shown) < 2:
        raise OverlapError(
            "{fov:g} degrees across show {count} of {total} pictures; choose a larger field of view",
            kind="view",
            fov=fov,
            count=len(shown),
            total=len(sizes),
        )
    return replace(
        found,
        numbers=[found.numbers[k] for k in shown],
        transforms=[found.transforms[k] for k in shown],
        matches=among(shown, found.matches),
        off=among(shown, found.off),
        outvoted=tuple(among(shown, dict.fromkeys(found.outvoted))),
        beyond=tuple(number for k, number in enumerate(found.numbers) if k not in shown),
    )


def _reason(given: _Set, found: _Found, number: int) -> str:
    """Why a picture belongs to none of those that were placed."""
    name = given.names[number]
    if number in found.beyond:
        return f"{name} lies beyond the field of view"
    others = [other for other in np.flatnonzero(found.groups == found.groups[number]) if other != number]
    if others:
        return f"{name} shows something else, together with {named(given.pictures, np.array(others))}"
    shared = {
        other: len(given.sightings.shared((min(number, other), max(number, other))))
        for other in found.numbers
    }
    nearest = max(shared, key=lambda other: shared[other])
    if is_plain(given.sightings.looks[number]):
        return f"{name} shows too little detail to be placed"
    if not shared[nearest]:
        return f"{name} shares nothing with the other pictures"
    return (
        f"{name} shares {shared[nearest]} features with {given.names[nearest]}, but no overlap brings them "
        "together"
    )


def _check_contradictions(names: Sequence[str], fit: ModelFit) -> None:
    """Refuse pairs that match elsewhere if the others do not outvote them."""
    bundle = fit.bundle
    if fit.clear or not fit.outvoted:
        return
    off = bundle.medians({pair: fit.matches[pair] for pair in fit.outvoted})
    elsewhere = placed_elsewhere(bundle.sizes, off)
    if elsewhere:
        raise ambiguous(list(names), elsewhere, max(off.values()))
