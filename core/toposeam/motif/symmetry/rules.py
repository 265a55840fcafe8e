r"""Rules by which a motif repeats, with wallpaper groups as exact permutations of a cell's elements.

A wallpaper group acts on the points of a cell by x → A x + t, with A an integer matrix and t a multiple of
half the cell. On the cell's elements it is a permutation. If loads and design variables are constant along
its orbits, so are the temperatures. So the solution θ = Tθ' (thesis 4.8), with T the group's projection, is
the solution on the torus, and only the orbits must be computed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats
from toposeam.checks import check_choice
from toposeam.errors import OptionError, Term
from toposeam.heat.plate_joints import Joint, Shift
from toposeam.motif.symmetry.tiling import shift_of

#: One operation: ((a, b), (c, d)) takes (x, y) to (ax + by, cx + dy), then (t, u) half cells are added.
Operation = tuple[tuple[int, int], tuple[int, int], tuple[int, int]]

_TURN2: Operation = ((-1, 0), (0, -1), (0, 0))
_TURN4: Operation = ((0, -1), (1, 0), (0, 0))
_MIRROR_X: Operation = ((-1, 0), (0, 1), (0, 0))
_MIRROR_Y: Operation = ((1, 0), (0, -1), (0, 0))
_CENTRED: Operation = ((1, 0), (0, 1), (1, 1))
_GLIDE_DIAGONAL: Operation = ((-1, 0), (0, 1), (1, 1))

#: Generators of the groups on a rectangular or square cell, besides its translations.
GENERATORS: dict[str, tuple[Operation, ...]] = {
    "p1": (),
    "p2": (_TURN2,),
    "pm": (_MIRROR_X,),
    "pg": (((-1, 0), (0, 1), (0, 1)),),
    "cm": (_MIRROR_X, _CENTRED),
    "pmm": (_MIRROR_X, _MIRROR_Y),
    "pmg": (_TURN2, ((-1, 0), (0, 1), (1, 0))),
    "pgg": (_TURN2, _GLIDE_DIAGONAL),
    "cmm": (_MIRROR_X, _MIRROR_Y, _CENTRED),
    "p4": (_TURN4,),
    "p4m": (_TURN4, _MIRROR_X),
    "p4g": (_TURN4, _GLIDE_DIAGONAL),
}
_SQUARE = ("p4", "p4m", "p4g")

_TURN3: Operation = ((0, -1), (1, -1), (0, 0))
_TURN6: Operation = ((1, -1), (1, 0), (0, 0))
_SWAP: Operation = ((0, 1), (1, 0), (0, 0))
_CROSS: Operation = ((0, -1), (-1, 0), (0, 0))

#: Generators of the hexagonal groups, in coordinates along the lattice vectors (1, 0) and (-1/2, √3/2).
HEXAGONAL: dict[str, tuple[Operation, ...]] = {
    "p3": (_TURN3,),
    "p3m1": (_TURN3, _CROSS),
    "p31m": (_TURN3, _SWAP),
    "p6": (_TURN6,),
    "p6m": (_TURN6, _SWAP),
}

#: All rules by which a motif can repeat. ``drop`` and ``brick`` shift columns or rows by half a cell, or by
#: another share that follows the name: ``drop 1/3``.
REPEATS = ("none", "reflect", "translate", "rotate", "drop", "brick", *GENERATORS, *HEXAGONAL)


def check_repeat(repeat: str, shape: tuple[int, int]) -> None:
    """Refuse unknown rules, and sizes of cells on which a rule is no exact permutation.

    Raises
    ------
    OptionError
    """
    shift = shift_of(repeat) if isinstance(repeat, str) else None
    h, w = shape
    if shift is None:
        check_choice("repeat", repeat, REPEATS)
    elif shape[shift[0]] % shift[1].denominator:
        side, parts, name = shape[shift[0]], shift[1].denominator, ("height", "width")[shift[0]]
        raise OptionError(
            "{parameter} {value} needs a {side} that divides by {parts}, this one is {length}; use {size}",
            kind="size for rule",
            side=name,
            parts=parts,
            length=side,
            size=-(-side // parts) * parts,
            parameter=Term("repeat"),
            value=repeat,
        )
    if (repeat in _SQUARE or repeat in HEXAGONAL) and h != w:
        raise OptionError(
            "{parameter} {value} needs a square cell, this one is {height} × {width}; make both sides equal",
            kind="size for rule",
            height=h,
            width=w,
            parameter=Term("repeat"),
            value=repeat,
        )
    halves = [operation[2] for operation in GENERATORS.get(repeat, ())]
    odd = (any(t for t, _ in halves) and w % 2) or (any(u for _, u in halves) and h % 2)
    if odd or (repeat == "rotate" and (h % 2 or w % 2)):
        raise OptionError(
            "{parameter} {value} needs even sizes, this cell is {height} × {width}; use "
            "{even_height} × {size}",
            kind="odd size",
            height=h,
            width=w,
            even_height=h + h % 2,
            size=w + w % 2,
            parameter=Term("repeat"),
            value=repeat,
        )


def fits_twice(repeat: str) -> bool:
    """Test whether an even number of copies of a cell along each side repeats by the same rule as the cell.

    Odd numbers do for all rules. Of even ones, operations with half a cell's shift become others.
    """
    return repeat != "rotate" and not any(any(shift) for *_, shift in GENERATORS.get(repeat, ()))


def joint(repeat: str) -> Joint | Shift:
    """Return how the plate's borders are joined for a rule."""
    shift = shift_of(repeat)
    if shift is not None:
        return Shift(*shift)
    if repeat in ("none", "reflect"):
        return Joint.FREE
    return Joint.ROTATE if repeat == "rotate" else Joint.TRANSLATE


