"""The cases of guard.py, each with what is timed and the figures its result is judged by; see there.

Nothing but the public names of ``toposeam`` is used, so that any checkout can be judged. Figures are computed
here from the pictures and the result, except for the law "natural" and motifs, whose own figures count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from seam_pairs import ell, islands, pair, ring

Array = npt.NDArray[Any]
Figures = dict[str, float]
#: What is timed, and what judges its result.
Prepared = tuple[Callable[[], Any], Callable[[Any], Figures]]


@dataclass(frozen=True)
class Case:
    """One case of a room; `prepare` makes its pictures, which is not timed."""

    name: str
    prepare: Callable[[], Prepared]


def match_cost(law: str) -> Any:
    """The match cost by name, the same whatever the defaults are."""
    return ts.seam.MatchCost(law=law)


def interfaces(a: Array, b: Array, on_a: Array, on_b: Array, law: str) -> Iterator[Array]:
    """M of the laws "gradient" (2.4) and "colour" (3.22) across each axis, of the interface of every voxel
    with the next one; 0 where neither has both pictures.

    Parameters
    ----------
    a, b : (…, C) arrays on one canvas of any number of axes, 0 to 1
    on_a, on_b : (…) bool arrays
        Where each has pixels.
    """
    shared = on_a & on_b
    difference = np.where(shared, np.sqrt(np.square(a - b).sum(axis=-1)), 0)
    for axis in range(shared.ndim):
        steep = np.zeros(shared.shape)
        for image, on in ((a, on_a), (b, on_b)) if law == "gradient" else ():
            lines, present = np.moveaxis(image, axis, 0), np.moveaxis(on, axis, 0)
            step = np.diff(lines, axis=0) * (present[1:] & present[:-1])[..., np.newaxis]
            none = np.zeros_like(lines[:1])
            slope = np.concatenate([step, none]) + np.concatenate([none, step])
            steep += np.moveaxis(np.sqrt(np.square(slope).sum(axis=-1)) / 2, 0, axis)
        known, above, below = (np.moveaxis(one, axis, 0) for one in (shared, difference, steep * shared))
        twice = np.where(known[1:] & known[:-1], 1, 2)  # where only one of the two pixels is known
        cost = twice * (above[1:] + above[:-1])
        if law == "gradient":
            cost /= twice * (below[1:] + below[:-1]) + 0.02
        yield np.moveaxis(np.where(known[1:] | known[:-1], cost + 1e-3, 0), 0, axis)


def seam_cost(
    a: Array, b: Array, labels: Array, on_a: Array | None = None, on_b: Array | None = None, *, law: str
) -> float:
    """Σ M over what (…) bool labels cut; infinite where they show what is not there."""
    on_a, on_b = (np.ones(labels.shape, bool) if on is None else on for on in (on_a, on_b))
    if (labels & on_a & ~on_b).any() or (~labels & on_b & ~on_a).any():
        return float("inf")
    costs = interfaces(as_float(a, labels.ndim), as_float(b, labels.ndim), on_a, on_b, law)
    return sum(float(cost[np.diff(labels, axis=axis)].sum()) for axis, cost in enumerate(costs))


def pile_cost(layers: Sequence[Any], stitched: Any) -> float:
    """Σ M of the law "gradient" over all pairs of layers, which are opaque rectangles of one kind."""
    shows = np.asarray(stitched.label_map)
    left, top = stitched.origin
    places = [(layer.at[1] - top, layer.at[0] - left, *layer.image.shape[:2]) for layer in layers]
    covered = np.zeros(shows.shape, bool)
    for number, (y, x, h, w) in enumerate(places):
        covered[y : y + h, x : x + w] = True
        if (shows == number).sum() != (shows[y : y + h, x : x + w] == number).sum():
            return float("inf")
    if ((shows >= 0) != covered).any():
        return float("inf")
    total = 0.0
    for j, second in enumerate(places):
        for i, first in enumerate(places[:j]):
            low = [max(first[axis], second[axis]) for axis in (0, 1)]
            high = [min(one[axis] + one[axis + 2] for one in (first, second)) for axis in (0, 1)]
            if low[0] >= high[0] or low[1] >= high[1]:
                continue
            # Steps and neighbours one pixel beyond what both cover count.
            box = tuple(
                slice(max(start - 2, 0), min(stop + 2, length))
                for start, stop, length in zip(low, high, shows.shape, strict=True)
            )
            (a, on_a), (b, on_b) = (on_box(layers[k].image, places[k], box) for k in (i, j))
            part = shows[box]
            for axis, cost in enumerate(interfaces(a, b, on_a, on_b, "gradient")):
                line = np.moveaxis(part, axis, 0)
                low_label, high_label = np.minimum(line[1:], line[:-1]), np.maximum(line[1:], line[:-1])
                total += float(np.moveaxis(cost, axis, 0)[(low_label == i) & (high_label == j)].sum())
    return total


def on_box(image: Array, place: tuple[int, ...], box: tuple[slice, ...]) -> tuple[Array, Array]:
    """A layer's pixels on a box of the canvas, and where it has any."""
    on = np.zeros([side.stop - side.start for side in box], bool)
    canvas = np.zeros((*on.shape, *image.shape[2:]))
    ours, theirs = [], []
    for side, start, length in zip(box, place, image.shape, strict=False):
        first, last = max(side.start, start), min(side.stop, start + length)
        ours.append(slice(first - side.start, last - side.start))
        theirs.append(slice(first - start, last - start))
    on[tuple(ours)] = True
    canvas[tuple(ours)] = image[tuple(theirs)] / 255
    return canvas if canvas.ndim == 3 else canvas[..., np.newaxis], on


