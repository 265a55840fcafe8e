"""The growth of a motif as frames."""

import re

import numpy as np
import pytest

import toposeam as ts


@pytest.fixture(scope="module", params=["p4m", "p6", "rotate"])
def animation(request):
    return ts.motif.animate(
        64, style=["vein", "rosette"], repeat=request.param, seed=3, iterations=10, palette="sea"
    )


def test_it_ends_with_the_motif_of_the_recipe(animation):
    motif = ts.generate_motif(animation.motif.recipe)
    assert np.array_equal(list(animation.frames(3))[-1].image(), motif.image())
    assert [len(steps) for steps in animation.steps] == [10, 10]


def test_ink_grows_from_nothing_and_does_not_jump(animation):
    inked = [frame.coverage().mean() for frame in animation.frames(25)]
    assert inked[0] < 0.01
    assert inked[-1] > 0.1
    assert np.abs(np.diff(inked)).max() < 0.35 * inked[-1]


def test_every_frame_has_the_whole_group(animation):
    if animation.motif.repeat != "p4m":
        pytest.skip("mirrors are told by flipping on a square cell only")
    for frame in animation.frames(5):
        cell = frame.densities[0]
        np.testing.assert_allclose(cell, cell.T, atol=1e-6)
        np.testing.assert_allclose(cell, cell[::-1], atol=1e-6)


def test_an_svg_moves_and_ends_with_the_motif(animation):
    document = animation.to_svg((1, 2), frames=5, seconds=2.0, pause=1.0)
    groups = re.findall(r'<g id="frame-(\d)"( display="none")?>', document)
    assert [(number, bool(hidden)) for number, hidden in groups] == [
        ("1", True), ("2", True), ("3", True), ("4", True), ("5", False),
    ]  # fmt: skip
    times = re.findall(r'values="([^"]+)" keyTimes="([^"]+)" dur="3s"', document)
    assert times[0] == ("inline;none", "0.00000;0.13333")
    assert times[-1] == ("none;inline", "0.00000;0.53333")
    assert len(set(re.findall(r' id="([^"]+)"', document))) == len(re.findall(r' id="([^"]+)"', document))


@pytest.mark.parametrize("options", [{"frames": 1}, {"seconds": 0.0}, {"pause": -1.0}])
def test_impossible_animations_are_refused(animation, options):
    with pytest.raises(ts.OptionError):
        animation.to_svg(**options)
