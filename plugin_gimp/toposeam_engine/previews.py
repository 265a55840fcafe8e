"""Previews of a request's result, one small picture each, which the dialogs show while options change.

That of an animation has all frames, one below the other.

The asker sends reduced pixels and the scale; options that are lengths in px are reduced by it, too.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import toposeam as ts
from toposeam.arrays import Image, Mask
from toposeam.colours import parse_colour
from toposeam.display import to_rgba8
from toposeam.motif.ink.mixing import mix
from toposeam_engine import animations, motifs, seams, textures
from toposeam_engine.job import EngineJob
from toposeam_engine.layers import colours_of, layers_of, with_alpha
from toposeam_engine.places import framed

#: Options that are lengths, and their least useful values, px.
_LENGTHS = {"blend_width": 1, "patch": 8, "overlap": 2, "band": 4, "width": 16, "height": 16}
#: Largest size of a motif, px, and most iterations: in a first preview, and in the final one.
_MOTIF_PX, _MOTIF_ITERATIONS = {False: 96, True: 384}, {False: 18, True: 80}
#: Most pixels of the layers of a first preview of seams: together, and of each that must be placed.
_MOST_JOINED, _MOST_PLACED = 400_000, 60_000
#: Most pixels of a preview that was made at full size.
_MOST_SHOWN = 3_000_000
#: Area in which a hole is filled at full size at once, pixels, and that of a first preview of a larger one.
_MOST_FILLED, _MOST_ROUGH = 1_800_000, 32_000
#: Gap between layers whose places are unknown, px.
_GAP_PX = 8
#: Divisor of the values of pixels that are not copied.
_DARKER = 3


def preview(job: EngineJob) -> dict[str, Any]:
    """Return the picture of an operation's result, (H, W, 4) or (H, W, 2) with opacity last."""
    options = _scaled(job.options, float(job.request["scale"]))
    if "places" in job.request:
        options["places"] = job.request["places"]
    for name in ("width", "height"):  # sizes of a texture, of which only a part is shown
        if name in options:
            options[name] = max(int(options[name] * float(job.request.get("extent", 1))), _LENGTHS[name])
    shows = _COPIED if job.request.get("copied") else _BEFORE if job.request.get("before") else _SHOWN
    of, job = str(job.request["of"]), dataclasses.replace(job, request={**job.request, "options": options})
    rough = of == "motif"
    if of in ("stitch", "patch", "fill") and shows is _SHOWN:
        job, rough = _reduced(job)
    return {"picture": job.write(shows[of](job)), "rough": rough and not job.request.get("exact")}


def _scaled(options: dict[str, Any], scale: float) -> dict[str, Any]:
    """Return the options for reduced pixels; 0 keeps its meaning."""
    return {
        name: max(type(value)(value * scale), _LENGTHS[name]) if value and name in _LENGTHS else value
        for name, value in options.items()
    }


class _Reduced(EngineJob):
    """A job whose pixels are reduced by a whole factor."""

    def read(self, raster: Mapping[str, Any]) -> Any:
        """Read a raster as it is, and return its blocks' means."""
        return _blocks(super().read({**raster, **raster["full"]}), int(raster["step"]))


