"""Recipes of motifs as plain values: the same recipe makes the same bytes."""

from __future__ import annotations

import base64
import binascii
import dataclasses
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from toposeam.checks import check_choice, check_kind, check_number, check_pair, check_range, check_whole
from toposeam.colours import LUMA
from toposeam.errors import OptionError, Term
from toposeam.images import as_float, in_dtype
from toposeam.motif.ink.mixing import INKINGS
from toposeam.motif.ink.stroke_edges import EDGES
from toposeam.motif.recipe.styles import STYLES
from toposeam.motif.symmetry.rules import check_repeat, fits_twice

#: x and y in [0, 1] of the cell, and a strength.
Point = tuple[float, float, float]
Colour = tuple[float, float, float]
#: Least and largest side of a cell, in elements.
MIN_SIDE, MAX_SIDE = 8, 8192
#: Laws by which a base image's brightness becomes conductivity: a geometric fall from its brightest part, or
#: proportionality, as in the thesis.
LAWS = ("contrast", "brightness")
#: Where a layer lies: on the whole cell, or only inside or outside of the recipe's outline.
PLACES = ("everywhere", "inside", "outside")
#: Longer side of a stored base image, and of any stored picture, px at most, to keep recipes small.
_MAX_BASE_SIDE, MAX_PACKED_SIDE = 256, 512
#: Least side of a copy of a layer, in elements, and the number by which sides of copies divide: so rules fit.
_MIN_COPY, _COPY_GRAIN = 16, 8
#: What may be one piece: nothing need be, what is inked, or what is left of the sheet (a stencil).
ONE_PIECE = ("", "ink", "paper")
Kind = TypeVar("Kind")
#: Entries of a layer that older recipes lack, and what they are without.
_LATER = {
    "style": "vein",
    "avoid": 0.0,
    "iterations": None,
    "filter_radius": None,
    "place": "everywhere",
    "scale": 1,
}
#: The same of a recipe.
_LATER_OF_RECIPE = {
    "inking": INKINGS[0],
    "outline": "",
    "guide": "",
    "knock_out": False,
    "trap": 0.0,
    "one_piece": "",
    "bridge": 2.0,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class LayerRecipe:
    """Parameters of one layer: its ink, and the sources, sinks, mass and penalty of its optimisation.

    Examples
    --------
    >>> import toposeam as ts
    >>> recipe = ts.motif.random_recipe(16, layers=2, seed=1)
    >>> 0 < recipe.layers[0].mass < 1
    True
    """

    #: sRGB in [0, 1].
    ink: Colour
    #: Points that generate heat; strengths are relative.
    sources: tuple[Point, ...]
    #: Points where heat leaves by convection; strengths are relative.
    sinks: tuple[Point, ...]
    #: Share of the heat that is generated everywhere, in proportion to the nominal conductivity, 0 to 1. It
    #: makes strokes branch.
    ambient: float = 0.0
    #: Allowed mass (4.4): the mean density.
    mass: float = 0.3
    #: Penalty exponent p: 1 for ink wash, 3 for distinct strokes.
    penalty: float = 3.0
    #: Stroke edges in print, one of `EDGES`.
    edge: str = "soft"
    #: Name of the ink, such as a spot colour's; empty for none.
    name: str = ""
    #: The style from which the other values were drawn, one of `STYLES`. A layer of style "thesis" is
    #: optimised and printed as the thesis says, (4.1) to (4.5), without what makes ours robust.
    style: str = "vein"
    #: How far the layer keeps out of what the layers before it have inked, 0 to 1: at 1 all densities at a
    #: place add up to 1 at most.
    avoid: float = 0.0
    #: Iterations and filter radius of this layer; None for the recipe's.
    iterations: int | None = None
    filter_radius: float | None = None
    #: Where it lies, one of `PLACES`: everywhere, or inside or outside of the recipe's outline.
    place: str = "everywhere"
    #: Number of copies along each side of the cell: with 3, the layer repeats nine times in the cell, by the
    #: same rule. Its sources and sinks are given in one of the copies.
    scale: int = 1

    def __post_init__(self) -> None:
        object.__setattr__(self, "ink", _numbers(self.ink, 3, "ink"))
        for name in ("sources", "sinks"):
            object.__setattr__(self, name, tuple(_numbers(point, 3, name) for point in getattr(self, name)))
        if not all(0 <= c <= 1 for c in self.ink):
            raise OptionError(
                "{parameter} is {value!s}; colours are three numbers from 0 to 1",
                kind="number",
                parameter=Term("ink"),
                value=self.ink,
            )
        check_range(0, 1, ambient=self.ambient)
        if not 0 < check_number("mass", self.mass) < 1:
            raise OptionError(
                "{parameter} is {value}; it must lie between 0 and 1, both excluded (0.2 to 0.5 is usual)",
                kind="number",
                parameter=Term("mass"),
                value=self.mass,
            )
        check_range(1, 10, penalty=self.penalty)  # 1 is ink wash
        check_choice("edge", self.edge, EDGES)
        check_choice("style", self.style, tuple(STYLES))
        check_range(0, 1, avoid=self.avoid)
        if self.iterations is not None:
            check_whole("iterations", self.iterations, 1, 10_000)
        if self.filter_radius is not None:
            check_range(0, 10, filter_radius=self.filter_radius)
        check_choice("place", self.place, PLACES)
        check_whole("scale", self.scale, 1, 32)
        if not isinstance(self.name, str) or len(self.name) > 100 or not self.name.isprintable():
            raise OptionError(
                "the ink's name is {given}; use {allowed}",
                kind="type",
                parameter=Term("name"),
                value=self.name,
                given=repr(self.name),
                allowed="up to 100 printable characters",
            )
        if not any(s > 0 for *_, s in self.sources) and self.ambient == 0:
            raise OptionError(
                "a layer has no heat source; give at least one source a strength above 0, or set {ambient} "
                "above 0",
                kind="no source",
                parameter=Term("sources"),
                value=self.sources,
            )
        if not any(s > 0 for *_, s in self.sinks):
            raise OptionError(
                "a layer has no heat sink; give at least one sink a strength above 0",
                kind="no sink",
                parameter=Term("sinks"),
                value=self.sinks,
            )
        for name in ("sources", "sinks"):
            for x, y, strength in getattr(self, name):
                if not (0 <= x <= 1 and 0 <= y <= 1 and strength >= 0):
                    raise OptionError(
                        "{parameter} has ({x:g}, {y:g}, {strength:g}); x and y must lie in 0 to 1 and "
                        "strengths not be negative",
                        kind="number",
                        parameter=Term(name),
                        value=(x, y, strength),
                        x=x,
                        y=y,
                        strength=strength,
                    )
        places = {(x, y) for x, y, s in (*self.sources, *self.sinks) if s > 0}
        if self.ambient == 0 and len(places) < 2:
            raise OptionError(
                "a layer's sources and sinks all lie on one point, so no heat flows; move them apart",
                kind="same place",
                parameter=Term("sources"),
                value=self.sources,
            )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Recipe:
    """A motif's parameters.

    Examples
    --------
    >>> import toposeam as ts
    >>> recipe = ts.motif.random_recipe(16, layers=2, seed=1)
    >>> ts.motif.Recipe.from_dict(recipe.to_dict()) == recipe
    True
    """

    #: Rows and columns of the cell; for a hexagonal group, elements along its two sides.
    size: tuple[int, int]
    #: The rule by which the motif repeats, one of `REPEATS`.
    repeat: str = "none"
    #: The seed of the random parameters; kept for the record.
    seed: int = 0
    #: sRGB in [0, 1].
    paper: Colour = (1.0, 1.0, 1.0)
    layers: tuple[LayerRecipe, ...] = ()
    #: Iterations; strokes become more distinct with each.
    iterations: int = 40
    #: Largest change of a density in one iteration.
    move: float = 0.2
    #: Radius of the filter against checkerboards, in hundredths of the cell's shorter side; 0 for none.
    filter_radius: float = 0.5
    #: Run most iterations on coarser plates, and only the last ones at full size.
    coarse: bool = True
    #: Brightness of a base image, packed by `pack_base`; empty for none.
    base: str = ""
    #: Influence of the base image, -1 to 1: strokes keep to its bright parts, or below 0 to its dark ones.
    base_strength: float = 0.0
    #: Law by which its brightness becomes conductivity, one of `LAWS`.
    base_law: str = "contrast"
    #: Kind of the inks, one of `INKINGS`: opaque ones cover what lies below, also on dark paper.
    inking: str = "transparent"
    #: A shape, packed by `pack_outline`: layers lie where their `place` says. Empty for none.
    outline: str = ""
    #: Lines along which heat flows more easily, packed by `pack_guide`, so that strokes follow them.
    guide: str = ""
    #: Knock the inks out: where a later layer has strokes, those before it are left out.
    knock_out: bool = False
    #: How far inks reach under those that knock them out, in hundredths of the cell's shorter side, -5 to 5,
    #: so that no paper shows where plates are not in register; below 0 they end before, and paper shows.
    trap: float = 0.0
    #: What is made one piece, one of `ONE_PIECE`: "ink" for a cut-out, "paper" for a stencil. See
    #: :mod:`toposeam.motif.ink.bridging`.
    one_piece: str = ""
    #: Least width of that piece, in hundredths of the cell's shorter side, 0.5 to 20.
    bridge: float = 2.0

    def __repr__(self) -> str:
        rows, columns = self.size
        return (
            f"Recipe({len(self.layers)} inks on {rows} × {columns} elements, repeat={self.repeat!r}, "
            f"seed={self.seed})"
        )

    def __post_init__(self) -> None:
        size = check_pair("size", self.size, MIN_SIDE, MAX_SIDE)
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "layers", tuple(self.layers))
        object.__setattr__(self, "paper", _numbers(self.paper, 3, "paper"))
        check_repeat(self.repeat, size)
        check_whole("seed", self.seed, 0)
        if not all(0 <= c <= 1 for c in self.paper):
            raise OptionError(
                "{parameter} is {value!s}; colours are three numbers from 0 to 1",
                kind="number",
                parameter=Term("paper"),
                value=self.paper,
            )
        if not self.layers:
            raise OptionError(
                "the recipe has no layers; give at least one", kind="count", parameter=Term("layers"), count=0
            )
        check_whole("iterations", self.iterations, 1, 10_000)
        check_range(0, 1, above=True, move=self.move)
        check_range(0, 10, filter_radius=self.filter_radius)  # hundredths of the cell
        check_range(-1, 1, base_strength=self.base_strength)
        check_choice("base_law", self.base_law, LAWS)
        check_choice("inking", self.inking, INKINGS)
        check_range(-5, 5, trap=self.trap)
        check_choice("one_piece", self.one_piece, ONE_PIECE)
        check_range(0.5, 20, bridge=self.bridge)  # hundredths of the cell
        check_kind("knock_out", self.knock_out, bool, "True or False")
        for name in ("outline", "guide"):
            text = getattr(self, name)
            check_kind(name, text, str, "the text of a packed picture, or empty")
            if text:
                unpack_base(text)
        self._check_composition()
        if not isinstance(self.coarse, bool) or not isinstance(self.base, str):
            name = "base" if isinstance(self.coarse, bool) else "coarse"
            raise OptionError(
                "coarse must be True or False, and base the text of pack_base, or empty",
                kind="type",
                parameter=Term(name),
                value=getattr(self, name),
            )
        if self.base:
            unpack_base(self.base)

    def _check_composition(self) -> None:
        """Refuse places without an outline, and scales that do not fit the size or the rule."""
        for layer in self.layers:
            if layer.place != "everywhere" and not self.outline:
                raise OptionError(
                    "a layer lies {place} of an outline, and there is none; give {outline}, or let it lie "
                    "everywhere",
                    kind="no outline",
                    parameter=Term("place"),
                    place=layer.place,
                    outline=Term("outline"),
                )
            many = layer.scale
            if many > 1:
                if min(self.size) < many * _MIN_COPY:
                    raise OptionError(
                        "{parameter} is {value}, too many copies for a cell of {columns} × {rows} elements; "
                        "each needs {least} at least",
                        kind="size",
                        parameter=Term("scale"),
                        value=many,
                        rows=self.size[0],
                        columns=self.size[1],
                        least=_MIN_COPY,
                    )
                if many % 2 == 0 and not fits_twice(self.repeat):
                    raise OptionError(
                        "{parameter} is {value}; by {repeat} only odd numbers of copies repeat, use {next}",
                        kind="scale for rule",
                        parameter=Term("scale"),
                        value=many,
                        repeat=self.repeat,
                        next=many + 1,
                    )

    def of_layer(self, index: int) -> Recipe:
        """Return the recipe of one layer alone, with its own iterations and filter, on one of its copies."""
        layer = self.layers[index]
        own: dict[str, Any] = {"iterations": layer.iterations, "filter_radius": layer.filter_radius}
        changed: dict[str, Any] = {name: value for name, value in own.items() if value is not None}
        if layer.scale > 1:  # copies of a cell that does not join itself would not join each other
            many, rule = layer.scale, "translate" if self.repeat == "none" else self.repeat
            layer = dataclasses.replace(layer, scale=1, place="everywhere", avoid=0.0)
            size = tuple(max(_MIN_COPY, _COPY_GRAIN * round(side / many / _COPY_GRAIN)) for side in self.size)
            changed |= {"size": size, "repeat": rule, "guide": ""}
        if layer.style == "thesis":
            changed["coarse"] = False
        return dataclasses.replace(self, layers=(layer,), **changed)

    def to_dict(self) -> dict[str, Any]:
        """Return the recipe as plain lists, numbers and strings, for JSON or TOML.

        Entries that older recipes lack are left out where they have no effect.
        """
        record = dataclasses.asdict(self)
        record["layers"] = [
            {name: _plain(value) for name, value in layer.items() if _LATER.get(name, ...) != value}
            for layer in record["layers"]
        ]
        kept = (name for name, value in record.items() if _LATER_OF_RECIPE.get(name, ...) != value)
        return {name: _plain(record[name]) for name in kept}

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> Recipe:
        """Make a recipe from the values of `to_dict`.

        Raises
        ------
        OptionError
            For unknown names, missing or unusable values.
        """
        values = dict(record)
        layers = values.pop("layers", ())
        try:
            return _build(cls, {**values, "layers": tuple(_build(LayerRecipe, layer) for layer in layers)})
        except (TypeError, ValueError, AttributeError) as error:
            if isinstance(error, OptionError):
                raise
            raise OptionError(
                "the recipe cannot be read ({reason}); compare it with one that toposeam wrote",
                kind="unreadable",
                reason=str(error),
            ) from error


