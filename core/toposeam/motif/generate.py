"""Generation of a motif, from a size and a seed or from a recipe."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Mask
from toposeam.checks import (
    Seed,
    check_choice,
    check_function,
    check_items,
    check_kind,
    check_number,
    check_numbers,
    check_pair,
    check_range,
    check_whole,
    seed_of,
)
from toposeam.colours import parse_colour
from toposeam.errors import OptionError, Term
from toposeam.heat.threads import one_thread
from toposeam.motif.border_smoothing import smooth_borders
from toposeam.motif.finishing import finish, spread_copies
from toposeam.motif.ink.palettes import PALETTES, Palette, palette
from toposeam.motif.ink.stroke_repair import repair_strokes
from toposeam.motif.motif import Motif
from toposeam.motif.optimise.conduction import nominal_conductivity
from toposeam.motif.optimise.hexagonal_lattice import tile_size, to_tile
from toposeam.motif.optimise.layer import Step, on_outline, optimise_layer, outline_on_cell
from toposeam.motif.optimise.spot_layout import Points, inside_only, lay_spots, place_around, spots
from toposeam.motif.recipe.composition import pack_guide, pack_outline
from toposeam.motif.recipe.recipe import (
    LAWS,
    MAX_SIDE,
    MIN_SIDE,
    ONE_PIECE,
    PLACES,
    LayerRecipe,
    Recipe,
    pack_base,
    unpack_base,
)
from toposeam.motif.recipe.styles import STYLES, Style, draw_rule, styles_of
from toposeam.motif.symmetry.rules import HEXAGONAL, check_repeat

#: Least penalty exponent of a layer that is drawn in strokes; below, it is ink wash.
_MIN_STROKE_PENALTY = 1.75
#: Least penalty exponent that is drawn where strokes are to be cut out.
_MIN_CUT_PENALTY = 3.0


class RecipeKeywords(TypedDict, total=False):
    """Keywords of :func:`random_recipe`."""

    style: str | Sequence[str] | None
    layers: int | None
    repeat: str | None
    seed: Seed
    sources: Points | Sequence[Points] | None
    sinks: Points | Sequence[Points] | None
    distance: float | None
    strengths: tuple[float, float]
    ambient: float | None
    mass: float | Sequence[float] | None
    penalty: float | Sequence[float] | None
    edge: str | Sequence[str] | None
    iterations: int | None
    move: float
    filter_radius: float | None
    avoid: float | None
    coarse: bool
    base: npt.ArrayLike | None
    base_strength: float
    base_law: str | None
    palette: str | Palette | npt.ArrayLike | None
    paper: str | None
    inking: str
    outline: str | npt.ArrayLike | None
    place: str | Sequence[str] | None
    scale: int | Sequence[int]
    guide: npt.ArrayLike | None
    knock_out: bool
    trap: float
    one_piece: str
    bridge: float


#: Most layers of a motif.
_MOST_LAYERS = 1000
#: Most elements of a motif by default, in millions, and how often all layers together may iterate that many.
MAX_MEGAPIXELS, _MOST_ROUNDS = 5.0, 100


def motif(
    source: int | tuple[int, int] | Recipe,
    *,
    max_megapixels: float = MAX_MEGAPIXELS,
    progress: Callable[[float], None] | None = None,
    watch: Callable[[int, Floats], None] | None = None,
    **options: Unpack[RecipeKeywords],
) -> Motif:
    """Generate a motif by heat conduction.

    Parameters
    ----------
    source : int, (rows, columns) or Recipe
        The cell's size in elements, or a recipe, which fixes every parameter.
    max_megapixels : float
        Most elements, in millions; all layers together may iterate a hundred times as many. Somebody else's
        recipe may ask for days and many gigabytes.
    progress : callable, optional
        Called with the share done, in [0, 1].
    watch : callable, optional
        Called after each iteration with the index of its layer, and the layer's density on the plate of that
        iteration, which may be coarser than the cell.
    **options
        Options of :func:`random_recipe`; only with a size.

    Returns
    -------
    Motif
        The same bytes for the same recipe.

    Raises
    ------
    OptionError
        For options out of range or in conflict.
    ImageError
        For a base image or a palette's picture that cannot be used.

    Examples
    --------
    >>> import toposeam as ts
    >>> drop = ts.motif(32, repeat="p4m", seed=7, layers=1, iterations=4)
    >>> drop
    Motif(1 ink on 32 × 32 elements, repeat='p4m', seed=7)
    >>> drop.image().shape
    (32, 32, 3)
    """
    check_function("progress", progress)
    check_function("watch", watch)
    if isinstance(source, Recipe):
        if options:
            raise OptionError(
                "a recipe decides everything; leave out {names} or change the recipe with "
                "dataclasses.replace",
                kind="conflict",
                parameter=Term(next(iter(options))),
                names=tuple(map(Term, options)),
            )
        recipe = source
    else:
        known = list(inspect.signature(random_recipe).parameters)[1:]
        unknown = [name for name in options if name not in known]
        if unknown:
            raise OptionError(
                "{parameter} is not an option of a motif; known are {allowed}",
                kind="unknown",
                parameter=Term(unknown[0]),
                allowed=tuple(known),
            )
        recipe = random_recipe(source, **options)
    check_work(recipe, max_megapixels)
    alone = [on_outline(recipe.of_layer(index)) for index in range(len(recipe.layers))]
    total = sum(each.iterations for each in alone)
    densities: list[npt.NDArray[np.float32]] = []
    history: list[tuple[Step, ...]] = []
    for index, own in enumerate(alone):

        def report(
            done: int, density: Floats, before: int = sum(map(len, history)), layer: int = index
        ) -> None:
            if watch is not None:
                watch(layer, density)
            if progress is not None:
                progress((before + done) / total)

        alike = densities and own.size == recipe.size
        taken = np.stack(densities).sum(axis=0).astype(np.float64) if alike else None
        with one_thread():
            density, steps = optimise_layer(own, taken, report)
        mass = own.layers[0].mass
        density = repair_strokes(density, own.repeat, mass) if own.filter_radius else density
        densities.append(spread_copies(density, recipe, index))
        history.append(steps)

    def make(layers: list[npt.NDArray[np.float32]]) -> Motif:
        return make_motif(recipe, layers, history)

    return finish(smooth_borders(densities, recipe, make), make)


def check_work(recipe: Recipe, max_megapixels: float, depth: int = 1) -> None:
    """Refuse a recipe that asks for too many elements or iterations; see :func:`motif`.

    Raises
    ------
    OptionError
    """
    check_number("max_megapixels", max_megapixels, 0, above=True)
    rows, columns = recipe.size
    millions = rows * columns * depth / 1e6
    rounds = sum(layer.iterations or recipe.iterations for layer in recipe.layers)
    given = {"rows": rows, "columns": columns, "most": max_megapixels}
    if millions > max_megapixels:
        raise OptionError(
            "the motif has {columns} × {rows} elements, more than {most:g} million; make it smaller",
            kind="too large",
            parameter=Term("size"),
            value=recipe.size,
            **given,
        )
    if rounds * millions > _MOST_ROUNDS * max_megapixels:
        raise OptionError(
            "the motif takes {rounds} iterations of {columns} × {rows} elements in all layers, more than "
            "{allowed}; ask for fewer, or for a smaller motif",
            kind="too large",
            parameter=Term("iterations"),
            value=rounds,
            rounds=rounds,
            allowed=int(_MOST_ROUNDS * max_megapixels / millions),
            **given,
        )


def make_motif(
    recipe: Recipe, densities: list[npt.NDArray[np.float32]], history: list[tuple[Step, ...]]
) -> Motif:
    """Make a motif of a recipe and the densities of its layers."""
    layers, lattice = np.stack(densities), None
    if recipe.repeat in HEXAGONAL:
        lattice = layers
        layers = np.stack([to_tile(layer, recipe.repeat, tile_size(recipe.size[0])) for layer in lattice])
    return Motif(
        densities=layers,
        lattice=lattice,
        inks=np.array([layer.ink for layer in recipe.layers]),
        paper=np.array(recipe.paper),
        repeat=recipe.repeat,
        recipe=recipe,
        history=tuple(history),
    )


def random_recipe(
    size: int | tuple[int, int],
    *,
    style: str | Sequence[str] | None = "vein",
    layers: int | None = None,
    repeat: str | None = "none",
    seed: Seed = 0,
    sources: Points | Sequence[Points] | None = None,
    sinks: Points | Sequence[Points] | None = None,
    distance: float | None = None,
    strengths: tuple[float, float] = (0.5, 1.5),
    ambient: float | None = None,
    mass: float | Sequence[float] | None = None,
    penalty: float | Sequence[float] | None = None,
    edge: str | Sequence[str] | None = None,
    iterations: int | None = None,
    move: float = 0.2,
    filter_radius: float | None = None,
    avoid: float | None = None,
    coarse: bool = True,
    base: npt.ArrayLike | None = None,
    base_strength: float = 0.7,
    base_law: str | None = None,
    palette: str | Palette | npt.ArrayLike | None = None,
    paper: str | None = None,
    inking: str = "transparent",
    outline: str | npt.ArrayLike | None = None,
    place: str | Sequence[str] | None = None,
    scale: int | Sequence[int] = 1,
    guide: npt.ArrayLike | None = None,
    knock_out: bool = False,
    trap: float = 0.0,
    one_piece: str = "",
    bridge: float = 2.0,
) -> Recipe:
    """Return a recipe; every parameter that is not given is drawn at random.

    Parameters
    ----------
    size : int or (rows, columns)
    style : str, one per layer, or None
        One of `STYLES`: the ranges from which the parameters are drawn. With None it is drawn from the seed.
    layers : int, optional
        Number of inks n_L; by default as many as the style has.
    repeat : str or None
        One of `REPEATS`; with None drawn from the seed among those that suit the style and the size.
    seed : int, Generator or None
        Seed of the random parameters. The recipe keeps it as a whole number.
    sources, sinks : int or (n, 2 or 3) array_like, or one of these per layer
        Their number, or their places: x and y in [0, 1] of the cell, and optionally a strength.
    distance : float
        Distance from each sink to a source, as a share of the cell's shorter side.
    strengths : (low, high)
        Range of the random strengths.
    ambient : float
        Share of the heat that is generated everywhere; it makes strokes branch.
    mass, penalty : float or one per layer
        Mean density, and the exponent p (1 for ink wash).
    edge : str or one per layer
        Stroke edges in print, of `EDGES`; by default "soft" for ink wash and "crisp" for strokes.
    iterations, move, filter_radius, coarse
        See :class:`Recipe`; by default those of the style.
    avoid : float
        See :class:`LayerRecipe`; by default that of the style.
    base : (H, W) or (H, W, C) array_like
        A logo, a symbol or a photograph that shapes the strokes.
    base_strength : float
        Influence of the base image, -1 to 1; see :class:`Recipe`.
    base_law : str
        One of `LAWS`; by default "brightness" for the thesis's style, else "contrast".
    palette : str, Palette or picture
        Colours; by default a random named palette.
    paper : str
        Colour of the paper, ``#rrggbb``; by default the palette's.
    inking : str
        One of `INKINGS`; opaque inks are seen on dark paper.
    outline : str or picture
        A shape inside or outside of which layers lie: one of `OUTLINES`, or a picture, where what is opaque,
        or else dark, is inside. `mass` is then the inked share of their part of the cell.
    place : str or one per layer
        One of `PLACES`; by default "inside" if there is an outline.
    scale : int or one per layer
        Number of copies of the layer along each side of the cell, such as 3 for a fine ground.
    guide : picture
        Lines, dark or opaque, along which strokes run. Random sinks lie on them.
    knock_out, trap, one_piece, bridge
        See :class:`Recipe`.

    Raises
    ------
    OptionError, ImageError

    Examples
    --------
    >>> import toposeam as ts
    >>> recipe = ts.motif.random_recipe((24, 32), layers=2, repeat="p2", seed=4)
    >>> recipe.size, recipe.seed, len(recipe.layers)
    ((24, 32), 4, 2)
    """
    shape = _shape(size)
    check_kind("paper", paper, (str, type(None)), "a colour, like #20304a, or None")
    if layers is not None:
        layers = check_whole("layers", layers, 1, _MOST_LAYERS)
    seed = seed_of(seed)
    free = sources is None and sinks is None
    styles = styles_of(style, seed, layers, free and base is None and outline is None)
    layers = len(styles)
    repeat = draw_rule(styles, seed, shape) if repeat is None else repeat
    check_repeat(repeat, shape)
    rng = np.random.default_rng(seed)
    inks = _inks(palette, layers, rng)
    low_and_high = check_numbers("strengths", strengths)
    if low_and_high.shape != (2,) or not 0 < low_and_high[0] <= low_and_high[1] < np.inf:
        raise OptionError(
            "{parameter} is {value!r}; give a low and a high one, both above 0",
            kind="number",
            parameter=Term("strengths"),
            value=strengths,
        )
    low, high = low_and_high.tolist()
    check_range(-1, 1, base_strength=base_strength)
    if base_law is None:
        base_law = "brightness" if styles[0] == "thesis" else "contrast"
    check_choice("base_law", base_law, LAWS)
    check_choice("one_piece", one_piece, ONE_PIECE)
    packed = "" if base is None else pack_base(base)
    composed = _Composition.of(outline, place, scale, guide, layers, repeat, shape)
    shown = (
        _base_conductivity(packed, base_strength, base_law) if packed and repeat not in HEXAGONAL else None
    )
    recipes = []
    for index in range(layers):
        # Draw every parameter, used or not, so that giving one does not change the others.
        draw, like = rng.spawn(1)[0], STYLES[styles[index]]
        many, few = int(draw.integers(*like.sources)), int(draw.integers(*like.sinks))
        drawn_mass, (low_ambient, high_ambient) = float(draw.uniform(*like.mass)), like.ambient
        drawn_ambient = high_ambient - (high_ambient - low_ambient) * float(draw.random()) ** 2
        drawn_penalty = _drawn_penalty(like, draw, one_piece)
        aspect = shape[1] / shape[0]
        laid = lay_spots(like.lay, draw, seed, (low, high), aspect, repeat) if free else None
        inside = composed.inside(index)
        given = spots(
            _layer_points(sources, index, layers, "sources"),
            draw,
            many,
            (low, high),
            aspect,
            "sources",
            repeat,
            shown,
            inside,
        )
        drains = spots(
            _layer_points(sinks, index, layers, "sinks"),
            draw,
            few,
            (low, high),
            aspect,
            "sinks",
            repeat,
            shown,
            composed.along(inside),
        )
        if distance is not None:
            check_range(0, 1, above=True, distance=distance)  # of the cell's shorter side
            drains = place_around(given, drains, distance, draw, shape)
        if laid is not None:
            given, drains = (inside_only(points, inside) for points in laid)
        exponent = _number(penalty, index, layers, drawn_penalty, "penalty")
        recipes.append(
            LayerRecipe(
                ink=tuple(inks.inks[index]),
                sources=given,
                sinks=drains,
                ambient=drawn_ambient if ambient is None else ambient,
                mass=_number(mass, index, layers, drawn_mass, "mass"),
                penalty=exponent,
                edge=_edge(edge, index, layers, exponent, styles[index], one_piece),
                style=styles[index],
                avoid=like.avoid if avoid is None else avoid,
                iterations=_own(like.iterations, STYLES[styles[0]].iterations, iterations),
                filter_radius=_own(like.filter_radius, STYLES[styles[0]].filter_radius, filter_radius),
                place=composed.places[index],
                scale=composed.copies[index],
            )
        )
    first = STYLES[styles[0]]
    return Recipe(
        size=shape,
        repeat=repeat,
        seed=seed,
        paper=tuple(inks.paper) if paper is None else parse_colour(paper),
        layers=tuple(recipes),
        iterations=first.iterations if iterations is None else iterations,
        move=move,
        filter_radius=first.filter_radius if filter_radius is None else filter_radius,
        coarse=coarse,
        base=packed,
        base_strength=base_strength if packed else 0.0,
        base_law=base_law,
        inking=inking,
        outline=composed.outline,
        guide=composed.guide,
        knock_out=knock_out,
        trap=trap,
        one_piece=one_piece,
        bridge=bridge,
    )


@dataclass(frozen=True, slots=True)
class _Composition:
    """Where the layers of a motif lie."""

    #: The packed outline and guide; empty for none.
    outline: str
    guide: str
    #: The place and the number of copies of each layer.
    places: list[str]
    copies: list[int]
    repeat: str
    shape: tuple[int, int]

    @classmethod
    def of(
        cls,
        outline: str | npt.ArrayLike | None,
        place: str | Sequence[str] | None,
        scale: int | Sequence[int],
        guide: npt.ArrayLike | None,
        layers: int,
        repeat: str,
        shape: tuple[int, int],
    ) -> _Composition:
        """Return the composition of the options of :func:`random_recipe`."""
        places = PLACES[int(outline is not None)] if place is None else place
        return cls(
            "" if outline is None else pack_outline(outline, shape),
            "" if guide is None else pack_guide(guide, shape),
            _words(places, layers, "place"),
            _counts(scale, layers),
            repeat,
            shape,
        )

    def inside(self, layer: int) -> Mask | None:
        """Return where the random places of a layer may lie; None for anywhere."""
        if not self.outline or self.places[layer] == "everywhere" or self.copies[layer] > 1:
            return None
        return outline_on_cell(self.outline, self.places[layer], self.repeat, self.shape)

    def along(self, inside: Mask | None) -> Mask | None:
        """Return where the random sinks of a layer may lie: on the guide, if there is one."""
        return outline_on_cell(self.guide, "inside", self.repeat, self.shape) if self.guide else inside


def _drawn_penalty(like: Style, draw: np.random.Generator, one_piece: str) -> float:
    """Draw the penalty exponent of a style; wash has no edge to cut along."""
    drawn = float(draw.uniform(1.0, 1.3)) if draw.random() < like.wash else like.penalty
    return max(drawn, _MIN_CUT_PENALTY) if one_piece else drawn


def _words(value: str | Sequence[str], layers: int, name: str) -> list[str]:
    values = (
        [value] * layers
        if isinstance(value, str)
        else check_items(name, value, str, "a text, or one per layer")
    )
    _check_count(values, layers, name)
    return list(values)


def _counts(value: int | Sequence[int], layers: int) -> list[int]:
    single = isinstance(value, int | np.integer)
    values = (
        [value] * layers
        if single
        else check_items("scale", value, object, "a whole number, or one per layer")
    )
    _check_count(values, layers, "scale")
    return [check_whole("scale", each, 1, 32) for each in values]


def _check_count(values: Sequence[Any] | npt.NDArray[Any], layers: int, name: str) -> None:
    if len(values) != layers:
        raise OptionError(
            "{parameter} is given for {count} layers, the motif has {wanted}; give one, or one for each",
            kind="count",
            parameter=Term(name),
            value=values,
            count=len(values),
            wanted=layers,
        )


def _own(value: Any, first: Any, given: Any) -> Any:
    """Return a layer's own value where its style's differs from the first layer's, and none is given."""
    return None if given is not None or value == first else value


