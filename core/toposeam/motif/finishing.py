"""What is done to the layers of a motif after optimisation, before it is printed: cuts along an outline, inks
that knock each other out, and strokes made one piece.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from toposeam.arrays import Floats32, Mask
from toposeam.motif.ink.bridging import one_piece
from toposeam.motif.ink.raster import Raster
from toposeam.motif.ink.sampling import resample
from toposeam.motif.motif import Motif
from toposeam.motif.optimise.conduction import MIN_DENSITY
from toposeam.motif.optimise.hexagonal_lattice import refined
from toposeam.motif.optimise.layer import problem_at
from toposeam.motif.recipe.recipe import Recipe
from toposeam.motif.symmetry.rules import HEXAGONAL, symmetry
from toposeam.motif.symmetry.tiling import tile

#: Standard deviation of the blur of an outline along which a layer is cut, in elements: it removes stairs.
_CUT_BLUR = 0.7
#: Share of a pixel from which on it counts as inked.
_PRINTED = 0.5


def spread_copies(density: Floats32, recipe: Recipe, index: int) -> Floats32:
    """Return one layer on the whole cell: as many copies of what was optimised as it has, cut along the
    outline.

    Parameters
    ----------
    density : (h, w) float32 array
        Of the recipe :meth:`Recipe.of_layer`.
    recipe : Recipe
    index : int
    """
    layer = recipe.layers[index]
    if layer.scale == 1:
        return density
    copies = (layer.scale, layer.scale)
    if recipe.repeat in HEXAGONAL:
        laid = refined(np.tile(density, copies), recipe.size)
    else:
        cells = tile(density, recipe.of_layer(index).repeat, copies)
        laid = resample(cells, recipe.repeat, recipe.size).astype(np.float64)
    whole = symmetry(recipe.repeat, recipe.size).mean(np.clip(laid, MIN_DENSITY, 1.0))
    domain = problem_at(layer, recipe, recipe.size).domain
    if domain is not None:
        share = ndimage.gaussian_filter(domain.astype(np.float64), _CUT_BLUR, mode="wrap")
        whole = np.minimum(whole, np.maximum(share, MIN_DENSITY))
    return whole.astype(np.float32)


def finish(motif: Motif, make: Callable[[list[Floats32]], Motif]) -> Motif:
    """Return a motif as its recipe wants it: inks knocked out, strokes in one piece.

    Parameters
    ----------
    motif : Motif
    make : callable
        Makes the motif of the densities of its layers, or those of its lattice.
    """
    recipe = motif.recipe
    raster = Raster(recipe.repeat, recipe.size)
    share = min(recipe.size) / 100
    if recipe.knock_out:
        motif = make(_knocked_out(motif, raster, recipe.trap * share))
    if recipe.one_piece:
        masks = [_inside(motif, index, raster) for index in range(len(motif.inks))]
        motif = make([_in_one_piece(mask, raster, recipe.one_piece, recipe.bridge * share) for mask in masks])
    return motif


def _layers(motif: Motif) -> list[Floats32]:
    return list(motif.densities if motif.lattice is None else motif.lattice)


def _inside(motif: Motif, layer: int, raster: Raster) -> Mask:
    """Return the printed pixels of a layer, on the whole pattern."""
    return raster.of(motif.coverage_of(layer, raster.size)) > _PRINTED


def _knocked_out(motif: Motif, raster: Raster, trap: float) -> list[Floats32]:
    """Return the layers without what lies under the strokes of later ones, except for the trap, in elements.

    Ink wash knocks nothing out.
    """
    layers = _layers(motif)
    for above in range(1, len(layers)):
        if motif.edges[above] == "soft":
            continue
        beyond = raster.signed_distance(_inside(motif, above, raster)) + trap
        covered = raster.densities(np.clip(0.5 - beyond, 0.0, 1.0))
        left = np.maximum(1.0 - covered, MIN_DENSITY).astype(np.float32)
        layers[:above] = [np.minimum(layer, left) for layer in layers[:above]]
    return layers


def _in_one_piece(mask: Mask, raster: Raster, kind: str, width: float) -> Floats32:
    """Return the density of a layer whose ink, or whose paper, is one piece."""
    beyond = one_piece(mask if kind == "ink" else ~mask, raster, width)
    piece = np.clip(raster.densities(np.clip(0.5 - beyond, 0.0, 1.0)), 0.0, 1.0)
    density = piece if kind == "ink" else 1.0 - piece
    return np.clip(density, MIN_DENSITY, 1.0).astype(np.float32)
