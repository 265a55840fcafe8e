"""The edges of strokes in print: sharp at any size, as wide as their mass, and alike on pixels and in SVG."""

import re

import numpy as np
import pytest
from scipy import ndimage
from skimage import measure

import toposeam as ts
from toposeam.motif.ink import EDGES, coverage_beyond, level, stroke_ends
from toposeam.motif.ink.svg import Bands


def disc(size, radius, hazy=1.5):
    """A disc on a cell of `size` elements with a haze round it."""
    y, x = np.mgrid[:size, :size] + 0.5 - size / 2
    return (1 / (1 + np.exp((np.hypot(y, x) - radius) / hazy))).astype(np.float32)


def motif_of(density, edge, repeat="translate"):
    """A motif whose only layer is a given density, black on white."""
    import dataclasses

    recipe = ts.motif.random_recipe(
        len(density),
        layers=1,
        repeat=repeat,
        seed=1,
        palette=ts.motif.Palette(paper=np.ones(3), inks=np.zeros((1, 3))),
    )
    layer = dataclasses.replace(recipe.layers[0], edge=edge)
    recipe = dataclasses.replace(recipe, layers=(layer,), iterations=1)
    return dataclasses.replace(ts.generate_motif(recipe), densities=density[None])


@pytest.mark.parametrize("size", [64, 200, 945])
def test_crisp_edges_are_at_most_two_pixels_wide(size):
    print_layer = motif_of(disc(64, 16), "crisp").coverage((size, size))[0]
    for line in (print_layer[size // 2], print_layer[:, size // 2], np.diagonal(print_layer)):
        between = np.flatnonzero((line > 0.1) & (line < 0.9))
        assert len(between) <= 4  # of two edges
    soft = motif_of(disc(64, 16), "soft").coverage((size, size))[0][size // 2]
    assert np.count_nonzero((soft > 0.1) & (soft < 0.9)) > (4 if size == 64 else 30)


def widths_across(field):
    """How far it is from 10 % to 90 % across the edges of a print, px: along the normal at every point of the
    contour at 50 %, except where a stroke or a gap is too narrow to reach both.
    """
    wide = np.pad(field, 16, mode="wrap").astype(float)
    slope = np.stack(np.gradient(ndimage.gaussian_filter(wide, 1.0)))
    along = np.arange(-6, 6.01, 0.1)
    found = []
    for line in measure.find_contours(wide, 0.5):
        normal = np.stack([ndimage.map_coordinates(part, line.T, order=1) for part in slope])
        length = np.linalg.norm(normal, axis=0)
        normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
        places = line.T[:, :, np.newaxis] + normal[:, :, np.newaxis] * along
        values = ndimage.map_coordinates(wide, places, order=1, mode="nearest")
        low = np.array([np.max(np.flatnonzero(row[:61] <= 0.1), initial=-1) for row in values])
        high = np.array([np.min(np.flatnonzero(row[60:] >= 0.9), initial=999) for row in values])
        both = (low >= 0) & (high < 999)
        found.append((high + 60 - low)[both] * 0.1)
    return np.concatenate(found)


@pytest.mark.medium
@pytest.mark.parametrize("repeat", ["translate", "p4m", "p6m"])
def test_edges_of_motifs_at_300_dpi_are_at_most_two_px_wide(repeat):
    """A motif of 60 mm, with the interpolation between pixels counted in."""
    motif = ts.generate_motif(128, layers=2, repeat=repeat, seed=3, penalty=3.0, edge=("crisp", "soft"))
    rows, columns = motif.densities.shape[1:]
    crisp, soft = motif.coverage((round(709 * rows / columns), 709))
    assert np.percentile(widths_across(crisp), 99) <= 2.0
    assert np.percentile(widths_across(soft), 50) > 4.0


@pytest.mark.parametrize("edge", EDGES)
@pytest.mark.parametrize("size", [(40, 40), (64, 64), (300, 300)])
def test_what_is_printed_has_the_mass_that_was_spent(edge, size):
    density = disc(64, 18)
    print_layer = motif_of(density, edge).coverage(size)[0]
    assert print_layer.mean() == pytest.approx(density.mean(), rel=0.02)
    assert 0 <= print_layer.min() <= print_layer.max() <= 1


def test_a_disc_keeps_its_radius():
    print_layer = motif_of(disc(64, 18), "crisp").coverage((640, 640))[0]
    # The area of a disc with a logistic haze s is π (r² + π² s² / 3).
    assert np.sqrt(print_layer.sum() / np.pi) == pytest.approx(
        10 * np.sqrt(18**2 + np.pi**2 * 1.5**2 / 3), rel=5e-3
    )


def test_ink_shades_within_its_edge_and_leaves_paper_clean():
    density = disc(64, 14, hazy=3)
    soft, ink = (motif_of(density, edge).coverage((320, 320))[0] for edge in ("soft", "ink"))
    inside = ink > 0.05
    assert np.mean((soft > 0.02) & ~inside) > 0.02  # the haze that is left off
    assert ink[~ndimage.binary_dilation(inside, iterations=2)].max() == 0
    assert np.std(ink[inside]) > 0.1  # shaded


def test_the_share_of_a_pixel_beyond_a_straight_edge_is_exact():
    x = np.broadcast_to(np.arange(12, dtype=np.float32), (8, 12))
    shares = coverage_beyond(x, 5.25, "none")[4]
    assert shares.tolist() == [0] * 5 + [0.25] + [1] * 6


def test_the_level_parts_the_asked_share():
    values = np.random.default_rng(0).random(10_001)
    assert np.mean(values > level(values, 0.23)) == pytest.approx(0.23, abs=1e-3)


@pytest.mark.medium
@pytest.mark.parametrize("repeat", ["translate", "rotate", "p4m", "p6m", "none"])
@pytest.mark.parametrize("edge", ["crisp", "ink"])
def test_pixels_and_drawing_are_the_same_contours(repeat, edge):
    import pyvips

    motif = ts.generate_motif(
        48, layers=2, repeat=repeat, seed=4, iterations=20, edge=edge, filter_radius=3, palette="fall"
    )
    rows, columns = motif.densities.shape[1:]
    document = re.sub(r'width="\d+" height="\d+"', f'width="{8 * columns}"', motif.to_svg(), count=1)
    drawn = pyvips.Image.svgload_buffer(document.encode()).numpy()[..., :3].astype(float)
    painted = 255 * motif.image((8 * rows, 8 * columns))
    # Where they differ a curve misses its polygon by up to a quarter of a px, two px here.
    assert np.abs(drawn - painted).mean() < (2 if edge == "crisp" else 4)
    assert np.mean(np.abs(drawn - painted).max(axis=2) > 60) < 0.02


def test_drawing_levels_are_midway_between_adjacent_densities():
    density = disc(64, 16)
    assert Bands("soft", (0.0, np.float32(1)), 4).thresholds == pytest.approx([1 / 8, 3 / 8, 5 / 8, 7 / 8])
    at, gain = stroke_ends([density], "ink", "translate", 2)
    edge, gain_of_crisp = stroke_ends([density], "crisp", "translate", 2)
    assert Bands("crisp", (edge, gain_of_crisp), 4).thresholds == pytest.approx([edge])
    # Ink begins at the stroke's edge; inside it levels part what is printed, the density times the gain.
    ink = Bands("ink", (at, gain), 4)
    print_layer = [t / gain for t in (1 / 8, 3 / 8, 5 / 8, 7 / 8)]
    assert ink.thresholds == pytest.approx([at, *(t for t in print_layer if t >= at)])
    assert len(ink.thresholds) < 5  # one of them would lie in the haze beside the stroke
    assert ink.tones(density.astype(float))[0] == 0
    assert 0 < Bands("soft", (0.0, np.float32(1)), 4).tones(density.astype(float))[0] < 1 / 8


def test_haze_is_drawn_between_soft_strokes_only():
    density = np.maximum(disc(64, 16), np.float32(0.04))
    haze = re.compile(r'<rect x="-\d+" y="-\d+" [^>]*fill="#f5f5f5"/>')  # 4 % of black
    assert haze.search(motif_of(density, "soft").to_svg())
    assert not haze.search(motif_of(density, "crisp").to_svg())


@pytest.mark.parametrize("repeat", ["translate", "reflect", "rotate", "p6"])
def test_edges_go_on_across_the_border(repeat):
    motif = ts.generate_motif(48, layers=1, repeat=repeat, seed=2, iterations=20, edge="crisp")
    rows, columns = motif.densities.shape[1:]
    sheet = ts.motif.repeat_densities(motif, (2, 2), size=(5 * rows, 5 * columns))[0]
    steps = np.abs(np.diff(sheet, axis=0)).mean(axis=1)
    assert steps[5 * rows - 1] <= 1.05 * np.percentile(steps, 99)
