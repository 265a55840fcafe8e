"""Where pictures belong, how well their pairs fit there, and what is doubtful about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from toposeam.arrays import Floats
from toposeam.layers.canvas.canvas import extent_of, groups
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.transforms import (
    CameraTransform,
    MeshTransform,
    Projection,
    Transform,
    unbent,
)
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.pair_matching import LEAST_CORRELATION
from toposeam.sentence import counted
from toposeam.typing import MODELS as MODELS
from toposeam.typing import Model as Model

#: Models with perspective.
Family: TypeAlias = Literal["plane", "rotation"]
#: px that are left between two pictures above which they are told of: a step of 2 px in an edge is visible.
VISIBLE_PX = 2.0
#: Area of a canvas ÷ that of its pictures beyond which it is told.
_LARGEST_CANVAS = 4.0
#: Correlation below which a pair that alone holds pictures is doubtful.
_SURE_CORRELATION = 0.7
#: Median of a pair, as a share of a picture's diagonal: where half of the pairs have more, and correlate less
#: than what shows the same, no model explains them. Of sets from one place or of one plane half have at most
#: 0.0006 and at least 0.8, of twelve views round a tree 0.0016 and 0.36.
_MOVED = 0.001
#: Pictures or pairs that are named at most.
NAMED = 8
#: Largest residuals of a model ÷ those of one with more unknowns, for the poorer model to be taken.
POORER_RATIO = 1.3


@dataclass(frozen=True, slots=True)
class Residual:
    """Distances that are left between the points that two pictures share."""

    #: px, in the median and at the farthest twentieth.
    median: float
    farthest: float
    #: Number of points, and of features that agreed.
    points: int
    features: int
    #: Of each point that is farther apart than :data:`VISIBLE_PX`: x and y on the canvas, and how far, px.
    apart: tuple[tuple[float, float, float], ...] = ()

    @classmethod
    def of(cls, distances: Floats, points: Floats, features: int) -> Residual:
        """Summarise (M,) distances, px, at (M, 2) points of the canvas."""
        if not len(distances):
            return cls(0.0, 0.0, 0, features)
        farthest = float(np.percentile(distances, 95))
        known = distances[np.argmin(np.abs(distances - farthest))]  # beyond it may be false matches
        order = np.argsort(-distances, kind="stable")
        order = order[(distances[order] > VISIBLE_PX) & (distances[order] <= known)]
        apart = map(tuple, np.column_stack([points[order], distances[order]]).tolist())
        return cls(float(np.median(distances)), farthest, len(distances), features, tuple(apart))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Placement:
    """The places of pictures: transforms to a canvas, and how well pairs fit there.

    Examples
    --------
    >>> from skimage import data
    >>> from toposeam.layers.registration.find_places import find_places
    >>> whole = data.camera()[100:260, :300]
    >>> found = find_places([Layer(whole[:, :180], name="left"), Layer(whole[:, 120:], name="right")])
    >>> found.places.shape, found.misfit < 1
    ((2, 2), True)
    """

    #: The placed pictures, warped where they are more than moved.
    layers: tuple[Layer, ...]
    #: Kind of the transforms.
    model: Model
    #: Width and height of each placed picture, px, before it was warped.
    sizes: tuple[tuple[int, int], ...]
    #: From the pixels of each placed picture to the canvas.
    transforms: tuple[Transform, ...]
    #: Numbers of the placed pictures among the given ones, and the reason why each other one was left out.
    numbers: tuple[int, ...]
    left_out: Mapping[int, str] = field(default_factory=dict)
    #: Groups of pictures that belong together, but not to the ones that were placed.
    other_groups: tuple[tuple[int, ...], ...] = ()
    #: Correlation of the overlap of each pair that was used, and its residual; pairs are of `layers`.
    correlations: dict[Pair, float]
    residuals: dict[Pair, Residual]
    #: Largest median of a pair, px.
    misfit: float
    #: Pairs that match in another place than the others put them, and that were not used.
    outvoted: tuple[Pair, ...] = ()
    #: What is doubtful about the places, or was decided for the user, in sentences.
    doubts: tuple[str, ...] = ()
    #: Of a camera: focal length of the picture in the middle, px, b of its radial distortion, the projection
    #: of the canvas, and the canvas's width, px, if it goes all the way round.
    focal: float | None = None
    distortion: float = 0.0
    projection: Projection | None = None
    wrap: int | None = None

    @property
    def focals(self) -> tuple[float, ...]:
        """The focal length of each picture of a camera that turned, px."""
        own = map(unbent, self.transforms)
        return tuple(one.focal for one in own if isinstance(one, CameraTransform))

    @property
    def bent(self) -> float:
        """The largest displacement, px of the canvas, by which meshes bend pictures; 0 where none does."""
        meshes = [one.coefficients for one in self.transforms if isinstance(one, MeshTransform)]
        return max((float(np.hypot(*np.moveaxis(one, -1, 0)).max()) for one in meshes), default=0.0)

    def levelled(self, picture: int, line: Floats) -> Placement:
        """Return the placement turned so that a (2, 2) line of a placed picture lies level or upright
        (:func:`toposeam.layers.canvas.levelling.levelled`); its layers are not warped anew.
        """
        from toposeam.layers.canvas.levelling import levelled  # only where it is asked for

        transforms = levelled(self.transforms, picture, line)
        residuals = {}
        for pair, residual in self.residuals.items():
            apart = np.array(residual.apart).reshape(-1, 3)
            at = self.transforms[pair[0]].to_picture(apart[:, :2])
            apart[:, :2] = transforms[pair[0]].to_canvas(at)
            residuals[pair] = replace(residual, apart=tuple(map(tuple, apart.tolist())))
        return replace(self, transforms=transforms, residuals=residuals)

    @cached_property
    def places(self) -> Floats:
        """(N, 2) px, x and y of each picture's upper left corner on the canvas."""
        return np.array(
            [
                corner if np.isfinite(corner).all() else layer.at
                for corner, layer in zip((local[0] for local in self._locals(0.0)), self.layers, strict=True)
            ]
        )

    @cached_property
    def turns(self) -> Floats:
        """(N,) degrees clockwise, in the middle of each picture."""
        return np.array([np.degrees(np.arctan2(local[1][1], local[1][0])) for local in self._locals(0.5)])

    @cached_property
    def scales(self) -> Floats:
        """(N,) factors, in the middle of each picture."""
        return np.array([np.hypot(*local[1]) for local in self._locals(0.5)])

    def _locals(self, share: float) -> list[tuple[Floats, Floats]]:
        """Map a point of each picture to the canvas, and the step of one px to its right."""
        found = []
        for size, transform in zip(self.sizes, self.transforms, strict=True):
            at = share * (np.array(size) - 1.0)
            here, there = transform.to_canvas(np.stack([at, at + np.array([1, 0])]))
            found.append((here, there - here))
        return found

    def __repr__(self) -> str:
        return (
            f"Placement({len(self.layers)} pictures by {self.model}, "
            f"{counted(len(self.correlations), 'pair')}, misfit {self.misfit:.2f} px)"
        )


