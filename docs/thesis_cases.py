"""The constructed cases of the thesis's chapter 3, drawn by make_figures.py and checked by
tests/core/seam/test_thesis_cases.py.

Each is a pair of patches on one canvas, with the boundary that the seam is meant to follow where the case
plants one.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

import toposeam as ts

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

#: Overlap of the patches of Figures 3.11 to 3.14, in px.
OVERLAP = 20

_GROUND, _SHADE = 0.85, 0.45
_DRAWN_TO_EDGES = ts.seam.MatchCost(law="gradient", flat=100.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """Two patches to join."""

    #: (H, W) or (H, W, 3) float arrays in [0, 1], the patches on their common canvas.
    a: Floats
    b: Floats
    #: (H, W) bool, where each patch has pixels; None for both where the arrays are the overlap.
    mask_a: Mask | None = None
    mask_b: Mask | None = None
    cost: ts.seam.MatchCost = field(default_factory=lambda: ts.seam.MatchCost(law="gradient"))
    #: (H, W) bool, True where b is meant to show; None where the case plants no boundary.
    planted: Mask | None = None

    def find(
        self, method: ts.typing.Method = "heat", *, cost: ts.seam.MatchCost | None = None, **options: object
    ) -> ts.seam.Seam:
        """The seam by any method, with the case's match cost or another one."""
        return ts.find_seam(
            self.a, self.b, self.mask_a, self.mask_b, method=method, cost=cost or self.cost, **options
        )

    def joined(self, seam: ts.seam.Seam) -> Floats:
        """The two patches joined along a seam."""
        labels = seam.labels if self.a.ndim == 2 else seam.labels[..., np.newaxis]
        return np.where(labels, self.b, self.a)


def toy() -> Case:
    """Figure 3.5: two patches of 3 × 3 px, dark on the left and light on the right, in slightly different
    tones, which differ a little more off the boundary.

    The boundary between dark and light runs through nodes 2, 6, 7, 11 and 15 of the 4 × 4 nodes, numbered row
    by row from 1.
    """
    light = np.array([[0, 1, 1], [0, 0, 1], [0, 0, 1]], bool)
    off = np.array([[0, 0, 1], [1, 0, 0], [1, 0, 0]], bool)
    return Case(a=np.where(light, 0.80, 0.20), b=np.where(light, 0.90, 0.30) + 0.05 * off, planted=light)


def zigzag() -> Case:
    """Figure 3.11: patches of one colour, 80 × 80 px, but in the overlap ``a`` is shaded beyond a zigzag
    line.

    Where the ground is plain (2.4) is 0/0. The thesis does not say what that costs; its seam along the shade
    needs it to cost more than the edge does. With contrast d the edge costs (d + ε flat)/(d + ε) and one
    pixel off it ε flat/(d/2 + ε), so flat must exceed 2 + d/ε = 22.
    """
    a, b, mask_a, mask_b = _side_by_side()
    edge = 70 + _teeth(np.arange(80), period=32, height=12)
    shade = (np.arange(140) >= edge[:, np.newaxis]) & mask_a
    a[shade] = _SHADE
    return Case(
        a=a, b=b, mask_a=mask_a, mask_b=mask_b, cost=_DRAWN_TO_EDGES, planted=(shade | ~mask_a) & mask_b
    )


def ell() -> Case:
    """Figure 3.13: ``a`` is 140 × 140 px without its lower right corner, which ``b``, 80 × 80 px, fills; both
    overlap by 20 px.
    """
    mask_a, mask_b = np.ones((140, 140), bool), np.zeros((140, 140), bool)
    mask_a[80:, 80:] = False
    mask_b[60:, 60:] = True
    a, b = np.where(mask_a, _GROUND, 0.0), np.where(mask_b, _GROUND, 0.0)
    y, x = np.indices(a.shape)
    depth, along = np.minimum(x, y) - 60, np.maximum(x, y) - 60
    edge = 10 + np.where(along < 20, 0, _teeth(along - 12, period=32, height=10))
    shade = (depth >= edge) & mask_a
    a[shade] = _SHADE
    return Case(
        a=a, b=b, mask_a=mask_a, mask_b=mask_b, cost=_DRAWN_TO_EDGES, planted=(shade | ~mask_a) & mask_b
    )


def random_colours(seed: int = 0) -> Case:
    """Figure 3.14: patches of random colours within a narrow range; both have the same shade in the overlap,
    whose outline turns back.
    """
    _, _, mask_a, mask_b = _side_by_side()
    rng = np.random.default_rng(seed)
    shade = np.zeros(mask_a.shape, bool)
    # The outline goes down, left, up again, left and down: the seam has to turn back.
    shade[:, 60 + 15 :] = True
    shade[46:, 60 + 4 :] = True
    shade[30:46, 60 + 4 : 60 + 9] = True
    light, dark = np.array([0.93, 0.80, 0.62]), np.array([0.20, 0.42, 0.58])
    base = np.where(shade[..., np.newaxis], dark, light)
    a, b = (
        np.where(mask[..., np.newaxis], base + rng.uniform(-0.05, 0.05, base.shape), 0.0)
        for mask in (mask_a, mask_b)
    )
    return Case(a=a, b=b, mask_a=mask_a, mask_b=mask_b, planted=(shade | ~mask_a) & mask_b)


def _teeth(along: npt.NDArray[np.int_], period: int, height: int) -> npt.NDArray[np.int_]:
    """A zigzag of 45° round 0 with blunt tips, beginning in the middle of one."""
    return np.clip(np.abs(along % period - period // 2) - period // 4, -(height // 2), height // 2)


def _side_by_side() -> tuple[Floats, Floats, Mask, Mask]:
    """Two plain patches of 80 × 80 px on a canvas of 80 × 140."""
    columns = np.arange(140)
    mask_a, mask_b = (np.broadcast_to(on, (80, 140)).copy() for on in (columns < 80, columns >= 80 - OVERLAP))
    return np.where(mask_a, _GROUND, 0.0), np.where(mask_b, _GROUND, 0.0), mask_a, mask_b
