"""Settings of patches: a few small textures are laid, judged, and the best one's setting is taken.

No one setting does for all textures. Small patches that have to show all of the sample cut what is large or
ordered; large ones that fit best repeat what is small. What decides is the number of visible joints, against
the steps that the sample has itself, and how much of the sample shows: less than random pixels would show
counts against a texture, and so does that only what fits best is taken, unless the sample repeats itself
anyway. Where there are objects on a ground, joints within them count as well.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from toposeam.arrays import Floats32, Mask
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.progress import Report, stage
from toposeam.texture.canvas.visible_joints import FEW, JointSteps, JointVerdict, busyness
from toposeam.texture.exemplar.landmarks import find_landmarks
from toposeam.texture.exemplar.patch_search import reduced, whole
from toposeam.texture.exemplar.scale import SMALLEST_PATCH, autocorrelation
from toposeam.texture.exemplar.sources import Sources
from toposeam.texture.material import Material, lay
from toposeam.texture.periodicity.period import Order
from toposeam.texture.placement.request import TextureRequest

#: In the order in which they are tried: coarse patches are few.
SettingName = Literal["coarse", "coarse-mixed", "fine", "fine-mixed", "varied"]


class PatchSetting(NamedTuple):
    """How large patches are, and how they are chosen."""

    #: Whether patches are about half as large as the sample, not a few elements.
    coarse: bool
    #: See :func:`toposeam.synth`.
    variation: float


#: Of each name.
SETTINGS: dict[SettingName, PatchSetting] = {
    "coarse": PatchSetting(True, 0.0),
    "coarse-mixed": PatchSetting(True, 0.25),
    "fine": PatchSetting(False, 0.0),
    "fine-mixed": PatchSetting(False, 0.25),
    "varied": PatchSetting(False, 0.5),
}
#: Side, px, to which samples are reduced for the trial, about, and of the textures that are laid.
_SIDE = 192
#: Share of the work at which a texture is given up, and how much dearer than the best it is then, as the
#: natural logarithm of its joints.
_HALF_WAY, _HOPELESS = 0.5, 0.5
#: Of the part of the sample that as many random pixels would show, this share should show. Cost of each
#: further share of the sample that does not, in the unit of the logarithm of joints.
_SHOWN, _UNSHOWN_COST = 0.85, 5.0
#: What it costs that only what fits best is taken.
_REPEATING = 0.5
#: By how much a texture that keeps an order may cost more than one that does not; and how many times as large
#: a second one of either is, as patches get out of step the more, the further they are laid.
_DOUBT, _LARGER = 0.1, 1.5
#: Largest likeness of the sample with itself far away at which repeating it is a fault, and what is far, as a
#: share of its shorter side.
_ORDERED, _FAR = 0.5, 0.15


class Tried(NamedTuple):
    """A setting that was tried, and what came of it; no verdict where it was given up."""

    name: SettingName
    verdict: JointVerdict | None
    cost: float


class _HopelessError(Exception):
    """A texture is worse than another one already."""


def try_settings(
    material: Material,
    others: Sequence[Order | None],
    seen: Floats32,
    patches: Sequence[tuple[int, int]],
    request: TextureRequest,
    size: tuple[int, int],
    progress: Report | None = None,
    *,
    varied: bool = False,
) -> tuple[list[Tried], Order | None]:
    """Lay a small texture with each setting, at reduced size where the samples are large; and with the best
    of them those that keep other orders.

    Parameters
    ----------
    material : Material
    others : sequence of Order or None
        Orders that patches may keep step with instead of the material's.
    seen : (AH, AW, C) float32 array
        Colours of the samples on their atlas, in shares of white.
    patches : sequence of (int, int)
        Side and overlap, px, of fine patches, and of coarse ones where these are larger.
    request : TextureRequest
        Of all settings, but for what a variation stands for.
    size : (int, int)
        Height and width of the texture that is wanted, px.
    progress : callable, optional
    varied : bool
        Whether settings that take only what fits best, and repeat it, are left out.

    Returns
    -------
    list of Tried
        The best one first; empty where holes leave no room at reduced size.
    Order or None
        The one that patches had better keep step with.
    """
    shorter = int(material.atlas.shapes.min())
    factor = max(1, round(shorter / _SIDE))
    context = -(-request.options.context // factor)
    small, seen = _reduced(material, seen, factor, context)
    side = max(shorter // factor, min(_SIDE, 2 * shorter // factor))
    shape, larger = (
        (min(-(-size[0] // factor), length), min(-(-size[1] // factor), length))
        for length in (side, round(_LARGER * side))
    )
    judge = _Judge(small, seen)
    names = [
        name
        for name, (coarse, variation) in SETTINGS.items()
        if len(patches) > coarse and (variation or not varied)
    ]
    part = 1 / (len(names) + 1)

    def attempt(
        name: SettingName,
        material: Material,
        shape: tuple[int, int],
        best: float,
        report: Report | None,
    ) -> Tried | None:
        patch, overlap = (max(length // factor, 2) for length in patches[SETTINGS[name].coarse])
        patch = max(patch, SMALLEST_PATCH)
        if not whole(small.atlas.copied, (min(patch, shape[0]), min(patch, shape[1]))).any():
            return None
        options = request.varied(SETTINGS[name].variation).options
        options = dataclasses.replace(options, context=context)
        placer = material.placer(shape, (False, False), options, request.rng)
        # Where there are objects, those that are cut are made whole in the end.
        watching = judge.watching(placer.canvas, best) if placer.guard is None else None
        try:
            lay(placer, patch, overlap, progress=report, shown=watching)
        except _HopelessError:
            return Tried(name, None, math.inf)
        verdict = judge.verdict(placer.canvas)
        repeats = SETTINGS[name].variation == 0
        return Tried(name, verdict, judge.cost(verdict, placer.canvas.index.size, repeats=repeats))

    tried: list[Tried] = []
    for number, name in enumerate(names):
        best_cost = min((each.cost for each in tried), default=math.inf)
        one = attempt(name, small, shape, best_cost, stage(progress, number * part, part))
        tried += [] if one is None else [one]
    tried.sort(key=lambda one: one.cost)
    if not tried:
        return tried, material.order
    order, least = material.order, math.inf
    orders = (order, *others) if others else ()
    for number, other in enumerate(orders):
        kept = dataclasses.replace(small, order=None if other is None else other.scaled(factor))
        report = stage(progress, 1 - part * (1 - number / len(orders)), part / len(orders))
        again = [
            attempt(tried[0].name, kept, extent, math.inf, stage(report, k / 2, 0.5))
            for k, extent in enumerate((shape, larger))
        ]
        cost = sum(math.inf if one is None else one.cost for one in again) + 2 * _DOUBT * (other is None)
        if cost < least:
            order, least = other, cost
    return tried, order


def colours(sources: Sources, white: float, *, levelled: bool) -> list[Floats32]:
    """Compute the colours of exemplars, (H, W, C) each, in shares of white; without slow light where that is
    levelled, which features have lost.
    """
    if levelled and sources.own_features:
        scale = np.float32(1 / np.sqrt(sources.compared[0][1]))
        return [scale * values[..., : sources.own_features] for values in sources.features]
    return [image.astype(np.float32) / np.float32(white) for image in sources.planes[0]]


def _reduced(material: Material, seen: Floats32, factor: int, context: int) -> tuple[Material, Floats32]:
    """Reduce samples and their colours by a factor."""
    small = material.reduced(factor, context)
    if factor == 1:
        return material, seen
    planes = [
        reduced(seen[place], material.atlas.usable[place].astype(np.float32), factor)[0]
        for place in material.atlas.places
    ]
    return small, small.atlas.spread(planes)


class _Judge:
    """What textures of one sample cost."""

    def __init__(self, material: Material, seen: Floats32) -> None:
        self._atlas, self._seen = material.atlas, seen
        self._busy = busyness(seen, self._atlas.usable)
        place = max(self._atlas.places, key=lambda one: seen[one].size)
        self._order = _order(seen[place].mean(axis=2, keepdims=True), self._atlas.usable[place])
        guard = find_landmarks(material.features, self._atlas.copied, self._atlas.factor).guard
        self._objects = None if guard is None else guard.reshape(seen.shape[:2]) > 0

    def verdict(self, canvas: IndexCanvas) -> JointVerdict:
        """Judge what has been laid."""
        steps = JointSteps(canvas.index, self._atlas, canvas.wrap)
        steps.add_all(self._seen, 1.0)
        laid = int(np.count_nonzero(canvas.index >= 0))
        return steps.verdict(self._busy, laid, canvas.shown(self._atlas.copied), objects=self._objects)

    def cost(self, verdict: JointVerdict, laid: int, *, repeats: bool) -> float:
        """Weigh joints and what of the sample does not show, given the number of pixels laid, and whether
        only what fits best is taken, which repeats the more, the larger a texture is.
        """
        expected = _SHOWN * (1 - math.exp(-laid / np.count_nonzero(self._atlas.copied)))
        missing = max(0.0, expected - (verdict.shown or 0.0))
        faults = _UNSHOWN_COST * missing + _REPEATING * repeats
        return _joint_cost(verdict) + faults * max(0.0, 1 - self._order / _ORDERED)

    def watching(self, canvas: IndexCanvas, best: float) -> Report:
        """Make a report that gives a texture up, half-way, if it has many more joints than the best."""

        def watch(share: float) -> None:
            nonlocal best
            if share >= _HALF_WAY and best < math.inf:
                if _joint_cost(self.verdict(canvas)) > best + _HOPELESS:
                    raise _HopelessError
                best = math.inf

        return watch


def _joint_cost(verdict: JointVerdict) -> float:
    return math.log(FEW + verdict.noticed)


def _order(gray: Floats32, usable: Mask) -> float:
    """Find the strongest likeness of a sample with itself far away, in [0, 1]."""
    alike = autocorrelation(gray, usable)
    half = alike.shape[0] // 2, alike.shape[1] // 2
    distance = np.hypot(*np.ogrid[-half[0] : half[0] + 1, -half[1] : half[1] + 1])
    return max(0.0, float(alike[distance > _FAR * min(gray.shape[:2])].max(initial=0)))
