"""How a motif goes to paper."""

import pytest

import toposeam as ts
from toposeam_cli.motifs.printing import Print


@pytest.mark.parametrize("counts", [(391, 1000), (1000, 391)])
def test_sheets_above_400_megapixels_are_refused_at_once(counts):
    recipe = ts.motif.random_recipe((32, 32), seed=0)
    Print(counts=(counts[0] - (counts[0] == 391), counts[1] - (counts[1] == 391))).check(recipe, drawn=False)
    with pytest.raises(ts.OptionError, match="fewer or smaller motifs"):
        Print(counts=counts).check(recipe, drawn=False)


def test_a_motif_keeps_its_proportions_at_a_picture_s_width():
    recipe = ts.motif.random_recipe((32, 64), seed=0)
    assert Print(counts=(2, 3), pixels=(301, 120)).laid(recipe) == ((3, 3), (50, 101))
    assert Print(counts=(2, 3), width_mm=25.4, dpi=100).laid(recipe) == ((2, 3), (50, 100))
    assert Print(counts=(2, 3)).laid(recipe) == ((2, 3), (32, 64))


def test_paper_is_printed_unless_it_is_left_out():
    assert Print().note()["print"]["transparent"] is False
    assert Print.read({"print": {"transparent": True}})["transparent"] is True
