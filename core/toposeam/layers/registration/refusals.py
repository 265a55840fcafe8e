"""Errors about pictures that show nothing in common with the others, contradict them, or are not placed
exactly.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from toposeam.arrays import Floats, Indices
from toposeam.errors import OverlapError
from toposeam.layers.canvas.canvas import groups
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.labelling.label_map import Pair
from toposeam.layers.registration.features import FeatureSet
from toposeam.layers.registration.homography import LEAST_INLIERS
from toposeam.layers.registration.pair_matching import Match, PairMatcher, at_one_place
from toposeam.layers.registration.placement import NAMED, named_few
from toposeam.sentence import counted

#: Largest standard deviation of a picture's corners, px, where places are to be exact: what is below is
#: placed within half a pixel (benchmarks/placing.py).
LARGEST_UNCERTAINTY = 0.4


def is_plain(features: FeatureSet) -> bool:
    """Test whether a picture shows too little detail to look for an overlap."""
    return len(features.keypoints) < LEAST_INLIERS


#: What unrelated pictures share.
OVERLAID = "what lies at the same place in both, as a frame, a tool bar, a menu or a logo: crop it off"


def is_overlaid(a: FeatureSet, b: FeatureSet, shared: Indices) -> bool:
    """Test whether most features that two pictures share lie at the same place in both."""
    fixed = at_one_place(a, b, shared)
    return bool(fixed.sum() >= LEAST_INLIERS and 2 * fixed.sum() > len(fixed))


def strangers(matcher: PairMatcher, correlation: float, least: float) -> OverlapError:
    """Return the error about two pictures that show nothing in common; `correlation` is the best of their
    overlap, -1 where none was found.
    """
    names = matcher.names
    plain = [name for name, features in zip(names, matcher.features, strict=True) if is_plain(features)]
    if plain:
        why = f"{' and '.join(plain)} {'shows' if len(plain) == 1 else 'show'} too little detail"
    elif is_overlaid(matcher.features[0], matcher.features[1], matcher.shared((0, 1))):
        why = f"they share only {OVERLAID}"
    elif correlation > -1:
        why = f"the correlation of their overlap is {correlation:.2f}, {least:g} is needed"
    else:
        shared = counted(len(matcher.shared((0, 1))), "feature")
        why = f"they share {shared}, and too few of them agree on one overlap"
    return OverlapError(
        "{first} and {name} cannot be placed: {why}; say where they lie, or which points they share",
        kind="fits none",
        layers=(1,),
        first=names[0],
        name=names[1],
        why=why,
    )


def ambiguous(names: Sequence[str], elsewhere: Sequence[Pair], most: float) -> OverlapError:
    """Return the error about pairs that match elsewhere, up to `most` px off."""
    return OverlapError(
        "{names} match where the other pictures do not place them, up to {off} px off, "
        "and too little else shows which is right: what repeats itself matches in several"
        " places; leave such pictures out, or say where the pictures lie",
        kind="ambiguous",
        names=named_pairs(names, elsewhere),
        off=f"{most:.0f}",
        layers=_pictures_of(elsewhere),
    )


def misfit(names: Sequence[str], wrong: Sequence[Pair], most: float) -> OverlapError:
    """Return the error about pairs that do not fit, up to `most` px off."""
    return OverlapError(
        "{names} do not fit where the other pictures place them: up to {off} px are left "
        "between them; a lens or perspective is not undone here: align them with Hugin "
        "(pto_gen, cpfind, autooptimiser, nona), and join its pictures with toposeam "
        "enblend",
        kind="misfit",
        names=named_pairs(names, wrong),
        off=f"{most:.1f}",
        layers=_pictures_of(wrong),
    )


def _pictures_of(pairs: Collection[Pair]) -> tuple[int, ...]:
    """Return the numbers of the pictures of some pairs."""
    return tuple(sorted({index for pair in pairs for index in pair}))


def named_pairs(names: Sequence[str], pairs: Sequence[Pair]) -> str:
    """Name pairs by their pictures, a few of them."""
    named = [f"{names[i]} and {names[j]}" for i, j in pairs]
    if len(named) > NAMED:
        named[NAMED - 1 :] = [f"{len(named) - NAMED + 1} more pairs"]
    return ", ".join(named)


def check_joined(
    pictures: Sequence[Layer],
    matches: Mapping[Pair, Match],
    best: Floats,
    least: float,
    shared: Indices | None = None,
) -> None:
    """Refuse pictures that pairs do not join to most of the others.

    Parameters
    ----------
    pictures : sequence of Layer
    matches : mapping from (int, int) to Match
    best : (N,) array
        Best correlation of each picture.
    least : float
        Least correlation of a match.
    shared : (N,) int array, optional
        Features that each shares with the one that it shares most with.

    Raises
    ------
    OverlapError
        It names all of them, with the features that they share.
    """
    own = groups(len(pictures), matches)
    sizes = np.bincount(own)
    if len(sizes) == 1:
        return
    lost = [np.flatnonzero(own == group) for group in dict.fromkeys(own) if group != sizes.argmax()]
    alone = np.array([members[0] for members in lost if len(members) == 1], np.intp)
    others = [members for members in lost if len(members) > 1]
    findings = []
    if len(alone):
        most = 0 if shared is None else int(shared[alone].max())
        if best[alone].max() > -1:
            close = f"the best correlation is {best[alone].max():.2f}, {least:g} is needed"
        elif most:
            share = _each(alone, "it shares", "they share")
            close = f"{share} {counted(most, 'feature')} at most, and too few agree"
        else:
            close = f"{_each(alone, 'it has', 'they have')} nothing in common"
        findings.append(
            f"{named(pictures, alone)} {_each(alone, 'fits', 'fit')} none of the other pictures ({close})"
        )
    if others:
        shown = ", and ".join(named(pictures, members) for members in others)
        findings.append(f"{shown} show something else than the other pictures")
    remedies = []
    if len(alone):
        remedies.append(f"leave {_each(alone, 'it', 'them')} out, or say where the pictures lie")
    if others:
        remedies.append(f"join the {'two' if len(others) == 1 else len(others) + 1} groups apart")
    members = np.concatenate(lost).tolist()
    if len(alone) == 1:
        kind, data = "fits none", {"name": pictures[alone[0]].name}
    elif len(alone):
        kind, data = "fit none", {"names": named(pictures, alone)}
    else:
        kind, data = "apart in groups", {"name": pictures[members[0]].name}
        data["others"] = named(pictures, np.array(members[1:]))
    raise OverlapError(
        "{what}; {remedies}",
        kind=kind,
        layers=tuple(sorted(members)),
        what=", and ".join(findings),
        remedies="; ".join(remedies),
        **data,
    )


def check_exact(pictures: Sequence[Layer], uncertainties: Floats) -> None:
    """Refuse pictures whose corners are too uncertain; the error names all of them, the worst first.

    `uncertainties` has one standard deviation of each picture's corners, px.
    """
    worst_first = np.argsort(-uncertainties, kind="stable")
    unsure = worst_first[uncertainties[worst_first] > LARGEST_UNCERTAINTY]
    if len(unsure):
        raise OverlapError(
            "{name} cannot be placed exactly: what {shared} with the others leaves "
            "{up_to}{off} px open; {remedy}, or say where the pictures lie",
            kind="inexact",
            layers=tuple(unsure.tolist()),
            name=named(pictures, unsure),
            shared=_each(unsure, "it shares", "they share"),
            up_to=_each(unsure, "", "up to "),
            off=f"{uncertainties.max():.1f}",
            remedy=_each(unsure, "leave it out", "let them overlap more"),
        )


def _each(indices: Indices, one: str, several: str) -> str:
    return one if len(indices) == 1 else several


def named(pictures: Sequence[Layer], indices: Indices) -> str:
    """Name some pictures, a few of them."""
    return named_few([pictures[index].name for index in indices])
