"""Errors about pictures that show nothing in common with the others, or too little to be placed exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.errors import OverlapError
from toposeam.layers.canvas.layer import Layer
from toposeam.layers.labelling.problem import Pair
from toposeam.layers.registration.features import Look
from toposeam.layers.registration.pair_matching import Match, Sightings, groups
from toposeam.sentence import counted

#: A picture of which more than so many px are open, one standard deviation at its corners, is refused where
#: places are to be exact: what is nearer is placed within half a pixel (benchmarks/placing.py).
LARGEST_DOUBT = 0.4
#: Fewer features are too few to look for an overlap.
_PLAIN = 8
#: So many pictures are named at most that show something else.
_NAMED = 8


def is_plain(look: Look) -> bool:
    """Test whether a picture shows too little detail to look for an overlap."""
    return len(look.keypoints) < _PLAIN


def strangers(
    pictures: Sequence[Layer], sightings: Sightings, correlation: float, least: float
) -> OverlapError:
    """Return the error about two pictures that show nothing in common; `correlation` is the best of their
    overlap, -1 where none was found.
    """
    plain = [picture.name for picture, look in zip(pictures, sightings.looks, strict=True) if is_plain(look)]
    if plain:
        why = f"{' and '.join(plain)} {'shows' if len(plain) == 1 else 'show'} too little detail"
    elif correlation > -1:
        why = f"the correlation of their overlap is {correlation:.2f}, {least:g} is needed"
    else:
        shared = counted(len(sightings.shared((0, 1))), "feature")
        why = f"they share {shared}, and too few of them agree on one overlap"
    return OverlapError(
        "{first} and {name} cannot be placed: {why}; say where they lie, or which points they share",
        kind="fits none",
        layers=(1,),
        first=pictures[0].name,
        name=pictures[1].name,
        why=why,
    )


def check_joined(
    pictures: Sequence[Layer],
    matches: Mapping[Pair, Match],
    best: Floats,
    least: float,
    shared: npt.NDArray[np.intp] | None = None,
) -> None:
    """Refuse pictures that are not joined to most of the others by pairs that agree. All are named, with the
    features that they share.
    """
    own = groups(len(pictures), matches)
    sizes = np.bincount(own)
    if len(sizes) == 1:
        return
    lost = [np.flatnonzero(own == group) for group in dict.fromkeys(own) if group != sizes.argmax()]
    alone = np.array([members[0] for members in lost if len(members) == 1], np.intp)
    others = [members for members in lost if len(members) > 1]
    told = []
    if len(alone):
        most = 0 if shared is None else int(shared[alone].max())
        if best[alone].max() > -1:
            close = f"the best correlation is {best[alone].max():.2f}, {least:g} is needed"
        elif most:
            share = _each(alone, "it shares", "they share")
            close = f"{share} {counted(most, 'feature')} at most, and too few agree"
        else:
            close = f"{_each(alone, 'it has', 'they have')} nothing in common"
        told.append(
            f"{named(pictures, alone)} {_each(alone, 'fits', 'fit')} none of the other pictures ({close})"
        )
    if others:
        shown = ", and ".join(named(pictures, members) for members in others)
        told.append(f"{shown} show something else than the other pictures")
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
        what=", and ".join(told),
        remedies="; ".join(remedies),
        **data,
    )


def check_exact(pictures: Sequence[Layer], doubts: Floats) -> None:
    """Refuse pictures whose corners are open by so many px, and name all of them, the worst first."""
    worst_first = np.argsort(-doubts, kind="stable")
    unsure = worst_first[doubts[worst_first] > LARGEST_DOUBT]
    if len(unsure):
        raise OverlapError(
            "{name} cannot be placed exactly: what {shared} with the others leaves "
            "{up_to}{off} px open; {remedy}, or say where the pictures lie",
            kind="inexact",
            layers=tuple(unsure.tolist()),
            name=named(pictures, unsure),
            shared=_each(unsure, "it shares", "they share"),
            up_to=_each(unsure, "", "up to "),
            off=f"{doubts.max():.1f}",
            remedy=_each(unsure, "leave it out", "let them overlap more"),
        )


def _each(indices: npt.NDArray[np.intp], one: str, several: str) -> str:
    return one if len(indices) == 1 else several


def named(pictures: Sequence[Layer], indices: npt.NDArray[np.intp]) -> str:
    """List some pictures by their names, a few of them."""
    names = [pictures[index].name for index in indices]
    if len(names) > _NAMED + 1:
        names[_NAMED:] = [f"{len(names) - _NAMED} more"]
    return names[0] if len(names) == 1 else f"{names[0]} and {', '.join(names[1:])}"