def _build(kind: type[Kind], values: Mapping[str, Any]) -> Kind:
    known = {field.name for field in dataclasses.fields(kind)}  # type: ignore[arg-type]
    unknown = [name for name in values if name not in known]
    if unknown:
        raise OptionError(
            "the recipe has an unknown entry {given}; known are {allowed}",
            kind="unknown",
            parameter=Term(unknown[0]),
            given=repr(unknown[0]),
            allowed=tuple(sorted(known)),
        )
    return kind(**values)


def _plain(value: Any) -> Any:
    return (
        [_plain(item) for item in value]
        if isinstance(value, tuple | list) and not isinstance(value, str)
        else value
    )


def _numbers(values: Any, count: int, name: str) -> tuple[float, ...]:
    try:
        result = tuple(float(value) for value in values)
    except (TypeError, ValueError):
        result = ()
    if len(result) != count or not all(math.isfinite(value) for value in result):
        raise OptionError(
            "{parameter} has {given}; give {count} numbers",
            kind="number",
            parameter=Term(name),
            value=values,
            given=repr(values),
            count=count,
        )
    return result


def pack_base(image: npt.ArrayLike) -> str:
    """Pack the brightness of a picture as text, with at most 256 px along the longer side, 8 bits each.

    Raises
    ------
    ImageError
        For pictures that cannot be used.
    """
    array = as_float(image, "the base image")
    if array.shape[2] in (2, 4):  # transparent parts become white
        alpha = np.clip(array[..., -1:], 0.0, 1.0)
        array = array[..., :-1] * alpha + (1.0 - alpha)
    gray = array @ LUMA.astype(np.float32) if array.shape[2] == 3 else array.mean(axis=2)
    return pack(gray, _MAX_BASE_SIDE)


