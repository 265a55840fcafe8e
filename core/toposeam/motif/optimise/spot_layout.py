"""Places and strengths of sources and sinks, given or random."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy import ndimage

from toposeam.arrays import Mask
from toposeam.errors import OptionError, Term
from toposeam.motif.recipe.recipe import Point
from toposeam.motif.symmetry.rules import move_onto_axes, operations

#: Least distance of random spots, as a share of the distance in an even distribution.
_MIN_DISTANCE = 0.7

#: Least distance of random spots from the border, as a share of the cell: their strokes are the thickest.
_MARGIN = 0.06

#: Number of random spots from which on they come to the border as well, as empty space there would mark it.
_MANY = 13

#: Largest height of the waves on which spots lie, as a share of the cell.
_MAX_HEIGHT = 0.09

#: Largest number of random spots of one layer: the time to place them grows with its square.
_MAX_POINTS = 200

#: Largest numbers of copies in a cell, by the rule's operations, of random spots whose number is not given,
#: and of circles of them: strokes of more are as small as what is dropped as crumbs.
_MOST_COPIES, _MOST_CIRCLES = 200, 12

#: A number of spots, or x, y and optionally a strength of each.
Points = int | Sequence[Sequence[float]]


def spots(
    value: Points | None,
    rng: np.random.Generator,
    drawn: int,
    strengths: tuple[float, float],
    aspect: float,
    name: str,
    repeat: str,
    shown: npt.NDArray[np.float64] | None,
    inside: Mask | None = None,
) -> tuple[Point, ...]:
    """Return a layer's sources or sinks: those given, or `drawn` random ones with random strengths.

    Half of the random ones lie on the axes of the repetition, where it has any. All of them lie `inside`, if
    it is given.

    Raises
    ------
    OptionError
    """
    count = min(drawn, max(1, _MOST_COPIES // len(operations(repeat)))) if value is None else value
    if isinstance(count, int | np.integer):
        if count < 1:
            raise OptionError(
                "{parameter} is {value}; a layer needs at least one, give a number from 1",
                kind="whole number",
                parameter=Term(name),
                value=count,
            )
        if count > _MAX_POINTS:
            raise OptionError(
                "{parameter} is {value}, which leaves no strokes between them; give {most} at most",
                kind="whole number",
                parameter=Term(name),
                value=count,
                most=_MAX_POINTS,
            )
        places = _random_places(int(count), rng, aspect, shown, inside)
        powers = rng.uniform(*strengths, int(count))
        for index in range((int(count) + 1) // 2):
            moved = move_onto_axes(places[index], repeat, rng)
            if inside is None or lies_in(inside, moved):
                places[index] = moved
        return tuple((float(x), float(y), float(s)) for (x, y), s in zip(places, powers, strict=True))
    try:
        array = np.asarray(count).astype(np.float64, casting="same_kind")
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.ndim != 2 or array.shape[1] not in (2, 3) or len(array) == 0:
        raise OptionError(
            "{parameter} must be {allowed}",
            kind="type",
            parameter=Term(name),
            value=count,
            allowed="a number or a list of (x, y) or (x, y, strength), one at least",
        )
    if array.shape[1] == 2:
        array = np.column_stack([array, np.ones(len(array))])
    return tuple((float(x), float(y), float(s)) for x, y, s in array)


def _random_places(
    count: int,
    rng: np.random.Generator,
    aspect: float,
    shown: npt.NDArray[np.float64] | None,
    inside: Mask | None = None,
) -> npt.NDArray[np.float64]:
    """Draw places that keep a distance, also across the border, and avoid blocked parts of a base image."""
    places: list[npt.NDArray[np.float64]] = []
    margin = _MARGIN if count < _MANY else 0.0
    if inside is not None:
        margin = 0.0
        size = np.array([inside.shape[1], inside.shape[0]])
        deep = ndimage.binary_erosion(
            inside, iterations=round(_MARGIN / 3 * min(inside.shape)), border_value=1
        )
        free = np.argwhere(deep if deep.any() else inside)[:, ::-1]
    apart = _MIN_DISTANCE * np.sqrt(aspect / count)
    for _ in range(count):
        for attempt in range(30):
            place = rng.uniform(margin, 1 - margin, 2)
            if inside is not None:
                place = (free[int(place[0] * len(free))] + 0.5) / size
            gaps = [np.abs(place - other) for other in places]
            wrapped = [np.hypot(min(g[0], 1 - g[0]) * aspect, min(g[1], 1 - g[1])) for g in gaps]
            if (
                shown is not None
                and rng.random() > shown[int(place[1] * shown.shape[0]), int(place[0] * shown.shape[1])]
            ):
                continue
            if all(gap >= apart * (1 - attempt / 30) for gap in wrapped):
                break
        places.append(place)
    return np.array(places)


def lies_in(inside: Mask, place: npt.ArrayLike) -> bool:
    """Test whether a place, (x, y) in [0, 1], lies in a mask."""
    x, y = np.asarray(place)[:2]
    rows, columns = inside.shape
    return bool(inside[min(int(y * rows), rows - 1), min(int(x * columns), columns - 1)])


def inside_only(points: tuple[Point, ...], inside: Mask | None) -> tuple[Point, ...]:
    """Return the points that lie in a mask, if there is one; if none does, one of them, moved there."""
    if inside is None:
        return points
    kept = tuple(point for point in points if lies_in(inside, point))
    if kept or not points:
        return kept
    free = (np.argwhere(inside)[:, ::-1] + 0.5) / np.array([inside.shape[1], inside.shape[0]])
    x, y, strength = points[0]
    x, y = free[np.argmin(np.square(free - [x, y]).sum(axis=1))].tolist()
    return ((x, y, strength),)


def lay_spots(
    lay: str, rng: np.random.Generator, seed: int, strengths: tuple[float, float], aspect: float, repeat: str
) -> tuple[tuple[Point, ...], tuple[Point, ...]] | None:
    """Return sources and sinks on waves or circles; None where they lie anywhere.

    Circles have their centres where those of all layers of a seed do, so that flowers lie in flowers.

    Parameters
    ----------
    lay : str
        One of `LAYS`.
    rng : Generator
    seed : int
        The motif's.
    strengths : (low, high)
    aspect : float
        Width of the cell over its height.
    repeat : str
        The rule, whose operations copy what is laid.
    """
    if lay == "anywhere":
        return None
    if lay == "circles":
        common = np.random.default_rng([seed, 103])
        sources, sinks = [], []
        many = min(int(common.integers(1, 4)), max(1, _MOST_CIRCLES // len(operations(repeat))))
        for place in _random_places(many, common, aspect, None):
            count, radius = int(rng.integers(7, 15)), float(rng.uniform(0.09, 0.24)) * min(1.0, aspect)
            angle = 2 * np.pi * (np.arange(count) + rng.random()) / count
            away = radius * np.column_stack([np.cos(angle) / aspect, np.sin(angle)])
            sources.append((place + away) % 1)
            sinks.append(place[np.newaxis])
        return _with_strengths(sources, rng, strengths), _with_strengths(sinks, rng, strengths)
    upright, at = rng.random() < 0.5, rng.random()
    if lay == "sinks on waves":
        count = int(rng.integers(1, 3))
        waves = [_wave(int(rng.integers(8, 22)), at + index / count, upright, rng) for index in range(count)]
        return (), _with_strengths(waves, rng, strengths)
    first = _wave(int(rng.integers(7, 15)), at, upright, rng)
    second = _wave(int(rng.integers(5, 12)), at + rng.uniform(0.4, 0.6), upright, rng)
    return _with_strengths([first], rng, strengths), _with_strengths([second], rng, strengths)


def _wave(count: int, at: float, upright: bool, rng: np.random.Generator) -> npt.NDArray[np.float64]:
    """Return places along a wave from one side of the cell to the other, which goes on beyond it."""
    along = (np.arange(count) + rng.random()) / count
    height = float(rng.uniform(0.0, _MAX_HEIGHT))
    across = at + height * np.sin(2 * np.pi * (int(rng.integers(1, 3)) * along + rng.random()))
    places = np.column_stack([along, across]) % 1
    return places[:, ::-1] if upright else places


def _with_strengths(
    places: Sequence[npt.NDArray[np.float64]], rng: np.random.Generator, strengths: tuple[float, float]
) -> tuple[Point, ...]:
    together = np.concatenate(places)
    powers = rng.uniform(*strengths, len(together))
    return tuple((float(x), float(y), float(s)) for (x, y), s in zip(together, powers, strict=True))


def place_around(
    sources: tuple[Point, ...],
    sinks: tuple[Point, ...],
    distance: float,
    rng: np.random.Generator,
    shape: tuple[int, int],
) -> tuple[Point, ...]:
    """Move the sinks to the given distance from the sources, taken in turn."""
    side = min(shape)
    moved = []
    for index, (*_, strength) in enumerate(sinks):
        x, y, _ = sources[index % len(sources)]
        angle = rng.uniform(0, 2 * np.pi)
        along = distance * side * np.array([np.cos(angle) / shape[1], np.sin(angle) / shape[0]])
        place = np.array([x, y]) + along
        place = np.where((place < 0) | (place > 1), np.array([x, y]) - along, place)
        moved.append((float(np.clip(place[0], 0, 1)), float(np.clip(place[1], 0, 1)), strength))
    return tuple(moved)
