"""Styles of motifs: named regions of the parameters, from which what is not given is drawn.

A style is no method of its own. All solve the same problem; what differs is how much heat comes from
everywhere, where sources and sinks lie, how wide the filter is and when the iterations end. Heat from
everywhere makes strokes branch; without it they lead from sources to sinks. A wide filter makes them smooth,
many sources and sinks fine, few iterations short.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toposeam.checks import check_choice, check_items
from toposeam.errors import OptionError, Term
from toposeam.motif.symmetry.rules import REPEATS, check_repeat, operations

#: How random sources and sinks lie: anywhere; sinks along waves across the cell; sources along one wave and
#: sinks along another; sources on circles round the sinks.
LAYS = ("anywhere", "sinks on waves", "wave to wave", "circles")
#: The second number of the seeds from which styles and rules are drawn, so that they do not change what else
#: is drawn.
_STYLE_STREAM, _RULE_STREAM = 101, 102
#: Rules of three operations or more. A few large strokes make an ornament under these; under others they look
#: as if they were dropped.
_ORNAMENTAL = tuple(rule for rule in REPEATS[1:] if len(operations(rule)) >= 3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """Ranges and values of the parameters of a layer; a pair is a range, of whole numbers without its end.

    Examples
    --------
    >>> import toposeam as ts
    >>> ts.motif.STYLES["cutout"].filter_radius
    8.0
    """

    #: What it looks like, in a few words.
    look: str
    #: Number of sources and of sinks, where they lie anywhere.
    sources: tuple[int, int] = (3, 10)
    sinks: tuple[int, int] = (2, 7)
    lay: str = "anywhere"
    mass: tuple[float, float] = (0.14, 0.34)
    ambient: tuple[float, float] = (0.47, 0.97)
    penalty: float = 3.0
    #: Share of layers that are ink wash instead of strokes.
    wash: float = 0.0
    iterations: int = 40
    filter_radius: float = 0.5
    #: How far a layer keeps out of what the layers before it have inked; see :class:`LayerRecipe`.
    avoid: float = 0.0
    #: Number of inks where none is given.
    layers: int = 3
    #: Rules of repetition among which one is drawn.
    rules: tuple[str, ...] = REPEATS[1:]


#: The styles by their names. "thesis" is never drawn.
STYLES: dict[str, Style] = {
    "vein": Style(look="branching veins", wash=0.15),
    "cutout": Style(look="cut paper", filter_radius=8.0, mass=(0.18, 0.3), layers=2),
    "chain": Style(
        look="chains and tendons",
        sources=(5, 8),
        sinks=(5, 8),
        ambient=(0.0, 0.0),
        layers=2,
        rules=_ORNAMENTAL,
    ),
    "seed": Style(
        look="scattered seeds and links",
        sources=(34, 47),
        sinks=(34, 47),
        ambient=(0.0, 0.0),
        mass=(0.18, 0.28),
        layers=2,
    ),
    "key": Style(look="maple keys", iterations=5, mass=(0.18, 0.3), layers=2),
    "batik": Style(look="dense bursts in a dyed ground", mass=(0.5, 0.56), layers=1),
    "leaf": Style(look="a mosaic of leaves", filter_radius=3.0, mass=(0.29, 0.36), avoid=1.0),
    "rosette": Style(look="watercolour", wash=1.0, mass=(0.18, 0.34), layers=2),
    "brush": Style(look="brush strokes in fog", iterations=12, penalty=1.5, mass=(0.16, 0.26), layers=2),
    "folk": Style(
        look="folk ornament",
        filter_radius=4.0,
        ambient=(0.0, 0.0),
        mass=(0.2, 0.3),
        layers=2,
        rules=_ORNAMENTAL,
    ),
    "bone": Style(
        look="bones and beads",
        penalty=6.0,
        filter_radius=1.5,
        ambient=(0.05, 0.15),
        layers=2,
        rules=_ORNAMENTAL,
    ),
    "pebble": Style(
        look="pebbles and worms",
        sources=(26, 35),
        sinks=(26, 35),
        ambient=(0.0, 0.0),
        filter_radius=5.0,
        mass=(0.3, 0.4),
        avoid=1.0,
        layers=2,
    ),
    "fern": Style(
        look="fronds along waves", lay="sinks on waves", ambient=(1.0, 1.0), mass=(0.24, 0.36), layers=2
    ),
    "thread": Style(
        look="threads and knots", lay="wave to wave", ambient=(0.0, 0.0), mass=(0.14, 0.24), layers=2
    ),
    "daisy": Style(
        look="flower heads", lay="circles", ambient=(0.0, 0.0), mass=(0.1, 0.17), layers=2, rules=_ORNAMENTAL
    ),
    "thesis": Style(
        look="the thesis's algorithm, (4.1) to (4.5), to the letter",
        ambient=(0.0, 0.0),
        filter_radius=0.0,
        rules=("reflect", "translate", "rotate"),
    ),
}


def styles_of(style: str | Sequence[str] | None, seed: int, layers: int | None, free: bool) -> list[str]:
    """Return the style of each layer: those given, or one for all that is drawn from the seed.

    Parameters
    ----------
    style : str, sequence of str or None
    seed : int
    layers : int or None
        By default as many as the style has, or as styles are given.
    free : bool
        False if sources and sinks may lie anywhere only, as a picture or the caller says where.

    Raises
    ------
    OptionError
        For an unknown name, or not one name for each layer.
    """
    if style is None:
        names = [
            name for name, each in STYLES.items() if name != "thesis" and (free or each.lay == "anywhere")
        ]
        style = str(np.random.default_rng([seed, _STYLE_STREAM]).choice(names))
    if isinstance(style, str):
        check_choice("style", style, tuple(STYLES))
        return [style] * (STYLES[style].layers if layers is None else layers)
    given = check_items("style", style, str, "a text, or one for each layer")
    for name in given:
        check_choice("style", name, tuple(STYLES))
    if not given or (layers is not None and len(given) != layers):
        raise OptionError(
            "{parameter} is given for {count} layers, the motif has {wanted}; give one, or one for each",
            kind="count",
            parameter=Term("style"),
            value=style,
            count=len(given),
            wanted=1 if layers is None else layers,
        )
    return list(given)


def draw_rule(styles: Sequence[str], seed: int, shape: tuple[int, int]) -> str:
    """Draw a rule of repetition that suits the first layer's style and the cell's shape."""
    fitting = []
    for rule in STYLES[styles[0]].rules:
        try:
            check_repeat(rule, shape)
        except OptionError:
            continue
        fitting.append(rule)
    return str(np.random.default_rng([seed, _RULE_STREAM]).choice(fitting))
