"""Gaps where strokes meet are closed, pinholes filled, crumbs left out; what is larger stays."""

import dataclasses

import numpy as np
import pytest
from scipy import ndimage

import toposeam as ts
from toposeam.motif.ink import repair_strokes
from toposeam.motif.symmetry import tile


def strokes(gap=2):
    """A stroke from border to border, with a gap in the middle, and a block with a pinhole."""
    design = np.full((150, 150), 0.001, np.float32)
    design[40:46] = 1
    design[40:46, 70 : 70 + gap] = 0.001
    design[80:120, 60:100] = 1
    design[99, 79] = 0.001
    return design


def test_gaps_and_pinholes_are_closed_and_the_mass_stays():
    design = strokes()
    made = repair_strokes(design, "translate", float(design.mean()))
    assert made[41:45].min() > 0.9
    assert made[80:120, 60:100].min() > 0.9
    assert made.mean() == pytest.approx(design.mean(), rel=1e-4)
    np.testing.assert_allclose(made[50:75], 0.001)  # and nothing but that
    wide = strokes(gap=12)
    assert repair_strokes(wide, "translate", float(wide.mean()))[42, 76] < 0.01


def test_what_motifs_share_at_the_border_stays():
    design = np.roll(strokes(), 75, axis=1)  # the gap lies at the border
    made = repair_strokes(design, "translate", 0.3, kept=4)
    np.testing.assert_array_equal(made[:, :4], design[:, :4])
    assert made[99, 4] == made[99, 5] == 1


def specks(mask, most, neighbours):
    labels, _ = ndimage.label(mask, ndimage.generate_binary_structure(2, neighbours))
    area = np.bincount(labels.ravel())[1:]
    cut = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    return [number for number, size in enumerate(area, 1) if size <= most and number not in cut]


@pytest.mark.parametrize(("repeat", "seed"), [("cmm", 77), ("p6m", 77), ("p3", 9), ("pmm", 9)])
@pytest.mark.parametrize("fine", [1, 2])
def test_no_rule_prints_pinholes_or_crumbs(repeat, seed, fine):
    motif = ts.generate_motif(96, layers=1, repeat=repeat, seed=seed, edge="crisp", iterations=25)
    rows, columns = motif.densities.shape[1:]
    ink = tile(motif.coverage((fine * rows, fine * columns)), repeat, (2, 2))[0] > 0.5
    most = fine**2 * rows * columns // 1600
    assert specks(~ink, most, 1) == []
    assert specks(ink, most, 2) == []


def test_a_drawing_has_no_crumbs_either():
    motif = ts.generate_motif(64, layers=1, repeat="translate", seed=4, edge="crisp", iterations=12)
    clean = motif.to_svg().count("Z")
    dots = motif.densities.copy()
    far = ndimage.distance_transform_edt(dots[0] < 0.05)
    y, x = np.unravel_index(far.argmax(), far.shape)
    dots[0, y, x] = 1
    assert dataclasses.replace(motif, densities=dots).to_svg().count("Z") <= clean
