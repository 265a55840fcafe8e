"""A session: a sketch that changes by messages, what it looks like, and the way back. Nothing of the web."""

from __future__ import annotations

import dataclasses
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.arrays import Floats
from toposeam.motif.ink import Palette
from toposeam.motif.recipe import Recipe
from toposeam.motif.symmetry import HEXAGONAL, operations, shift_of
from toposeam_cli.edit.motif.messages import MOST_LAYERS
from toposeam_cli.edit.motif.sketch import Sketch, Wall, erased
from toposeam_cli.edit.motif.work import MOST_KEPT, MotifWork

#: How much of what is shown is kept where a number, a place or the rule has changed; the rest is made even.
_KEPT_NUMBER, _KEPT_PLACE, _KEPT_RULE = 0.7, 0.5, 0.35
#: Longest side of the finest plate while something is dragged, at rest, and of relatives, in elements.
_DRAGGED_SIDE, _SETTLED_SIDE, RELATIVE_SIDE = 128, 256, 64
#: Number of relatives, and how far they vary: style and rule stay.
_RELATIVES, _VARIED = 8, 0.35
#: Strength of a source or sink that is drawn.
_STRENGTH = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GrowthTask:
    """What is to be grown after a change."""

    recipe: Recipe
    #: Densities to begin with, or None.
    start: list[Floats] | None
    kept: float
    most: int


@dataclass(slots=True, eq=False)
class _Moment:
    """A sketch and what it looks like: densities of its layers in 255ths, none yet if it was not shown, and
    how they are printed.
    """

    sketch: Sketch
    levels: list[npt.NDArray[np.uint8]] | None = None
    printed: dict[str, list[float]] = field(default_factory=dict)
    final: bool = False


