"""Find the places of pictures whose positions are unknown.

1. SIFT features describe each picture, reduced, and those that match describe pairs of pictures
   (:mod:`toposeam.layers.registration.pair_matching`).
2. The poorest model that explains the pictures is adjusted to all pairs at once, so that loops close. *Shift*
   and *similarity* (a turn and a scale) come first: patches of each overlap, laid exactly on each other by
   phase correlation, give them by linear least squares (:mod:`toposeam.layers.registration.pose_graph`). Then
   come a camera that *rotates* and homographies of one *plane*
   (:mod:`toposeam.layers.registration.perspective`).
3. Wrong pairs, as of pictures that repeat themselves, are left out where others outvote them
   (:mod:`toposeam.layers.registration.consensus`).
4. Pictures that are only moved come to lie on whole pixels; others are warped once, by cubic splines.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Indices
from toposeam.checks import check_choice, check_function, check_items, check_range, check_whole
from toposeam.errors import OptionError, OverlapError, Term
from toposeam.layers.canvas.canvas import groups
from toposeam.layers.canvas.layer import Layer, as_layers
from toposeam.layers.canvas.transforms import (
    PROJECTIONS,
    CameraTransform,
    PlaneTransform,
    Projection,
    Transform,
    is_move,
    reach,
)
from toposeam.layers.canvas.warping import on_canvas
from toposeam.layers.execution.tasks import Executor, check_executor
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.consensus import placed_elsewhere, without_contradictions
from toposeam.layers.registration.homography import applied
from toposeam.layers.registration.pair_matching import (
    ELSEWHERE,
    FEATURE_DEVIATION,
    LEAST_CORRELATION,
    Kind,
    Match,
    PairMatcher,
    quarter_turns,
)
from toposeam.layers.registration.placement import (
    MODELS,
    POORER_RATIO,
    Family,
    Model,
    Placement,
    Residual,
    asked_camera,
    large_canvas,
    moved_camera,
    open_turn,
    seems_flat,
    weakly_held,
)
from toposeam.layers.registration.pose_graph import FREEDOMS, LARGEST_MISFIT, open_corners, residuals

if TYPE_CHECKING:
    from toposeam.layers.registration import perspective
    from toposeam.layers.registration.bundle_adjustment import Bundle
    from toposeam.layers.registration.perspective import ModelFit

#: Largest distance, px, at the farthest twentieth of the points of any pair, with which similarities are
#: taken without a comparison with other models, and perspectives without one with other planes.
_SIMILARITY_SUFFICES = 1.2
#: Strongest pairs that decide whether similarities are tried at all.
_DECIDING_PAIRS = 6

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
    horizon: tuple[int, npt.ArrayLike] | None = None,
    straighten: bool = False,
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
        The kind of transforms: moves; also turns by up to 3° and scales by up to 3 %; homographies of one
        plane; a camera that turns about one point. By default the poorest that explains the pictures.
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
        Of the canvas, for a camera; by default the one that suits the field of view.
    level : bool
        Whether the horizon is laid level; otherwise the picture in the middle lies upright.
    centre : int, optional
        The picture that lies in the middle of the canvas, where a camera turned.
    fov : float in (0, 360], optional
        Largest field of view of the canvas, degrees across, for a camera; pictures beyond are left out.
    horizon : (int, (2, 2) array_like), optional
        A picture, and two points of it, x and y, px from the middle of its upper left pixel. The canvas is
        turned until the line between them is level, or upright if it is nearer to that.
    straighten : bool
        Turn the canvas by up to 15° until lines of text, rules and edges of paper lie level and upright,
        where these stand out. Of a camera that turned, `level` does that.
    points : mapping from (int, int) to (M, 4) array_like, optional
        Points that two pictures share, at least four, in place of the features found in them: x and y in the
        one, px from the middle of its upper left pixel, and in the other.
    least_correlation : float in (0, 1]
        Of the overlap of two pictures that similarities bring together.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].
    executor : concurrent.futures.Executor, optional
        Where pictures are described and pairs are matched; the places are the same.

    Returns
    -------
    Placement

    Raises
    ------
    OverlapError
        When no two pictures show the same, or pairs contradict each other and neither outvotes the other;
        the text names them.
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
        horizon=horizon,
        straighten=straighten,
        points={} if points is None else points,
        least_correlation=least_correlation,
    )
    check_executor(executor)
    return found_places(as_layers(pictures), options, progress, executor, _place_in_memory)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceOptions:
    """Options of :func:`find_places`."""

    model: Model | str = "auto"
    exact: bool = False
    focal: float | None = None
    #: Whether the focal length is only a first guess, as that of EXIF.
    about: bool = False
    lens: float | None = None
    projection: Projection | str = "auto"
    level: bool = True
    centre: int | None = None
    fov: float | None = None
    horizon: tuple[int, npt.ArrayLike] | None = None
    straighten: bool = False
    points: Mapping[Pair, npt.ArrayLike] = field(default_factory=dict)
    least_correlation: float = LEAST_CORRELATION

    @property
    def families(self) -> tuple[Family, ...]:
        """The models that are tried beyond similarities: only the camera where an option is about cameras."""
        if self.model in ("plane", "rotation"):
            return ("plane",) if self.model == "plane" else ("rotation",)
        known = self.lens is not None or (self.focal is not None and not self.about)
        known = known or self.projection != "auto" or self.fov is not None
        return ("rotation",) if known else ("plane", "rotation")

    def check(self, count: int) -> None:
        """Refuse options that mean nothing for `count` pictures."""
        check_choice("model", self.model, ("auto", *MODELS))
        check_choice("projection", self.projection, ("auto", *PROJECTIONS))
        check_choice("level", self.level, (True, False))
        check_choice("exact", self.exact, (True, False))
        check_choice("straighten", self.straighten, (True, False))
        check_range(0, 1, above=True, least_correlation=self.least_correlation)
        if self.focal is not None:
            check_range(1, 1e9, focal=self.focal)
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
        if self.straighten and self.horizon is not None:
            raise OptionError(
                "{straighten} and {horizon} both turn the canvas; leave one of them out",
                kind="conflict",
                straighten=Term("straighten"),
                horizon=Term("horizon"),
            )
        if self.centre is not None:
            check_whole("centre", self.centre, 0, count - 1)
        if self.horizon is not None:
            from toposeam.layers.canvas.levelling import as_horizon  # only where it is asked for

            as_horizon(self.horizon, count)


#: Lays pictures on the canvas by their transforms; the last argument is the width of a round canvas, or None.
Places = Callable[[Sequence[Layer], Sequence[Transform], int | None], Sequence[Layer]]


def _place_in_memory(
    pictures: Sequence[Layer], transforms: Sequence[Transform], wrap: int | None
) -> Sequence[Layer]:
    return [on_canvas(picture, transform) for picture, transform in zip(pictures, transforms, strict=True)]


def found_places(
    pictures: Sequence[Layer],
    options: PlaceOptions,
    progress: Callable[[float], None] | None,
    executor: Executor | None,
    place: Places,
) -> Placement:
    """Find places as :func:`find_places` does, and lay pictures on the canvas by `place`, as into files."""
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
    given: Mapping[Pair, Match] = {}
    if not isinstance(options.points, Mapping) or options.points:
        from toposeam.layers.registration.given_points import matches_of  # few users give points

        given = matches_of(
            options.points, [(picture.image.shape[1], picture.image.shape[0]) for picture in pictures]
        )
    matcher = PairMatcher(pictures, report, executor, given)
    quarters = (
        [0] * len(pictures) if given else quarter_turns(matcher.features, matcher.pairs, matcher.shared)
    )
    if any(quarters):
        from toposeam.layers.registration.quarter_turns import turned  # few files lost their orientation

        upright = [turned(picture, own) for picture, own in zip(pictures, quarters, strict=True)]
        matcher = PairMatcher(upright, report, executor)
    placement = _by_the_seam(matcher, options, _poorest_model(matcher, options))
    if options.centre is not None and options.centre not in placement.numbers:
        raise OverlapError(
            "{centre} is to lie in the middle, but {why}; name another picture",
            kind="centre",
            layers=(options.centre,),
            centre=matcher.names[options.centre],
            why=placement.left_out[options.centre],
        )
    numbers, areas = placement.numbers, sum(width * height for width, height in placement.sizes)
    if any(quarters):
        from toposeam.layers.registration.quarter_turns import as_in_files

        placement = as_in_files(placement, quarters, matcher.names)
    if options.horizon is not None:
        from toposeam.layers.canvas.levelling import as_horizon

        number, line = as_horizon(options.horizon, len(pictures))
        if number not in placement.numbers:
            raise OverlapError(
                "{picture} has the horizon, but {why}; take two points of another picture",
                kind="horizon",
                layers=(number,),
                picture=matcher.names[number],
                why=placement.left_out[number],
            )
        placement = placement.levelled(placement.numbers.index(number), line)
    if options.straighten and placement.focal is None:
        from toposeam.layers.canvas.levelling import straightening

        level = straightening([pictures[number].image for number in numbers], placement.transforms)
        placement = placement if level is None else placement.levelled(*level)
    layers = place([pictures[number] for number in numbers], placement.transforms, placement.wrap)
    report(1.0)
    doubts = (*placement.doubts, *large_canvas(layers, areas))
    return replace(placement, layers=tuple(layers), doubts=doubts)


def _poorest_model(matcher: PairMatcher, options: PlaceOptions) -> Placement:
    """Find the poorest model that explains the pictures, without layers."""
    model = options.model
    freedoms: Sequence[str] = FREEDOMS[:1] if model == "shift" else FREEDOMS
    if options.exact or model in ("shift", "similarity"):
        return _by_similarity(matcher, options, freedoms, LARGEST_MISFIT if options.exact else None)
    if len(options.families) == 1:
        return _by_perspective(matcher, options)
    similar: Placement | None = None
    refused: OverlapError | None = None
    if not _is_perspective(matcher):
        try:
            similar = _by_similarity(matcher, options, freedoms, LARGEST_MISFIT)
        except OverlapError as error:
            refused = error
    if similar is not None and _farthest(similar) <= _SIMILARITY_SUFFICES:
        places_all = len(similar.numbers) == len(matcher.pictures)
        if places_all or _most_joined(matcher, options) <= len(similar.numbers):
            return similar
    try:
        other = _by_perspective(matcher, options)
    except OverlapError as error:
        if similar is None:
            raise (refused or error) from None
        return similar
    if refused is not None and refused.kind == "ambiguous" and other.outvoted:
        raise refused
    if similar is None or len(other.numbers) > len(similar.numbers):
        return other
    largest = max(_SIMILARITY_SUFFICES, POORER_RATIO * _farthest(other))
    return similar if _farthest(similar) <= largest else other


def _by_the_seam(matcher: PairMatcher, options: PlaceOptions, placement: Placement) -> Placement:
    """Choose among the alignments of two photographs, unless all points fit, the one with the cheapest
    seam.
    """
    if len(placement.numbers) != 2 or placement.model not in ("plane", "rotation") or options.points:
        return placement
    if _farthest(placement) <= _SIMILARITY_SUFFICES:
        return placement
    from toposeam.layers.registration.alignments import cheapest  # photographs only

    numbers, matches, labels = _joined(matcher, options, "homography")
    planes = matcher.planes((numbers[0], numbers[1]))

    def others() -> Iterator[Placement]:
        families: Sequence[Family] = [one for one in options.families if one != placement.model]
        tried = [(family, matches) for family in families]
        if "plane" in options.families:
            tried += [("plane", {(0, 1): match}) for match in planes[1:]]
        for family, own in tried:
            with suppress(OverlapError):
                yield _adjusted(matcher, replace(options, model=family), numbers, own, labels)

    pictures = [matcher.pictures[number] for number in numbers]
    return cheapest(pictures, placement, others(), planes if options.model == "auto" else ())


def _farthest(placement: Placement) -> float:
    """Return the largest distance, px, at the farthest twentieth of the points of any pair."""
    return max(residual.farthest for residual in placement.residuals.values())


def _most_joined(matcher: PairMatcher, options: PlaceOptions) -> int:
    """Count the pictures that homographies join."""
    matches, _ = matcher.matches("homography", options.least_correlation)
    return int(np.bincount(groups(len(matcher.pictures), matches)).max())


def _is_perspective(matcher: PairMatcher) -> bool:
    """Test whether most of the strongest pairs need a homography, as no similarity fits their features."""
    votes = []
    strongest = matcher.pairs[:_DECIDING_PAIRS]
    for pair, match in zip(strongest, matcher.homographies(strongest), strict=True):
        if match is None:
            continue
        first, second = match.first @ [1, 1j], match.second @ [1, 1j]
        own, other = first - first.mean(), second - second.mean()
        left = np.abs(own - np.vdot(other, own) / np.vdot(other, other) * other)
        least = np.abs(first - applied(match.matrix, match.second) @ [1, 1j])
        slack = FEATURE_DEVIATION * matcher.features[pair[0]].scale
        votes.append(_root_mean_square(left) > POORER_RATIO * _root_mean_square(least) + slack)
    return bool(votes) and sum(votes) > len(votes) / 2


def _root_mean_square(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _joined(
    matcher: PairMatcher, options: PlaceOptions, kind: Kind
) -> tuple[list[int], dict[Pair, Match], Indices]:
    """Choose the largest group of pictures that pairs of a kind join.

    Returns
    -------
    numbers : list of int
        Of the pictures.
    matches : dict of (int, int) to Match
        Pairs are counted among these pictures.
    labels : (N,) int array
        The group of each of all pictures.

    Raises
    ------
    OverlapError
        When no two pictures are joined, or when places are to be exact and pictures are lost.
    """
    pictures, least = matcher.pictures, options.least_correlation
    matches, best = matcher.matches(kind, least)
    labels = groups(len(pictures), matches)
    sizes = np.bincount(labels)
    if options.exact or sizes.max() < 2:
        from toposeam.layers.registration.refusals import check_joined, strangers  # most pictures are joined

        if len(pictures) == 2 and not matches:
            raise strangers(matcher, float(best.max()), least)
        check_joined(pictures, matches, best, least, matcher.most_shared())
    numbers = np.flatnonzero(labels == sizes.argmax()).tolist()
    return numbers, among(numbers, matches), labels


def among(numbers: Sequence[int], pairs: Mapping[Pair, _Value]) -> dict[Pair, _Value]:
    """Keep the pairs of some pictures, counted among these."""
    order = {number: index for index, number in enumerate(numbers)}
    return {(order[i], order[j]): value for (i, j), value in pairs.items() if i in order and j in order}


def _by_similarity(
    matcher: PairMatcher, options: PlaceOptions, freedoms: Sequence[str], largest: float | None
) -> Placement:
    """Place most pictures by moves, turns and scales.

    Parameters
    ----------
    matcher : PairMatcher
    options : PlaceOptions
    freedoms : sequence of str
        Kinds of transforms, the simplest first.
    largest : float, optional
        Largest distance of a pair that fits, px; by default all fit that match in no other place.
    """
    numbers, matches, labels = _joined(matcher, options, "similarity")
    pictures = [matcher.pictures[number] for number in numbers]
    sizes = np.array([picture.image.shape[:2] for picture in pictures], float)
    if largest is None:
        largest = ELSEWHERE * float(np.hypot(*sizes.T).min())
    names = [picture.name for picture in pictures]
    solution, used = without_contradictions(names, sizes, matches, freedoms, largest)
    if options.exact:
        from toposeam.layers.registration.refusals import check_exact  # few users ask for exact places

        check_exact(pictures, open_corners(sizes, solution))
    transforms = [
        PlaneTransform(np.array([[a, -b, u], [b, a, v], [0.0, 0.0, 1.0]]))
        for a, b, u, v in solution.transforms
    ]
    moved = all(map(is_move, transforms))
    placement = _placement(
        matcher,
        labels,
        numbers,
        model="shift" if moved else "similarity",
        transforms=transforms,
        matches=used,
        distances={pair: residuals(solution.transforms, *pair, match) for pair, match in used.items()},
        outvoted=[pair for pair in matches if pair not in used],
    )
    return replace(placement, doubts=tuple(weakly_held(names, placement.correlations)))


def _by_perspective(matcher: PairMatcher, options: PlaceOptions) -> Placement:
    """Place most pictures on a plane, or as those of a camera that turns."""
    return _adjusted(matcher, options, *_joined(matcher, options, "homography"))


def _adjusted(
    matcher: PairMatcher,
    options: PlaceOptions,
    numbers: Sequence[int],
    matches: Mapping[Pair, Match],
    labels: Indices,
) -> Placement:
    """Place pictures by a plane or a camera adjusted to their matches; parameters as from :func:`_joined`."""
    from toposeam.layers.registration import perspective  # shifts and similarities do without

    features = [matcher.features[number] for number in numbers]
    lens = perspective.Lens(
        focal=options.focal,
        fixed=options.focal is not None and not options.about,
        distortion=options.lens,
    )
    fit = perspective.fit_models(features, matches, options.families, lens, matcher.executor)
    bundle, reaches, closes = fit.bundle, False, False
    if bundle.family == "rotation":
        reaches, closes, ends = perspective.loop_of(fit.bundle, fit.matches)
        if reaches and not closes:
            tried = matcher.homographies([(numbers[i], numbers[j]) for i, j in ends])
            more = {
                pair: match
                for pair, own in zip(ends, tried, strict=True)
                if (match := own or perspective.match_ends(features, bundle, pair, options.least_correlation))
            }
            if more:
                matches = dict(sorted({**matches, **more}.items()))
                fit = perspective.fit_models(features, matches, [bundle.family], lens, matcher.executor)
                reaches, closes, _ = perspective.loop_of(fit.bundle, fit.matches)
    fit, doubts = _doubts_of(matcher, numbers, options, fit)
    if reaches and not closes:
        doubts.append(open_turn())
    bundle = fit.bundle
    camera = fit.camera if bundle.family == "plane" else bundle
    down = _down(matcher, numbers, options, camera)
    if bundle.family == "plane":
        view = perspective.View(level=options.level, down=down)
    else:
        asked = None if options.projection == "auto" else options.projection
        centre = numbers.index(options.centre) if options.centre in numbers else None
        view = perspective.View(
            projection=asked,  # type: ignore[arg-type]
            level=options.level,
            centre=centre,
            fov=options.fov,
            closed=closes,
            down=down,
        )
    transforms, width = _shown(bundle, camera, view)
    first = transforms[0]
    projection = first.projection if isinstance(first, CameraTransform) else None
    distances = {pair: bundle.distances(pair, match) for pair, match in fit.matches.items()}
    shown = range(len(numbers)) if options.fov is None else _in_view(transforms, bundle, options.fov)
    placement = _placement(
        matcher,
        labels,
        [numbers[k] for k in shown],
        model=bundle.family,
        transforms=[transforms[k] for k in shown],
        matches=among(shown, fit.matches),
        distances=among(shown, distances),
        outvoted=list(among(shown, dict.fromkeys(fit.outvoted))),
        beyond=[number for k, number in enumerate(numbers) if k not in shown],
    )
    return replace(
        placement,
        focal=bundle.focal if bundle.family == "rotation" else None,
        distortion=bundle.distortion,
        projection=projection,
        wrap=width,
        doubts=tuple(doubts),
    )


def _shown(
    bundle: Bundle, camera: Bundle | None, view: perspective.View
) -> tuple[Sequence[Transform], int | None]:
    """Lay all pictures on a canvas, upright unless that costs too much of it; return also its width, px, if
    it goes all the way round.
    """
    from toposeam.layers.registration import perspective

    transforms: Sequence[Transform]
    width = None
    if bundle.family == "plane":
        transforms = perspective.plane_transforms(bundle, camera, view)
    else:
        transforms, width = perspective.camera_transforms(bundle, view)
    if view.down is None or camera is None or width is not None:
        return transforms, width
    from toposeam.layers.mesh.verticals import costs_too_much

    leaning, width = _shown(bundle, camera, replace(view, down=None))
    cosine = min(1.0, float(perspective.level_down(camera) @ view.down))
    degrees = float(np.degrees(np.arccos(cosine)))
    if width is None and costs_too_much(bundle.sizes, transforms, leaning, degrees):
        return leaning, None
    return transforms, None


def _down(
    matcher: PairMatcher, numbers: Sequence[int], options: PlaceOptions, camera: Bundle | None
) -> Floats | None:
    """Return the direction on which upright lines agree, in the frame of a camera, unless another is asked
    for.
    """
    if camera is None or not options.level or options.horizon is not None:
        return None
    from toposeam.layers.mesh.verticals import down_of
    from toposeam.layers.registration.perspective import level_down, rays_at

    lines = list(map(matcher.lines, numbers))
    forward = camera.rotations[camera.middle][:, 2]
    return down_of(lines, lambda index, points: rays_at(camera, index, points), forward, level_down(camera))


def _doubts_of(
    matcher: PairMatcher, numbers: Sequence[int], options: PlaceOptions, fit: ModelFit
) -> tuple[ModelFit, list[str]]:
    """List the doubts about a model; refuse pairs that match elsewhere if the others do not outvote them.

    Where a camera was asked for and only a plane explains the pictures, no pair matches elsewhere.
    """
    bundle, doubts = fit.bundle, list[str]()
    medians = {} if fit.clear and len(fit.matches) < 2 else bundle.medians(fit.matches)
    if not fit.clear:
        distances = {pair: medians[pair] for pair in fit.outvoted}
        elsewhere = placed_elsewhere(bundle.sizes, distances)
        off = max(distances.values())
        from toposeam.layers.registration import perspective

        if options.families == ("rotation",) and perspective.is_one_plane(bundle.sizes, fit.matches):
            return replace(fit, outvoted=()), [asked_camera(off)]
        if elsewhere:
            from toposeam.layers.registration.refusals import ambiguous  # most pictures need no refusal

            raise ambiguous([matcher.names[number] for number in numbers], elsewhere, off)
    correlations = {pair: match.correlation for pair, match in fit.matches.items()}
    if len(medians) > 1:
        doubts = moved_camera(medians, correlations, float(np.hypot(*bundle.sizes.T).min()))
    return fit, doubts if fit.seeming_mm is None else [seems_flat(fit.seeming_mm), *doubts]


def _in_view(transforms: Sequence[Transform], bundle: Bundle, fov: float) -> list[int]:
    """List the pictures that a canvas `fov` degrees across shows; refuse a view of fewer than two."""
    shown = [k for k, transform in enumerate(transforms) if reach(transform, bundle.size(k)) is not None]
    if len(shown) < 2:
        raise OverlapError(
            "{fov:g} degrees across show {count} of {total} pictures; choose a larger field of view",
            kind="view",
            fov=fov,
            count=len(shown),
            total=len(transforms),
        )
    return shown


def _placement(
    matcher: PairMatcher,
    labels: Indices,
    numbers: Sequence[int],
    *,
    model: Model,
    transforms: Sequence[Transform],
    matches: Mapping[Pair, Match],
    distances: Mapping[Pair, Floats],
    outvoted: Sequence[Pair],
    beyond: Sequence[int] = (),
) -> Placement:
    """Return the placement of some pictures, without layers.

    Parameters
    ----------
    matcher : PairMatcher
    labels : (N,) int array
        The group of each of all pictures.
    numbers : sequence of int
        Of the placed pictures; pairs are counted among these.
    model : {"shift", "similarity", "plane", "rotation"}
    transforms : sequence of Transform
        From each placed picture to the canvas.
    matches : mapping from (int, int) to Match
        Pairs that were used.
    distances : mapping from (int, int) to (M,) arrays
        Of the points of each pair, px.
    outvoted : sequence of (int, int)
        Pairs that were not used.
    beyond : sequence of int
        Pictures of which the canvas shows nothing.
    """
    sides = [matcher.pictures[number].image.shape[:2] for number in numbers]
    members = [np.flatnonzero(labels == label) for label in dict.fromkeys(labels.tolist())]
    return Placement(
        layers=(),
        model=model,
        sizes=tuple((int(width), int(height)) for height, width in sides),
        transforms=tuple(transforms),
        numbers=tuple(numbers),
        left_out={
            number: _reason(matcher, labels, numbers, beyond, number)
            for number in range(len(matcher.pictures))
            if number not in numbers
        },
        other_groups=tuple(
            tuple(int(number) for number in group)
            for group in members
            if len(group) > 1 and group[0] not in numbers
        ),
        correlations={pair: match.correlation for pair, match in matches.items()},
        residuals={
            pair: _residual(transforms[pair[0]], match, distances[pair]) for pair, match in matches.items()
        },
        misfit=max(float(np.median(own)) for own in distances.values()),
        outvoted=tuple(outvoted),
    )


def _residual(transform: Transform, match: Match, distances: Floats) -> Residual:
    """Summarise the distances of a pair's points that the canvas shows."""
    points = transform.to_canvas(match.first)
    features = match.features or len(distances)
    if isinstance(transform, CameraTransform):
        shown = np.abs(points[:, 0]) <= transform.edge
        points, distances = points[shown], distances[shown]
    return Residual.of(distances, points, features)


