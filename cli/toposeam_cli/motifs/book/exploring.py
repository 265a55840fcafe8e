"""A page of motifs to choose from: a click keeps one; its recipe can be copied or saved."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Sequence
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

import toposeam as ts
from toposeam.motif.symmetry.tiling import period
from toposeam.sentence import counted
from toposeam_cli.media.pictures.colour import to_depth
from toposeam_cli.media.pictures.libvips import to_vips
from toposeam_cli.motifs.printing import style_words
from toposeam_cli.motifs.recipe_files import to_toml

if TYPE_CHECKING:
    from toposeam.motif import Motif, Recipe

#: Width of a motif's pattern on the page, px.
_SHOWN_PX = 360


def explore_page(
    recipes: Sequence[Recipe],
    columns: int,
    max_megapixels: float,
    progress: Callable[[float], None] | None,
) -> str:
    """Return the page as one .html file.

    Parameters
    ----------
    recipes : sequence of Recipe
    columns : int
    max_megapixels : float
        Of each; see :func:`toposeam.motif`.
    progress : callable or None
        Called with the share done.
    """
    cards = []
    for number, recipe in enumerate(recipes, 1):
        made = ts.motif(recipe, max_megapixels=max_megapixels)
        picture = to_depth(_swatch(made), np.dtype(np.uint8))
        data = base64.b64encode(to_vips(picture).pngsave_buffer(compression=9)).decode("ascii")
        inks = counted(len(recipe.layers), "ink")
        words = f"{style_words(recipe)}, {recipe.repeat}, seed {recipe.seed}, {inks}"
        cards.append(
            f'<button class="card" aria-pressed="false" data-number="{number}"><img alt="motif {number}" '
            f'src="data:image/png;base64,{data}"><span>{number} · {escape(words)}</span></button>'
        )
        if progress is not None:
            progress(number / len(recipes))
    texts = json.dumps([to_toml(recipe) for recipe in recipes]).replace("</", "<\\/")
    page = files("toposeam_cli.motifs.book").joinpath("explore.html").read_text("utf-8")
    return (
        page.replace("{{columns}}", str(columns))
        .replace("{{cards}}", "\n".join(cards))
        .replace("{{recipes}}", texts)
    )


def _swatch(made: Motif) -> np.ndarray:
    rows, columns = made.densities.shape[1:]
    counts = tuple(max(2, many) for many in period(made.repeat))
    across = _SHOWN_PX // counts[1]
    image = ts.repeat(made, (counts[0], counts[1]), size=(max(1, round(across * rows / columns)), across))
    return np.ascontiguousarray(image[:_SHOWN_PX])
