r"""One colour layer as a problem of heat conduction: its loads, its conductivities and their derivatives.

The conductivity of an element is k_e (ε + (1 - ε) ρ_e^p), with ε = 10⁻³ so that heat leaves every element by
some way, and

.. math:: \partial\Pi / \partial\rho_e = -p\,\rho_e^{p-1} (1-ε) k_e\,\theta_e^T \mathbf K^0 \theta_e.

A filter against checkerboards replaces the sensitivities by a weighted mean of ρ ∂Π/∂ρ over the
neighbourhood, divided by ρ (Sigmund 2001, doi:10.1007/s001580050176); its weights fall linearly with the
distance down and across. Neighbours beyond the border are those of the pattern.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.ndimage import correlate1d

from toposeam.arrays import Floats, Mask
from toposeam.errors import OptionError, Term
from toposeam.heat.plate import Plate
from toposeam.motif.ink.sampling import resample
from toposeam.motif.recipe.recipe import LayerRecipe, Point, Recipe, unpack_base
from toposeam.motif.symmetry.rules import Symmetry, joint, symmetry
from toposeam.motif.symmetry.tiling import extend, shift_of

#: Lowest density: with 0 an element could never gain material again.
MIN_DENSITY = 1e-3
#: Conductivity of an empty element as a share of a full one's.
VOID = 1e-3
#: Radius of a source or a sink, as a share of the cell's shorter side.
SPOT_RADIUS = 0.012
#: Nominal conductivity at the blocked end of a base image of full strength, relative to the open end.
_BLOCKED = 0.02
#: Nominal conductivity far from the lines of a guide, relative to that on them.
BESIDE_GUIDE = 0.03
#: Least radius of the filter at full size, in elements, for smooth edges of strokes.
_MIN_RADIUS = 1.5
#: Convection of all sinks together, relative to the conductivity.
_CONVECTION = 4.0


@dataclass(frozen=True, eq=False)
class LayerProblem:
    """A layer's plate at one size."""

    plate: Plate
    #: Nominal conductivity k_e, (h, w).
    nominal: Floats
    symmetry: Symmetry
    repeat: str
    #: The filter's radius, in elements.
    radius: float
    #: Conductivity ε of an empty element, as a share of a full one's.
    void: float
    #: Largest density of an element, (h, w) or one for all.
    upper: Floats | float
    #: Elements on which the layer lies, (h, w); None for all.
    domain: Mask | None = None

    @classmethod
    def at(
        cls, layer: LayerRecipe, recipe: Recipe, shape: tuple[int, int], taken: Floats | None = None
    ) -> LayerProblem:
        """Return the layer of a recipe on a plate of the given shape; `taken` is the ink before it, (h, w) at
        full size.
        """
        orbits = symmetry(recipe.repeat, shape)
        spots = (_spots(points, shape, recipe.repeat) for points in (layer.sources, layer.sinks))
        nominal, domain = cls.nominal_of(recipe, shape), cls.domain_of(layer, recipe, shape)
        plate = Plate(*cls.loads(layer, orbits, nominal, domain, *spots), joint(recipe.repeat))
        radius, free = filter_radius(recipe, shape), cls.left_free(layer, recipe, shape, taken, domain)
        return cls(plate, nominal, orbits, recipe.repeat, radius, void_of(layer), free, domain)

    @classmethod
    def left_free(
        cls,
        layer: LayerRecipe,
        recipe: Recipe,
        shape: tuple[int, int],
        taken: Floats | None,
        domain: Mask | None,
    ) -> Floats | float:
        """Compute the largest densities: what the layers before have left, as far as this one avoids them,
        and nothing beyond its domain.
        """
        left: Floats | float = 1.0
        if taken is not None and layer.avoid:
            inked = symmetry(recipe.repeat, shape).mean(cls.reduced(taken, recipe.repeat, shape))
            left = np.clip(1.0 - layer.avoid * inked, MIN_DENSITY, 1.0)
        return left if domain is None else np.where(domain, left, MIN_DENSITY)

    @classmethod
    def domain_of(cls, layer: LayerRecipe, recipe: Recipe, shape: tuple[int, int]) -> Mask | None:
        """Return the elements on which a layer lies, all of an orbit or none; None for the whole cell.

        By a rule with more operations the outline is that of all its images together.
        """
        if layer.place == "everywhere" or not recipe.outline:
            return None
        inside = cls.outline_of(recipe.outline, recipe.repeat, shape)
        return inside if layer.place == "inside" else ~inside

    @classmethod
    @lru_cache(maxsize=8)
    def outline_of(cls, outline: str, repeat: str, shape: tuple[int, int]) -> Mask:
        """Return the elements inside of a packed outline; a read-only array for all layers."""
        shown = cls.base_on_elements(unpack_base(outline), shape).astype(np.float64)
        inside: Mask = symmetry(repeat, shape).largest(shown) >= 0.5
        inside.flags.writeable = False
        return inside

    @staticmethod
    def reduced(density: Floats, repeat: str, shape: tuple[int, int]) -> Floats:
        """Resample a density at full size to a coarser plate."""
        return resample(density, repeat, shape).astype(np.float64)

    @classmethod
    def nominal_of(cls, recipe: Recipe, shape: tuple[int, int]) -> Floats:
        """Compute the nominal conductivities k_e of a recipe's base image and guide."""
        return cls._nominal(
            recipe.base, recipe.base_strength, recipe.base_law, recipe.guide, recipe.repeat, shape
        )

    @classmethod
    @lru_cache(maxsize=4)
    def _nominal(
        cls, base: str, strength: float, law: str, guide: str, repeat: str, shape: tuple[int, int]
    ) -> Floats:
        """Compute k_e of a packed base image, averaged over the orbits, times that of a guide and all its
        images; a read-only array for all layers.
        """
        brightness = None if not base else cls.base_on_elements(unpack_base(base), shape)
        orbits = symmetry(repeat, shape)
        nominal = orbits.mean(nominal_conductivity(brightness, strength, shape, law))
        if guide:
            along = orbits.largest(cls.base_on_elements(unpack_base(guide), shape).astype(np.float64))
            nominal = nominal * BESIDE_GUIDE ** (1.0 - np.clip(along, 0.0, 1.0))
        nominal.flags.writeable = False
        return nominal

    @staticmethod
    def base_on_elements(
        brightness: npt.NDArray[np.float32], shape: tuple[int, int]
    ) -> npt.NDArray[np.floating]:
        """Resample a base image to the cell's elements."""
        return resample(brightness, "none", shape)

    @staticmethod
    def loads(
        layer: LayerRecipe,
        orbits: Symmetry,
        nominal: Floats,
        domain: Mask | None,
        sources: Floats,
        sinks: Floats,
    ) -> tuple[Floats, Floats]:
        """Compute the heat load, of sum 1, and the convection, both averaged over the orbits.

        Ambient heat is distributed in proportion to the nominal conductivity. No heat enters or leaves beyond
        the domain.

        Raises
        ------
        OptionError
            When all sources, or all sinks, lie beyond it.
        """
        everywhere = nominal
        if domain is not None:
            sources, sinks = (
                _inside(field, orbits, domain, name)
                for field, name in ((sources, "sources"), (sinks, "sinks"))
            )
            everywhere = nominal * domain
        heat = (1.0 - layer.ambient) * sources + layer.ambient * everywhere / everywhere.sum()
        return orbits.mean(heat), orbits.mean(_CONVECTION * sinks)

    def conductivity(self, density: Floats, penalty: Floats | float) -> Floats:
        """Compute k_e (ε + (1 - ε) ρ^p)."""
        k: Floats = power(density, penalty)
        k *= 1.0 - self.void
        k += self.void
        k *= self.nominal
        return k

    def sensitivity(self, density: Floats, penalty: Floats | float, energy: Floats) -> Floats:
        """Compute ∂Π/∂ρ, not filtered."""
        slope: Floats = power(density, penalty - 1.0)
        slope *= -(1.0 - self.void) * penalty
        slope *= self.nominal
        slope *= energy
        return slope

    def filter_sensitivity(self, density: Floats, sensitivity: Floats) -> Floats:
        """Filter sensitivities: weighted means of ρ ∂Π/∂ρ over the neighbours, divided by ρ."""
        reach = math.ceil(self.radius) - 1
        if reach < 1:
            return sensitivity
        weights = self.radius - np.abs(np.arange(-reach, reach + 1))
        wide = extend(density * sensitivity, self.repeat, reach)
        for axis in (0, 1):
            wide = correlate1d(wide, weights / weights.sum(), axis=axis, mode="nearest")
        result: Floats = wide[reach:-reach, reach:-reach] / density
        return result

    def refine(self, density: Floats, shape: tuple[int, int]) -> Floats:
        """Resample the densities to a plate of twice the size."""
        return resample(density, self.repeat, shape).astype(np.float64)