def pack(gray: npt.NDArray[np.floating], side: int) -> str:
    """Pack an (h, w) brightness in [0, 1], with at most `side` px along the longer side, 8 bits each."""
    step = max(1.0, max(gray.shape) / side)
    if step > 1:
        from toposeam.motif.ink.sampling import resample

        gray = resample(
            np.clip(gray, 0.0, 1.0),
            "none",
            (max(1, round(gray.shape[0] / step)), max(1, round(gray.shape[1] / step))),
        )
    levels = in_dtype(gray * 255, np.dtype(np.uint8))
    return f"{levels.shape[0]}x{levels.shape[1]}:" + base64.b85encode(
        zlib.compress(levels.tobytes(), 9)
    ).decode("ascii")


def unpack_base(text: str) -> npt.NDArray[np.float32]:
    """Return the (h, w) brightness in [0, 1] that `pack_base` has packed.

    Raises
    ------
    OptionError
    """
    try:
        shape, _, data = text.partition(":")
        rows, columns = (int(side) for side in shape.split("x"))
        if not (0 < rows <= MAX_PACKED_SIDE and 0 < columns <= MAX_PACKED_SIDE):
            raise ValueError("size")
        raw = zlib.decompressobj().decompress(base64.b85decode(data), rows * columns + 1)
        return np.frombuffer(raw, np.uint8).reshape(rows, columns).astype(np.float32) / np.float32(255)
    except (ValueError, zlib.error, binascii.Error) as error:
        raise OptionError(
            "a picture in the recipe is damaged; give it again",
            kind="unreadable",
            parameter=Term("base"),
            value=text,
        ) from error
