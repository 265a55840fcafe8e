"""A composition in numbers, for programs: one schema, whatever the number and size of the pictures.

``schema`` is 1. It changes when a key goes or means something else; keys may be added. Sizes and places are
in px; None stands for what is not known.

=================  =======================================================================================
``schema``         1
``size``           width and height of the picture
``crop``           left, top, width and height of the box of the canvas that is shown; None for all of it
``cost``           Σ M over all seams
``rounds``         rounds of expansions, 0 for two pictures
``bent_px``        the largest displacement by which pictures were bent to meet, 0 if none was
``likeness``       of the seam most likely to be seen, as that of each seam
``worst_likeness`` the same
``look_at``        the same
``layers``         of each picture name, at (x, y), shown_px, and if its place was searched moved (x, y),
                   correlation, turn (degrees) and scale
``seams``          of each seam between (two names), method, cost, optimum (the least possible cost), ratio
                   (of both), bound (proven, 0 for nothing), stages, iterations, termination, paths (their
                   number), length_px, seconds, likeness and worst_likeness (in [0, 1], the mean and that of
                   the worst tenth) and look_at (x, y in the picture, None if nothing is likely to be seen)
``placement``      how places were found
=================  =======================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from toposeam.layers.canvas.canvas import Canvas
from toposeam.layers.canvas.layer import Box, Layer
from toposeam.layers.labelling.label_map import Pair
from toposeam.optimize.history import Termination
from toposeam.seam.result.seam import Seam
from toposeam.seam.result.verdict import Verdict
from toposeam.vector.polyline import Polyline
from toposeam.vector.svg import write_svg

SCHEMA = 1
#: Keys of a layer that are filled in if its place was searched.
_PLACEMENT_KEYS = ("moved", "correlation", "turn", "scale")
_NO_VERDICT: dict[str, Any] = {"likeness": None, "worst_likeness": None, "look_at": None}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeamOutline:
    """The paths and figures of a seam, without the problem that it solves."""

    pair: Pair
    paths: tuple[Polyline, ...]
    cost: float
    method: str
    bound: float
    stages: int
    iterations: int
    termination: Termination
    seconds: float
    settings: Mapping[str, Any]
    verdict: Verdict | None = None

    @classmethod
    def of(cls, pair: Pair, seam: Seam) -> SeamOutline:
        """Copy everything but the problem from the seam of a pair."""
        return cls(
            pair=pair,
            paths=tuple(seam.paths),
            cost=seam.cost,
            method=seam.method,
            bound=seam.bound,
            stages=seam.history[-1].stage if seam.history else 0,
            iterations=len(seam.history),
            termination=seam.termination,
            seconds=seam.seconds,
            settings=seam.settings,
            verdict=seam.verdict,
        )

    @property
    def length(self) -> float:
        """Total length of the paths, px."""
        return sum(line.length for line in self.paths)


class Summarised(Protocol):
    """The parts of a :class:`toposeam.layers.Composition` that a summary reads."""

    @property
    def bent(self) -> float:
        """The largest displacement by which layers were bent, px."""

    @property
    def canvas(self) -> Canvas:
        """The layers in their places."""

    @property
    def layers(self) -> Sequence[Layer]:
        """The layers, with their tones matched."""

    @property
    def view(self) -> Box:
        """The box of the canvas that the picture shows."""

    @property
    def shown(self) -> Sequence[int]:
        """The number of pixels of the picture that show each layer."""

    @property
    def rounds(self) -> int:
        """The number of rounds of expansions."""

    @property
    def outlines(self) -> Sequence[SeamOutline]:
        """The seams without their problems."""

    @property
    def seams(self) -> Sequence[Seam]:
        """The seams."""


def summary_of(composition: Summarised, *, optima: bool) -> dict[str, Any]:
    """Summarise a composition, with the keys of the table above."""
    names, view = composition.canvas.names, composition.view
    crop = None
    if view != composition.canvas.box:
        crop = (view.left, view.top, view.shape[1], view.shape[0])
    found, verdicts = [], []
    for number, seam in enumerate(composition.outlines):
        verdict = None if seam.verdict is None else seam.verdict.inside(crop)
        verdicts.append(verdict)
        ratio = composition.seams[number].optimum_ratio() if optima else None
        found.append(
            {
                "between": [names[index] for index in seam.pair],
                "method": seam.method,
                "cost": seam.cost,
                "optimum": None if ratio is None else seam.cost / ratio,
                "ratio": ratio,
                "bound": seam.bound,
                "stages": seam.stages,
                "iterations": seam.iterations,
                "termination": str(seam.termination),
                "paths": len(seam.paths),
                "length_px": round(seam.length),
                "seconds": round(seam.seconds, 6),
                **(_NO_VERDICT if verdict is None else verdict.summary()),
            }
        )
    known = [verdict for verdict in verdicts if verdict is not None]
    worst = min(known, key=lambda verdict: verdict.worst) if known else None
    layers = [
        {"name": layer.name, "at": list(layer.at), "shown_px": shown, **dict.fromkeys(_PLACEMENT_KEYS)}
        for layer, shown in zip(composition.layers, composition.shown, strict=True)
    ]
    height, width = view.shape
    return {
        "schema": SCHEMA,
        "size": [width, height],
        "crop": None if crop is None else list(crop),
        "cost": sum(seam["cost"] for seam in found),
        "rounds": composition.rounds,
        "bent_px": composition.bent,
        **(_NO_VERDICT if worst is None else worst.summary()),
        "layers": layers,
        "seams": found,
        "placement": None,
    }


def pair_name(first: str, second: str) -> str:
    """Return the name that the paths between two layers have in SVG.

    Examples
    --------
    >>> import toposeam as ts
    >>> ts.layers.pair_name("a", "b")
    'a : b'
    """
    return " ".join(f"{first} : {second}".split())


def seams_svg(seams: Sequence[SeamOutline], names: Sequence[str], shape: tuple[int, int], rounds: int) -> str:
    """Return the seams between layers as one SVG document of the canvas's height and width."""
    lines = [
        (line, pair_name(names[i], names[j])) for seam in seams for i, j in [seam.pair] for line in seam.paths
    ]
    settings: dict[str, Any] = {
        "layers": tuple(names),
        "cost": sum(seam.cost for seam in seams),
        "rounds": rounds,
        "seams": [
            {**seam.settings, "pair": seam.pair, "method": seam.method, "cost": seam.cost} for seam in seams
        ],
    }
    height, width = shape
    return write_svg([line for line, _ in lines], width, height, settings, [name for _, name in lines])