class MotifSession:
    """The motif of a page."""

    def __init__(self, work: MotifWork) -> None:
        self._work = work
        found = work.read()
        sketches, at = found or ([work.first(secrets.randbelow(10_000))], 0)
        check_layers(sketches[at].recipe)
        moments = [_Moment(sketch) for sketch in sketches]
        self._past, self._now, self._future = moments[:at], moments[at], moments[:at:-1]
        self._before: _Moment | None = None
        self.relatives: list[tuple[Sketch, list[Floats] | None]] = []

    @property
    def recipe(self) -> Recipe:
        """The whole recipe, with walls."""
        return self._now.sketch.whole()

    @property
    def final(self) -> bool:
        """True if what is shown is what the recipe makes."""
        return self._now.final

    def begin(self) -> GrowthTask:
        """Return what is to be grown at first."""
        return GrowthTask(recipe=self.recipe, start=None, kept=0.0, most=_SETTLED_SIDE)

    def shown(self) -> list[Floats] | None:
        """Return the densities that are shown, each (h, w) in [0, 1]."""
        levels = self._now.levels
        return None if levels is None else [level / 255.0 for level in levels]

    @property
    def printed(self) -> dict[str, list[float]]:
        """How what is shown is printed."""
        return self._now.printed

    def show(
        self,
        densities: Sequence[npt.NDArray[np.floating]],
        printed: dict[str, list[float]] | None = None,
        *,
        final: bool = False,
    ) -> list[bytes]:
        """Take over what is shown now, and how it is printed; return it in 255ths."""
        self._now.levels = [np.rint(255 * density).astype(np.uint8) for density in densities]
        self._now.printed, self._now.final = printed or {}, final
        return [level.tobytes() for level in self._now.levels]

    def change(self, message: Mapping[str, Any]) -> GrowthTask | None:
        """Change the sketch; return what is to be grown, if anything.

        Raises
        ------
        OptionError
            If the recipe would not be one.
        """
        kind = message["kind"]
        if kind in ("undo", "redo"):
            return self._step(back=kind == "undo")
        sketch, shown = self._now.sketch, self.shown()
        recipe, done = sketch.recipe, message.get("done", True)
        start, kept = shown, _KEPT_PLACE
        if kind == "colours":
            changed = _coloured(sketch, message)
            self._keep(changed, done=done, final=self._now.final)
            return None
        if kind == "dice":
            changed, start = Sketch(recipe=_thrown(recipe, message)), None
        elif kind == "style":
            changed, start = self._restyled(message["style"], message["layer"])
        elif kind == "repeat":
            repeated = dataclasses.replace(recipe, repeat=message["repeat"])
            changed, kept = dataclasses.replace(sketch, recipe=repeated), _KEPT_RULE
        elif kind == "set":
            values = {message["name"]: message["value"]}
            changed, kept = self._of_layers(message["layer"], **values), _KEPT_NUMBER
        elif kind == "layers":
            changed, kept = self._counted(message["count"]), 1.0
            if shown is not None:
                even = [np.full(shown[0].shape, layer.mass) for layer in changed.recipe.layers[len(shown) :]]
                start = [*shown[: message["count"]], *even]
        elif kind == "relative":
            if message["number"] >= len(self.relatives):
                return None
            changed, start = self.relatives[message["number"]]
            kept = _KEPT_NUMBER
        else:
            changed = self._drawn(message)
        check_layers(changed.recipe)
        task = GrowthTask(
            recipe=changed.whole(),
            start=start,
            kept=kept,
            most=_SETTLED_SIDE if done else _DRAGGED_SIDE,
        )
        self._keep(changed, done=done)
        return task

    def breed(self, seed: int) -> list[GrowthTask]:
        """Return relatives of the motif to be grown, small ones."""
        sketch = self._now.sketch
        self.relatives = []
        for number in range(_RELATIVES):
            recipe = ts.motif.vary(sketch.recipe, amount=_VARIED, seed=seed + number)
            self.relatives.append((dataclasses.replace(sketch, recipe=recipe), None))
        return [
            GrowthTask(recipe=each.whole(), start=None, kept=0.0, most=RELATIVE_SIDE)
            for each, _ in self.relatives
        ]

    def bred(self, number: int, densities: Sequence[Floats]) -> None:
        """Keep the densities of a relative."""
        self.relatives[number] = (self.relatives[number][0], list(densities))

    def describe(self) -> dict[str, Any]:
        """Return all that the page shows of the sketch."""
        sketch = self._now.sketch
        recipe, shift = sketch.recipe, shift_of(sketch.recipe.repeat)
        alone = [recipe.of_layer(index) for index in range(len(recipe.layers))]
        return {
            "repeat": recipe.repeat,
            "hexagonal": recipe.repeat in HEXAGONAL,
            "operations": operations(recipe.repeat),
            "shift": None if shift is None else [shift[0], float(shift[1])],
            "size": recipe.size,
            "seed": recipe.seed,
            "paper": recipe.paper,
            "inking": recipe.inking,
            "layers": [
                {
                    "ink": layer.ink,
                    "style": layer.style,
                    "edge": layer.edge,
                    "mass": layer.mass,
                    "ambient": layer.ambient,
                    "penalty": layer.penalty,
                    "filter_radius": own.filter_radius,
                    "sources": layer.sources,
                    "sinks": layer.sinks,
                }
                for layer, own in zip(recipe.layers, alone, strict=True)
            ],
            "walls": [{"points": wall.points, "radius": wall.radius} for wall in sketch.walls],
            "undo": len(self._past),
            "redo": len(self._future),
            "final": self.final,
        }

    def _keep(self, sketch: Sketch, *, done: bool, final: bool = False) -> None:
        """Take over a sketch, shown as before; once a gesture is done, undo leads to what was before it."""
        self._before = self._before or self._now
        self._now = _Moment(sketch, self._now.levels, self._now.printed, final)
        if done:
            self._past = [*self._past, self._before][-MOST_KEPT:]
            self._future, self._before = [], None
            self._save()

    def _step(self, *, back: bool) -> GrowthTask | None:
        source, target = (self._past, self._future) if back else (self._future, self._past)
        self._before = None
        if not source:
            return None
        target.append(self._now)
        self._now = source.pop()
        self._save()
        return self.begin() if self._now.levels is None else None

    def _save(self) -> None:
        future = self._future[::-1][:MOST_KEPT]
        sketches = [moment.sketch for moment in (*self._past, self._now, *future)]
        self._work.save(sketches, len(self._past))

    def _of_layers(self, number: int | None, **values: Any) -> Sketch:
        """Return the sketch with values of one layer, or of all, changed."""
        sketch = self._now.sketch
        layers = tuple(
            dataclasses.replace(layer, **values) if number in (None, index) else layer
            for index, layer in enumerate(sketch.recipe.layers)
        )
        return dataclasses.replace(sketch, recipe=dataclasses.replace(sketch.recipe, layers=layers))

    def _restyled(self, style: str, number: int | None) -> tuple[Sketch, list[Floats] | None]:
        sketch, shown = self._now.sketch, self.shown()
        recipe = sketch.recipe
        drawn = ts.motif.restyle(recipe, style)
        if number is None:
            return dataclasses.replace(sketch, recipe=drawn), None
        if number >= len(recipe.layers):
            return sketch, shown
        own = drawn.of_layer(number)
        layer = dataclasses.replace(own.layers[0], iterations=own.iterations, filter_radius=own.filter_radius)
        layers = (*recipe.layers[:number], layer, *recipe.layers[number + 1 :])
        if shown is not None:
            shown = [np.full(each.shape, layer.mass) if k == number else each for k, each in enumerate(shown)]
        return dataclasses.replace(sketch, recipe=dataclasses.replace(recipe, layers=layers)), shown

    def _counted(self, count: int) -> Sketch:
        """Return the sketch with fewer layers, or with more that its seed draws."""
        sketch = self._now.sketch
        recipe = sketch.recipe
        layers = recipe.layers[:count]
        if count > len(layers):
            styles = [recipe.layers[min(k, len(layers) - 1)].style for k in range(count)]
            drawn = ts.motif.random_recipe(
                recipe.size,
                style=styles,
                repeat=recipe.repeat,
                seed=recipe.seed,
                palette=_palette(recipe, count),
            )
            for index in range(len(layers), count):
                own = drawn.of_layer(index)
                layers += (
                    dataclasses.replace(
                        own.layers[0], iterations=own.iterations, filter_radius=own.filter_radius
                    ),
                )
        return dataclasses.replace(sketch, recipe=dataclasses.replace(recipe, layers=layers))

    def _drawn(self, message: Mapping[str, Any]) -> Sketch:
        """Return the sketch with a source, a sink or a wall drawn, moved or erased."""
        sketch, kind = self._now.sketch, message["kind"]
        points = message["points"]
        if kind == "wall":
            wall = Wall(points=tuple((x, y) for x, y in points), radius=message["radius"])
            return dataclasses.replace(sketch, walls=(*sketch.walls, wall))
        if kind == "erase":
            return erased(sketch, points, message["radius"])
        role, layers = message["role"], list(sketch.recipe.layers)
        for index, layer in enumerate(layers):
            if message["layer"] not in (None, index):
                continue
            spots = list(getattr(layer, role))
            if kind == "add":
                spots += [(x, y, _STRENGTH) for x, y in points]
            elif message["index"] < len(spots):
                spots[message["index"]] = (*points[0], spots[message["index"]][2])
            changed: dict[str, Any] = {role: tuple(spots)}
            layers[index] = dataclasses.replace(layer, **changed)
        recipe = dataclasses.replace(sketch.recipe, layers=tuple(layers))
        return dataclasses.replace(sketch, recipe=recipe)


