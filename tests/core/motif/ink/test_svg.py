"""Drawings of sheets: one motif, and clones of it."""

import re

import numpy as np
import pytest

import toposeam as ts

pyvips = pytest.importorskip("pyvips")


@pytest.fixture(scope="module", params=["rotate", "drop", "reflect", "p4", "p6"])
def motif(request):
    return ts.motif(64, repeat=request.param, seed=3, style=["vein", "rosette"], iterations=8, palette="sea")


def test_every_copy_is_a_clone_of_the_first(motif):
    one, sheet = (ts.motif.draw_svg(motif, counts) for counts in ((1, 1), (6, 5)))
    assert re.findall(r"<path.*", sheet) == re.findall(r"<path.*", one)
    names = set(re.findall(r'id="([^"]+)"', sheet))
    assert set(re.findall(r'href="#([^"]+)"', sheet)) <= names
    assert len(sheet) < len(one) + 20_000


def test_sheet_looks_like_the_pattern(motif):
    counts, (rows, columns) = (3, 2), motif.densities.shape[1:]
    drawn = pyvips.Image.svgload_buffer(ts.motif.draw_svg(motif, counts).encode(), scale=2).numpy()
    pattern = ts.repeat(motif, counts, size=(2 * rows, 2 * columns))
    apart = np.abs(drawn[..., :3] / 255 - pattern)
    beside_borders = [apart[2 * rows * row - 2 : 2 * rows * row + 2] for row in (1, 2)]
    assert apart.mean() < 0.015
    assert np.mean(beside_borders) < 0.025  # a hairline or a double edge would be 0.1 and more
