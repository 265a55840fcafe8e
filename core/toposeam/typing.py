"""Types of arguments, for annotations: ``def join(method: ts.typing.Method)``.

The words that options take are said here, and loading them loads no numerics.
"""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

#: Methods of :func:`toposeam.find_seam`.
Method = Literal["auto", "heat", "thesis", "shortest-path", "dp", "graph-cut"]
METHODS: tuple[Method, ...] = get_args(Method)  #: Methods of :func:`toposeam.find_seam`.
#: Laws of a match cost.
Law = Literal["natural", "gradient", "colour"]
LAWS: tuple[Law, ...] = get_args(Law)  #: Laws of a match cost.
#: The side of one picture on which the other continues.
Side = Literal["right", "left", "bottom", "top"]
SIDES: tuple[Side, ...] = get_args(Side)  #: Sides of a picture on which another continues.
#: Blends across seams.
Blend = Literal["auto", "none", "feather", "soft", "multiband", "gradient"]
BLENDS: tuple[Blend, ...] = get_args(Blend)  #: Blends across seams.
#: Of the search for many layers. "fast" searches once, with costs reduced in one way; "best" searches with
#: costs reduced in two ways, combines the results, and searches again at full size round the places where
#: three layers meet.
Effort = Literal["fast", "best"]
EFFORTS: tuple[Effort, ...] = get_args(Effort)
#: What brings pictures together, the poorest first.
Model: TypeAlias = Literal["shift", "similarity", "plane", "rotation"]
MODELS: tuple[Model, ...] = get_args(Model)
#: How a canvas shows what a camera saw.
Projection: TypeAlias = Literal["flat", "cylinder", "sphere", "panini"]
PROJECTIONS: tuple[Projection, ...] = get_args(Projection)
#: How samples of a texture are turned: as they are; mirrored left to right as well; turned by quarters; both.
Turns = Literal["none", "mirror", "quarters", "all"]
TURNS: tuple[Turns, ...] = get_args(Turns)  #: How samples of a texture are turned.
#: How a texture is grown: the setting that is judged to be best, or a named one.
Setting = Literal["auto", "coarse", "coarse-mixed", "fine", "fine-mixed", "varied"]
SETTING_NAMES: tuple[Setting, ...] = get_args(Setting)
#: What fills a hole.
By = Literal["auto", "patches", "shifts"]
BYS: tuple[By, ...] = get_args(By)  #: What fills a hole.
#: Methods of :func:`toposeam.find_surface`.
SurfaceMethod = Literal["heat", "graph-cut"]
SURFACE_METHODS: tuple[SurfaceMethod, ...] = get_args(
    SurfaceMethod
)  #: Methods of :func:`toposeam.find_surface`.
#: The farthest by which layers may be bent, px.
MOST_BENT = 32

__all__ = [
    "Blend",
    "By",
    "Effort",
    "Law",
    "Method",
    "Model",
    "Projection",
    "Setting",
    "Side",
    "SurfaceMethod",
    "Turns",
]
