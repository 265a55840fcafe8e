"""Many small overlaps: what their shape decides is worked out once, and shared without one seam changing
another.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.heat import elimination, network
from toposeam.seam.problem import overlap
from toposeam.seam.problem import seam_problem as problem


def ell(size=40, width=10):
    """The masks of a patch laid on a canvas that is filled above and to the left of it."""
    filled = np.zeros((size, size), bool)
    filled[:width] = filled[:, :width] = True
    return filled, np.ones((size, size), bool)


@pytest.fixture
def forget():
    """Forget all shapes."""

    def clear():
        overlap._kept_side_by_side.cache_clear()
        overlap._kept_between_masks.cache_clear()
        problem._kept_pattern.cache_clear()

    clear()
    return clear


@pytest.mark.usefixtures("forget")
@pytest.mark.parametrize(("size", "masks"), [((70, 10), (None, None)), ((40, 40), ell())])
def test_overlaps_of_one_shape_are_analysed_once(size, masks, crops, monkeypatch):
    analysed = []
    system = network.system
    monkeypatch.setattr(
        network, "system", lambda *arguments: analysed.append(arguments) or system(*arguments)
    )
    for index in range(10):
        ts.find_seam(*crops(np.random.default_rng([1, index]), *size), *masks, method="heat")
    assert len(analysed) == 1


@pytest.mark.parametrize(("size", "widest"), [((70, 10), 250), ((60, 60), 250), ((60, 60), 20)])
@pytest.mark.parametrize("method", ["auto", "heat"])
def test_a_cached_shape_gives_the_same_bytes_as_a_new_one(method, size, widest, crops, forget, monkeypatch):
    monkeypatch.setattr(
        elimination, "WIDEST_BAND", widest
    )  # narrower than this matrices are banded, others sparse
    a, b = crops(np.random.default_rng(3), *size)
    first = ts.find_seam(a, b, method=method)
    ts.find_seam(b, a, method=method)
    second = ts.find_seam(a, b, method=method)
    forget()
    third = ts.find_seam(a, b, method=method)
    for other in (second, third):
        assert other.labels.tobytes() == first.labels.tobytes()
        assert other.soft.tobytes() == first.soft.tobytes()
        assert [repr(record) for record in other.history] == [repr(record) for record in first.history]


def test_equal_shapes_with_other_costs_or_exclusions_differ(crops):
    a, b = crops(np.random.default_rng(4), 40, 12)
    avoid = np.zeros((40, 12), bool)
    avoid[10:20, 3:9] = True
    free, bent = ts.find_seam(a, b), ts.find_seam(a, b, avoid=avoid)
    plain = ts.find_seam(a, b, gradient=False)
    for seam in (free, bent, plain, ts.find_seam(a, b, side="left")):
        assert seam.optimum_ratio() == pytest.approx(1.0, abs=1e-3)
    assert not (bent.labels[10:20, 3:9].any() and not bent.labels[10:20, 3:9].all())


def test_what_overlaps_share_cannot_be_written_to(crops):
    seam = ts.find_seam(*crops(np.random.default_rng(5), 40, 12))
    with pytest.raises(ValueError, match="read-only"):
        seam.problem.overlap.side[0, 0] = 1
    labels = seam.labels.copy()
    seam.labels[:] = False  # the seam's own
    assert (ts.find_seam(*crops(np.random.default_rng(5), 40, 12)).labels == labels).all()


@pytest.mark.slow
def test_small_overlaps_are_proven_within_a_thousandth(crops):
    ratios = []
    for index in range(200):
        rng = np.random.default_rng([6, index])
        if index % 2:
            masks, size = ell(int(rng.integers(24, 56)), int(rng.integers(6, 14))), None
            size = masks[0].shape
        else:
            masks, size = (None, None), (int(rng.integers(40, 100)), int(rng.integers(6, 16)))
        seam = ts.find_seam(*crops(rng, *size), *masks, method="heat")
        assert seam.termination == ts.optimize.Termination.SINGLE_LINE
        assert len(seam.paths) == 1
        ratios.append(seam.optimum_ratio())
    assert max(ratios) <= 1.001
    assert np.median(ratios) == pytest.approx(1.0, abs=1e-6)


def blob(rng, shape):
    smooth = ndimage.gaussian_filter(rng.random(shape), rng.uniform(0.3, 5))
    return smooth > np.quantile(smooth, rng.uniform(0.05, 0.7))


def test_arbitrary_masks_weights_and_exclusions_are_proven():
    """Costs span up to fifteen orders of magnitude here."""
    proven = 0
    for index in range(120):
        rng = np.random.default_rng([7, index])
        shape = tuple(rng.integers(3, 40, 2))
        a, b = rng.random((2, *shape))
        if index % 3 == 0:
            b = a + 0.1 * (rng.random(shape) > 0.5)
        masks = blob(rng, shape), blob(rng, shape)
        options = {"cost": ts.seam.MatchCost(length=10 ** rng.uniform(-9, -1), law=ts.seam.LAWS[index % 3])}
        if index % 3:
            options["weight"] = 10 ** rng.uniform(-3, 3, shape)
        if index % 4 == 1:
            options["avoid"] = rng.random(shape) < 0.05
        try:
            seam = ts.find_seam(a, b, *masks, method="heat", **options)
        except ts.OverlapError:
            continue
        exact = ts.find_seam(a, b, *masks, method="graph-cut", **options)
        assert seam.termination == ts.optimize.Termination.SINGLE_LINE, index
        assert len(seam.history) <= 25
        assert seam.cost <= exact.cost * 1.001
        proven += 1
    assert proven > 80