def check_layers(recipe: Recipe) -> None:
    """Refuse more inks than the page shows.

    Raises
    ------
    OptionError
    """
    if len(recipe.layers) > MOST_LAYERS:
        raise ts.OptionError(
            f"{len(recipe.layers)} inks are more than the page shows, which is {MOST_LAYERS}; change this "
            "motif by toposeam motif --like"
        )


def _coloured(sketch: Sketch, message: Mapping[str, Any]) -> Sketch:
    """Return a sketch with other inks, another paper or another way to print."""
    inks = message["inks"]
    layers = tuple(
        dataclasses.replace(layer, ink=tuple(inks[index] if index < len(inks) else layer.ink))
        for index, layer in enumerate(sketch.recipe.layers)
    )
    recipe = dataclasses.replace(
        sketch.recipe, layers=layers, paper=tuple(message["paper"]), inking=message["inking"]
    )
    return dataclasses.replace(sketch, recipe=recipe)


def _thrown(recipe: Recipe, message: Mapping[str, Any]) -> Recipe:
    """Return what a seed draws, in the colours of a recipe."""
    drawn = ts.motif.random_recipe(
        recipe.size,
        style=message["style"],
        repeat=message["repeat"],
        seed=message["seed"],
        palette=_palette(recipe, MOST_LAYERS),
        inking=recipe.inking,
    )
    return dataclasses.replace(drawn, layers=drawn.layers[:MOST_LAYERS])


def _palette(recipe: Recipe, count: int) -> Palette:
    """Return the colours of a recipe, with more of the palette that they come from, or of the first one."""
    own = np.array([layer.ink for layer in recipe.layers])
    more = None
    for name in ts.motif.PALETTES:
        each = ts.motif.palette(name, count)
        many = min(count, len(own))
        if more is None or np.allclose(each.inks[:many], own[:many], atol=1e-3):
            more = each.inks
    inks = np.concatenate([own, np.asarray(more)[len(own) :]])[:count]
    return Palette(paper=np.array(recipe.paper), inks=inks)