def _reason(
    matcher: PairMatcher, labels: Indices, numbers: Sequence[int], beyond: Sequence[int], number: int
) -> str:
    """Say why a picture was left out; parameters as of :func:`_placement`."""
    from toposeam.layers.registration.refusals import (
        OVERLAID,
        is_overlaid,
        is_plain,
        named,
    )  # most pictures are placed

    name = matcher.names[number]
    if number in beyond:
        return f"{name} lies beyond the field of view"
    others = [other for other in np.flatnonzero(labels == labels[number]) if other != number]
    if others:
        return f"{name} shows something else, together with {named(matcher.pictures, np.array(others))}"
    shared = {other: len(matcher.shared((min(number, other), max(number, other)))) for other in numbers}
    nearest = max(shared, key=lambda other: shared[other])
    if is_plain(matcher.features[number]):
        return f"{name} shows too little detail to be placed"
    if not shared[nearest]:
        return f"{name} shares nothing with the other pictures"
    pair = min(number, nearest), max(number, nearest)
    if is_overlaid(matcher.features[pair[0]], matcher.features[pair[1]], matcher.shared(pair)):
        return f"{name} and {matcher.names[nearest]} share only {OVERLAID}"
    return (
        f"{name} shares {shared[nearest]} features with {matcher.names[nearest]}, but no overlap brings them "
        "together"
    )