def named_few(names: Sequence[str]) -> str:
    """List names, a few of them."""
    names = list(names)
    if len(names) > NAMED + 1:
        names[NAMED:] = [f"{len(names) - NAMED} more"]
    return names[0] if len(names) == 1 else f"{names[0]} and {', '.join(names[1:])}"


def turned_back(names: Sequence[str], quarters: Sequence[int]) -> list[str]:
    """Tell which pictures were turned back, by how many quarter turns counterclockwise."""
    told = []
    for turn in (1, 2, 3):
        those = [name for name, own in zip(names, quarters, strict=True) if own == turn]
        if those:
            way = "by 180°" if turn == 2 else f"by 90° {'counter' if turn == 1 else ''}clockwise"
            guess = "" if 2 * len(those) < len(names) else "; that this is upright is a guess"
            lay = "was" if len(those) == 1 else "were"
            told.append(f"{named_few(those)} {lay} turned {way}, as the pixels lay otherwise{guess}")
    return told


def large_canvas(layers: Sequence[Layer], pixels: int) -> list[str]:
    """Tell of a canvas that is several times as large as its pictures, which have so many pixels."""
    height, width = extent_of(layers).shape
    times = height * width / pixels
    if times <= _LARGEST_CANVAS:
        return []
    return [
        f"the canvas of {width} × {height} px has {times:.1f} times as many pixels as the pictures: check "
        "that they are placed and stretched as they should be"
    ]


def weakly_held(names: Sequence[str], correlations: Mapping[Pair, float]) -> list[str]:
    """Tell of pairs that alone hold pictures together and show little in common."""
    return [
        f"{names[i]} and {names[j]} show little in common (correlation {correlation:.2f}), and nothing else "
        "says where they lie: things that repeat, such as windows, match in several places; check them"
        for (i, j), correlation in correlations.items()
        if correlation < _SURE_CORRELATION
        and groups(len(names), [pair for pair in correlations if pair != (i, j)]).any()
    ]


def seems_flat(length: float) -> str:
    """Tell of a plane that a camera of that focal length, mm, would have to have seen."""
    return (
        "taken for one plane, such as a map, a scan, a facade or something far away, since a turning camera "
        f"would have a lens of {length:.0f} mm"
    )


def asked_camera(off: float) -> str:
    """Tell of pictures of which only a plane brings all pairs together, up to so many px off."""
    return (
        "a camera that only turned does not explain these pictures, but one plane does: up to "
        f"{off:.0f} px are left, as if the camera also moved; it was used because you asked for it"
    )


def open_turn() -> str:
    """Tell of a turn whose ends do not agree."""
    return (
        "the pictures seem to reach all the way round, but the first and the last of them do not show the "
        "same there, so that the turn is not closed"
    )


def moved_camera(
    medians: Mapping[Pair, float], correlations: Mapping[Pair, float], diagonal: float
) -> list[str]:
    """Tell of pictures that neither a plane nor a turn explains, by the median of the distances, px, and the
    correlation of each of several pairs, and the pictures' diagonal, px.
    """
    if len(medians) < 2 or np.median(list(medians.values())) <= _MOVED * diagonal:
        return []
    if not np.median([own for own in correlations.values() if np.isfinite(own)] or [1.0]) < LEAST_CORRELATION:
        return []
    return [
        "neither a plane nor a camera that turned explains these pictures, of which up to "
        f"{max(medians.values()):.0f} px are left in the median of two: the camera went round what they "
        "show, or past it; take pictures from one place, or of what is flat"
    ]