def _shape(size: Any) -> tuple[int, int]:
    sides = (size, size) if isinstance(size, int | np.integer) else size
    return check_pair("size", None if isinstance(sides, str) else sides, MIN_SIDE, MAX_SIDE)


def _inks(choice: str | Palette | npt.ArrayLike | None, layers: int, rng: np.random.Generator) -> Palette:
    names = list(PALETTES)
    drawn = names[int(rng.integers(len(names)))]
    if isinstance(choice, Palette):
        choice.check_layers(layers)
        return choice
    return palette(drawn if choice is None else choice, layers)


def _layer_points(value: Any, index: int, layers: int, name: str) -> Points | None:
    """Return the value for one layer, of a value that is given once or per layer."""
    if value is None or isinstance(value, int | np.integer):
        return None if value is None else int(value)
    items = list(check_items(name, value, object, "points, or points for each layer"))
    per_layer = bool(items) and all(
        isinstance(item, int | np.integer) or (np.ndim(item) == 2) for item in items
    )
    if not per_layer:
        return items
    _check_count(items, layers, name)
    chosen: Points = items[index]
    return chosen


def _number(value: float | Sequence[float] | None, index: int, layers: int, drawn: float, name: str) -> float:
    if value is None:
        return drawn
    if isinstance(value, str) or not isinstance(value, Sequence | np.ndarray):
        return check_number(name, value)
    values = check_numbers(name, value)
    if values.ndim == 0:
        return check_number(name, values)
    _check_count(values, layers, name)
    return check_number(name, values[index])


def _edge(
    value: str | Sequence[str] | None, index: int, layers: int, penalty: float, style: str, one_piece: str
) -> str:
    if value is None:
        strokes = penalty >= _MIN_STROKE_PENALTY and style != "thesis"
        return "crisp" if strokes or one_piece else "soft"
    return _words(value, layers, "edge")[index]


def _base_conductivity(packed: str, strength: float, law: str) -> npt.NDArray[np.float64]:
    """Compute the nominal conductivities of a packed base image on its own grid."""
    brightness = unpack_base(packed)
    return nominal_conductivity(brightness, strength, (brightness.shape[0], brightness.shape[1]), law)


#: The former name of :func:`motif`.
generate_motif = motif
