"""What a texture is laid from, and patches laid from it over a whole canvas."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toposeam.arrays import Floats32
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import Guide
from toposeam.texture.canvas.progress import Report, stage, together
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.patch_search import reduced
from toposeam.texture.exemplar.turns import Turns
from toposeam.texture.objects.object_exchange import make_objects_whole
from toposeam.texture.objects.scattered_objects import ScatteredObjects, lay_scattered
from toposeam.texture.periodicity.period import STRETCH, Order
from toposeam.texture.periodicity.phase import Phase
from toposeam.texture.placement.options import LayOptions
from toposeam.texture.placement.patch_placer import PatchPlacer
from toposeam.texture.repair.seam_mending import mend
from toposeam.texture.scheduling.process_pool import Crew
from toposeam.texture.scheduling.raster import lay_all, patches_on, shape_on

#: Largest number of objects that are replaced, per patch laid: the processes' shared memory has room for no
#: more patches.
_MAX_REPLACEMENTS = 64
#: Share of a block of pixels that may be copied where the block may be.
_WHOLE = 0.999


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Material:
    """Samples on their atlas, and what all patches keep to, whatever their size."""

    atlas: Atlas
    #: (AH, AW, F) float32, by which patches are compared.
    features: Floats32
    #: The order that patches keep step with, if there is any.
    order: Order | None = None
    guide: Guide | None = None
    #: On how much of the texture each exemplar of the atlas is to show.
    shares: Sequence[float] | None = None
    turns: Turns = "none"
    #: Whether light is levelled between copies.
    levelled: bool = False

    def placer(
        self, size: tuple[int, int], wraps: tuple[bool, bool], options: LayOptions, rng: np.random.Generator
    ) -> PatchPlacer:
        """Prepare an empty canvas."""
        phase = None
        if self.order is not None:
            closed, stretch = self.order.fitted(size, wraps)
            if stretch <= STRETCH:
                phase = Phase(self.order, closed, self.atlas.factor)
        return PatchPlacer(
            self.atlas,
            self.features,
            IndexCanvas(size, wraps, self.atlas.usable.size),
            options,
            rng,
            size[0] * size[1],
            self.guide,
            phase,
            self.shares,
            self.turns,
            self.levelled,
        )

    def reduced(self, factor: int, context: int) -> Material:
        """Reduce the samples: means over blocks of factor × factor px."""
        if factor == 1:
            return self
        planes, masks = [], []
        for place in self.atlas.places:
            usable, copied = (
                plane[place].astype(np.float32) for plane in (self.atlas.usable, self.atlas.copied)
            )
            values, present = reduced(self.features[place], usable, factor)
            _, free = reduced(self.features[place][..., :1], copied, factor)
            planes.append(values)
            masks.append((present >= _WHOLE, free >= _WHOLE))
        atlas = Atlas.of([one for one, _ in masks], context, [one for _, one in masks])
        order = None if self.order is None else self.order.scaled(factor)
        return dataclasses.replace(self, atlas=atlas, features=atlas.spread(planes), order=order)


def lay(
    placer: PatchPlacer,
    side: int,
    overlap: int,
    processes: int = 1,
    progress: Report | None = None,
    shown: Report | None = None,
    scattered: ScatteredObjects | None = None,
    larger: Sequence[tuple[int, int]] = (),
) -> tuple[int, int]:
    """Fill a canvas with patches, and mend it where that shows; return their height and width, px.

    Parameters
    ----------
    placer : PatchPlacer
    side, overlap : int
        Of the patches, px.
    processes : int
    progress, shown : callable, optional
        Called with the share of the work, and of the patches, that is done.
    scattered : ScatteredObjects, optional
        Objects that are laid last.
    larger : sequence of (int, int)
        Side and overlap of patches that are laid before, where they follow the guide.
    """
    canvas, options = placer.canvas, placer.options
    shape, sides = shape_on(canvas, side, overlap), (*larger, (side, overlap))
    count = sum(patches_on(canvas, *one) for one in sides)
    tries = round(options.mend * count)
    most = count + tries + _MAX_REPLACEMENTS * count
    with Crew(processes, placer, lambda: canvas.share(most)) as crew:
        for number, one in enumerate(sides):
            part = 1 / len(sides)
            report = stage(together(shown, stage(progress, 0.0, 0.9)), number * part, part)
            lay_all(placer, *one, crew, report, guided=number < len(larger))
        if placer.guard is None:
            mend(placer, shape, tries, crew, stage(progress, 0.9, 0.1))
        elif options.mend:  # where seams are bad they cut objects, and those are replaced
            make_objects_whole(placer, shape, crew, most)
        crew.dismiss()
    if scattered is not None:
        lay_scattered(placer, scattered)
    if progress is not None:
        progress(1.0)
    return shape
