"""Large textures from small samples (thesis 3.5, after Efros and Freeman 2001, doi:10.1145/383259.383296)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, Unpack

import numpy as np
import numpy.typing as npt

from toposeam.arrays import Floats32
from toposeam.checks import (
    Seed,
    check_choice,
    check_function,
    check_items,
    check_number,
    check_pair,
    check_whole,
)
from toposeam.errors import ImageError, OptionError, Term
from toposeam.texture.assemble_result import finish
from toposeam.texture.canvas.index_canvas import IndexCanvas
from toposeam.texture.canvas.places import Guide
from toposeam.texture.canvas.progress import Previews, stage
from toposeam.texture.canvas.synthesis import Synthesis
from toposeam.texture.canvas.tileable import Tileable
from toposeam.texture.exemplar.atlas import Atlas
from toposeam.texture.exemplar.mirror_narrow import widened
from toposeam.texture.exemplar.patch_search import whole
from toposeam.texture.exemplar.scale import SMALLEST_PATCH, coarse_patch, patch_for
from toposeam.texture.exemplar.sources import DataRange, Images, Sources, check_varied
from toposeam.texture.exemplar.turns import TURNS, Turns, count_of, turned_sources
from toposeam.texture.guide import guide_of, patches_within
from toposeam.texture.light.seam_easing import EasedLight, Level, level_for
from toposeam.texture.light.slow_light import CopyLight, flattened, levelled_copies, without_light
from toposeam.texture.material import Material, lay
from toposeam.texture.objects.scattered_objects import ScatteredObjects, atlas_without, find_scattered
from toposeam.texture.periodicity.period import Order, find_order, given_order, likely_order
from toposeam.texture.placement.options import VARIED, LayKeywords, LayOptions
from toposeam.texture.placement.request import TextureRequest
from toposeam.texture.scheduling.process_pool import MAX_PROCESSES
from toposeam.texture.scheduling.raster import patches_along
from toposeam.texture.setting_trial import SETTINGS, Tried, colours, try_settings
from toposeam.texture.tile_origin import begun
from toposeam.typing import Setting


def synth(
    source: Images,
    size: int | tuple[int, int],
    *,
    patch: int | None = None,
    overlap: float | None = None,
    seed: Seed = 0,
    tileable: Tileable = "none",
    turns: Turns = "none",
    setting: Setting = "auto",
    variation: float | None = None,
    lattice: npt.ArrayLike | None = None,
    alpha: Images | None = None,
    transparent: bool = False,
    source_mask: Images | None = None,
    maps: Sequence[Images] = (),
    normal: Images | None = None,
    weights: Sequence[float] | None = None,
    shares: Sequence[float] | None = None,
    data_range: DataRange = None,
    guide: npt.ArrayLike | None = None,
    guide_source: Images | None = None,
    guide_weight: float = 0.8,
    smooth: int = 1,
    flatten: bool = False,
    level: Level | None = None,
    max_megapixels: float = 72.0,
    processes: int = 1,
    progress: Callable[[float], None] | None = None,
    preview: Callable[[npt.NDArray[Any]], None] | None = None,
    options: LayOptions | None = None,
    **given_options: Unpack[LayKeywords],
) -> Synthesis:
    """Grow a texture of any size from one or more samples.

    Patches are laid in raster order, each where it fits best to what is there, and cut along the best seam.

    Parameters
    ----------
    source : (H, W[, C]) array_like, or a list of such
        The exemplars, gray or RGB, of one dtype; sides of less than 4 px are mirrored until they have 32, and
        so is what belongs to them.
    size : int or (int, int)
        Height and width of the texture, px.
    patch : int, optional
        Side of a patch, px; by default by the size of the texture's elements (:func:`natural_patch`), with a
        guide smaller where patches of that side do not follow it. Cut to the texture where that is smaller.
    overlap : int or float, optional
        How far neighbouring patches overlap, px, or below 1 as a share of the patch; by default a quarter.
    seed : int, Generator or None
        The same seed gives the same bytes; the result keeps it.
    tileable : {"both", "x", "y", "none"} or bool
        On which axes the texture continues at the opposite border. Without a guide it begins there at a line
        that shows little (:mod:`toposeam.texture.tile_origin`).
    turns : {"none", "mirror", "quarters", "all"}
        Whether patches are also taken from the exemplars mirrored left to right, turned by quarters, or both:
        for gravel and leaves, which have no upper side. The light turns with them, and so do the vectors of
        `normal`, whichever way their green counts. :attr:`Synthesis.exemplar` counts every position as an
        exemplar.
    setting : {"auto", "coarse", "coarse-mixed", "fine", "fine-mixed", "varied"}
        How large patches are (fine: by the size of elements; coarse: half of the exemplar's shorter side) and
        which are taken: those that fit best (a `variation` of 0), mixed (0.25) or varied (0.5). By default
        each is tried on a small texture, and the one of fewest visible joints that shows enough of the
        exemplars is taken (:mod:`toposeam.texture.setting_trial`), unless `patch`, `variation`, one of the
        options that this stands for, `options` or `guide` is given, or `transparent`: then it is varied.
    variation : float, optional
        From 0, where every patch fits as well as any can, whatever that repeats, to 1, where all of the
        sample shows about equally often, whatever that costs at the seams; the usual choice is 0.5. Stands
        for the options `tolerance`, `candidates`, `most` and `variety`.
    lattice : (float, float), (float, float, float) or (n, 2) array_like, optional
        The periods, px, at which the exemplar repeats itself downwards and to the right, 0 where it does not,
        and by how much each row is shifted to the right, as of bricks; or one or two shifts, (n, 2). Patches
        keep step with it; by default with the order that is found, if any, which takes three or more periods,
        or that of fewer periods that is guessed where settings are tried, if that does as well. For one
        exemplar, not turned, without a guide.
    alpha, source_mask : (H, W) array_like, or a list with one per exemplar
        Opacity, which is laid with the patches, and what may be copied; by default whatever has an opacity
        above 0.
    transparent : bool
        Whether opacity is part of the texture, as of lace or scattered leaves: places without any are copied
        and compared like others.
    maps : sequence
        Further maps of the same exemplars (heights, roughness, numbers of materials …), each an array or a
        list with one per exemplar; their values are never mixed.
    normal : (H, W, 3) array_like, or a list with one per exemplar
        A normal map: unit vectors, (v + 1) / 2 as a share of white, or in floats below 0 as they are. Where
        patches are mixed, vectors have length 1 again.
    weights : sequence of float, optional
        How much the picture, each map and the normals count in the search and in the seams, against a
        picture of as much variance; 1 each by default, 1e6 at most.
    shares : sequence of float, optional
        On how much of the texture each exemplar is to show against the others, nearly; by default wherever
        it fits best.
    data_range : float, or sequence of float or None, optional
        The value that counts as white in the picture, or in the picture, each map and the normals: needed for
        integers other than uint8 and uint16, and for floats beyond ±2.
    guide, guide_source : array_like
        What is wanted, on the texture's canvas, and what the exemplars' pixels stand for, in the same terms:
        (H, W) or (H, W, G) each. Each patch is then also chosen for how well its piece of `guide_source`
        agrees with `guide` there.
    guide_weight : float
        Share of the guide in that choice, in [0, 1]; with 1 neighbours count for nothing but the seams.
    smooth : int
        px to either side of a seam in which neighbouring patches are mixed, in the picture and its normals; 0
        for hard cuts.
    flatten : bool
        Take slow light out of the exemplars first (:func:`toposeam.texture.flatten_light`); not out of maps.
    level : bool or "steps", optional
        Whether light is levelled between patches (:mod:`toposeam.texture.light.slow_light`), which changes
        colours a little, or steps at seams are eased into both sides only
        (:mod:`toposeam.texture.light.seam_easing`). By default, where no guide is given, light where the
        exemplars have slow light or are fibres, steps where they are smooth. Maps never are: for exemplars
        whose values are no colours, say False.
    max_megapixels : float
        Refuse a larger texture.
    processes : int
        How many work on the texture, which looks the same for any number. Where processes cannot be forked
        (Windows), or must not be (macOS), one does it.
    progress : callable, optional
        Called with the share of the work done, in [0, 1].
    preview : callable, optional
        Called about a dozen times with the picture so far, reduced by leaving pixels out: (h, w[, C]) of the
        exemplars' dtype, at most 512 px a side, 0 where nothing has been laid.
    options : LayOptions, optional
        How patches are chosen and cut; or its fields as keywords.

    Returns
    -------
    Synthesis

    Raises
    ------
    ImageError
        For exemplars, masks or maps that cannot be used.
    OptionError
        For sizes and options out of range.

    Examples
    --------
    >>> import numpy as np, toposeam as ts
    >>> sample = np.random.default_rng(0).integers(0, 256, (48, 48), np.uint8)
    >>> ts.synth(sample, (60, 80), patch=24, tileable="x").image.shape
    (60, 80)
    """
    check_function("progress", progress)
    check_function("preview", preview)
    height, width = _size(size, max_megapixels)
    check_whole("processes", processes, 1, MAX_PROCESSES)
    named = _named(setting, patch, variation, options, given_options)
    request = TextureRequest.of(
        "synth",
        options,
        given_options,
        seed=seed,
        smooth=smooth,
        alpha=widened(alpha),
        maps=widened(check_items("maps", maps, object, "a sequence of images, one a map")),
        normal=widened(normal),
        weights=weights,
        data_range=data_range,
        tileable=tileable,
        variation=variation if setting == "auto" else SETTINGS[setting].variation,
    )
    _check_turns(turns, lattice, guide)
    read, level = _exemplars(
        request, widened(source), widened(source_mask), flatten, level, transparent, guided=guide is not None
    )
    parts = _shares(shares, len(read.shapes))
    sources = turned_sources(read, turns)
    atlas = Atlas.of(sources.present, request.options.context, sources.usable)
    if level is True:
        even = tuple(map(without_light, sources.features, sources.present, sources.usable))
        sources = dataclasses.replace(sources, features=even)
    features = atlas.spread(sources.features)
    wanted = guide_of(guide, widened(guide_source), guide_weight, atlas, sources, (height, width), turns)
    order = _order(sources, request.options, lattice) if wanted is None else None
    alone = [order is None, wanted is None, len(read.shapes) == 1, request.options.mend > 0, not transparent]
    scattered, sides = _on_ground(
        find_scattered(features, atlas) if all(alone) else None,
        _sides(sources, patch, overlap),
        sized=patch is not None,
    )
    side, lap = sides[-1] if setting != "auto" and SETTINGS[setting].coarse else sides[0]
    *larger, (side, lap) = _following(wanted, sources, patch, (side, lap), overlap)
    material = Material(
        atlas=atlas_without(scattered, atlas),
        features=features,
        order=order,
        guide=wanted,
        shares=None if parts is None else np.repeat(parts, count_of(turns)).tolist(),
        turns=turns,
        levelled=level is True,
    )
    sized, masked = patch is not None, source_mask is not None
    _check_room(atlas, (height, width), request, (side, lap), sized=sized, masked=masked)
    tried: list[Tried] = []
    done = 0.0
    if setting == "auto" and not (named or transparent or wanted):
        others, done = _other_orders(sources, material.order, request.options, lattice, scattered), 0.4
        seen = atlas.spread(colours(sources, request.white_of(sources), levelled=level is True))
        report = stage(progress, 0.0, done)
        tried, order = try_settings(
            material, others, seen, sides, request, (height, width), report, varied=scattered is not None
        )
        setting = tried[0].name if tried else "varied"
        side, lap = sides[-1] if SETTINGS[setting].coarse else sides[0]
        request = request.varied(
            SETTINGS[setting].variation, close=order is not None or material.order is None
        )
        material = dataclasses.replace(material, order=order)
    placer = material.placer((height, width), request.wraps, request.options, request.rng)
    canvas = placer.canvas
    shown = None if preview is None else Previews(preview, sources, atlas, canvas)
    report = stage(progress, done, 1 - done)
    shape = lay(placer, side, lap, processes, report, shown, scattered, larger)
    fits = None if material.order is None else material.order.better_size((height, width), request.wraps)
    periods = None if material.order is None else material.order.periods.tolist()
    del placer, material, wanted  # a guide takes more memory than the picture
    settings = {
        "patch": None if larger else side,
        "overlap": lap,
        **request.settings,
        "flatten": flatten,
        "level": level,
    }
    settings |= {"shares": parts, "turns": turns, "transparent": transparent}
    settings |= {"lattice": periods}
    settings |= {"setting": None if setting == "auto" else setting}
    lift = _light(sources, features, atlas, canvas, level) if level else None
    made = finish(sources, atlas, canvas, shape, settings, request, lift=lift)
    made = dataclasses.replace(made, fits=fits, tried={one.name: one.verdict for one in tried})
    return begun(made) if guide is None else made


def _check_turns(turns: Turns, lattice: npt.ArrayLike | None, guide: object) -> None:
    """Refuse a lattice where exemplars are turned, or beside a guide."""
    check_choice("turns", turns, TURNS)
    if lattice is not None and (turns != "none" or guide is not None):
        raise _several(lattice)


def _named(
    setting: Setting,
    patch: int | None,
    variation: float | None,
    options: LayOptions | None,
    given: LayKeywords,
) -> bool:
    """Check a setting; test whether something that it stands for is given."""
    check_choice("setting", setting, ("auto", *SETTINGS))
    own: dict[str, Any] = {"patch": patch, "variation": variation, "options": options, **given}
    refused = [name for name in ("patch", "variation", "options", *VARIED) if own.get(name) is not None]
    if refused and setting != "auto":
        raise OptionError(
            "{parameter} stands for how large patches are and which are taken; leave out {refused}, or "
            "{parameter}",
            kind="conflict",
            parameter=Term("setting"),
            value=setting,
            refused=tuple(map(Term, refused)),
        )
    return bool(refused)


def _sides(sources: Sources, patch: int | None, overlap: float | None) -> list[tuple[int, int]]:
    """Choose side and overlap, px, of fine patches, and of coarse ones where these are larger."""
    sides = [check_patch(sources, patch, overlap)]
    coarse = coarse_patch(sources.usable, sources.shapes)
    if patch is None and coarse > sides[0][0]:
        sides.append(check_patch(sources, coarse, overlap))
    return sides


def _following(
    guide: Guide | None,
    sources: Sources,
    patch: int | None,
    usual: tuple[int, int],
    overlap: float | None,
) -> list[tuple[int, int]]:
    """List the sides and overlaps, px, of patches that follow a guide, largest first; the usual ones alone
    where there is none, or the caller gives the patch.
    """
    if guide is None or not guide.weight or patch is not None:
        return [usual]
    return [check_patch(sources, side, overlap) for side in patches_within(guide, usual[0])]


def _on_ground(
    scattered: ScatteredObjects | None, sides: list[tuple[int, int]], *, sized: bool
) -> tuple[ScatteredObjects | None, list[tuple[int, int]]]:
    """Reduce patches, given by side and overlap, to what the ground between scattered objects has room for;
    none are scattered where it has no room.
    """
    found = [] if scattered is None else [scattered.side_for(side) for side, _ in sides]
    fitting = [
        (new, max(2, lap * new // side))
        for new, (side, lap) in zip(found, sides, strict=False)
        if new is not None and (new == side or not sized)
    ]
    return (scattered, list(dict.fromkeys(fitting))) if fitting else (None, sides)


def _check_room(
    atlas: Atlas,
    size: tuple[int, int],
    request: TextureRequest,
    patch: tuple[int, int],
    *,
    sized: bool,
    masked: bool,
) -> None:
    """Refuse patches, given by side and overlap, that have room nowhere in the exemplars."""
    height, width = (
        patches_along(length, *patch, wraps)[0] for length, wraps in zip(size, request.wraps, strict=True)
    )
    if whole(atlas.copied, (height, width)).any():
        return
    room = {"width": width, "height": height, "smaller": "smaller patches or " if sized else ""}
    if masked:
        raise ImageError(
            "no place in {mask} has room for a patch of {width} × {height} px; use {smaller}a larger mask",
            kind="no room",
            mask=Term("source_mask", "the mask"),
            **room,
        )
    raise ImageError(
        "no place that shows has room for a patch of {width} × {height} px; use {smaller}an exemplar "
        "with fewer holes, or {transparent} where holes are part of it",
        kind="no opaque room",
        transparent=Term("transparent", value=True),
        **room,
    )


def _exemplars(
    request: TextureRequest,
    source: Images,
    mask: Images | None,
    flatten: bool,
    level: Level | None,
    transparent: bool,
    *,
    guided: bool,
) -> tuple[Sources, Level]:
    """Read the exemplars, and decide how light is levelled where the caller does not say."""
    check_choice("flatten", flatten, (True, False))
    check_choice("level", level, (True, False, "steps", None))
    check_choice("transparent", transparent, (True, False))
    sources = request.read(source, mask, "source", transparent=transparent)
    if transparent and not sources.has_alpha:
        raise OptionError(
            "{transparent} is for samples with opacity, and these have none; leave it out",
            kind="conflict",
            parameter=Term("transparent"),
        )
    if transparent and level:
        raise OptionError(
            "light is levelled between opaque patches only; leave out {transparent}, or {level}",
            kind="conflict",
        )
    check_varied(sources)
    if level is None:  # what flattening leaves of slow light is levelled as well
        level = False if transparent or guided else level_for(sources)
    if flatten:
        even = flattened(source, mask, request.white[0])
        sources = request.read(even, mask, "source", transparent=transparent)
    return sources, level


def _order(sources: Sources, options: LayOptions, lattice: npt.ArrayLike | None) -> Order | None:
    """Find the order that patches keep step with, if none is given."""
    if lattice is not None and len(sources.shapes) > 1:
        raise _several(lattice)
    if lattice is not None:
        return given_order(lattice)
    if len(sources.shapes) > 1 or not options.close:
        return None
    return find_order(sources.features[0], sources.usable[0])


def _several(lattice: npt.ArrayLike) -> OptionError:
    return OptionError(
        "{parameter} is that of one exemplar as it lies; leave it out with several ones, {turns} or {guide}",
        kind="conflict",
        parameter=Term("lattice"),
        value=lattice,
        turns=Term("turns"),
        guide=Term("guide"),
    )


def _other_orders(
    sources: Sources,
    order: Order | None,
    options: LayOptions,
    lattice: npt.ArrayLike | None,
    scattered: ScatteredObjects | None,
) -> list[Order | None]:
    """List the orders to be tried besides one: one that is guessed, and none; bare ground has none."""
    if lattice is not None or not options.close or len(sources.shapes) > 1 or scattered is not None:
        return []
    guess = likely_order(sources.features[0], sources.usable[0])
    others: list[Order | None] = (
        [] if guess is None or (order is not None and order.spans(guess)) else [guess]
    )
    return others if order is None else [*others, None]


def _light(
    sources: Sources, features: Floats32, atlas: Atlas, canvas: IndexCanvas, level: Level
) -> EasedLight:
    """Find the light of every copy, or only what eases the steps between them."""
    plane = atlas.spread(sources.planes[0]).astype(np.float32)
    laid = canvas.index, canvas.labels
    light = (
        levelled_copies(plane, features, atlas, *laid, canvas.first_patches(), canvas.wrap)
        if level is True
        else CopyLight.of(plane, atlas)
    )
    return EasedLight(plane, light, *laid, canvas.wrap)


def _shares(shares: Sequence[float] | None, count: int) -> list[float] | None:
    if shares is None:
        return None
    found = list(check_items("shares", shares, object, "a list with one number per exemplar"))
    if len(found) != count:
        raise OptionError(
            "{parameter} has length {given} for {count} {exemplars}; give one number for each",
            kind="count",
            parameter=Term("shares"),
            given=len(found),
            count=count,
        )
    return [
        check_number(Term("shares", "one of the shares", 0), share, 0, 1e6, above=True) for share in found
    ]


def check_patch(sources: Sources, patch: int | None, overlap: float | None) -> tuple[int, int]:
    """Resolve the defaults of patch and overlap, px.

    Raises
    ------
    ImageError
        When an exemplar is smaller than the patch.
    OptionError
        When the two do not fit each other.
    """
    height, width = max(sources.shapes, key=min)
    if min(height, width) < SMALLEST_PATCH:
        raise ImageError(
            "{exemplar} is {width} × {height} px; to copy patches from it needs at least {least} px a side",
            kind="small",
            width=width,
            height=height,
            least=SMALLEST_PATCH,
            exemplar=Term("exemplar", "the source"),
        )
    if patch is None:
        patch = patch_for(sources.features, sources.usable, sources.shapes)
    patch = check_whole("patch", patch, SMALLEST_PATCH)
    if overlap is None:
        overlap = max(2, patch // 4)
    elif isinstance(overlap, float | np.floating) and 0 < overlap < 1:
        overlap = max(2, round(overlap * patch))
    try:
        lap = check_whole("overlap", overlap, 2, patch - 1)
    except OptionError as error:
        raise OptionError(
            "{parameter} is {value!r} with patches of {patch} px; give a whole number from"
            " {least} to {most} px, usually a quarter",
            kind="whole number",
            parameter=Term("overlap"),
            value=overlap,
            allowed=error.allowed,
            patch=patch,
            least=2,
            most=patch - 1,
        ) from error
    if patch > min(height, width):
        raise ImageError(
            "{exemplar} is {width} × {height} px, smaller than a patch of {patch} px; use "
            "a patch of {most} px or less",
            kind="smaller than patch",
            parameter=Term("patch"),
            value=patch,
            width=width,
            height=height,
            patch=patch,
            most=min(height, width),
            exemplar=Term("exemplar", "the source"),
        )
    return patch, lap


def _size(size: int | tuple[int, int], max_megapixels: float) -> tuple[int, int]:
    check_number("max_megapixels", max_megapixels, 0, above=True, infinite=True)
    given = size if isinstance(size, tuple | list) else (size, size)
    try:
        height, width = check_pair("size", given, 1)
    except OptionError as error:
        raise OptionError(
            "{parameter} is {value!r}; give height and width as whole numbers of px, 1 or more",
            kind="whole number",
            parameter=Term("size"),
            value=size,
        ) from error
    if height * width > max_megapixels * 1e6:
        raise OptionError(
            "a texture of {width} × {height} px has more than {most:g} megapixels; make a "
            "smaller one that repeats, and repeat it",
            kind="too large",
            width=width,
            height=height,
            most=max_megapixels,
        )
    return height, width


#: The former name of :func:`synth`.
synthesize = synth
