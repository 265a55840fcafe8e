"""A composite with its seams as one HTML page without further files."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

import toposeam as ts
from toposeam.images import full_scale
from toposeam.sentence import counted
from toposeam_cli.stitching.rendering import Rendered

#: Largest side of the pictures in the page, px: larger ones are reduced.
_LARGEST_SIDE = 1600

Pair = tuple[int, int]


def seam_page(
    title: str, layers: Sequence[ts.Layer], rendered: Rendered, correlations: Mapping[Pair, float]
) -> str:
    """Return the page of a result.

    Parameters
    ----------
    title : str
    layers : sequence of Layer
        The pictures before their tones were matched.
    rendered : Rendered
    correlations : mapping of (int, int) to float
        Of each two pictures that overlap.
    """
    composed, picture = rendered.composition, rendered.picture
    height, width = composed.shape
    step = max(1, -(-max(height, width) // _LARGEST_SIDE))
    every = slice(0, None, step)
    after = _bytes(picture.pixels[every, every])
    opaque = None if picture.alpha is None else _bytes(picture.alpha[every, every])
    before, covered = _stacked(layers, composed, step)
    names = [layer.name for layer in layers]
    rows, paths = [], []
    for number, seam in enumerate(composed.outlines):
        i, j = seam.pair
        correlation = correlations.get((i, j))
        cells = [
            f"{names[i]} : {names[j]}",
            f"{seam.cost:.4g}",
            f"{seam.cost / max(seam.length, 1):.3f}",
            f"{seam.length:.0f}",
            "" if correlation is None else f"{correlation:.2f}",
        ]
        rows.append(_row(cells, f' data-seam="{number}"'))
        lines = " ".join(_path(line) for line in seam.paths)
        paths.append(f'<path data-seam="{number}" d="{lines}"><title>{escape(cells[0])}</title></path>')
    shown = composed.shown
    total = max(sum(shown), 1)
    shares = [f"{count / total:.1%}" if count else "nowhere" for count in shown]
    pile = [
        _row([name, f"{index}", f"{layer.at[0]},{layer.at[1]}", share], "")
        for index, (name, layer, share) in enumerate(zip(names, layers, shares, strict=True))
    ]
    places = {
        "title": escape(title),
        "summary": f"{len(names)} pictures, {counted(len(rows), 'seam')} of cost {composed.cost:.4g}, "
        f"{width} × {height} px.",
        "before": _data(before, covered),
        "after": _data(after, opaque),
        "left": str(composed.view.left),
        "top": str(composed.view.top),
        "width": str(width),
        "height": str(height),
        "paths": "\n".join(paths),
        "seams": "\n".join(rows),
        "pile": "\n".join(pile),
    }
    page = files("toposeam_cli.stitching").joinpath("seams.html").read_text("utf-8")
    return re.sub(r"\{\{(\w+)\}\}", lambda place: places[place[1]], page)


def _stacked(
    layers: Sequence[ts.Layer], composed: ts.layers.Composition, step: int
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Stack the layers, later ones on top; return the picture, and the mask where there is any."""
    height, width = (-(-side // step) for side in composed.shape)
    image, alpha = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), np.uint8)
    for layer in layers:
        left, top = (layer.at[axis] - composed.origin[axis] for axis in (0, 1))
        first = max(-(-top // step), 0), max(-(-left // step), 0)
        key = tuple(
            slice(number * step - start, None, step) for number, start in zip(first, (top, left), strict=True)
        )
        part = _bytes(layer.image[key])[: height - first[0], : width - first[1]]
        here = np.s_[first[0] : first[0] + part.shape[0], first[1] : first[1] + part.shape[1]]
        covered = np.ones(part.shape[:2], bool)
        if layer.alpha is not None:
            covered = layer.alpha[key][: part.shape[0], : part.shape[1]] > 0
        image[here][covered] = (part if part.ndim == 3 else part[..., np.newaxis])[covered]
        alpha[here][covered] = 255
    return image, alpha


def _bytes(values: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    share = values / float(full_scale(values.dtype)) * 255
    return np.clip(np.rint(share), 0, 255).astype(np.uint8)


def _data(image: npt.NDArray[np.uint8], alpha: npt.NDArray[np.uint8] | None) -> str:
    """Encode a picture as a data URL: JPEG if it is opaque, else WebP."""
    from PIL import Image

    colour = image if image.ndim == 3 else np.repeat(image[..., np.newaxis], 3, axis=2)
    opaque = alpha is None or bool((alpha == 255).all())
    content, kind = io.BytesIO(), "jpeg" if opaque else "webp"
    whole = colour if alpha is None or opaque else np.dstack([colour, alpha])
    Image.fromarray(whole).save(content, kind, quality=88)
    return f"data:image/{kind};base64,{base64.b64encode(content.getvalue()).decode()}"


def _path(line: ts.vector.Polyline) -> str:
    points = line.simplified(0.75).outline
    return "M" + " L".join(f"{x:g} {y:g}" for x, y in points.tolist())


def _row(cells: Sequence[str], more: str) -> str:
    return f"<tr{more}>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"