def void_of(layer: LayerRecipe) -> float:
    """Return ε of a layer: none in the thesis's law, k^e = k_e ρ^p."""
    return 0.0 if layer.style == "thesis" else VOID


def filter_radius(recipe: Recipe, shape: tuple[int, int]) -> float:
    """Return the filter's radius on a plate, in elements; at full size at least `_MIN_RADIUS`, if not 0."""
    radius = recipe.filter_radius * min(shape) / 100
    return max(radius, _MIN_RADIUS) if radius > 0 and shape == recipe.size else radius


def nominal_conductivity(
    brightness: npt.NDArray[np.floating] | None,
    strength: float,
    shape: tuple[int, int],
    law: str = "contrast",
) -> Floats:
    """Compute the nominal conductivity k_e of a base image.

    By the law "contrast" k_e falls geometrically from 1, where the image is brightest (for strengths below 0:
    darkest), to 1/50 at the other end of its range, at strength ±1. By the law "brightness" k_e is
    proportional to the brightness, and black conducts as little as void (thesis 4.2); lower strengths mix
    this with an even 1. At strength 0 the image has no influence.
    """
    if brightness is None:
        return np.ones(shape)
    if law == "brightness":
        light = np.clip(brightness.astype(np.float64) if strength > 0 else 1.0 - brightness, VOID, 1.0)
        mixed: Floats = (1.0 - abs(strength)) + abs(strength) * light
        return mixed
    dark, bright = float(brightness.min()), float(brightness.max())
    shown = (brightness.astype(np.float64) - dark) / max(bright - dark, 1e-6)
    nominal: Floats = _BLOCKED ** (abs(strength) * (1.0 - shown if strength > 0 else shown))
    return nominal


