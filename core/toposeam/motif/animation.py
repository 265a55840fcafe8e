"""Growth of a motif: what the iterations of its optimisation make of it, one after another."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats, Floats32
from toposeam.checks import check_range, check_whole, options_from
from toposeam.motif.finishing import spread_copies
from toposeam.motif.generate import MAX_MEGAPIXELS, RecipeKeywords, make_motif
from toposeam.motif.generate import motif as generate
from toposeam.motif.ink.sampling import resample
from toposeam.motif.ink.svg import SvgKeywords, SvgOptions, draw_frames
from toposeam.motif.motif import Motif
from toposeam.motif.optimise.hexagonal_lattice import refined
from toposeam.motif.recipe.recipe import Recipe
from toposeam.motif.symmetry.rules import HEXAGONAL

#: Level at which strokes end at first, and its least multiple of the mean density, so that the even start
#: shows nothing.
_FIRST_LEVEL, _ABOVE_MEAN = 0.7, 1.3
#: Exponent of the share of the growth that gives the share of the iterations: the first ones change most.
_SLOW_START = 1.6
#: Share of the growth in which ink wash comes up from nothing, and in which strokes become those of the
#: finished motif, which are repaired.
_FADE, _FINISH = 0.15, 0.12


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class GrowingMotif(Motif):
    """A motif that is not finished: its strokes end at given levels."""

    levels: tuple[tuple[float, np.float32], ...]

    def ends(self, layer: int) -> tuple[float, np.float32]:
        """Return the density at which a layer's strokes end in print, and the factor on densities inside."""
        return self.levels[layer]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Animation:
    """Result of :func:`animate`.

    Examples
    --------
    >>> import toposeam as ts
    >>> animation = ts.motif.animate(16, layers=1, repeat="p4", seed=1, iterations=3)
    >>> animation
    Animation(3 iterations of 1 layer, repeat='p4', seed=1)
    >>> [frame.image().shape for frame in animation.frames(4)][-1]
    (16, 16, 3)
    """

    #: The finished motif.
    motif: Motif
    #: For each layer, its density after each iteration, on the plate of that iteration; for hexagonal groups,
    #: on the lattice.
    steps: tuple[tuple[Floats32, ...], ...]

    def at(self, share: float) -> Motif:
        """Return the motif as it is after a share of its growth, in [0, 1]; all layers grow at the same time.

        Between two iterations densities are interpolated; towards the end they become the finished ones.

        Raises
        ------
        OptionError
        """
        check_range(0, 1, share=share)
        if share == 1:
            return self.motif
        motif = self.motif
        final = motif.densities if motif.lattice is None else motif.lattice
        layers, levels = [], []
        finished = np.clip((share - 1 + _FINISH) / _FINISH, 0.0, 1.0)
        for index, layer in enumerate(final):
            grown = self._layer(index, share)
            if motif.edges[index] == "soft":
                grown = grown * np.float32(min(share / _FADE, 1.0))
            layers.append(np.asarray((1 - finished) * grown + finished * layer, np.float32))
            at, gain = self._ends[index]
            first = max(at, _FIRST_LEVEL, _ABOVE_MEAN * motif.recipe.layers[index].mass)
            levels.append((first + (at - first) * share, gain))
        grown_up = make_motif(motif.recipe, layers, list(motif.history))
        values = {field.name: getattr(grown_up, field.name) for field in fields(Motif)}
        return GrowingMotif(**values, levels=tuple(levels))

    @cached_property
    def _ends(self) -> tuple[tuple[float, np.float32], ...]:
        """Where the strokes of the finished motif's layers end; see :meth:`Motif.ends`."""
        return tuple(map(self.motif.ends, range(len(self.motif.inks))))

    def _layer(self, index: int, share: float) -> Floats32:
        """Interpolate a layer's density between two iterations, on the whole cell."""
        even = np.full_like(self.steps[index][0], self.motif.recipe.layers[index].mass)
        steps = (even, *self.steps[index])
        place = min(share / (1 - _FINISH), 1.0) ** _SLOW_START * (len(steps) - 1)
        before = min(int(place), len(steps) - 1)
        after, part = min(before + 1, len(steps) - 1), min(place - before, 1.0)
        one, two = (self._on_cell(steps[number], index) for number in (before, after))
        return np.asarray((1 - part) * one + part * two, np.float32)

    def _on_cell(self, density: Floats32, index: int) -> Floats32:
        recipe = self.motif.recipe
        own = recipe.of_layer(index)
        if own.repeat in HEXAGONAL:
            whole = np.clip(refined(density, own.size), 0.0, 1.0).astype(np.float32)
        else:
            whole = resample(density, own.repeat, own.size)
        return spread_copies(whole, recipe, index)

    def frames(self, count: int) -> Iterator[Motif]:
        """Yield the motif at `count` even shares of its growth, the last one finished.

        Raises
        ------
        OptionError
        """
        count = check_whole("count", count, 2)
        for number in range(count):
            yield self.at(number / (count - 1))

    def to_svg(
        self,
        counts: tuple[float, float] = (1, 1),
        *,
        frames: int = 36,
        seconds: float = 3.0,
        pause: float = 1.5,
        options: SvgOptions | None = None,
        **given: Unpack[SvgKeywords],
    ) -> str:
        """Return the growth as an SVG document that moves by itself, again and again.

        Programs that show no animation show the finished motif.

        Parameters
        ----------
        counts : (rows, columns)
            Number of motifs, as :func:`draw_svg` takes it.
        frames : int
        seconds : float
            Duration of the growth.
        pause : float
            How long the finished motif then stands still, s.
        options : SvgOptions
        **given
            The options as plain keywords instead.

        Raises
        ------
        OptionError
        """
        chosen = options_from(SvgOptions, options, given, "a drawing")
        check_range(0, 1e4, above=True, seconds=seconds)
        check_range(0, 1e4, pause=pause)
        frames = check_whole("frames", frames, 2, 1000)
        return draw_frames(list(self.frames(frames)), counts, (seconds, pause), options=chosen)

    def __repr__(self) -> str:
        layers = len(self.steps)
        iterations = max(map(len, self.steps))
        return (
            f"Animation({iterations} iterations of {layers} layer{'s' if layers > 1 else ''}, "
            f"repeat={self.motif.repeat!r}, seed={self.motif.recipe.seed})"
        )


def animate(
    source: int | tuple[int, int] | Recipe,
    *,
    max_megapixels: float = MAX_MEGAPIXELS,
    progress: Callable[[float], None] | None = None,
    **options: Unpack[RecipeKeywords],
) -> Animation:
    """Generate a motif, and keep what each iteration has made of it.

    Parameters
    ----------
    source, max_megapixels, progress, **options
        As of :func:`toposeam.motif`.

    Returns
    -------
    Animation

    Raises
    ------
    OptionError, ImageError

    Examples
    --------
    >>> import toposeam as ts
    >>> animation = ts.motif.animate(16, layers=1, repeat="p4", seed=1, iterations=3)
    >>> [len(steps) for steps in animation.steps]
    [3]
    """
    steps: dict[int, list[npt.NDArray[np.float32]]] = {}

    def watch(layer: int, density: Floats) -> None:
        steps.setdefault(layer, []).append(density.astype(np.float32))

    motif = generate(source, max_megapixels=max_megapixels, progress=progress, watch=watch, **options)
    return Animation(motif=motif, steps=tuple(tuple(steps[index]) for index in range(len(motif.inks))))
