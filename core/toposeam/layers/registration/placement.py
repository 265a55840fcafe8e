"""Where pictures belong, and how well their pairs fit there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, TypeAlias, get_args

import numpy as np

from toposeam.arrays import Floats
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.canvas.transforms import (
    CameraTransform,
    MeshTransform,
    Projection,
    Transform,
    unbent,
)
from toposeam.layers.labelling.label_map import Pair
from toposeam.sentence import counted

Model: TypeAlias = Literal["shift", "similarity", "plane", "rotation"]
#: Models with perspective.
Family: TypeAlias = Literal["plane", "rotation"]
#: The poorest first.
MODELS: tuple[Model, ...] = get_args(Model)
#: Largest residuals of a model ÷ those of one with more unknowns, for the poorer model to be taken.
POORER_RATIO = 1.3


@dataclass(frozen=True, slots=True)
class Residual:
    """Distances that are left between the points that two pictures share."""

    #: px, in the median and at the farthest twentieth.
    median: float
    farthest: float
    #: x and y on the canvas, px, of a point at the farthest twentieth.
    near: tuple[float, float]
    #: Number of points, and of features that agreed.
    points: int
    features: int

    @classmethod
    def of(cls, distances: Floats, points: Floats, features: int) -> Residual:
        """Summarise (M,) distances, px, at (M, 2) points of the canvas."""
        if not len(distances):
            return cls(0.0, 0.0, (0.0, 0.0), 0, features)
        farthest = float(np.percentile(distances, 95))
        x, y = points[int(np.argmin(np.abs(distances - farthest)))]
        return cls(float(np.median(distances)), farthest, (float(x), float(y)), len(distances), features)


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
            at = self.transforms[pair[0]].to_picture(np.array([residual.near]))
            x, y = transforms[pair[0]].to_canvas(at)[0]
            residuals[pair] = replace(residual, near=(float(x), float(y)))
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