def power(density: Floats, exponent: Floats | float) -> Floats:
    """Compute ρ^p, for p = 0, 1, 2, 3 without a logarithm."""
    if np.ndim(exponent):
        varied: Floats = density**exponent
        return varied
    if exponent == 0.0:
        return np.ones_like(density)
    if exponent == 1.0:
        return density.copy()
    if exponent == 2.0:
        return np.square(density)
    if exponent == 3.0:
        return np.square(density) * density
    result: Floats = density**exponent
    return result


def _spots(points: tuple[Point, ...], shape: tuple[int, int], repeat: str) -> Floats:
    """Return discs round points, with the given relative strengths, as a field of sum 1."""
    h, w = shape
    radius = max(SPOT_RADIUS * min(h, w), 0.75)
    field = np.zeros(shape)
    reach = (radius + 1) / min(h, w)
    y, x = np.arange(h) + 0.5, np.arange(w) + 0.5
    for px, py, strength in points:
        spot = np.zeros(shape)
        for row, column in _copies(repeat):
            place = _copy(px, py, repeat, row, column)
            if not all(-reach < along < 1 + reach for along in place):
                continue
            down, across = np.abs(y - place[1] * h), np.abs(x - place[0] * w)
            near = np.ix_(down < radius + 0.5, across < radius + 0.5)
            disc = radius + 0.5 - np.hypot(down[near[0]], across[near[1]])
            spot[near] = np.maximum(spot[near], np.clip(disc, 0.0, 1.0))
        field += spot * (strength / spot.sum())
    total = field.sum()
    return field / total if total > 0 else field


def _inside(field: Floats, orbits: Symmetry, domain: Mask, name: str) -> Floats:
    """Return the spots of a field, with their images, that lie inside of a domain, with the sum 1.

    Raises
    ------
    OptionError
        When there were some, and none is left.
    """
    kept = orbits.mean(field) * domain
    total = float(kept.sum())
    if total <= 0 < field.sum():
        raise OptionError(
            "all {parameter} lie beyond the outline, where their layer has no ink; move one inside",
            kind="outside",
            parameter=Term(name),
        )
    return kept / total if total > 0 else kept


def _copies(repeat: str) -> list[tuple[int, int]]:
    """Return the offsets of neighbouring cells into which a spot near the border may reach."""
    if repeat in ("none", "reflect", "rotate"):
        return [(0, 0)]
    reach = (-2, -1, 0, 1, 2) if shift_of(repeat) else (-1, 0, 1)
    return [(row, column) for row in reach for column in reach]


def _copy(x: float, y: float, repeat: str, row: int, column: int) -> tuple[float, float]:
    """Map a place to another row and column of cells."""
    shift = shift_of(repeat)
    if shift is None:
        return x + column, y + row
    axis, share = shift
    return (
        (x + column + row * float(share), y + row)
        if axis == 1
        else (x + column, y + row + column * float(share))
    )