def operations(repeat: str) -> list[Operation]:
    """Return all operations of a group modulo the cell's translations, the identity first."""
    identity: Operation = ((1, 0), (0, 1), (0, 0))
    found = [identity]
    for known in found:  # `found` grows in the loop
        for generator in (*GENERATORS.get(repeat, ()), *HEXAGONAL.get(repeat, ())):
            product = _compose(generator, known)
            if product not in found:
                found.append(product)
    return found


def _compose(second: Operation, first: Operation) -> Operation:
    """Compose two operations: `first`, then `second`."""
    (a, b), (c, d), (t, u) = second
    (e, f), (g, h), (v, w) = first
    return (
        (a * e + b * g, a * f + b * h),
        (c * e + d * g, c * f + d * h),
        ((a * v + b * w + t) % 2, (c * v + d * w + u) % 2),
    )


def move_onto_axes(
    point: npt.NDArray[np.float64], repeat: str, rng: np.random.Generator
) -> npt.NDArray[np.float64]:
    """Move a place, (x, y) in [0, 1], to a mirror or a centre of rotation of the rule, chosen at random.

    Strokes stop short of mirrors without sources or sinks, which would leave empty lines in the pattern.
    Centres on the cell's border are not used, as the thickest strokes would lie there.
    """
    if repeat == "reflect":
        moved = point.copy()
        axis = int(rng.integers(2))
        moved[axis] = np.round(point[axis])
        return moved
    group = operations(repeat)[1:]
    if not group:
        return point
    (a, b), (c, d), (t, u) = group[int(rng.integers(len(group)))]
    matrix, shift = np.array([[a, b], [c, d]], float), np.array([t, u]) / 2
    shift = shift - np.round(matrix @ point + shift - point)  # the copy nearest to the point
    # The mean over the powers of an operation, whose order divides 12, is its fixed point. Translations and
    # glides have none.
    images = [point]
    for _ in range(11):
        images.append(matrix @ images[-1] + shift)
    mean = np.mean(images, axis=0)
    if not np.allclose(matrix @ mean + shift, mean, atol=1e-9):
        return point
    turns = a * d - b * c == 1
    on_border = np.any(np.abs(mean - np.round(mean)) < 1e-9)
    return point if turns and on_border else mean % 1.0


def permutation(
    operation: Operation, shape: tuple[int, int], hexagonal: bool = False
) -> npt.NDArray[np.intp]:
    """Compute the permutation of a cell's elements by an operation, as (h, w) flat indices.

    On a hexagonal lattice nodes take the place of elements.
    """
    h, w = shape
    (a, b), (c, d), (t, u) = operation
    y, x = np.ogrid[:h, :w]
    if hexagonal:
        node: npt.NDArray[np.intp] = (c * x + d * y) % h * w + (a * x + b * y) % w
        return node
    # Doubled coordinates, so that centres and half cells are whole numbers.
    x2, y2 = 2 * x + 1, 2 * y + 1
    to_x, to_y = (a * x2 + b * y2 + t * w) % (2 * w), (c * x2 + d * y2 + u * h) % (2 * h)
    place: npt.NDArray[np.intp] = (to_y // 2) * w + to_x // 2
    return place


@dataclass(frozen=True, eq=False)
class Symmetry:
    """The orbits of a rule on a cell's elements."""

    shape: tuple[int, int]
    #: (h * w,) ints, number of the orbit of every element; None if every element is an orbit of its own.
    orbit: npt.NDArray[np.intp] | None
    #: Number of elements of every orbit.
    count: npt.NDArray[np.float64]

    def mean(self, field: Floats) -> Floats:
        """Average a field over every orbit; the result is exactly constant along orbits."""
        if self.orbit is None:
            return field
        return self.spread(self.total(field) / self.count)

    def total(self, field: Floats) -> Floats:
        """Sum a field over every orbit."""
        if self.orbit is None:
            return field.ravel()
        return np.bincount(self.orbit, field.ravel(), len(self.count)).astype(np.float64, copy=False)

    def largest(self, field: Floats) -> Floats:
        """Return the maximum of a field over every orbit."""
        if self.orbit is None:
            return field
        most = np.full(len(self.count), -np.inf)
        np.maximum.at(most, self.orbit, field.ravel())
        return self.spread(most)

    def spread(self, values: Floats) -> Floats:
        """Return an (h, w) field from one value per orbit."""
        return (values if self.orbit is None else values[self.orbit]).reshape(self.shape)


@lru_cache(maxsize=16)
def symmetry(repeat: str, shape: tuple[int, int]) -> Symmetry:
    """Compute the orbits of a rule on a cell."""
    group = operations(repeat)
    if len(group) == 1:
        return Symmetry(shape, None, np.ones(shape[0] * shape[1]))
    hexagonal = repeat in HEXAGONAL
    leader = permutation(group[0], shape, hexagonal)
    for operation in group[1:]:
        np.minimum(leader, permutation(operation, shape, hexagonal), out=leader)
    flat = leader.ravel()
    first = np.flatnonzero(flat == np.arange(len(flat)))
    number = np.zeros(len(flat), np.intp)
    number[first] = np.arange(len(first))
    orbit = number[flat]
    return Symmetry(shape, orbit, np.bincount(orbit).astype(np.float64))