def _reduced(job: EngineJob) -> tuple[EngineJob, bool]:
    """Return a job with layers that are small enough for a first preview of seams, unless the exact one is
    asked for, and whether they were reduced.
    """
    layers = job.request.get("layers") or [job.request["layer"]]
    area = sum(layer["width"] * layer["height"] for layer in layers)
    most = _MOST_PLACED * len(layers) if job.options.get("places") == "anywhere" else _MOST_JOINED
    if "layer" in job.request:
        most = area if area <= _MOST_FILLED else _MOST_ROUGH
    step = math.ceil(math.sqrt(area / most))
    if step == 1 or job.request.get("exact"):
        return job, False

    def small(raster: Mapping[str, Any]) -> dict[str, Any]:
        size = {name: raster[name] for name in ("width", "height")}
        about = {name: max(value // step, 1) for name, value in size.items()} | {"full": size, "step": step}
        if "at" in raster:
            about["at"] = [round(value / step) for value in raster["at"]]
        if raster.get("mask"):
            about["mask"] = small(raster["mask"])
        return {**raster, **about}

    request = {**job.request, "options": _scaled(job.options, 1 / step)}
    request["scale"] = float(job.request["scale"]) / step
    if "layers" in request:
        request["layers"] = list(map(small, layers))
    if "shown" in request:
        request["shown"] = [value // step for value in request["shown"]]
        request["layer"] = {**request["layer"], "cut_from": request["layer"]["cut_from"] // step**2}
    for name in ("layer", "selection", "avoid", "source"):
        if request.get(name):
            request[name] = small(request[name])
    return _Reduced(folder=job.folder, request=request, progress=job.progress), True


def _stitch(job: EngineJob) -> Image:
    try:
        place, found = seams.stitched(job, layers_of(job))
    except ts.OverlapError as error:
        if job.options.get("places") != "anywhere":
            raise
        raise ts.OverlapError(
            "reduced as they are for a preview, the layers cannot be placed; go on, and they are looked at "
            "in "
            "full size",
            kind="small preview",
        ) from error
    if "crop" not in job.options:
        return _with_seams(job, found)
    shown = framed(place, found, str(job.options["crop"])).shown
    picture, whole = _with_seams(job, found)[shown.view.slices], with_alpha(shown.image, shown.alpha)
    holes = picture[..., -1] == 0
    picture[holes] = (whole if whole.shape == picture.shape else to_rgba8(whole))[holes]
    return picture


def _patch(job: EngineJob) -> Image:
    found = seams.stitched_patch(job, seams.patch_layers(job))
    return _with_seams(job, found)


def _with_seams(job: EngineJob, found: ts.layers.Composition) -> Image:
    lined = job.request.get("seam_line", True)
    return with_alpha(ts.seam.draw_seams(found.image, found.seams) if lined else found.image, found.alpha)


def _stacked(job: EngineJob) -> Image:
    """Return the layers on each other at their places, or beside each other if these are unknown."""
    layers = layers_of(job)
    if job.options.get("places") == "anywhere":
        ends = np.cumsum([0, *(layer.image.shape[1] + _GAP_PX for layer in layers)])
        layers = [dataclasses.replace(layer, at=(int(x), 0)) for layer, x in zip(layers, ends, strict=False)]
    canvas = ts.layers.common_canvas(layers)
    first = with_alpha(layers[0].image, None)
    picture = np.zeros((*canvas.shape, first.shape[2]), first.dtype)
    for layer in layers:
        here = picture[canvas.place(layer).slices]
        np.copyto(here, with_alpha(layer.image, layer.alpha), where=layer.covered[..., np.newaxis])
    return picture


def _synthesize(job: EngineJob) -> Image:
    made = textures.synthesized(job)
    return with_alpha(made.image, made.alpha)


def _make_tileable(job: EngineJob) -> Image:
    made = textures.made_tileable(job)
    return np.tile(with_alpha(made.image, made.alpha), (2, 2, 1))


def _tiled(job: EngineJob) -> Image:
    return np.tile(_layer(job), (2, 2, 1))


def _layer(job: EngineJob) -> Image:
    return with_alpha(*colours_of(job, job.request["layer"]))


def _unfilled(job: EngineJob) -> Image:
    return _cut(job, _layer(job))


def _copied(job: EngineJob) -> Image:
    """Return the layer of a hole, dark where it is not copied."""
    if job.options.get("from") == "other" and not job.request["source"].get("is_mask"):
        return _small(with_alpha(*colours_of(job, job.request["source"])))
    shown = _layer(job)
    _darken(shown, ~textures.copied_from(job))
    return _small(shown)


def _fill(job: EngineJob) -> Image:
    image, alpha, sample, part, source = textures.filled(job)
    shown = _layer(job)
    shown[part] = with_alpha(image, alpha)
    if source is not None:
        dark = np.ones(shown.shape[:2], bool)
        dark[part] = ~(source | np.asarray(sample.selected))
        _darken(shown, dark)
    return _cut(job, shown)


def _cut(job: EngineJob, picture: Image) -> Image:
    """Return the shown part of a picture that was made at full size."""
    left, top, width, height = job.request.get("shown") or (0, 0, picture.shape[1], picture.shape[0])
    return _small(picture[top : top + height, left : left + width])


def _darken(picture: Image, where: Mask) -> None:
    """Darken the pixels that are not copied."""
    picture[where, :-1] //= _DARKER


def _small(picture: Image) -> Image:
    """Return the picture reduced by a whole factor to the size of a preview."""
    return _blocks(picture, math.ceil(math.sqrt(picture.shape[0] * picture.shape[1] / _MOST_SHOWN)))


def _blocks(picture: Image, step: int) -> Image:
    """Return the means of blocks of `step` × `step` pixels."""
    height, width = (max(length // step, 1) for length in picture.shape[:2])
    rows, columns = (
        np.minimum(np.arange(length * step), most - 1)
        for length, most in zip((height, width), picture.shape, strict=False)
    )
    blocks = picture[rows][:, columns].reshape(height, step, width, step, *picture.shape[2:])
    reduced: Image = np.rint(blocks.mean(axis=(1, 3), dtype=np.float32)).astype(picture.dtype)
    return reduced


def _motif(job: EngineJob) -> Image:
    options = dict(job.options)
    exact = bool(job.request.get("exact"))
    options["size"] = min(options["size"], _MOTIF_PX[exact])
    options["iterations"] = min(options["iterations"], _MOTIF_ITERATIONS[exact])
    made = motifs.generated(dataclasses.replace(job, request={**job.request, "options": options}))
    sheet = made if options["repeat"] == "none" else ts.repeat(made, (2, 2))
    image = sheet.image() if isinstance(sheet, ts.motif.Motif) else sheet
    return _small(with_alpha(np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8), None))


def _repeat(job: EngineJob) -> Image:
    densities, _rule = motifs.repeated(job)
    name = str(job.options.get("palette", "own"))
    if name == "own":
        inks = np.array([parse_colour(ink) for ink in job.request["inks"]])
        paper = np.array(parse_colour(str(job.request["paper"])))
    else:
        chosen = ts.motif.palette(name, len(densities))
        inks, paper = chosen.inks, chosen.paper
    image = mix(np.stack(densities) / np.float32(255), inks, paper)
    return with_alpha(np.rint(image * 255).astype(np.uint8), None)


def _loop(job: EngineJob) -> Image:
    return with_alpha(np.concatenate(list(animations.looped(job).frames)), None)


_SHOWN: dict[str, Callable[[EngineJob], Image]] = {
    "stitch": _stitch,
    "patch": _patch,
    "synthesize": _synthesize,
    "make_tileable": _make_tileable,
    "fill": _fill,
    "motif": _motif,
    "repeat": _repeat,
    "loop": _loop,
}
#: Functions that draw the state before an operation.
_BEFORE: dict[str, Callable[[EngineJob], Image]] = {
    "stitch": _stacked,
    "patch": _stacked,
    "make_tileable": _tiled,
    "fill": _unfilled,
}
#: Functions that draw the source of a result.
_COPIED: dict[str, Callable[[EngineJob], Image]] = {"fill": _copied}