def as_float(image: Array, axes: int) -> Array:
    """(…, C) from 0 to 1."""
    whole = image / 255 if image.dtype == np.uint8 else image.astype(float)
    return whole if whole.ndim > axes else whole[..., np.newaxis]


def seams() -> Iterator[Case]:
    """200: 120 strips, 20 by the thesis's method, and 20 each of Ls, rings and pairs of islands."""
    lengths = (60, 80, 120, 160, 240, 320, 640)
    for index in range(120):
        yield seam_case("strip", index, lengths[index % len(lengths)])
    for index in range(20):
        yield seam_case("thesis", index, lengths[index % 4])
    for index in range(60):
        yield seam_case(("L", "ring", "islands")[index // 20], index % 20, 60 + 20 * (index % 20))


def seam_case(kind: str, index: int, length: int) -> Case:
    law = "natural" if index % 4 == 3 and kind != "thesis" else "gradient"
    method: dict[str, Any] = {"method": "thesis"} if kind == "thesis" else {}

    def prepare() -> Prepared:
        masks: tuple[Array | None, Array | None] = None, None
        shape, side = (length, length // 4), {}
        if kind in ("strip", "thesis"):
            side = {"side": "bottom" if index % 2 else "right"}
        else:
            made = {"L": ell, "ring": ring, "islands": islands}[kind]
            masks = made(length, max(length // 8, 10)) if kind != "islands" else islands(length)
            shape = masks[0].shape
        a, b = pair(*shape, index, 7)
        if index % 2 and side:
            a, b = (np.ascontiguousarray(image.swapaxes(0, 1)) for image in (a, b))

        def run() -> Any:
            return ts.find_seam(a, b, *masks, cost=match_cost(law), **method, **side)

        def judge(seam: Any) -> Figures:
            labels = np.asarray(seam.labels)
            if side:
                line = labels if side["side"] == "right" else labels.T
                if line[:, 0].any() or not line[:, -1].all():
                    return {"cost": float("inf")}
            cost = seam_cost(a, b, labels, *masks, law="gradient")
            return {"cost": cost if law == "gradient" or np.isinf(cost) else float(seam.cost)}

        return run, judge

    return Case(f"{kind} {length} px {index}, {law}", prepare)


def small_piles() -> Iterator[Case]:
    """100 of stitching.py, every fifth by the law "natural"."""
    from stitching import make_set

    for index in range(100):
        law = "natural" if index % 5 == 4 else "gradient"
        yield pile_case(f"crops {index}", law, partial(lambda index: make_set(index, 4)[1], index))


def large_piles() -> Iterator[Case]:
    """The first twelve of seam_costs.py, every fourth by the law "natural"."""
    from piles import large_pile

    for index in range(12):
        law = "natural" if index % 4 == 3 else "gradient"
        yield pile_case(f"large {index}", law, partial(lambda index: large_pile(index, 4)[1], index))


def frames() -> Iterator[Case]:
    """30 frames that overlap by 60 %, with cores and without."""
    from piles import frames

    yield pile_case("frames", "gradient", partial(frames, 4))
    yield pile_case("frames with cores", "gradient", partial(frames, 4), core=0.5)


def pile_case(name: str, law: str, make: Callable[[], list[Any]], **options: Any) -> Case:
    def prepare() -> Prepared:
        layers = make()

        def run() -> Any:
            return ts.stitch(layers, cost=match_cost(law), **options)

        def judge(stitched: Any) -> Figures:
            cost = pile_cost(layers, stitched)
            return {"cost": cost if law == "gradient" or np.isinf(cost) else float(stitched.cost)}

        return run, judge

    return Case(f"{name}, {law}", prepare)


def volumes() -> Iterator[Case]:
    """40 of surfaces.py, half of them by the law "gradient" and half by "colour"."""
    from volumes import carried, drawn

    for kind, found in drawn(40):
        for number, (shape, masks, gradient, seed) in enumerate(found):
            law = "gradient" if gradient else "colour"

            def prepare(shape: Any = shape, masks: Any = masks, law: str = law, seed: int = seed) -> Prepared:
                a, b = carried(*shape, np.random.default_rng(seed), 2 * shape[0])
                axis = {"axis": 0} if masks[0] is None and masks[1] is None else {}

                def run() -> Any:
                    return ts.find_surface(a, b, *masks, cost=match_cost(law), **axis)

                def judge(surface: Any) -> Figures:
                    labels = np.asarray(surface.labels)
                    if axis and (labels[0].any() or not labels[-1].all()):
                        return {"cost": float("inf")}
                    return {"cost": seam_cost(a, b, labels, *masks, law=law)}

                return run, judge

            yield Case(f"{kind} {number}, {law}", prepare)


def textures() -> Iterator[Case]:
    """The 20 of texture_samples.py grown to 384 × 384 px, every other one so that it repeats."""
    from texture_samples import MAKERS

    for number, name in enumerate(MAKERS):

        def prepare(name: str = name, tileable: Any = ("none", "both")[number % 2]) -> Prepared:
            made = MAKERS[name]()
            sample = np.ascontiguousarray(made[0] if isinstance(made, tuple) else made)

            def run() -> Any:
                return ts.synthesize(sample, (384, 384), seed=1, tileable=tileable)

            def judge(grown: Any) -> Figures:
                source = np.asarray(grown.source)
                shown = np.bincount(source[..., 0].ravel() * sample.shape[1] + source[..., 1].ravel())
                return {
                    "steps": excess(grown.image, sample, np.ones(sample.shape[:2], bool), source),
                    "repeats": float(np.square(shown).sum() / shown.sum()),
                }

            return run, judge

        yield Case(name, prepare)


def holes() -> Iterator[Case]:
    """The twelve photographs of texture_fill.py."""
    from texture_fill import photographs

    for name in photographs():

        def prepare(name: str = name) -> Prepared:
            image, hole = photographs()[name]

            def run() -> Any:
                return ts.fill(image, hole)

            def judge(filled: Any) -> Figures:
                source = np.asarray(filled.source)
                if hole[source[..., 0], source[..., 1]].any():
                    return {"steps": float("inf")}
                share = hole.size / np.count_nonzero(hole)
                return {"steps": float(share * excess(filled.image, image, ~hole, source))}

            return run, judge

        yield Case(name, prepare)


def excess(image: Array, sample: Array, usable: Array, source: Array) -> float:
    """By how much steps between copies differ from those that the sample has there, per pixel.

    Of two neighbours whose sources are none, the step in the picture is compared with the step from the one's
    source to what lies beside it in the sample, and likewise from the other's: the mean of both, as far as
    they are known, over the channels, in 8-bit levels; summed over all such neighbours.
    """
    picture, given = image.astype(float), sample.astype(float)
    if picture.ndim == 2:
        picture, given = picture[..., np.newaxis], given[..., np.newaxis]
    total = 0.0
    for axis in (0, 1):
        one, other = np.moveaxis(source, axis, 0)[:-1], np.moveaxis(source, axis, 0)[1:]
        along = np.eye(2, dtype=source.dtype)[axis]
        apart = (other - one != along).any(axis=-1)
        step = np.diff(np.moveaxis(picture, axis, 0), axis=0)[apart]
        wrong, known = np.zeros(len(step)), np.zeros(len(step))
        for low, high in ((one[apart], one[apart] + along), (other[apart] - along, other[apart])):
            inside = ((low >= 0) & (high < usable.shape)).all(axis=-1)
            p, q = (tuple(np.where(inside[:, np.newaxis], end, 0).T) for end in (low, high))
            inside &= usable[p] & usable[q]
            wrong += inside * np.abs(step - (given[q] - given[p])).mean(axis=-1)
            known += inside
        total += float((wrong / np.maximum(known, 1)).sum())
    return total / (picture.shape[0] * picture.shape[1])


#: Rules of repetition of the motifs.
REPEATS = (
    *("none", "reflect", "translate", "rotate", "p1", "p2", "pm", "pg", "pmm", "pmg"),
    *("pgg", "cmm", "p4", "p4m", "p4g", "p3", "p3m1", "p31m", "p6", "p6m"),
)


def motifs() -> Iterator[Case]:
    """20 motifs of two layers, by one rule of repetition after the other."""
    for number, repeat in enumerate(REPEATS):

        def prepare(number: int = number, repeat: str = repeat) -> Prepared:
            def run() -> Any:
                return ts.motif((64, 96)[number % 2], repeat=repeat, layers=2, seed=number)

            def judge(motif: Any) -> Figures:
                total = 0.0
                for recipe, steps in zip(motif.recipe.layers, motif.history, strict=True):
                    total += steps[-1].compliance * max(1.0, steps[-1].mass / recipe.mass)
                return {"compliance": total}

            return run, judge

        yield Case(repeat, prepare)


#: Of the samples.
PHOTOGRAPHS = (("coffee_a.jpg", "coffee_b.jpg", "coffee_c.jpg"), ("portrait_left.jpg", "portrait_right.jpg"))


def stitches() -> Iterator[Case]:
    """Two stitches of photographs, all of it: places, warps, tones, seams, bands, pixels."""
    from PIL import Image

    samples = Path(__file__).parents[1] / "samples"
    for files in PHOTOGRAPHS:

        def prepare(files: tuple[str, ...] = files) -> Prepared:
            layers = [ts.Layer(np.asarray(Image.open(samples / file)), name=file) for file in files]

            def run() -> Any:
                found = ts.find_places(layers)
                composed = ts.stitch(found.layers, match_shading=True, blend="multiband", wrap=found.wrap)
                return composed, composed.image

            def judge(joined: Any) -> Figures:
                return {"cost": joined[0].cost}

            return run, judge

        yield Case(files[0], prepare)


ROOMS: dict[str, Callable[[], Iterator[Case]]] = {
    "seams": seams,
    "small piles": small_piles,
    "large piles": large_piles,
    "frames": frames,
    "volumes": volumes,
    "textures": textures,
    "holes": holes,
    "motifs": motifs,
    "photographs": stitches,
}
