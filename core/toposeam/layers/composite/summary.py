"""A composition in numbers, for programs: one schema, whatever the number and size of the pictures.

``schema`` is 1. It changes when a key goes or means something else; keys may be added. Sizes and places are
in px; None stands for what is not known.

=================  =======================================================================================
``schema``         1
``size``           width and height of the picture
``crop``           left, top, width and height of the box of the canvas that is shown; None for all of it
``kept``           share of the pixels that pictures show on the canvas, in [0, 1]
``cost``           Σ M over all seams
``rounds``         rounds of expansions, 0 for two pictures
``bent_px``        the largest displacement by which pictures were bent to meet, 0 if none was
``likeness``       of the seam most likely to be seen, as that of each seam
``worst_likeness`` the same
``step``           the same
``look_at``        the same
``layers``         of each picture name, at (x, y), shown_px, and if its place was searched moved (x, y),
                   correlation, turn (degrees) and scale
``seams``          of each seam between (two names), method, cost, optimum (the least possible cost), ratio
                   (of both), bound (proven, 0 for nothing), stages, iterations, termination, paths (their
                   number), length_px, seconds, likeness and worst_likeness (in [0, 1], the mean and that of
                   the worst tenth), step (the largest step of tone, hue or grain that the picture shows: 1
                   is just seen) and look_at (x, y in the picture, None if nothing is likely to be seen)
``placement``      how places were found
=================  =======================================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from toposeam.layers.canvas.layer import Box
from toposeam.layers.composite.seams import SeamOutline
from toposeam.seam.result.verdict import worst_of
from toposeam.vector.svg import write_svg

SCHEMA = 1
#: Keys of a layer that are filled in if its place was searched.
_PLACEMENT_KEYS = ("moved", "correlation", "turn", "scale")
_NO_VERDICT: dict[str, Any] = {"likeness": None, "worst_likeness": None, "step": None, "look_at": None}


def summary_of(composition: Any, *, optima: bool) -> dict[str, Any]:
    """Summarise a composition, with the keys of the table above."""
    names, crop = composition.canvas.names, composition.cropped
    judged, found, verdicts = composition.verdicts(), [], []
    for number, seam in enumerate(composition.outlines):
        verdict = judged[seam.pair].inside(crop) if seam.pair in judged else None
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
    worst = worst_of(verdict for verdict in verdicts if verdict is not None)
    layers = [
        {"name": layer.name, "at": list(layer.at), "shown_px": shown, **dict.fromkeys(_PLACEMENT_KEYS)}
        for layer, shown in zip(composition.layers, composition.shown, strict=True)
    ]
    height, width = composition.shape
    return {
        "schema": SCHEMA,
        "size": [width, height],
        "crop": None if crop is None else list(crop),
        "kept": composition.kept,
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


def seams_svg(seams: Sequence[SeamOutline], names: Sequence[str], canvas: Box, view: Box, rounds: int) -> str:
    """Return the seams between layers as one SVG document, which shows a view of the canvas."""
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
    if view != canvas:
        settings["canvas"] = canvas.shape[::-1]
    height, width = view.shape
    written = [line for line, _ in lines], width, height, settings, [name for _, name in lines]
    return write_svg(*written, (view.left, view.top))
